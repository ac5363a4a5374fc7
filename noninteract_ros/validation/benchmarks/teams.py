# SPDX-License-Identifier: Apache-2.0
"""Teams of arms for timing the growth of the law with the number of robots."""

from typing import Any

COUNTS = (2, 8, 16, 32)
START = (0.0, -0.6, 0.0, -2.2, 0.0, 1.7, 0.8)
FINGERS = ("panda_finger_joint1", "panda_finger_joint2")


def bench_teams() -> dict[str, dict[str, Any]]:
    """Return the values of scenarios of Pandas by name; models need the extra `robots`."""
    return {f"{count} Pandas": pandas(count) for count in COUNTS}


def pandas(count: int) -> dict[str, Any]:
    """Return the values of a scenario of Pandas in rows, with pose, chain and elbow subtasks."""
    names = [f"panda_{number + 1}" for number in range(count)]
    robots = {
        name: {
            "model": "urdf",
            "urdf": "example-robot-data/panda_description/urdf/panda.urdf",
            "tool_frame": "panda_hand_tcp",
            "locked_joints": list(FINGERS),
            "base_pose": [1.2 * (i % 6), 1.2 * (i // 6), 0.0, 0.0, 0.0, 0.0, 1.0],
            # Distinct angles, so that no two tools have the same orientation.
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
