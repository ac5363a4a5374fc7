# SPDX-License-Identifier: Apache-2.0
"""Two Pandas that carry a box, led in six degrees of freedom over a link with delay and loss."""

from typing import Any

from harness import merged
from repository import ROOT

from noninteract_ros.scenario.files import read_parameters

HAPTIC = {
    "start_time": 0.1,
    "times": [0.0, 0.8, 4.0],
    "points": [0.0, 0.0, 0.5, 0.06, 0.08, 0.56, 0.06, 0.08, 0.56],
    "orientations": [0.0, 0.0, 0.0, 1.0, *[0.0, 0.14944, 0.0, 0.98877] * 2],
    "tremor_amplitude": 0.0005,
    "tremor_angle": 0.0005,
    "hand_mass": 0.6,
    "hand_damping": 15.0,
    "device_mass": 0.2,
    "device_damping": 1.0,
    "force_limit": 30.0,
    "torque_limit": 3.0,
}
LINK = {"delay": 0.1, "jitter": 0.3, "loss": 0.05, "force_scale": 0.1, "filling": 30.0}


def pose_link(**link: Any) -> dict[str, Any]:
    """The scenario `dual_panda` without squeezing and pushes, with a device and a link."""
    values = read_parameters(ROOT / "config" / "dual_panda.yaml")
    for name in ("pushes", "elbow", "hand", "operator"):
        values.pop(name, None)
    values["planner"]["formations"] = ["grasp"]
    del values["planner"]["pressed"]
    blocks = {"haptic": HAPTIC, "link": LINK | link, "cooperative": {"takeover": "direct"}}
    return merged(values, blocks)
