# SPDX-License-Identifier: Apache-2.0
"""Teams of arms whose law `noninteract bench` times beside the scenarios: how it grows."""

from typing import Any

COUNTS = (2, 8, 16, 32)
START = (0.0, -0.6, 0.0, -2.2, 0.0, 1.7, 0.8)
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")


def bench_teams() -> dict[str, dict[str, Any]]:
    """Values of scenarios of Pandas, by name; their models come with the extra `robots`."""
    return {f"{count} Pandas": pandas(count) for count in COUNTS}


def pandas(count: int) -> dict[str, Any]:
    """Values of a scenario: Pandas in rows, led by their pose, their chain, and their elbows."""
    names = [f"panda_{number + 1}" for number in range(count)]
    robots = {
        name: {
            "model": "urdf",
            "urdf": "example-robot-data/panda_description/urdf/panda.urdf",
            "tool_frame": "panda_hand_tcp",
            "locked_joints": list(FINGERS),
            "base_pose": [1.2 * (i % 6), 1.2 * (i // 6), 0.0, 0.0, 0.0, 0.0, 1.0],
            # Unlike ones, so that no tool points exactly as another.
            "initial_position": [angle + 0.01 * (i % 7) for angle in START],
        }
        for i, name in enumerate(names)
    }
    gains = {"stiffness": [100.0], "damping": [40.0], "timeout": 0.5}
    subtasks = {
        "cooperative": {"kind": "cooperative_pose", "authority": "human", **gains},
        "relative": {"kind": "relative_pose", "authority": "autonomy", **gains},
        "posture": {
            "kind": "posture",
            "joints": [f"{name}/panda_joint3" for name in names],
            "stiffness": [20.0],
            "damping": [8.0],
        },
    }
    return {"robots": names, **robots, "subtasks": list(subtasks), **subtasks}
