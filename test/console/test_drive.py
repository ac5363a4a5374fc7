# SPDX-License-Identifier: Apache-2.0
"""References from held inputs: exact displacement, bounded, continuous, at rest afterwards."""

from collections.abc import Callable

import numpy as np
import pytest

from noninteract_ros.arrays import Array
from noninteract_ros.console.drive import IDENTITY_ROTATION, DrivableSubtask, Drive, DriveState
from noninteract_ros.console.held_input import HeldInput, PageDrag, PageTwist
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.reference import Reference

NAME = "cooperative"
STEP = 1.0 / 120.0
LIMITS = np.array([[0.3], [5.0], [50.0]])


def subtask(elements: int, axes: tuple[str, ...], rotates: bool = False) -> DrivableSubtask:
    dim = elements * (len(axes) + 3 * rotates)
    return DrivableSubtask(
        elements=elements,
        axes=axes,
        rotates=rotates,
        limits=np.tile(LIMITS, dim),
        linear_speed=0.3,
        angular_speed=0.6,
    )


PLANAR = subtask(1, ("x", "y"))
EDGES = subtask(2, ("x", "y"))
POSE = subtask(1, ("x", "y", "z"), rotates=True)
QUARTER_ROTATION = so3.exp(np.array([0.0, 0.0, 0.5 * np.pi]))
START = {"planar": np.array([1.0, 2.0]), "pose": np.array([1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 1.0])}


def state_at(desired: Array, frame: Array = IDENTITY_ROTATION, enabled: bool = True) -> DriveState:
    return DriveState(
        desired={NAME: desired},
        frames={NAME: frame},
        enabled=frozenset([NAME] if enabled else []),
    )


def run(
    drive: Drive, held: Callable[[int], HeldInput | None], state: DriveState, ticks: int
) -> list[Reference]:
    """Return the references of a number of ticks, with the input held at each."""
    steps = [drive.step(held(tick), state, STEP) for tick in range(ticks)]
    return [references[NAME] for references in steps if references]


def drag(
    translation: list[float],
    rotation: Array = IDENTITY_ROTATION,
    grab: int = 1,
    element: int = 0,
) -> PageDrag:
    return PageDrag(
        subtask=NAME,
        element=element,
        grab=grab,
        translation=np.array(translation),
        rotation=rotation,
    )


def twist(linear: list[float]) -> PageTwist:
    return PageTwist(subtask=NAME, element=0, grab=1, linear=np.array(linear), angular=np.zeros(3))


def check_bounds(references: list[Reference], subtask: DrivableSubtask) -> None:
    """Check bounds of velocity, acceleration and jerk, and that positions integrate velocities."""
    v = np.array([item.velocity for item in references])
    a = np.array([item.acceleration for item in references])
    plain = subtask.layout.rates
    assert (np.abs(v)[:, plain] <= 0.3 + 1e-9).all()
    assert (np.abs(a)[:, plain] <= 5.0 + 1e-9).all()
    assert (np.abs(np.diff(a[:, plain], axis=0)) <= 50.0 * STEP + 1e-6).all()
    x = np.array([item.position for item in references])[:, subtask.layout.values]
    mean = 0.5 * (v[1:, plain] + v[:-1, plain])
    assert (np.abs(np.diff(x, axis=0) - STEP * mean) <= 50.0 * STEP**3).all()


def test_a_drag_moves_the_reference_by_its_displacement() -> None:
    """The reference reaches the dragged position within its bounds."""
    drive = Drive({NAME: PLANAR})
    references = run(drive, lambda _: drag([0.4, -0.2, 9.0]), state_at(START["planar"]), 400)
    np.testing.assert_allclose(references[-1].position, [1.4, 1.8], atol=1e-12)
    assert not references[-1].velocity.any()
    check_bounds(references, PLANAR)


def test_a_release_brings_the_reference_to_rest_and_ends_it() -> None:
    """After a release the motion stops within its bounds; then no reference is returned."""
    drive = Drive({NAME: PLANAR})
    state = state_at(START["planar"])
    references = run(drive, lambda tick: twist([1, 0, 0]) if tick < 120 else None, state, 240)
    check_bounds(references, PLANAR)
    released = references[120:]
    moving = [item for item in released if item.velocity.any()]
    assert len(moving) * STEP < 0.25
    assert not released[-1].velocity.any()
    assert not released[-1].acceleration.any()
    assert len(references) < 240
    assert not drive.active


def test_a_new_grab_does_not_jump() -> None:
    """A new grab starts from the last motion, even while that is coming to rest."""
    drive = Drive({NAME: PLANAR})

    def held(tick: int) -> HeldInput | None:
        if tick < 60:
            return drag([1.0, 0.0, 0.0], grab=1)
        return None if tick < 64 else drag([0.0, 0.05, 0.0], grab=2)

    references = run(drive, held, state_at(START["planar"]), 400)
    check_bounds(references, PLANAR)
    middle = references[64].position
    assert references[63].velocity[0] > 0.05  # It was still moving.
    np.testing.assert_allclose(references[-1].position, middle + np.array([0.0, 0.05]), atol=2e-2)


def test_a_drag_that_stutters_reaches_the_same_target() -> None:
    """The same grab resumes after a gap, however long the team has rested meanwhile."""
    drive = Drive({NAME: PLANAR})
    held = drag([0.4, -0.2, 0.0])
    gap = range(100, 220)
    desired = START["planar"].copy()
    for tick in range(600):
        references = drive.step(None if tick in gap else held, state_at(desired), STEP)
        desired = references[NAME].position if references else desired
        assert drive.active or tick in gap or tick > 300
    np.testing.assert_allclose(desired, [1.4, 1.8], atol=1e-12)


def test_only_the_held_element_moves() -> None:
    """The other edges of a relative subtask keep their values."""
    drive = Drive({NAME: EDGES})
    start = np.array([1.0, 0.0, 0.0, 1.0])
    references = run(drive, lambda _: drag([0.1, 0.0, 0.0], element=1), state_at(start), 300)
    np.testing.assert_allclose(references[-1].position, [1.0, 0.0, 0.1, 1.0], atol=1e-12)


def test_displacements_are_rotated_into_the_subtasks_frame() -> None:
    """In a frame rotated by 90 degrees about z, +y of the world is +x."""
    drive = Drive({NAME: PLANAR})
    references = run(
        drive, lambda _: drag([0.0, 0.1, 0.0]), state_at(START["planar"], QUARTER_ROTATION), 300
    )
    np.testing.assert_allclose(references[-1].position, [1.1, 2.0], atol=1e-12)
    drive = Drive({NAME: PLANAR})
    references = run(
        drive, lambda _: twist([0.0, 1.0, 0.0]), state_at(START["planar"], QUARTER_ROTATION), 120
    )
    np.testing.assert_allclose(references[-1].velocity, [0.3, 0.0], atol=1e-9)


@pytest.mark.parametrize("frame", [IDENTITY_ROTATION, QUARTER_ROTATION], ids=["world", "rotated"])
def test_a_rotation_of_the_handle_rotates_the_value_in_the_world(frame: Array) -> None:
    """The value's rotation, expressed in the world, follows the handle."""
    drive = Drive({NAME: POSE})
    rotation = so3.exp(np.array([0.3, -0.2, 0.1]))
    held = drag([0.0, 0.0, 0.0], rotation)
    references = run(drive, lambda _: held, state_at(START["pose"], frame), 600)
    in_world = so3.product(frame, references[-1].position[3:])
    np.testing.assert_allclose(so3.product(rotation, frame), in_world, atol=1e-9)
    assert max(np.linalg.norm(item.velocity[3:]) for item in references) < 0.6


def test_subtasks_without_human_authority_get_no_reference() -> None:
    """A hand-over to another source ends the motion at once."""
    drive = Drive({NAME: PLANAR})
    disabled = state_at(START["planar"], enabled=False)
    assert run(drive, lambda _: twist([1, 0, 0]), disabled, 10) == []
    run(drive, lambda _: twist([1, 0, 0]), state_at(START["planar"]), 10)
    assert drive.active
    assert run(drive, lambda _: twist([1, 0, 0]), disabled, 1) == []
    assert not drive.active


def test_no_reference_before_a_desired_value_is_received() -> None:
    """A motion needs a desired value to start from."""
    drive = Drive({NAME: PLANAR})
    unknown = DriveState(desired={}, frames={}, enabled=frozenset([NAME]))
    assert run(drive, lambda _: twist([1, 0, 0]), unknown, 10) == []
