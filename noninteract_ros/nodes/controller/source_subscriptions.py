# SPDX-License-Identifier: Apache-2.0
"""Subscriptions of the controller to the inputs of a source."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from trajectory_msgs.msg import MultiDOFJointTrajectory

from noninteract_ros.control.references.inputs import Force, MotionInput, Rate, Target
from noninteract_ros.nodes.common.node import ScenarioNode
from noninteract_ros.nodes.messages.messages import Marker, ParsedReference, SubtaskCodec
from noninteract_ros.subtasks.reference import Reference

Input = tuple[int, MotionInput | Force | None]  # Stamp [ns], input; None for a marker.


def subscribe_to_source(
    node: ScenarioNode,
    codec: SubtaskCodec,
    source: str,
    callback: Callable[[str, str, str, Input], None],
) -> None:
    """Subscribe to all inputs of one source to one subtask.

    Args:
        node: Controller node.
        codec: Messages of the subtask.
        source: Name of the source.
        callback: Called with topic, subtask, source and input.
    """
    prefix = f"{codec.name}/{source}"

    def on_message(kind: str, parse: Callable[[Any], Input], message: Any) -> None:
        callback(f"{prefix}/{kind}", codec.name, source, parse(message))

    def target(message: PoseStamped) -> Input:
        stamp, position = codec.target(message)
        return stamp, Target(position, np.zeros(codec.layout.dim))

    def rate(message: TwistStamped) -> Input:
        stamp, velocity = codec.rate(message)
        return stamp, Rate(velocity)

    def force(message: WrenchStamped) -> Input:
        stamp, value = codec.force(message)
        return stamp, Force(value)

    def reference(data: bytes) -> Input:
        return _reference(codec.decode(data), codec.layout.dim)

    on_reference = partial(on_message, "reference", reference)
    node.subscribe(MultiDOFJointTrajectory, f"{prefix}/reference", on_reference, raw=True)
    kinds: tuple[tuple[type, str, Callable[[Any], Input]], ...] = (
        (PoseStamped, "target_pose", target),
        (TwistStamped, "target_twist", rate),
        (WrenchStamped, "wrench", force),
    )
    for message_type, kind, parse in kinds:
        node.subscribe(message_type, f"{prefix}/{kind}", partial(on_message, kind, parse))


def _reference(parsed: ParsedReference | Marker, dim: int) -> tuple[int, MotionInput | None]:
    """Return a motion, a set-point if the message has no velocity, or None for a marker.

    A motion without acceleration is tracked by position and velocity alone.
    """
    if isinstance(parsed, Marker):
        return parsed.stamp_ns, None
    if parsed.velocity is None:
        return parsed.stamp_ns, Target(parsed.position, np.zeros(dim))
    acceleration = np.zeros(dim) if parsed.acceleration is None else parsed.acceleration
    return parsed.stamp_ns, Reference(parsed.position, parsed.velocity, acceleration)
