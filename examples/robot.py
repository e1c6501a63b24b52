"""A robot for `acm run --robot tcp://127.0.0.1:7401`, in nothing but the standard library: a block, a mat and a hand.

Camera and hand look straight down (half a turn about x), so a picture is a pile of rectangles.
docs/robot-protocol.md explains each message.
"""
import array, json, socket, sys

WIDTH, HEIGHT, FOCAL, EYE, TABLE, SIDE = 320, 240, 260.0, 1.24, 0.74, 0.05
LENS = {"width": WIDTH, "height": HEIGHT, "fx": FOCAL, "fy": FOCAL, "cx": WIDTH / 2 - 0.5, "cy": HEIGHT / 2 - 0.5}
VIEW, HOME = ({"translation": at, "rotation": [1.0, 0.0, 0.0, 0.0]} for at in ([0.0, 0.0, EYE], [0.0, -0.3, 1.1]))
ROBOT = {"name": "hand", "hand": [], "finger": [], "max_opening_m": 0.08, "max_grip_force_n": 30.0, "home": HOME,
         "pad_half_length_m": 0.01, "workspace_min": [-0.6, -0.5, 0.74], "workspace_max": [0.6, 0.5, 1.3],
         "max_speed_m_s": 0.5, "max_turn_rad_s": 2.0, "tick_s": 0.02}
TASK = {"instruction": "Put the block on the mat.", "instruction_at_s": 0.2,
        "budgets": {"seconds": 60.0, "skills": 8, "frames": 200},
        "cameras": [{"name": "head", "intrinsics": LENS, "pose": VIEW, "depth_min_m": 0.1, "depth_max_m": 3.0}]}
block, mat, world = [0.2, 0.05, TABLE], [-0.2, -0.05, TABLE], {"frames": 0, "held": None}
arm = {"time": 0, "tcp": HOME, "joints": [], "opening_m": 0.08, "commanded_opening_m": 0.08,
       "pad_force_n": [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]], "wrist_force_n": [0.0, 0.0, 0.0]}
on_mat = lambda: max(abs(block[0] - mat[0]), abs(block[1] - mat[1])) < 0.045 and not world["held"]

def picture():
    color, depth = bytearray(3 * WIDTH * HEIGHT), array.array("f", bytes(4 * WIDTH * HEIGHT))
    boxes = [(0, 0, TABLE, 9, b"\xe6\xe6\xe6"), (mat[0], mat[1], TABLE + 0.001, 0.09, b"\x20\x40\xc0")]
    boxes += [(block[0], block[1], block[2] + SIDE * layer / 20, SIDE, b"\x2e\x9e\x4f") for layer in range(21)]
    for x, y, z, side, rgb in boxes:
        scale = FOCAL / (EYE - z)
        left, right = (min(max(round(WIDTH / 2 + scale * (x + s * side)), 0), WIDTH) for s in (-0.5, 0.5))
        upper, lower = (min(max(round(HEIGHT / 2 - scale * (y + s * side)), 0), HEIGHT) for s in (0.5, -0.5))
        for row in range(upper * WIDTH, lower * WIDTH, WIDTH):
            color[3 * (row + left):3 * (row + right)] = rgb * (right - left)
            depth[row + left:row + right] = array.array("f", [EYE - z]) * (right - left)
    return bytes(color) + depth.tobytes()  # floats of this machine: little endian on all that are common

def tick(tcp, opening_m, grip_force_n):
    reached = max(abs(a - b) for a, b in zip(tcp["translation"], [*block[:2], block[2] + SIDE / 2])) < 0.03
    held = opening_m < SIDE and (world["held"] or reached and [b - a for a, b in zip(tcp["translation"], block)])
    world["held"], force, opening = held, 9.0 if held else 0.0, SIDE if held else opening_m
    block[:] = [a + b for a, b in zip(tcp["translation"], held)] if held else [*block[:2], TABLE + 0.001 * on_mat()]
    arm.update(time=arm["time"] + 20_000_000, tcp=tcp, opening_m=opening, commanded_opening_m=opening_m,
               pad_force_n=[[0.0, force, 0.0], [0.0, -force, 0.0]])

def answer(ask):
    kind, raw = ask["ask"], b""
    if kind == "capture":
        world["frames"], raw = world["frames"] + 1, picture()
    elif kind == "command":
        tick(**ask["command"])
    elif kind == "wait-until":
        arm["time"] = max(arm["time"], ask["time"])
    now, header = arm["time"], {"id": f"F{world['frames']}", "camera": "head", "intrinsics": LENS, "camera_pose": VIEW}
    return {"hello": {"answer": "hello", "protocol": 1, "host": "robot.py", "robot": ROBOT, "task": TASK, "time": now,
                      "feedback": arm, "frames": "inline"},
            "capture": {"answer": "frame", "header": header | {"time": now}, "bytes": len(raw)},
            "command": {"answer": "feedback", "feedback": arm}, "feedback": {"answer": "feedback", "feedback": arm},
            "wait-until": {"answer": "time", "time": now}, "stop": {"answer": "stopped"},
            "done": {"answer": "verdict", "verdict": {"strict": on_mat(), "explanation": f"block: {block}"}}}[kind], raw

server = socket.create_server(("127.0.0.1", int((sys.argv + ["7401"])[1])))
print(f"listening on tcp://127.0.0.1:{server.getsockname()[1]}", flush=True)
while True:  # one agent after the other, in the same world
    with server.accept()[0] as agent, agent.makefile("rwb") as lines:
        for ask in map(json.loads, lines):
            print(ask["ask"], flush=True)
            reply, raw = answer(ask)
            lines.write(json.dumps(reply).encode() + b"\n" + raw)
            lines.flush()
