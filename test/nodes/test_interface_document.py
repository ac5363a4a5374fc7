# SPDX-License-Identifier: Apache-2.0
"""The interface that the documentation lists is that of the running programs."""

import re
from collections.abc import Callable, Mapping
from typing import Any

import commands
import pytest
import rclpy
from documents import codes, tables
from harness import flat, merged, paper
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from repository import ROOT

from noninteract_ros.nodes.console.operator_console import OperatorConsole
from noninteract_ros.nodes.controller.controller import Controller
from noninteract_ros.nodes.sources.haptic_emulator import HapticEmulator
from noninteract_ros.nodes.sources.joy_operator import JoyOperator
from noninteract_ros.nodes.sources.relative_planner import RelativePlanner
from noninteract_ros.nodes.team.robot_team import RobotTeam
from noninteract_ros.scenario.files import read_parameters

OWN_TOPICS = {"own_states": "<robot joint_states_topic>", "own_efforts": "<robot effort_topic>"}
NAMES = {
    r"(robot_1|robot_2|left|right)": "<robot>",
    r"(cooperative|relative)": "<subtask>",
    r"(plate)": "<body>",
}
ROS_TOPICS = ("/rosout", "/parameter_events")


def scenarios() -> list[tuple[dict[str, Any], list[Callable[..., Node]]]]:
    """Return scenarios with programs that together have every topic."""
    wall = read_parameters(ROOT / "config/delayed_wall.yaml")
    plate = {"surroundings": ["plate"], "plate": {"kind": "rigid_object", "mass": 1.0}}
    full = paper(object=None, publish_clock=True, **plate)
    own = read_parameters(ROOT / "config/own_robots.yaml")
    topics = {
        name: {"joint_states_topic": f"{name}/own_states", "effort_topic": f"{name}/own_efforts"}
        for name in own["robots"]
    }
    return [
        (full, [RobotTeam, Controller, HapticEmulator, RelativePlanner]),
        (merged(full, {"console": {"port": 0}, "joy": {}}), [OperatorConsole, JoyOperator]),
        (wall, [HapticEmulator]),
        (merged(own, topics), [RobotTeam, Controller]),
    ]


def documented() -> dict[str, list[str]]:
    """Return the rows of the tables of topics, by topic."""
    return {
        codes(row[0])[0]: row
        for _, rows in tables(commands.INTERFACES)
        for row in rows
        if len(row) == 6
    }


def general_name(topic: str) -> str:
    """Return a topic as the document writes it."""
    name = topic.removeprefix("/team/")
    last = name.rpartition("/")[2]
    if last in OWN_TOPICS:
        return OWN_TOPICS[last]
    parts = []
    for part in name.split("/"):
        found = [text for pattern, text in NAMES.items() if re.fullmatch(pattern, part)]
        parts.append(found[0] if found else part)
    name = "/".join(parts)
    return re.sub(r"^(<subtask>)/(human|autonomy)/", r"\1/<source>/", name)


def quality(profile: QoSProfile) -> str:
    """Return the word of the document for a quality of service."""
    if profile.durability == DurabilityPolicy.TRANSIENT_LOCAL:
        return "latched"
    reliable = profile.reliability == ReliabilityPolicy.RELIABLE
    if reliable and profile.depth == 1000:
        return "loop"
    return f"{'reliable' if reliable else 'best effort'}, {profile.depth}"


@pytest.fixture(scope="module")
def interface(module_domain: int) -> Mapping[str, set[Any]]:
    """Return topics with types and qualities that programs publish, and services with types."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=module_domain)
    found: dict[str, set[Any]] = {"published": set(), "subscribed": set(), "services": set()}
    nodes = []
    try:
        for values, kinds in scenarios():
            overrides = [Parameter(name, value=value) for name, value in flat(values)]
            for kind in kinds:
                node = kind(context=context, parameter_overrides=overrides)
                nodes.append(node)
                name = node.get_name()
                for group, ends in (
                    ("published", node.publishers),
                    ("subscribed", node.subscriptions),
                ):
                    found[group] |= {
                        (
                            name,
                            general_name(end.topic_name),
                            kind_of(end.msg_type),
                            quality(end.qos_profile),
                        )
                        for end in ends
                        if end.topic_name not in ROS_TOPICS
                    }
                found["services"] |= {
                    (item.service_name.removeprefix("/team/"), kind_of(item.srv_type, "srv"))
                    for item in node.services
                }
    finally:
        for node in nodes:
            node.destroy_node()
        context.destroy()
    return found


def kind_of(message: type, group: str = "msg") -> str:
    """Return the full name of a type of message or service."""
    return f"{message.__module__.split('.')[0]}/{group}/{message.__name__}"


def test_published_topics_are_documented(interface: Mapping[str, set[Any]]) -> None:
    """Every topic that a program publishes has its row, with program, type and quality."""
    rows = documented()
    for node, topic, kind, profile in interface["published"]:
        assert topic in rows, f"{topic} of {node}"
        _, row_kind, source, _, row_profile, _ = rows[topic]
        assert codes(row_kind) == [kind], topic
        assert profile in row_profile, topic
        assert node in source or not codes(source), f"{topic} of {node}"


def test_topics_that_the_stack_receives_are_documented(interface: Mapping[str, set[Any]]) -> None:
    """Every topic that team, controller and sources receive has its row, with its type."""
    rows = documented()
    for node, topic, kind, _ in interface["subscribed"]:
        if topic.startswith("/joy"):  # a driver's, docs/devices.md
            continue
        assert topic in rows, f"{topic} of {node}"
        assert codes(rows[topic][1]) == [kind], topic


def test_documented_topics_exist(interface: Mapping[str, set[Any]]) -> None:
    """Every row of the tables is a topic of a program."""
    ends = interface["published"] | interface["subscribed"]
    assert set(documented()) == {topic for _, topic, *_ in ends if not topic.startswith("/joy")}


def test_documented_services_are_those_of_the_programs(
    interface: Mapping[str, set[Any]],
) -> None:
    """The table of services has all that are not ROS's own."""
    own = {item for item in interface["services"] if item[1].startswith("std_srvs/")}
    assert own == set(commands.services().items())
