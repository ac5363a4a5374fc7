# SPDX-License-Identifier: Apache-2.0
"""Authority by topic and by parameter, in mid-motion on the stack."""

import numpy as np
from harness import Ros, merged
from rcl_interfaces.srv import GetParameters
from repository import ROOT
from std_msgs.msg import String
from waiting import until

from noninteract_ros.scenario.files import read_parameters

LIMIT = 400.0  # [N/s]; all is faster here than in the scenario


def in_force(ros: Ros) -> str:
    """What the controller's parameter says."""
    request = GetParameters.Request(names=["relative.authority"])
    return ros.call(GetParameters, "controller/get_parameters", request).values[0].string_value


def test_a_subtask_changes_hands_by_topic_in_mid_motion(ros: Ros) -> None:
    """Autonomy to human and back whenever it comes; the parameter follows, the limit holds."""
    values = read_parameters(ROOT / "config" / "hand_over.yaml")
    early = {
        "relative": {"hand_over_times": [], "hand_over_to": []},
        "planner": {"turned": {"time": 0.0, "duration": 2.0}},
        "safety": {"torque_rate": LIMIT},
        "haptic": {"times": [0.0, 1.0, 2.0, 3.0]},
    }
    stack = ros.stack(merged(values, early))
    talker = ros.probe.create_publisher(String, "relative/authority", 10)
    ros.matched(talker)
    stack.begin()
    for time, taker in ((0.15, "human"), (0.3, "autonomy"), (0.45, "human")):
        stack.run_until(time)
        talker.publish(String(data=taker))
        until(lambda taker=taker: in_force(ros) == taker, f"{taker} in force")
    stack.run_until(0.6)
    times, _, _, effort = stack.ear.history(stack.ear.commands)
    assert times[-1] > 0.55
    rates = np.abs(np.diff(effort, axis=0)) / np.diff(times)[:, None]
    assert rates.max() <= LIMIT * (1.0 + 1e-9)
    until(lambda: stack.ear.value("controller", "relative led by") == "human", "the diagnostics")


def test_an_unknown_source_is_refused_and_changes_nothing(ros: Ros) -> None:
    """The refusal names what is allowed."""
    values = read_parameters(ROOT / "config" / "hand_over.yaml")
    stack = ros.stack(values)
    talker = ros.probe.create_publisher(String, "relative/authority", 10)
    ros.matched(talker)
    stack.begin()
    talker.publish(String(data="robot"))
    until(
        lambda: "human | autonomy | hold" in stack.ear.value("controller", "last rejection"),
        "the refusal",
    )
    assert in_force(ros) == "autonomy"
