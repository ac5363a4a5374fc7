# SPDX-License-Identifier: Apache-2.0
"""Who leads, told alike by the parameter, the diagnostics and the page, however it came about."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from harness import Ros, Stack, flat, go, paper
from pages import RawPage
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from std_msgs.msg import String
from waiting import until

from noninteract_ros.nodes.console.operator_console import OperatorConsole

PLAN = {"hand_over_times": [0.5, 2.5], "hand_over_to": ["human", "hold"]}


def values(**general: Any) -> dict[str, Any]:
    """The paper's team without its hand, with a plan for the relative subtask."""
    relative = PLAN | {"takeover": "shaped"}
    sources = {"lockstep_sources": ["relative/autonomy"], "haptic": None, "rate": 100.0}
    return paper(relative=relative, console={"port": 0}, **(sources | general))


def parameter(ros: Ros) -> str:
    """What the controller's parameter says of the relative subtask."""
    request = GetParameters.Request(names=["relative.authority"])
    return ros.call(GetParameters, "controller/get_parameters", request).values[0].string_value


def told(stack: Stack) -> str:
    return stack.ear.value("controller", "relative led by").removesuffix(", silent")


def agree(stack: Stack, leader: str) -> None:
    """Waits until diagnostics and parameter tell the same."""
    node = stack.nodes["controller"]
    until(lambda: told(stack) == leader, f"the diagnostics say {leader}")
    until(
        lambda: node.get_parameter("relative.authority").value == leader,
        f"the parameter says {leader}",
    )
    assert parameter(stack.ros) == leader


@pytest.mark.parametrize("lockstep", [True, False])
def test_the_parameter_follows_a_plan(ros: Ros, lockstep: bool) -> None:
    """Each hand-over of the plan in its turn, in lockstep and in wall time."""
    stack = ros.stack(values(lockstep=lockstep, real_time=lockstep)).begin()
    node, leaders = stack.nodes["controller"], ["autonomy"]

    def over() -> bool:
        if leaders[-1] != (leader := node.get_parameter("relative.authority").value):
            leaders.append(leader)
        return leader == "hold"

    until(over, lambda: f"the whole plan, not {leaders}")
    assert leaders == ["autonomy", "human", "hold"]
    agree(stack, "hold")
    assert stack.ear.value("controller", "changed parameters") == "none"


def test_what_is_asked_for_after_a_plan_stays(ros: Ros) -> None:
    """The parameter follows the plan, but overrides nobody who asks later."""
    stack = ros.stack(values()).begin()
    stack.run_until(2.7)
    agree(stack, "hold")
    wanted = Parameter("relative.authority", value="autonomy").to_parameter_msg()
    request = SetParametersAtomically.Request(parameters=[wanted])
    service = "controller/set_parameters_atomically"
    assert ros.call(SetParametersAtomically, service, request).result.successful
    agree(stack, "autonomy")
    stack.run_until(stack.ear.now + 1.0)
    agree(stack, "autonomy")


@contextmanager
def page(ros: Ros, scenario: dict[str, Any]) -> Iterator[RawPage]:
    """A page of a console beside the team."""
    overrides = [Parameter(key, value=value) for key, value in flat(scenario)]
    console = ros.node(OperatorConsole(context=ros.context, parameter_overrides=overrides))
    found = RawPage(int(console.url.rpartition(":")[2].rstrip("/")))
    try:
        found.wait_for_welcome()
        yield found
    finally:
        found.close()


def shown(page: RawPage, leader: str) -> None:
    """Reads what the page is told until it is who leads."""

    def says(message: dict[str, Any]) -> bool:
        found = message.get("subtasks", {}).get("relative", {})
        return message["kind"] == "status" and found.get("authority") == leader

    page.until(says)


def test_a_page_shows_who_leads_by_plan_by_topic_and_by_parameter(ros: Ros) -> None:
    """Whoever handed the subtask over, and by what, every page is told."""
    scenario = values(real_time=True)
    stack = ros.stack(scenario)
    talker = ros.probe.create_publisher(String, "relative/authority", 10)
    ros.matched(talker)
    with page(ros, scenario) as watcher:
        shown(watcher, "autonomy")
        go(ros)
        shown(watcher, "human")
        shown(watcher, "hold")
        talker.publish(String(data="autonomy"))
        shown(watcher, "autonomy")
        wanted = Parameter("relative.authority", value="human").to_parameter_msg()
        request = SetParametersAtomically.Request(parameters=[wanted])
        ros.call(SetParametersAtomically, "controller/set_parameters_atomically", request)
        shown(watcher, "human")
        agree(stack, "human")
