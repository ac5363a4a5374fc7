# SPDX-License-Identifier: Apache-2.0
"""From what is held to references: by that much, bounded, without jumps, at rest after it."""

from collections.abc import Callable

import numpy as np
import pytest

from noninteract_ros.arrays import Array
from noninteract_ros.console.drive import NO_TURN, Drivable, Drive, DriveState
from noninteract_ros.console.page_input import Held, PageDrag, PagePush
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.reference import Reference

NAME = "cooperative"
STEP = 1.0 / 120.0
LIMITS = np.array([[0.3], [5.0], [50.0]])
PLANAR = Drivable(1, ("x", "y"), False, np.tile(LIMITS, 2), 0.3, 0.6)
EDGES = Drivable(2, ("x", "y"), False, np.tile(LIMITS, 4), 0.3, 0.6)
POSE = Drivable(1, ("x", "y", "z"), True, np.tile(LIMITS, 6), 0.3, 0.6)
QUARTER = so3.exp(np.array([0.0, 0.0, 0.5 * np.pi]))
START = {"planar": np.array([1.0, 2.0]), "pose": np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0])}


def scene(desired: Array, frame: Array = NO_TURN, led: bool = True) -> DriveState:
    return DriveState({NAME: desired}, {NAME: frame}, frozenset([NAME] if led else []))


def lead(
    drive: Drive, held: Callable[[int], Held | None], seen: DriveState, ticks: int
) -> list[Reference]:
    """What is said in so many ticks, while something is held at each."""
    said = [drive.step(held(tick), seen, STEP) for tick in range(ticks)]
    return [references[NAME] for references in said if references]


def drag(by: list[float], turn: Array = NO_TURN, grab: int = 1, element: int = 0) -> PageDrag:
    return PageDrag(NAME, element, grab, np.array(by), turn)


def push(linear: list[float]) -> PagePush:
    return PagePush(NAME, 0, 1, np.array(linear), np.zeros(3))


def check_bounds(said: list[Reference], subtask: Drivable) -> None:
    """Velocities, accelerations and jerks within the bounds; velocities are what positions do."""
    v = np.array([item.velocity for item in said])
    a = np.array([item.acceleration for item in said])
    plain = subtask.layout.rates
    assert (np.abs(v)[:, plain] <= 0.3 + 1e-9).all()
    assert (np.abs(a)[:, plain] <= 5.0 + 1e-9).all()
    assert (np.abs(np.diff(a[:, plain], axis=0)) <= 50.0 * STEP + 1e-6).all()
    x = np.array([item.position for item in said])[:, subtask.layout.values]
    mean = 0.5 * (v[1:, plain] + v[:-1, plain])
    assert (np.abs(np.diff(x, axis=0) - STEP * mean) <= 50.0 * STEP**3).all()


def test_a_drag_leads_by_that_much() -> None:
    """Held for long enough, the reference is where the handle was pulled to, within bounds."""
    drive = Drive({NAME: PLANAR})
    said = lead(drive, lambda _: drag([0.4, -0.2, 9.0]), scene(START["planar"]), 400)
    np.testing.assert_allclose(said[-1].position, [1.4, 1.8], atol=1e-12)
    assert not said[-1].velocity.any()
    check_bounds(said, PLANAR)


def test_letting_go_comes_to_rest_and_then_to_silence() -> None:
    """After release the motion stops within its bounds, says so, and is silent."""
    drive = Drive({NAME: PLANAR})
    seen = scene(START["planar"])
    said = lead(drive, lambda tick: push([1, 0, 0]) if tick < 120 else None, seen, 240)
    check_bounds(said, PLANAR)
    released = said[120:]
    moving = [item for item in released if item.velocity.any()]
    assert len(moving) * STEP < 0.25
    assert not released[-1].velocity.any()
    assert not released[-1].acceleration.any()
    assert len(said) < 240
    assert not drive.active


def test_taking_hold_again_does_not_jump() -> None:
    """A new grab starts from where the last motion is, even while that still comes to rest."""
    drive = Drive({NAME: PLANAR})

    def held(tick: int) -> Held | None:
        if tick < 60:
            return drag([1.0, 0.0, 0.0], grab=1)
        return None if tick < 64 else drag([0.0, 0.05, 0.0], grab=2)

    said = lead(drive, held, scene(START["planar"]), 400)
    check_bounds(said, PLANAR)
    middle = said[64].position
    assert said[63].velocity[0] > 0.05  # It was still moving.
    np.testing.assert_allclose(said[-1].position, middle + np.array([0.0, 0.05]), atol=2e-2)


def test_a_drag_that_stutters_leads_to_the_same_place() -> None:
    """The same grab goes on after a gap, however long the team has rested meanwhile."""
    drive = Drive({NAME: PLANAR})
    held = drag([0.4, -0.2, 0.0])
    gap = range(100, 220)
    desired = START["planar"].copy()
    for tick in range(600):
        said = drive.step(None if tick in gap else held, scene(desired), STEP)
        desired = said[NAME].position if said else desired
        assert drive.active or tick in gap or tick > 300
    np.testing.assert_allclose(desired, [1.4, 1.8], atol=1e-12)


def test_only_the_element_that_is_held_moves() -> None:
    """A relative subtask's other edges keep their values."""
    drive = Drive({NAME: EDGES})
    start = np.array([1.0, 0.0, 0.0, 1.0])
    said = lead(drive, lambda _: drag([0.1, 0.0, 0.0], element=1), scene(start), 300)
    np.testing.assert_allclose(said[-1].position, [1.0, 0.0, 0.1, 1.0], atol=1e-12)


def test_displacements_are_seen_from_the_subtasks_frame() -> None:
    """In a frame that is turned by a quarter about z, the world's +y is its +x."""
    drive = Drive({NAME: PLANAR})
    said = lead(drive, lambda _: drag([0.0, 0.1, 0.0]), scene(START["planar"], QUARTER), 300)
    np.testing.assert_allclose(said[-1].position, [1.1, 2.0], atol=1e-12)
    drive = Drive({NAME: PLANAR})
    said = lead(drive, lambda _: push([0.0, 1.0, 0.0]), scene(START["planar"], QUARTER), 120)
    np.testing.assert_allclose(said[-1].velocity, [0.3, 0.0], atol=1e-9)


@pytest.mark.parametrize("frame", [NO_TURN, QUARTER], ids=["world", "turned"])
def test_a_turn_of_the_handle_turns_the_value_in_the_world(frame: Array) -> None:
    """The value's rotation, brought to the world, has turned as the handle has."""
    drive = Drive({NAME: POSE})
    turn = so3.exp(np.array([0.3, -0.2, 0.1]))
    held = drag([0.0, 0.0, 0.0], turn)
    said = lead(drive, lambda _: held, scene(START["pose"], frame), 600)
    in_world = so3.product(frame, said[-1].position[3:])
    np.testing.assert_allclose(so3.product(turn, frame), in_world, atol=1e-9)
    assert max(np.linalg.norm(item.velocity[3:]) for item in said) < 0.6


def test_what_somebody_else_leads_is_left_alone() -> None:
    """A subtask that the human does not lead hears nothing, and a hand-over ends the motion."""
    drive = Drive({NAME: PLANAR})
    nobody = scene(START["planar"], led=False)
    assert lead(drive, lambda _: push([1, 0, 0]), nobody, 10) == []
    lead(drive, lambda _: push([1, 0, 0]), scene(START["planar"]), 10)
    assert drive.active
    assert lead(drive, lambda _: push([1, 0, 0]), nobody, 1) == []
    assert not drive.active


def test_nothing_is_said_before_the_team_is_known() -> None:
    """Without a desired value to start from there is no reference."""
    drive = Drive({NAME: PLANAR})
    unknown = DriveState({}, {}, frozenset([NAME]))
    assert lead(drive, lambda _: push([1, 0, 0]), unknown, 10) == []
