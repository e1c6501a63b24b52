#!/usr/bin/env python3
"""The example server with an answer to every question and, below a path that names a fault, that fault."""
import importlib.util, json, pathlib, sys, time

example = pathlib.Path(__file__).parents[2] / "examples" / "perception_tool_server.py"
spec = importlib.util.spec_from_file_location("tool_server", example)
tool_server = importlib.util.module_from_spec(spec)
spec.loader.exec_module(tool_server)


def diagonal(size, value=1e-4):
    return [[value if row == column else 0.0 for column in range(size)] for row in range(size)]


def sound(question, request):
    if question == "segment":
        return {"masks": tool_server.segment(request)["masks"]}
    if question == "detect":
        return {"detections": [{"bounds": [5, 5, 50, 50], "labels": [["thing", 0.8]]}]}
    if question == "recognise":
        names = [template["name"] for template in request["templates"]]
        return {"hypotheses": [{"template": name, "log_likelihood": -i} for i, name in enumerate(names)]}
    if question == "pose":
        pose = {"translation": [0, 0, 0.7], "rotation": [0, 0, 0, 1], "covariance": diagonal(6), "symmetry_fold": 2}
        return {"pose": pose}
    values = [parameter["value"] for parameter in request["part"]["parameters"]]
    params = {"mean": values, "covariance": diagonal(len(values)), "support_px": 100}
    return {"params": {**params, "observability": ["observed"] * len(values)}}


def spoil(fault, question, answer, request):
    """The answer with one thing wrong in it."""
    pixels = request["frame"]["width"] * request["frame"]["height"]
    for mask in answer.get("masks", []):
        if fault == "wrong-size": mask["runs"] = [10, 10, 4 * pixels - 20]
        if fault == "outside": mask["runs"] = [pixels, 5]
        if fault == "nan": mask["score"] = float("nan")
    for box in answer.get("detections", []):
        if fault == "wrong-size": box["bounds"] = [0, 0, 10000, 10000]
        if fault == "outside": box["bounds"] = [-5, 0, 10, 10]
        if fault == "nan": box["labels"][0][1] = float("nan")
        if fault == "overlapping": box["labels"] = [["a", 0.9], ["b", 0.9]]
    for hypothesis in answer.get("hypotheses", []):
        if fault == "wrong-size": hypothesis["template"] = "no-such-template"
        if fault in ("outside", "nan"): hypothesis["log_likelihood"] = float("inf" if fault == "outside" else "nan")
    for belief in [answer[name] for name in ("pose", "params") if name in answer]:
        mean = "translation" if question == "pose" else "mean"
        if fault == "wrong-size": belief["covariance"] = diagonal(9)
        if fault == "outside": belief[mean][0] = 1e6
        if fault == "nan": belief[mean][0] = float("nan")
        if fault == "overlapping": belief["covariance"][0][1] = 1.0
    if fault == "overlapping":
        for name in ("masks", "hypotheses"):
            if name in answer: answer[name] += answer[name]
    return answer


class Handler(tool_server.Handler):
    def do_POST(self):
        request = json.loads(self.rfile.read(int(self.headers["content-length"])))
        _, fault, _, question = self.path.split("/")
        head = {"schema": "acm.tool-reply/1", "id": request["id"], "tool": "faulty", "version": "1", "outcome": "ok"}
        if fault == "late": time.sleep(1.5)
        answer = json.dumps({**head, **spoil(fault, question, sound(question, request), request)}).encode()
        if fault == "empty": answer = b""
        if fault == "garbage": answer = b"\x00\xff<html>not a reply</html>"
        length = len(answer)
        if fault == "truncated": answer = answer[: length // 2]
        if fault == "refusing": self.send_error(500, "out of memory"); return
        if fault == "endless": length, answer = 1 << 40, answer + b" " * (33 << 20)
        self.send_response(200)
        self.send_header("content-length", str(length))
        self.end_headers()
        try: self.wfile.write(answer)
        except OSError: pass


if __name__ == "__main__":
    server = tool_server.http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    print(f"listening on http://127.0.0.1:{server.server_port}", flush=True)
    server.serve_forever()
