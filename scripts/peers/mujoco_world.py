#!/usr/bin/env python3
"""The peer of `acm bench world`: MuJoCo plays the same commands and draws the same mesh.

Reads one JSON object from standard input and prints one JSON line; `acm bench world` starts it. It says
{"ready": true} once the scene stands and then waits for a line on standard input before each repetition, so that the
two programs take turns and a busy machine decides nothing.

{"task": "physics", "table": {...}, "cubes": [...], "robot": {...}, "commands": [[x, y, z, qx, qy, qz, qw, opening], ...]}
    plays one command a control tick and answers {"steps", "cpu_s", "simulated_s", "slip_m", "tower_error_m"}
{"task": "render", "width", "height", "camera": {...}, "objects": [...], "frames": N}
    draws colour, depth and ids, one pass each as MuJoCo does, and answers {"frames", "cpu_s", "triangles"}

The physics scene is a force-limited hand on a weld, two fingers on sliders with position servos, boxes on a table, 2 ms
steps, elliptic cones, impratio 10: what MuJoCo needs so that a grip holds.
"""

import json
import math
import sys
import time

import mujoco
import numpy as np


def main():
    request = json.loads(sys.stdin.readline())
    run = {"physics": Physics, "render": Render}[request["task"]](request)
    answer({"ready": True, "version": mujoco.__version__})
    for line in sys.stdin:
        if line.strip() != "go":
            break
        answer(run.repetition())


def answer(value):
    print(json.dumps(value), flush=True)


def wxyz(xyzw):
    x, y, z, w = xyzw
    return f"{w} {x} {y} {z}"


def numbers(values):
    return " ".join(repr(float(value)) for value in values)


class Physics:
    STEP_S = 0.002

    def __init__(self, request):
        self.request = request
        robot, home = request["robot"], request["commands"][0]
        finger, gap = robot["finger"], robot["max_opening_m"] / 2
        half = [0.5 * edge for edge in finger["size"]]
        centre_z = finger["tip_m"] - half[2]

        def finger_xml(name, side):
            return (
                f'<body name="{name}" pos="0 {side * gap} 0" gravcomp="1">'
                f'<joint name="{name}" type="slide" axis="0 {-side} 0" range="0 {gap}" damping="5" armature="0.01"/>'
                f'<geom type="box" size="{numbers(half)}" pos="0 {side * half[1]} {centre_z}" mass="0.05"'
                f' friction="1 .005 .0001"/></body>'
            )

        cubes = "".join(
            f'<body name="cube{i}" pos="{numbers(cube["position"])}" quat="{wxyz(cube["rotation"])}"><freejoint/>'
            f'<geom type="box" size="{numbers(0.5 * edge for edge in cube["size"])}" mass="{cube["mass_kg"]}"'
            f' friction="{cube["friction"]} .005 .0001"/></body>'
            for i, cube in enumerate(request["cubes"])
        )
        table, pose = request["table"], f'pos="{numbers(home[:3])}" quat="{wxyz(home[3:7])}"'
        xml = f"""<mujoco><option timestep="{self.STEP_S}" integrator="implicitfast" cone="elliptic" impratio="10"/>
<worldbody><geom type="box" size="{numbers(0.5 * edge for edge in table['size'])}" pos="{numbers(table['position'])}"
 friction="{table['friction']} .005 .0001"/>{cubes}
<body name="target" mocap="true" {pose}/>
<body name="hand" {pose} gravcomp="1"><freejoint/><geom type="box" size=".03 .05 .015" pos="0 0 -.08" mass=".5"
 contype="0" conaffinity="0"/>{finger_xml("left", 1)}{finger_xml("right", -1)}</body></worldbody>
<equality><weld body1="target" body2="hand" solref="0.01 1" solimp=".95 .99 .001"/></equality>
<contact><exclude body1="left" body2="right"/></contact>
<actuator><position joint="left" kp="2000" forcerange="-{robot['grip_n']} {robot['grip_n']}"/>
<position joint="right" kp="2000" forcerange="-{robot['grip_n']} {robot['grip_n']}"/></actuator></mujoco>"""
        self.model = mujoco.MjModel.from_xml_string(xml)
        self.cubes = [self.model.body(f"cube{i}").id for i in range(len(request["cubes"]))]
        self.hand = self.model.body("hand").id

    def repetition(self):
        model, data, request = self.model, mujoco.MjData(self.model), self.request
        gap, tick_s = request["robot"]["max_opening_m"] / 2, request["robot"]["tick_s"]
        steps_a_tick, steps = round(tick_s / self.STEP_S), 0
        carried = [[] for _ in self.cubes]
        before = np.array(request["commands"][0])
        began = time.process_time()
        spent = 0.0
        for command in np.array(request["commands"]):
            closed = gap - command[7] / 2
            # Servos press with what the stiffness makes of a target beyond the object.
            data.ctrl[:] = closed
            if command[3:7] @ before[3:7] < 0:
                command[3:7] = -command[3:7]
            for step in range(1, steps_a_tick + 1):
                share = step / steps_a_tick
                data.mocap_pos[0] = before[:3] + (command[:3] - before[:3]) * share
                x, y, z, w = before[3:7] + (command[3:7] - before[3:7]) * share
                data.mocap_quat[0] = (w, x, y, z)
                mujoco.mj_step(model, data)
            steps += steps_a_tick
            before = command
            began_look = time.process_time()
            self.look(data, carried)
            spent += time.process_time() - began_look
        cpu_s = time.process_time() - began - spent
        slip = max((max(np.linalg.norm(p - path[0]) for p in path) for path in carried if path), default=math.nan)
        spot = np.array(request["spot"])
        error = max(
            np.linalg.norm(data.xpos[body] - (spot + [0, 0, request["edge_m"] * i]))
            for i, body in enumerate(self.cubes)
        )
        simulated = steps * self.STEP_S
        return {"steps": steps, "cpu_s": cpu_s, "simulated_s": simulated, "slip_m": slip, "tower_error_m": error}

    def look(self, data, carried):
        """Notes where a cube is in the hand while it is carried; not part of the time."""
        for body, path in zip(self.cubes, carried):
            if data.xpos[body][2] > self.request["carried_above_m"]:
                turn = data.xmat[self.hand].reshape(3, 3)
                path.append(turn.T @ (data.xpos[body] - data.xpos[self.hand]))


class Render:
    def __init__(self, request):
        self.request = request
        camera = request["camera"]
        meshes, geoms = [], []
        for i, mesh in enumerate(request["meshes"]):
            meshes.append(
                f'<mesh name="m{i}" inertia="shell" vertex="{numbers(np.ravel(mesh["vertices"]))}"'
                f' face="{" ".join(str(k) for k in np.ravel(mesh["faces"]))}"/>'
            )
        for placed in request["objects"]:
            rgba = numbers([channel / 255 for channel in placed["color"]] + [1])
            pose = f'pos="{numbers(placed["position"])}" quat="{wxyz(placed["rotation"])}" rgba="{rgba}"'
            if "mesh" in placed:
                geoms.append(f'<geom type="mesh" mesh="m{placed["mesh"]}" {pose} contype="0" conaffinity="0"/>')
            else:
                size = numbers(0.5 * edge for edge in placed["size"])
                geoms.append(f'<geom type="box" size="{size}" {pose} contype="0" conaffinity="0"/>')
        width, height = request["width"], request["height"]
        xml = f"""<mujoco><visual><global offwidth="{width}" offheight="{height}"/>
<quality shadowsize="{request['shadow_map']}"/></visual><asset>{''.join(meshes)}</asset><worldbody>
<light type="directional" pos="0 -0.5 2" dir="{numbers(request['sun'])}" castshadow="true"/>
<camera name="c" pos="{numbers(camera['position'])}" quat="{wxyz(camera['rotation'])}" fovy="{camera['fov_y_deg']}"/>
{''.join(geoms)}</worldbody></mujoco>"""
        self.model = mujoco.MjModel.from_xml_string(xml)
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        self.renderer = mujoco.Renderer(self.model, height, width)
        self.frame()

    def frame(self):
        renderer, data = self.renderer, self.data
        renderer.disable_depth_rendering()
        renderer.disable_segmentation_rendering()
        renderer.update_scene(data, "c")
        color = renderer.render()
        renderer.enable_depth_rendering()
        renderer.update_scene(data, "c")
        depth = renderer.render()
        renderer.disable_depth_rendering()
        renderer.enable_segmentation_rendering()
        renderer.update_scene(data, "c")
        ids = renderer.render()
        renderer.disable_segmentation_rendering()
        return color, depth, ids

    def repetition(self):
        frames = self.request["frames"]
        began = time.process_time()
        for _ in range(frames):
            color, depth, ids = self.frame()
        cpu_s = time.process_time() - began
        seen = float(np.mean(ids[:, :, 0] >= 0))
        return {"frames": frames, "cpu_s": cpu_s, "seen": seen, "brightness": float(color.mean())}


if __name__ == "__main__":
    main()
