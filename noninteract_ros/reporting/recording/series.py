# SPDX-License-Identifier: Apache-2.0
"""Recorded messages of one topic as arrays over time.

Conventions of all series: stamps are in seconds and unique; of messages with equal stamps, such as
a state that was published again, the first is kept. Rows are in the order of arrival. Each name
that occurs in any message has a column, NaN where a message lacks it. A field whose size does not
match the names is NaN as well: subscribers reject it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array
from noninteract_ros.errors import one_of
from noninteract_ros.reporting.recording import layouts

TIME = "time"


@dataclass(frozen=True, slots=True)
class JointSeries:
    """Joint states or commands, in SI units.

    Attributes:
        names: Joints, `<robot>/<joint>`.
        stamps: Shape (n,).
        position: Shape (n, joints).
        velocity: Shape (n, joints).
        effort: Shape (n, joints).
    """

    names: tuple[str, ...]
    stamps: Array
    position: Array
    velocity: Array
    effort: Array


@dataclass(frozen=True, slots=True)
class TrajectorySeries:
    """Motion of a subtask (state, desired or reference), in SI units.

    Attributes:
        names: The subtask's elements.
        stamps: Stamps of the messages with a point, shape (n,).
        translation: Shape (n, elements, 3).
        quaternion: x, y, z, w; shape (n, elements, 4).
        linear_velocity: Shape (n, elements, 3).
        angular_velocity: Shape (n, elements, 3).
        linear_acceleration: Shape (n, elements, 3).
        angular_acceleration: Shape (n, elements, 3).
        markers: Stamps of the messages without points, shape (m,).
        conflicting: Stamps of messages with different content, shape (k,). A message that repeats
            another one byte by byte is no conflict.
    """

    names: tuple[str, ...]
    stamps: Array
    translation: Array
    quaternion: Array
    linear_velocity: Array
    angular_velocity: Array
    linear_acceleration: Array
    angular_acceleration: Array
    markers: Array
    conflicting: Array


@dataclass(frozen=True, slots=True)
class WrenchSeries:
    """Wrenches.

    Attributes:
        stamps: Shape (n,).
        frames: `header.frame_id` of each message, length n.
        force: [N], shape (n, 3).
        torque: [N m], shape (n, 3).
    """

    stamps: Array
    frames: tuple[str, ...]
    force: Array
    torque: Array


@dataclass(frozen=True, slots=True)
class LabelledSeries:
    """Labelled numbers, such as the energies of a subtask.

    Attributes:
        labels: Label of each column.
        stamps: Entry `time`, or the time of publication [s since 1970] without such an entry;
            shape (n,).
        data: Shape (n, labels).
    """

    labels: tuple[str, ...]
    stamps: Array
    data: Array

    def __getitem__(self, label: str) -> Array:
        """Return one column, shape (n,).

        Raises:
            KeyError: There is no such label.
        """
        if label not in self.labels:
            raise KeyError(f"{label}: found none, allowed: {one_of(self.labels, label)}")
        return self.data[:, self.labels.index(label)]


def joint_series(messages: list[bytes]) -> JointSeries:
    """Decode sensor_msgs/msg/JointState messages.

    Raises:
        InputError: A message is malformed.
    """
    table = _Table(messages, layouts.joint_state)
    keep = _first_of_each(table.stamps)
    fields = (table.field(key, 1)[keep, :, 0] for key in ("position", "velocity", "effort"))
    return JointSeries(table.names, table.stamps[keep], *fields)


def trajectory_series(messages: list[bytes]) -> TrajectorySeries:
    """Decode trajectory_msgs/msg/MultiDOFJointTrajectory messages.

    Raises:
        InputError: A message is malformed.
    """
    table = _Table(messages, layouts.trajectory)
    with_point = np.zeros(len(messages), dtype=bool)
    for group in table.groups:
        with_point[group.rows] = bool(group.layout.blocks)
    rows = np.flatnonzero(with_point)
    rows = rows[_first_of_each(table.stamps[rows])]
    markers = table.stamps[~with_point]
    transforms, velocities, accelerations = (
        table.field(key, size)[rows]
        for key, size in (("transforms", 7), ("velocities", 6), ("accelerations", 6))
    )
    return TrajectorySeries(
        table.names,
        table.stamps[rows],
        translation=transforms[..., :3],
        quaternion=transforms[..., 3:],
        linear_velocity=velocities[..., :3],
        angular_velocity=velocities[..., 3:],
        linear_acceleration=accelerations[..., :3],
        angular_acceleration=accelerations[..., 3:],
        markers=markers[_first_of_each(markers)],
        conflicting=_contradicted(messages, table.stamps),
    )


def wrench_series(messages: list[bytes]) -> WrenchSeries:
    """Decode geometry_msgs/msg/WrenchStamped messages.

    Raises:
        InputError: A message is malformed.
    """
    groups = layouts.group_by_layout(messages, layouts.wrench_stamped)
    stamps, wrench = np.empty(len(messages)), np.empty((len(messages), 6))
    frames = np.empty(len(messages), dtype=object)
    for group in groups:
        stamps[group.rows] = group.stamps()
        wrench[group.rows] = group.doubles(group.layout.blocks["wrench"])
        frames[group.rows] = group.layout.names[0]
    keep = _first_of_each(stamps)
    return WrenchSeries(stamps[keep], tuple(frames[keep]), wrench[keep, :3], wrench[keep, 3:])


def labelled_series(messages: list[bytes], publish_times: Array) -> LabelledSeries:
    """Decode std_msgs/msg/Float64MultiArray messages with labelled entries.

    Args:
        messages: Serialized messages.
        publish_times: Times of publication [s], shape (n,).

    Raises:
        InputError: A message is malformed.
    """
    table = _Table(messages, layouts.float64_multi_array)
    data, stamps = table.field("data", 1)[:, :, 0], publish_times
    labels = [label for label in table.names if label != TIME]
    if TIME in table.names:
        times = data[:, table.names.index(TIME)]
        stamps = np.where(np.isnan(times), publish_times, times)
    columns = [table.names.index(label) for label in labels]
    keep = _first_of_each(stamps)
    return LabelledSeries(tuple(labels), stamps[keep], data[keep][:, columns])


class _Table:
    """Messages grouped by layout, with one column for each name."""

    def __init__(self, messages: list[bytes], walker: layouts.Walker) -> None:
        self.groups = layouts.group_by_layout(messages, walker)
        self._rows = len(messages)
        in_order = sorted(self.groups, key=lambda group: int(group.rows[0]))
        # A dictionary keeps each name once, in the order of first appearance.
        names = dict.fromkeys(name for group in in_order for name in group.layout.names)
        self.names = tuple(names)
        self._columns = {name: column for column, name in enumerate(self.names)}
        self.stamps = np.zeros(self._rows)
        for group in self.groups:
            if group.layout.stamp is not None:
                self.stamps[group.rows] = group.stamps()

    def field(self, key: str, size: int) -> Array:
        """Return a field with `size` numbers for each name, shape (messages, names, size)."""
        values = np.full((self._rows, len(self.names), size), np.nan)
        for group in self.groups:
            names, block = group.layout.names, group.layout.blocks.get(key)
            if block is None or not block.length or block.length != size * len(names):
                continue
            columns = np.array([self._columns[name] for name in names])
            numbers = group.doubles(block).reshape(-1, len(names), size)
            values[np.ix_(group.rows, columns)] = numbers
        return values


def _first_of_each(stamps: Array) -> NDArray[np.intp]:
    """Return the first row of each stamp, in order."""
    _, first = np.unique(stamps, return_index=True)
    return np.sort(first)


def _contradicted(messages: list[bytes], stamps: Array) -> Array:
    """Return the stamps shared by messages with different content, shape (k,)."""
    distinct = set(zip(stamps.tolist(), messages, strict=True))
    values, counts = np.unique([stamp for stamp, _ in distinct], return_counts=True)
    return np.asarray(values[counts > 1], dtype=np.float64)
