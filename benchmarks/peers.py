# SPDX-License-Identifier: Apache-2.0
"""Benchmark of a placo cycle for the teams of Pandas that `noninteract bench` measures.

Run in a separate environment: `pip install placo example-robot-data`, then `python peers.py`.
The tasks are a position and an orientation for each hand and a position for each arm's elbow
joint, without limits: as many coordinates as the law has, but neither means nor pairs.
"""

import copy
import os
import sys
import time
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import placo

COUNTS = (2, 8, 16, 32)
START = (0.0, -0.6, 0.0, -2.2, 0.0, 1.7, 0.8)
CYCLES, WARM_UP = 300, 10
PANDA = "share/example-robot-data/robots/panda_description/urdf/panda.urdf"


def panda() -> ElementTree.Element:
    """Return the model with fixed fingers and without geometry."""
    places = [Path(entry, "cmeel.prefix", PANDA) for entry in sys.path]
    root = ElementTree.parse(next(place for place in places if place.is_file())).getroot()
    for link in root.findall("link"):
        for part in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(part)
    for joint in root.findall("joint"):
        if "finger" in joint.get("name", ""):
            joint.set("type", "fixed")
            for part in [*joint.findall("mimic"), *joint.findall("limit")]:
                joint.remove(part)
    return root


def team(count: int) -> str:
    """Return the URDF of several Pandas on one floor, with names prefixed by the arm's number."""
    arm = panda()
    base = arm.find("link").get("name")
    result = ElementTree.Element("robot", name="team")
    ElementTree.SubElement(result, "link", name="floor")
    for i in range(count):
        for part in copy.deepcopy(arm):
            if part.tag not in ("link", "joint"):
                continue
            part.set("name", f"{i}_{part.get('name')}")
            for end in (*part.findall("parent"), *part.findall("child")):
                end.set("link", f"{i}_{end.get('link')}")
            result.append(part)
        mount = ElementTree.SubElement(result, "joint", name=f"{i}_mount", type="fixed")
        ElementTree.SubElement(mount, "parent", link="floor")
        ElementTree.SubElement(mount, "child", link=f"{i}_{base}")
        ElementTree.SubElement(mount, "origin", xyz=f"{1.2 * (i % 6)} {1.2 * (i // 6)} 0")
    return ElementTree.tostring(result, encoding="unicode")


def cycle_times(count: int) -> np.ndarray:
    """Return the times of `update_kinematics` and `solve` [us]."""
    robot = placo.RobotWrapper("", placo.Flags.ignore_collisions, team(count))
    for i in range(count):
        for joint, angle in enumerate(START, start=1):
            robot.set_joint(f"{i}_panda_joint{joint}", angle + 0.01 * (i % 7))
    robot.update_kinematics()
    solver = placo.DynamicsSolver(robot)
    solver.mask_fbase(True)
    for i in range(count):
        hand = f"{i}_panda_hand_tcp"
        pose = robot.get_T_world_frame(hand)
        solver.add_position_task(hand, pose[:3, 3]).configure(f"{i}_point", "soft", 1.0)
        solver.add_orientation_task(hand, pose[:3, :3]).configure(f"{i}_turn", "soft", 1.0)
        elbow = solver.add_joints_task()
        elbow.set_joints({f"{i}_panda_joint3": START[2]})
        elbow.configure(f"{i}_elbow", "soft", 1.0)
    times = []
    for number in range(CYCLES + WARM_UP):
        start = time.perf_counter_ns()
        robot.update_kinematics()
        result = solver.solve()
        times.append(1e-3 * (time.perf_counter_ns() - start))
        if not result.success:
            raise RuntimeError(f"no solution in cycle {number}")
    return np.array(times[WARM_UP:])


def main() -> None:
    print(f"load average {os.getloadavg()}")
    for count in COUNTS:
        times = cycle_times(count)
        p10, median = np.percentile(times, (10, 50))
        print(f"{count:3d} Pandas: p10 {p10:8.1f} us, median {median:8.1f} us")


if __name__ == "__main__":
    main()
