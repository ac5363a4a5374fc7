# SPDX-License-Identifier: Apache-2.0
"""Everything that a source can send to a subtask, as the controller takes it."""

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

Parsed = tuple[int, MotionInput | Force | None]


def listen(
    node: ScenarioNode,
    codec: SubtaskCodec,
    source: str,
    take: Callable[[str, str, str, Parsed], None],
) -> None:
    """Subscribes to everything that one source can send to one subtask.

    Args:
        node: The controller's node.
        codec: Messages of the subtask.
        source: The source.
        take: Takes topic, subtask, source, and stamp [ns] with what is asked for, if anything.
    """
    prefix = f"{codec.name}/{source}"

    def on_message(kind: str, parse: Callable[[Any], Parsed], message: Any) -> None:
        take(f"{prefix}/{kind}", codec.name, source, parse(message))

    def target(message: PoseStamped) -> Parsed:
        stamp, position = codec.target(message)
        return stamp, Target(position, np.zeros(codec.layout.dim))

    def rate(message: TwistStamped) -> Parsed:
        stamp, velocity = codec.rate(message)
        return stamp, Rate(velocity)

    def force(message: WrenchStamped) -> Parsed:
        stamp, wanted = codec.force(message)
        return stamp, Force(wanted)

    def reference(data: bytes) -> Parsed:
        return _reference(codec.decode(data), codec.layout.dim)

    on_reference = partial(on_message, "reference", reference)
    node.subscribe(MultiDOFJointTrajectory, f"{prefix}/reference", on_reference, raw=True)
    kinds: tuple[tuple[type, str, Callable[[Any], Parsed]], ...] = (
        (PoseStamped, "target_pose", target),
        (TwistStamped, "target_twist", rate),
        (WrenchStamped, "wrench", force),
    )
    for message_type, kind, parse in kinds:
        node.subscribe(message_type, f"{prefix}/{kind}", partial(on_message, kind, parse))


def _reference(parsed: ParsedReference | Marker, dim: int) -> tuple[int, MotionInput | None]:
    """What a source asks for: a motion, a set-point where it gives no velocity, or nothing.

    A motion without acceleration is followed by its position and velocity alone.
    """
    if isinstance(parsed, Marker):
        return parsed.stamp_ns, None
    if parsed.velocity is None:
        return parsed.stamp_ns, Target(parsed.position, np.zeros(dim))
    acceleration = np.zeros(dim) if parsed.acceleration is None else parsed.acceleration
    return parsed.stamp_ns, Reference(parsed.position, parsed.velocity, acceleration)
