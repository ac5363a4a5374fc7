# SPDX-License-Identifier: Apache-2.0
"""Authority set by topic during motion."""

import numpy as np
from harness import Ros, merged
from rcl_interfaces.srv import GetParameters
from repository import ROOT
from std_msgs.msg import String
from waiting import until

from noninteract_ros.scenario.files import read_parameters

LIMIT = 400.0  # [N/s]; the test is faster than the scenario


def in_force(ros: Ros) -> str:
    """Return the authority parameter of the relative subtask."""
    request = GetParameters.Request(names=["relative.authority"])
    return ros.call(GetParameters, "controller/get_parameters", request).values[0].string_value


def test_authority_changes_by_topic_during_motion(ros: Ros) -> None:
    """The parameter follows each hand-over, and the torque rate stays below its limit."""
    values = read_parameters(ROOT / "config" / "hand_over.yaml")
    early = {
        "relative": {"hand_over_times": [], "hand_over_to": []},
        "planner": {"turned": {"time": 0.0, "duration": 2.0}},
        "safety": {"torque_rate": LIMIT},
        "haptic": {"times": [0.0, 1.0, 2.0, 3.0]},
    }
    stack = ros.stack(merged(values, early))
    publisher = ros.probe.create_publisher(String, "relative/authority", 10)
    ros.wait_for_subscribers(publisher)
    stack.start()
    for time, source in ((0.15, "human"), (0.3, "autonomy"), (0.45, "human")):
        stack.run_until(time)
        publisher.publish(String(data=source))
        until(lambda source=source: in_force(ros) == source, f"{source} in force")
    stack.run_until(0.6)
    times, _, _, effort = stack.monitor.history(stack.monitor.commands)
    assert times[-1] > 0.55
    rates = np.abs(np.diff(effort, axis=0)) / np.diff(times)[:, None]
    assert rates.max() <= LIMIT * (1.0 + 1e-9)
    until(
        lambda: stack.monitor.value("controller", "relative led by") == "human", "the diagnostics"
    )


def test_an_unknown_source_is_rejected(ros: Ros) -> None:
    """The rejection has the allowed sources, and the authority stays."""
    values = read_parameters(ROOT / "config" / "hand_over.yaml")
    stack = ros.stack(values)
    publisher = ros.probe.create_publisher(String, "relative/authority", 10)
    ros.wait_for_subscribers(publisher)
    stack.start()
    publisher.publish(String(data="robot"))
    until(
        lambda: "human | autonomy | hold" in stack.monitor.value("controller", "last rejection"),
        "the rejection",
    )
    assert in_force(ros) == "autonomy"
