#!/usr/bin/env python3
"""A perception tool behind HTTP (docs/perception-tools.md); nothing but the standard library.

    python3 examples/perception_tool_server.py [PORT]

It cuts out whatever is coloured otherwise than most of the image. Put SAM into `segment` and FoundationPose into
`pose`: both get the request as the page describes it and return the fields of a reply.
"""
import base64, collections, http.server, json, struct, sys, zlib

def pixels(png):
    """Rows of samples of an 8- or 16-bit grey or RGB image; with Pillow or OpenCV at hand use those."""
    data, at, packed = base64.b64decode(png), 8, b""
    while at < len(data):
        (size,), kind = struct.unpack(">I", data[at : at + 4]), data[at + 4 : at + 8]
        chunk, at = data[at + 8 : at + 8 + size], at + 12 + size
        if kind == b"IHDR": width, height, depth, colour = struct.unpack(">IIBB", chunk[:10])
        packed += chunk if kind == b"IDAT" else b""
    step, raw, rows = (3 if colour == 2 else 1) * depth // 8, zlib.decompress(packed), []
    for start in range(0, height * (width * step + 1), width * step + 1):
        row, above = bytearray(raw[start + 1 : start + 1 + width * step]), rows[-1] if rows else bytes(width * step)
        for i in range(len(row) if raw[start] else 0):
            a, b, c = (row[i - step], above[i], above[i - step]) if i >= step else (0, above[i], 0)
            nearest = min((abs(b - c), 0, a), (abs(a - c), 1, b), (abs(a + b - 2 * c), 2, c))[2]
            row[i] = (row[i] + (a, b, (a + b) // 2, nearest)[raw[start] - 1]) & 255
        rows.append(bytes(row))
    return [list(struct.unpack(f">{len(row) // 2}H", row)) if depth == 16 else row for row in rows]

def runs(chosen, count):
    """Run lengths over the whole image, row by row, beginning with background."""
    lengths, value = [0], False
    for pixel in range(count):
        if (pixel in chosen) != value: lengths, value = lengths + [0], not value
        lengths[-1] += 1
    return lengths

def segment(request):
    rows, width = pixels(request["frame"]["color_png"]), request["frame"]["width"]
    colours = [tuple(row[3 * x : 3 * x + 3]) for row in rows for x in range(width)]
    common = collections.Counter(colours).most_common(1)[0][0]
    rest = {i for i, c in enumerate(colours) if sum(abs(u - v) for u, v in zip(c, common)) > 60}
    masks = []
    while rest:
        thing, edge = set(), [rest.pop()]
        while edge:
            here = edge.pop()
            thing.add(here)
            near = {here - width, here + width} | {n for n in (here - 1, here + 1) if n // width == here // width}
            edge += near & rest
            rest -= near
        if len(thing) >= 100: masks.append({"runs": runs(thing, len(colours)), "score": 0.9})
    return {"outcome": "ok", "masks": masks} if masks else {"outcome": "abstain", "reason": "one colour everywhere"}

def pose(request):  # request["part"]["mesh"] holds the vertices and triangles of the thing, in metres
    return {"outcome": "abstain", "reason": "no pose estimator is built in"}

class Handler(http.server.BaseHTTPRequestHandler):
    tools = {"/v1/segment": segment, "/v1/pose": pose}
    def do_POST(self):
        request = json.loads(self.rfile.read(int(self.headers["content-length"])))
        answer = self.tools.get(self.path, lambda _: {"outcome": "abstain", "reason": "not offered"})(request)
        self.reply({"schema": "acm.tool-reply/1", "id": request["id"], "tool": "by-colour", "version": "1", **answer})
    def reply(self, answer):
        body = json.dumps(answer).encode()
        self.send_response(200); self.send_header("content-length", str(len(body))); self.end_headers()
        self.wfile.write(body)
    def log_message(self, *_): pass

if __name__ == "__main__":
    server = http.server.ThreadingHTTPServer(("127.0.0.1", int(sys.argv[1]) if len(sys.argv) > 1 else 8765), Handler)
    print(f"listening on http://127.0.0.1:{server.server_port}", flush=True)
    server.serve_forever()
