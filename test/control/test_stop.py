# SPDX-License-Identifier: Apache-2.0
"""A stop: how soon the team is at rest, by which torques, and what that does to its energy."""

from typing import Any

import numpy as np
import pytest
from repository import ROOT

from noninteract_ros.control.references.inputs import Rate
from noninteract_ros.control.safety.stop import RAMP, Stop
from noninteract_ros.control.tick import Tick
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters
from noninteract_ros.scenario.rehearsal import Rehearsal

ARMS = read_parameters(ROOT / "config" / "planar_arms.yaml")
SLOWEST = 30.0  # [1/s] rate of the fastest motions, the default of `stop_rate`
SLOW = 1e-3  # [m/s or rad/s] below which the team is at rest
FAST, STARTING = ((0.2, -0.4), 0.6), ((0.2, -0.4), 0.1)  # A velocity, and how long it was led [s].
TAME, COOPERATIVE, APART = ((0.1, -0.17), 0.6), slice(0, 2), slice(2, 4)


class SubtaskCommand:
    """Two unlike arms that hold an object, led at a velocity by a human's rates.

    Args:
        velocity: Of the middle of the grasp [m/s].
        seconds: For how long it was led.
        keys: Further keys of the scenario.
    """

    def __init__(self, velocity: tuple[float, float], seconds: float, **keys: Any) -> None:
        values = ARMS | {"relative": ARMS["relative"] | {"authority": "hold"}} | keys
        self._rehearsal = Rehearsal(Scenario.from_dict(values), human=False)
        self.rate = self._rehearsal.simulation.rate
        self.controller = self._rehearsal.controller
        self.before = [self.tick(velocity) for _ in range(round(seconds * self.rate))][-1]

    def tick(self, velocity: tuple[float, float] = (0.0, 0.0)) -> Tick:
        """One tick with the human asking for a velocity."""
        now = self._rehearsal.simulation.now
        heard = self.controller.inputs["cooperative"].sources["human"]
        heard.receive(now, Rate(np.array(velocity)), now)
        return self._rehearsal.step()

    def released(self) -> list[Tick]:
        """A second after the human has let go."""
        return [self.tick() for _ in range(round(self.rate))]

    def stopped(self) -> list[Tick]:
        """A second after a stop."""
        self.controller.stop()
        return self.released()


def joint_speeds(ticks: list[Tick]) -> np.ndarray:
    """Of the fastest joint at each tick [rad/s]."""
    return np.abs([tick.state.v for tick in ticks]).max(axis=1)


def rest_time(ticks: list[Tick]) -> float:
    """When the team was last in motion [s]."""
    return 1e-3 * (1 + np.flatnonzero(joint_speeds(ticks) > SLOW)[-1])


def way(before: Tick, ticks: list[Tick], part: slice) -> float:
    """Return the distance of a subtask from its value at `before` [m]."""
    return float(
        np.linalg.norm([t.task.x[part] - before.task.x[part] for t in ticks], axis=1).max()
    )


def torque_rates(before: Tick, ticks: list[Tick]) -> np.ndarray:
    """Largest change of a torque per second at each tick [N m/s]."""
    torques = [tick.torque for tick in (before, *ticks)]
    return 1e3 * np.abs(np.diff(torques, axis=0)).max(axis=1)


@pytest.mark.parametrize("led", [TAME, FAST, STARTING])
def test_a_stop_is_soon_and_no_longer_than_a_release(led: Any) -> None:
    """Sooner at rest, and on a shorter way, than where one lets go; within 0.2 s."""
    released, stopped = SubtaskCommand(*led), SubtaskCommand(*led)
    let_go, stop = released.released(), stopped.stopped()
    assert joint_speeds(stop)[0] > 0.2
    assert rest_time(stop) < min(0.2, rest_time(let_go))
    assert way(stopped.before, stop, COOPERATIVE) < way(released.before, let_go, COOPERATIVE)


@pytest.mark.parametrize("led", [TAME, FAST, STARTING])
def test_a_stop_keeps_the_other_subtask_where_it_is(led: Any) -> None:
    """All joints come to rest alike: what is held apart stays so but for the way's curvature."""
    arms = SubtaskCommand(*led)
    ticks = arms.stopped()
    moved = way(arms.before, ticks, COOPERATIVE)
    assert moved > 5e-3
    assert way(arms.before, ticks, APART) < 0.5 * moved**2 / 0.5  # The arms have links of 0.5 m.


def test_the_torque_of_a_stop_rises_without_a_step() -> None:
    """From what it was before, ever smaller steps at ever shorter ticks: none is in it."""
    largest = []
    for rate in (500.0, 1000.0, 2000.0):
        arms = SubtaskCommand(*FAST, rate=rate)
        torques = [tick.torque for tick in (arms.before, *arms.stopped())]
        largest.append(np.abs(np.diff(torques, axis=0)).max())
    np.testing.assert_allclose(np.divide(largest[:-1], largest[1:]), 2.0, rtol=0.1)


def test_a_stop_keeps_the_limit_of_the_torque_rate_and_still_comes_to_rest() -> None:
    """A limit below the torque of the stop makes it take a little longer."""
    limit = 300.0
    free, bounded = SubtaskCommand(*FAST), SubtaskCommand(*FAST, safety={"torque_rate": limit})
    assert torque_rates(free.before, free.stopped()).max() > 2.0 * limit
    ticks = bounded.stopped()
    assert any(tick.safety.rate_share < 1.0 for tick in ticks)
    assert torque_rates(bounded.before, ticks).max() <= limit * (1.0 + 1e-9)
    assert rest_time(ticks) < 0.3


def test_a_stop_takes_energy_out_of_the_arms_and_puts_none_in() -> None:
    """From the first tick that has nothing left of before, their kinetic energy only falls."""
    arms = SubtaskCommand(*STARTING)
    ticks = arms.stopped()
    energies = [0.5 * tick.state.v @ tick.state.M @ tick.state.v for tick in ticks]
    ramp = round(1e3 * RAMP / SLOWEST)
    assert energies[0] > 0.05
    assert (np.diff(energies[ramp:]) <= 0.0).all()
    assert energies[-1] < 1e-12


def test_a_slow_loop_is_not_damped_more_than_it_can_hold() -> None:
    """A torque that is held for a tick takes at most a quarter of the velocity."""
    arms = SubtaskCommand(*TAME, rate=100.0)
    arms.controller.stop()
    speeds = joint_speeds([arms.tick() for _ in range(60)])
    fast = speeds[:-1] > 1e-9
    shares = speeds[1:][fast] / speeds[:-1][fast]
    assert shares.min() == pytest.approx(0.75, abs=0.02)
    assert speeds[-1] < SLOW


def test_damping_rises_from_zero_and_is_in_force_at_once_after_a_reset() -> None:
    """A stop of before outlasts a reset of time, whose clock may go back."""
    stop = Stop(30.0, np.array([50.0, 80.0]))
    assert stop.damping(0.0) == 30.0
    stop.begin(7.0, np.array([0.5, -0.3]))
    assert stop.ramp_time == pytest.approx(0.1)
    assert [stop.damping(7.0 + t) for t in (0.0, 0.05, 0.1, 1.0)] == pytest.approx(
        [0.0, 20.0, 40.0, 40.0]
    )
    stop.reset()
    assert stop.damping(0.0) == pytest.approx(40.0)


@pytest.mark.parametrize("speed", [0.23, 0.35, 0.5])
@pytest.mark.parametrize("jerk", [30.0, 50.0])
def test_a_stop_has_at_most_four_times_the_jerk_and_is_sooner_at_rest(
    speed: float, jerk: float
) -> None:
    """By the law itself, against the quickest way of a reference within its jerk."""
    stop = Stop(SLOWEST, np.array([1e3, jerk]))
    stop.begin(0.0, np.array([0.0, speed]))
    t = np.linspace(0.0, 1.0, 100001)
    damping = np.array([stop.damping(s) for s in t])
    mean = 0.5 * (damping[1:] + damping[:-1])
    v = speed * np.exp(-np.concatenate([[0.0], np.cumsum(mean * np.diff(t))]))
    a = -damping * v
    assert np.abs(np.diff(a) / np.diff(t)).max() <= 4.0 * jerk * (1.0 + 1e-3)
    assert t[v > speed / 200.0][-1] < 2.0 * np.sqrt(speed / jerk)
