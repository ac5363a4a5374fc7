# SPDX-License-Identifier: Apache-2.0
"""Authority, timeout and force inputs of one subtask."""

import numpy as np
import pytest

from noninteract_ros.control.references.inputs import Force, Rate, Target
from noninteract_ros.control.references.subtask_input import InputSettings, SubtaskInput
from noninteract_ros.errors import ScenarioError
from noninteract_ros.subtasks.kinds.mixed_position import MixedPosition
from noninteract_ros.subtasks.reference import Reference

STEP = 1e-3
TASK = MixedPosition("lead", ("lead",), ("x", "y"), np.full((1, 2), 0.5))
START = np.array([0.1, 0.2])


def led_by(authority: str, **keys) -> SubtaskInput:
    item = SubtaskInput(TASK, InputSettings(authority, **keys))
    item.hold_at(START)
    return item


def ticks(item: SubtaskInput, first: int, last: int) -> list:
    return [item.advance(k * STEP, STEP) for k in range(first, last)]


def test_a_source_without_authority_changes_nothing_at_all():
    """Every kind of input of the other source leaves reference and force bit-equal."""
    alone, disturbed = led_by("human"), led_by("human")
    for k in range(400):
        now = k * STEP
        for item in (alone, disturbed):
            item.sources["human"].receive(now, Rate(np.array([0.1, 0.0])), now)
        noise = disturbed.sources["autonomy"]
        kind = k % 4
        if kind == 0:
            noise.receive(now, Force(np.array([9.0, 9.0])), now)
        elif kind == 1:
            noise.receive(now, Target(np.full(2, 3.0), np.zeros(2)), now)
        elif kind == 2:
            noise.receive(now, Rate(np.full(2, 3.0)), now)
        else:
            noise.receive(now, Reference.at_rest([5.0, 5.0]), now)
        a, b = alone.advance(now, STEP), disturbed.advance(now, STEP)
        np.testing.assert_array_equal(a.reference.position, b.reference.position)
        np.testing.assert_array_equal(a.reference.acceleration, b.reference.acceleration)
        np.testing.assert_array_equal(a.force, b.force)
        assert a.source == b.source == "human"


def test_hold_ignores_all_sources():
    """Under `hold` the subtask stays for any inputs, and is not reported silent."""
    item = led_by("hold")
    for name in ("human", "autonomy"):
        item.sources[name].receive(0.0, Rate(np.ones(2)), 0.0)
        item.sources[name].receive(0.0, Force(np.ones(2)), 0.0)
    for led in ticks(item, 0, 50):
        np.testing.assert_array_equal(led.reference.position, START)
        assert not led.force.any()
        assert not led.silent


def test_references_are_extrapolated_from_their_stamps():
    """A reference older than the tick is extrapolated by its velocity and acceleration."""
    item = led_by("human", takeover="direct")
    spoken = Reference(np.array([1.0, 2.0]), np.array([0.3, 0.0]), np.array([0.0, 0.4]))
    item.sources["human"].receive(0.1, spoken, 0.1)
    led = item.advance(0.15, STEP)
    np.testing.assert_allclose(led.reference.position, [1.015, 2.0005], rtol=1e-12)
    np.testing.assert_allclose(led.reference.velocity, [0.3, 0.02], rtol=1e-12)


@pytest.mark.parametrize("takeover", ["direct", "shaped"])
def test_a_timeout_leaves_the_subtask_at_rest_and_is_reported(takeover):
    """After the timeout, not before, the source counts as silent and the subtask comes to rest."""
    item = led_by("human", timeout=0.1, takeover=takeover)
    assert item.advance(0.0, 0.0).silent
    moving = Reference(START, np.array([0.5, 0.0]), np.zeros(2))
    item.sources["human"].receive(STEP, moving, STEP)
    led = ticks(item, 1, 1000)
    assert not any(item.silent for item in led[:100])
    assert all(item.silent for item in led[102:])
    assert not led[-1].reference.velocity.any()
    np.testing.assert_array_equal(led[-1].reference.position, led[-300].reference.position)
    assert 0.04 < led[-1].reference.position[0] - START[0] < 0.2


def test_fresh_input_after_a_timeout_takes_over_without_a_jump():
    """A source that resumes far away is approached from where the subtask rests."""
    item = led_by("human", timeout=0.05)
    item.sources["human"].receive(0.0, Reference.at_rest([0.5, 0.2]), 0.0)
    ticks(item, 1, 500)
    rest = item.advance(0.5, STEP).reference.position
    item.sources["human"].receive(0.501, Reference.at_rest([2.0, 2.0]), 0.5)
    led = item.advance(0.501, STEP)
    assert not led.silent
    np.testing.assert_allclose(led.reference.position, rest, atol=1e-6)
    np.testing.assert_allclose(led.reference.velocity, np.zeros(2), atol=1e-4)


def test_change_of_authority_has_no_jump():
    """A hand-over between sources with different references continues from the current motion."""
    item = led_by("human")
    last = None
    for k in range(3000):
        now = k * STEP
        item.sources["human"].receive(now, Reference.at_rest([1.0, 0.0]), now)
        item.sources["autonomy"].receive(now, Reference.at_rest([-1.0, 0.5]), now)
        item.authority = ("human", "autonomy")[(k // 700) % 2]
        led = item.advance(now, STEP)
        if last is not None:
            assert np.abs(led.reference.position - last.position).max() < 1.001 * STEP
            assert np.abs(led.reference.velocity - last.velocity).max() < 5.001 * STEP
            assert np.abs(led.reference.acceleration - last.acceleration).max() < 50.01 * STEP
        last = led.reference


def test_force_input_is_bounded_and_slewed():
    """A large force rises at its rate bound, stays at its bound and falls after the timeout."""
    item = led_by("human", timeout=0.5, max_wrench=(20.0, 5.0), max_wrench_rate=(100.0,))
    item.sources["human"].receive(0.0, Force(np.array([1e6, -1e6])), 0.0)
    forces = np.array([led.force for led in ticks(item, 0, 1000)])
    assert np.abs(np.diff(forces, axis=0)).max() <= 0.1 + 1e-12
    np.testing.assert_allclose(forces[:50, 0], 0.1 * np.arange(1, 51), rtol=1e-9)
    np.testing.assert_allclose(forces[499], [20.0, -5.0], rtol=1e-12)
    np.testing.assert_array_equal(forces[-1], [0.0, 0.0])


def test_a_force_within_its_bounds_passes_unchanged():
    """Once slewed, a moderate force is in force exactly as it was given."""
    item = led_by("human")
    item.sources["human"].receive(0.0, Force(np.array([7.0, -3.0])), 0.0)
    np.testing.assert_array_equal(ticks(item, 0, 100)[-1].force, [7.0, -3.0])


def test_a_source_that_only_gives_force_is_not_silent():
    """A force input is a way to lead (remark 1): the reference rests, the source is not silent."""
    item = led_by("human", timeout=0.1)
    item.sources["human"].receive(0.0, Force(np.ones(2)), 0.0)
    led = ticks(item, 0, 200)
    assert not any(item.silent for item in led[:100])
    assert all(item.silent for item in led[102:])
    np.testing.assert_array_equal(led[99].reference.position, START)


def test_a_change_of_authority_slews_the_old_force_out():
    """The force of a source that loses its authority fades at the rate bound."""
    item = led_by("human", max_wrench_rate=(100.0,))
    item.sources["human"].receive(0.0, Force(np.full(2, 5.0)), 0.0)
    ticks(item, 0, 100)
    item.authority = "autonomy"
    np.testing.assert_allclose(item.advance(0.1, STEP).force, [4.9, 4.9], rtol=1e-12)


@pytest.mark.parametrize(
    "name", ["max_velocity", "max_acceleration", "max_jerk", "max_wrench", "max_wrench_rate"]
)
def test_limits_must_fit_the_subtask(name):
    """A limit of another length is refused under its own key."""
    with pytest.raises(ScenarioError, match=rf"^lead\.{name}: found .*1 or 2 numbers"):
        led_by("human", **{name: (1.0, 2.0, 3.0)})
