# SPDX-License-Identifier: Apache-2.0
"""Operator input: dead-man's switch, dead zone, workspace and clutch."""

from typing import Any

import numpy as np
import pytest

from noninteract_ros.arrays import Array
from noninteract_ros.control.references.desired_motion import DesiredMotion
from noninteract_ros.control.references.inputs import Rate, Target
from noninteract_ros.errors import InputError, ScenarioError
from noninteract_ros.scenario import Scenario
from noninteract_ros.schema import load
from noninteract_ros.sources.human.input_settings import OperatorSettings
from noninteract_ros.sources.human.input_shaping import DeadManSwitch, OperatorInput, deflection
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.reference import Reference
from noninteract_ros.subtasks.subtask import Subtask

STEP = 1e-3
TURN = np.array([0.0, 0.0, np.sin(0.5), np.cos(0.5)])
LEVEL = np.array([0.0, 0.0, 0.0, 1.0])
GAINS = {"stiffness": [50.0], "damping": [30.0]}


def planar() -> Subtask:
    """Build the cooperative position of two planar robots: x and y."""
    values = {
        "robots": ["a", "b"],
        "a": {"mass": 1.0},
        "b": {"mass": 1.0, "initial_position": [1.0, 0.0]},
        "subtasks": ["cooperative", "relative"],
        "cooperative": {"kind": "cooperative_position", **GAINS},
        "relative": {"kind": "relative_position", **GAINS},
    }
    scenario = Scenario.from_dict(values)
    return scenario.build_stack(scenario.build_team()).subtasks[0]


class Pose(Subtask):
    """A subtask of one pose; only its layout is used."""

    name, elements, axes, rotates = "cooperative", ("cooperative",), ("x", "y", "z"), True

    def __init__(self) -> None: ...

    def evaluate(self, state: Any) -> Any:
        """Not used."""
        raise NotImplementedError


def limits(task: Subtask, velocity: float = 1.0) -> Array:
    """Return bounds of velocity, acceleration and jerk."""
    return np.outer([velocity, 5.0, 50.0], np.ones(task.layout.dim))


def operator_input(task: Subtask, **keys: Any) -> OperatorInput:
    """Build an input from keys of a scenario file."""
    return OperatorInput(load(OperatorSettings, keys, "operator"), task, limits(task))


def pose(*position: float, turn: Array = LEVEL) -> Array:
    """Return a pose of a device."""
    return np.concatenate([position, turn])


def test_a_timeout_releases_until_the_switch_is_held_again() -> None:
    """A device that returns with the button still pressed has no effect."""
    switch = DeadManSwitch(0.25)
    switch.update(0.0, held=True)
    assert switch.is_held(0.25)
    assert not switch.is_held(0.26)
    switch.update(0.3, held=True)
    assert not switch.is_held(0.3)
    switch.update(0.4, held=False)
    switch.update(0.5, held=True)
    assert switch.is_held(0.5)


def test_a_gap_between_updates_releases_the_switch() -> None:
    """The next update after a gap finds the switch released."""
    switch = DeadManSwitch(0.25)
    switch.update(0.0, held=True)
    switch.update(1.0, held=True)
    assert not switch.is_held(1.0)


def test_deflections_are_zero_in_the_dead_zone_continuous_and_odd() -> None:
    """Deflections grow from the edge of the dead zone to 1, symmetrically."""
    x = np.linspace(-1.2, 1.2, 2401)
    found = deflection(x, 0.1, 1.5)
    np.testing.assert_array_equal(found[np.abs(x) <= 0.1], 0.0)
    np.testing.assert_allclose(found, -found[::-1], atol=1e-12)
    assert found[-1] == 1.0
    assert np.abs(np.diff(found)).max() < 0.002
    assert (np.diff(found) >= 0.0).all()


def test_sticks_become_velocities_of_the_subtask_s_coordinates() -> None:
    """A planar subtask uses x and y; a pose uses all deflections."""
    stick = np.array([1.0, -0.5, 0.25, 0.1, 0.2, 1.0])
    flat = operator_input(planar(), linear_speed=0.2).rate(stick, Reference.at_rest(np.zeros(2)))
    np.testing.assert_allclose(flat, [0.2, -0.1])
    task = Pose()
    found = operator_input(task, linear_speed=0.2, angular_speed=0.5)
    np.testing.assert_allclose(
        found.rate(stick, Reference.at_rest(task.layout.identity, task.layout)),
        [0.2, -0.1, 0.05, 0.05, 0.1, 0.5],
    )


def test_velocities_stop_at_the_workspace_boundary() -> None:
    """At full deflection the shaped motion ends inside the box, near its boundary."""
    task = planar()
    found = operator_input(
        task, linear_speed=1.0, workspace=[1.0, 0.4], workspace_centre=[0.2, 0.0]
    )
    desired = DesiredMotion(limits(task), False, task.layout)
    desired.hold_at(np.array([-0.2, 0.1]))
    stick = np.array([1.0, -1.0, 0.0, 0.0, 0.0, 0.0])
    furthest = np.full(2, -np.inf)
    rate = np.zeros(2)
    late = [desired.now] * 40  # The operator's node receives it 40 ms late.
    for tick in range(4000):
        if tick % 20 == 0:
            rate = found.rate(stick, late[0])
        now = desired.advance(Rate(rate), STEP)
        late = [*late[1:], now]
        furthest = np.maximum(furthest, now.position * [1.0, -1.0])
    np.testing.assert_allclose(furthest, [0.7, 0.2], atol=2e-3)
    assert (furthest < [0.7005, 0.2005]).all()
    outside = Reference.at_rest([0.9, 0.0])
    assert found.rate(stick, outside)[0] == 0.0
    assert found.rate(-stick, outside)[0] < 0.0  # Motion towards the box is always allowed.


def test_a_clutch_starts_at_the_subtask_s_value() -> None:
    """The first set-point is the present value; then it follows the device's scaled motion."""
    task = Pose()
    found = operator_input(task, linear_scale=2.0, angular_scale=0.5)
    value = np.concatenate([[1.0, 2.0, 3.0], so3.exp(np.array([0.3, -0.2, 0.1]))])
    start = pose(5.0, 0.0, -1.0, turn=TURN)
    found.engage(start, value)
    np.testing.assert_allclose(found.target(start), value, atol=1e-12)
    turn = np.array([0.2, 0.4, -0.6])
    moved = pose(5.1, -0.2, -1.0, turn=so3.product(so3.exp(turn), TURN))
    gap = task.layout.difference(found.target(moved), value)
    np.testing.assert_allclose(gap, [0.2, -0.4, 0.0, 0.1, 0.2, -0.3], atol=1e-12)


def test_a_target_stays_in_the_workspace() -> None:
    """The set-point stays in the box when the device leaves it."""
    found = operator_input(planar(), workspace=[1.0, 1.0])
    found.engage(pose(0.0, 0.0, 0.0), np.array([0.2, 0.2]))
    np.testing.assert_allclose(found.target(pose(9.0, -0.1, 4.0)), [0.5, 0.1])


def test_without_a_clutch_there_is_no_target() -> None:
    """A pose without an engaged clutch is an error."""
    found = operator_input(planar())
    with pytest.raises(InputError, match="clutch"):
        found.target(pose(0.0, 0.0, 0.0))
    found.engage(pose(0.0, 0.0, 0.0), np.zeros(2))
    found.release()
    assert not found.clutched


def test_engagement_and_release_never_jump() -> None:
    """Engagement, release and jumps of the device keep the bounds, in position and rotation."""
    task = Pose()
    bounds = limits(task, 0.6)
    found = operator_input(task, linear_scale=1.5)
    desired = DesiredMotion(bounds, False, task.layout)
    desired.hold_at(task.layout.identity)
    rng = np.random.default_rng(5)
    device, held = pose(0.0, 0.0, 0.0), False
    trace: list[Reference] = []
    for tick in range(6000):
        if tick % 150 == 0:  # The clutch changes at any time, during motion.
            held = not held
            if held:
                found.engage(device, desired.now.position)
            else:
                found.release()
        if tick % 400 == 0 and not held:  # A released device is moved elsewhere.
            device = pose(*rng.normal(size=3), turn=so3.exp(rng.normal(size=3)))
        if tick % 20 == 0 and held:
            turn = so3.product(so3.exp(0.02 * rng.normal(size=3)), device[3:])
            device = pose(*(device[:3] + 0.02 * rng.normal(size=3)), turn=turn)
        motion = Target(found.target(device), np.zeros(6)) if held else Rate(np.zeros(6))
        trace.append(desired.advance(motion, STEP))
    layout = task.layout
    position = np.array([item.position for item in trace])
    velocity = np.array([item.velocity for item in trace])
    way = layout.difference(position[1:], position[:-1])
    assert np.abs(way[:, :3]).max() <= 0.6 * STEP * (1 + 1e-9)
    assert np.abs(np.diff(velocity[:, :3], axis=0)).max() <= 5.0 * STEP * (1 + 1e-6)
    # The bounds are those of rotation vectors, whose rate is at least the angular velocity.
    assert np.linalg.norm(way[:, 3:], axis=1).max() <= np.sqrt(3.0) * 0.6 * STEP * (1 + 1e-6)
    assert np.abs(velocity).max() > 0.3  # It did move.


def test_a_workspace_that_does_not_fit_the_subtask_is_rejected() -> None:
    """The error names the key and the required size."""
    with pytest.raises(ScenarioError, match=r"operator\.workspace: .*2 numbers"):
        operator_input(planar(), workspace=[1.0, 1.0, 1.0])
