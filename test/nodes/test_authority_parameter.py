# SPDX-License-Identifier: Apache-2.0
"""Authority as shown by the parameter, the diagnostics and the console."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
from harness import Ros, Stack, flat, paper, unpause
from pages import RawPage
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from std_msgs.msg import String
from waiting import until

from noninteract_ros.nodes.console.operator_console import OperatorConsole

PLAN = {"hand_over_times": [0.5, 2.5], "hand_over_to": ["human", "hold"]}


def values(**general: Any) -> dict[str, Any]:
    """Return the scenario `paper` without its hand, with a plan for the relative subtask."""
    relative = PLAN | {"takeover": "shaped"}
    sources = {"lockstep_sources": ["relative/autonomy"], "haptic": None, "rate": 100.0}
    return paper(relative=relative, console={"port": 0}, **(sources | general))


def parameter(ros: Ros) -> str:
    """Return the authority parameter of the relative subtask."""
    request = GetParameters.Request(names=["relative.authority"])
    return ros.call(GetParameters, "controller/get_parameters", request).values[0].string_value


def reported(stack: Stack) -> str:
    """Return the authority over the relative subtask in the diagnostics."""
    return stack.monitor.value("controller", "relative led by").removesuffix(", silent")


def wait_for_authority(stack: Stack, source: str) -> None:
    """Wait until diagnostics and parameter have this source."""
    node = stack.nodes["controller"]
    until(lambda: reported(stack) == source, f"{source} in the diagnostics")
    until(
        lambda: node.get_parameter("relative.authority").value == source,
        f"{source} in the parameter",
    )
    assert parameter(stack.ros) == source


@pytest.mark.parametrize("lockstep", [True, False])
def test_the_parameter_follows_a_plan(ros: Ros, lockstep: bool) -> None:
    """Each planned hand-over sets the parameter, in lockstep and in wall time."""
    stack = ros.stack(values(lockstep=lockstep, real_time=lockstep)).start()
    node, sources = stack.nodes["controller"], ["autonomy"]

    def plan_completed() -> bool:
        if sources[-1] != (source := node.get_parameter("relative.authority").value):
            sources.append(source)
        return source == "hold"

    until(plan_completed, lambda: f"the whole plan, not {sources}")
    assert sources == ["autonomy", "human", "hold"]
    wait_for_authority(stack, "hold")
    assert stack.monitor.value("controller", "changed parameters") == "none"


def test_an_authority_set_after_a_plan_stays(ros: Ros) -> None:
    """The parameter follows the plan, but does not override a later request."""
    stack = ros.stack(values()).start()
    stack.run_until(2.7)
    wait_for_authority(stack, "hold")
    wanted = Parameter("relative.authority", value="autonomy").to_parameter_msg()
    request = SetParametersAtomically.Request(parameters=[wanted])
    service = "controller/set_parameters_atomically"
    assert ros.call(SetParametersAtomically, service, request).result.successful
    wait_for_authority(stack, "autonomy")
    stack.run_until(stack.monitor.now + 1.0)
    wait_for_authority(stack, "autonomy")


@contextmanager
def page(ros: Ros, scenario: dict[str, Any]) -> Iterator[RawPage]:
    """Open a page of a console of the team."""
    overrides = [Parameter(key, value=value) for key, value in flat(scenario)]
    console = ros.add_node(OperatorConsole(context=ros.context, parameter_overrides=overrides))
    raw_page = RawPage(int(console.url.rpartition(":")[2].rstrip("/")))
    try:
        raw_page.wait_for_welcome()
        yield raw_page
    finally:
        raw_page.close()


def wait_for_page(page: RawPage, source: str) -> None:
    """Read messages of the page until one has this source in authority."""

    def has_source(message: dict[str, Any]) -> bool:
        subtask = message.get("subtasks", {}).get("relative", {})
        return message["kind"] == "status" and subtask.get("authority") == source

    page.until(has_source)


def test_pages_show_authority_set_by_plan_topic_and_parameter(ros: Ros) -> None:
    """Pages show every hand-over, whatever set it."""
    scenario = values(real_time=True)
    stack = ros.stack(scenario)
    publisher = ros.probe.create_publisher(String, "relative/authority", 10)
    ros.wait_for_subscribers(publisher)
    with page(ros, scenario) as raw_page:
        wait_for_page(raw_page, "autonomy")
        unpause(ros)
        wait_for_page(raw_page, "human")
        wait_for_page(raw_page, "hold")
        publisher.publish(String(data="autonomy"))
        wait_for_page(raw_page, "autonomy")
        wanted = Parameter("relative.authority", value="human").to_parameter_msg()
        request = SetParametersAtomically.Request(parameters=[wanted])
        ros.call(SetParametersAtomically, "controller/set_parameters_atomically", request)
        wait_for_page(raw_page, "human")
        wait_for_authority(stack, "human")
