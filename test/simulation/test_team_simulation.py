# SPDX-License-Identifier: Apache-2.0
"""Simulated team against independent integration of the closed-form arms."""

import numpy as np
import pytest
from planar_arms import PlanarArms
from scipy.integrate import solve_ivp

from noninteract_ros.simulation.plant import Plant
from noninteract_ros.simulation.push import ScheduledPush
from noninteract_ros.simulation.team_simulation import TeamSimulation
from noninteract_ros.team.models.point_mass import PointMass
from noninteract_ros.team.team import Team

ARMS = PlanarArms(gravity=9.81)
TORQUE = np.array([9.0, 2.0, 30.0, -4.0])
PUSH = np.array([3.0, -2.0, 0.0, 0.0, 0.0, 0.7])
DURATION = 0.5


def arms(rate: float, pushes=()) -> TeamSimulation:
    return TeamSimulation(Plant(Team(ARMS.robots(), (0.0, -9.81, 0.0))), rate, None, pushes)


def masses(rate: float = 100.0, pushes=()) -> TeamSimulation:
    robots = [PointMass(2.0, brake_damping=4.0).build("a"), PointMass(5.0).build("b")]
    return TeamSimulation(Plant(Team(robots)), rate, None, pushes)


def exact(in_tool_axes: bool) -> np.ndarray:
    """Return the final q and v of the closed-form arms, the first of them pushed."""

    def motion(t, y):
        state = ARMS.state(y[:4], y[4:])
        angle = y[0] + y[1]
        R = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        wrench = PUSH.copy()
        if in_tool_axes:
            wrench[:2] = R @ PUSH[:2]
        total = TORQUE + state.tool_jacobians[0].T @ wrench
        return np.concatenate([y[4:], ARMS.acceleration(state, total)])

    start = np.concatenate([arms(1.0).team.q0, np.zeros(4)])
    return solve_ivp(motion, (0, DURATION), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]


def simulated(rate: float, in_tool_axes: bool) -> np.ndarray:
    simulation = arms(rate)
    simulation.push("arm_1", PUSH, in_tool_axes, 10.0)
    for _ in range(round(DURATION * rate)):
        simulation.step(TORQUE)
    return np.concatenate([simulation.q, simulation.v])


@pytest.mark.parametrize("in_tool_axes", [False, True])
def test_error_falls_with_the_fourth_power_of_the_step(in_tool_axes):
    """Halving the step divides the error of pushed, falling arms by 16, in world and tool axes."""
    end = exact(in_tool_axes)
    coarse, fine = (np.abs(simulated(rate, in_tool_axes) - end).max() for rate in (200.0, 400.0))
    assert fine < 1e-7
    assert coarse / fine == pytest.approx(16.0, rel=0.15)


def test_world_and_tool_axes_are_not_the_same():
    """The two pushes above give different motions."""
    assert np.abs(exact(False) - exact(True)).max() > 0.01


def test_energy_is_conserved_without_torque():
    """Free arms that fall keep kinetic plus potential energy."""
    simulation = arms(2000.0)
    team = simulation.team
    before = team.mechanical_energy(simulation.q, simulation.v)
    for _ in range(1000):
        simulation.step(np.zeros(4))
    after = team.mechanical_energy(simulation.q, simulation.v)
    assert np.abs(simulation.v).max() > 1.0
    assert after == pytest.approx(before, abs=1e-6)


def test_work_of_torque_and_push_is_the_gain_of_energy():
    """Constant torques do the work torque times displacement; so does a constant force."""
    simulation = masses(pushes=[ScheduledPush("a", 0.0, 1.0, (0.0, 3.0, 0.0))])
    torque = np.array([1.0, 0.0, 2.0, -4.0])
    for _ in range(100):
        simulation.step(torque)
    work = torque @ simulation.q + 3.0 * simulation.q[1]
    energy = simulation.team.mechanical_energy(simulation.q, simulation.v)
    assert energy == pytest.approx(work, rel=1e-12)
    np.testing.assert_allclose(simulation.q, [0.25, 0.75, 0.2, -0.4], rtol=1e-12)


def test_a_scheduled_push_acts_from_start_for_its_duration():
    """The push has the impulse force times duration, over the ticks of its time only."""
    simulation = masses(pushes=[ScheduledPush("b", 0.25, 0.5, (0.0, 10.0, 0.0))])
    speeds = []
    for _ in range(100):
        simulation.step(np.zeros(4))
        speeds.append(simulation.v.copy())
    speeds = np.array(speeds)
    assert not speeds[:25].any()
    np.testing.assert_allclose(speeds[25], [0.0, 0.0, 0.0, 0.02], rtol=1e-12)
    np.testing.assert_allclose(speeds[74:], np.tile([0.0, 0.0, 0.0, 1.0], (26, 1)), rtol=1e-12)


def test_a_push_lasts_the_same_number_of_ticks_whenever_it_starts():
    """Rounding of start plus duration adds no tick to a scheduled push."""
    for start in np.arange(50) / 100.0:
        simulation = masses(pushes=[ScheduledPush("a", float(start), 0.2, (1.0, 0.0, 0.0))])
        for _ in range(80):
            simulation.step(np.zeros(4))
        assert simulation.v[0] == pytest.approx(0.1, rel=1e-9)


def test_a_received_push_expires_unless_repeated():
    """A received push acts for its duration; a new one replaces the last."""
    simulation = masses()
    simulation.push("a", np.array([2.0, 0, 0, 0, 0, 0]), False, 0.1)
    for _ in range(5):
        simulation.step(np.zeros(4))
    simulation.push("a", np.array([4.0, 0, 0, 0, 0, 0]), False, 0.1)
    for _ in range(50):
        simulation.step(np.zeros(4))
    assert simulation.v[0] == pytest.approx(0.05 * 1.0 + 0.1 * 2.0, rel=1e-9)
    assert not simulation.external_wrenches().any()


def test_pushes_on_different_robots_add_up():
    """Pushes on two robots and a scheduled push add up."""
    simulation = masses(pushes=[ScheduledPush("a", 0.0, 1.0, (1.0, 0.0, 0.0))])
    simulation.push("a", np.array([0.0, 2.0, 0, 0, 0, 0]), False, 1.0)
    simulation.push("b", np.array([0.0, 0.0, 3.0, 0, 0, 0]), False, 1.0)
    expected = [[1.0, 2.0, 0, 0, 0, 0], [0.0, 0.0, 3.0, 0, 0, 0]]
    np.testing.assert_array_equal(simulation.external_wrenches(), expected)


def test_tool_axes_rotate_with_the_tool():
    """A push along the tool's x acts along the last link, force and torque alike."""
    simulation = arms(100.0)
    simulation.push("arm_2", np.array([1.0, 0, 0, 0, 2.0, 0]), True, 1.0)
    angle = simulation.q[2] + simulation.q[3]
    link, across = (
        np.array([np.cos(angle), np.sin(angle)]),
        np.array([-np.sin(angle), np.cos(angle)]),
    )
    expected = [*link, 0.0, *(2.0 * across), 0.0]
    np.testing.assert_allclose(simulation.external_wrenches()[1], expected, atol=1e-14)


def test_without_commands_the_team_brakes_to_rest():
    """None damps each joint of the masses by v' = -(d/m) v, and holds against gravity."""
    simulation = masses(1000.0)
    simulation.v = np.array([1.0, -2.0, 3.0, 4.0])
    for _ in range(1000):
        simulation.step(None)
    rates = np.array([2.0, 2.0, 4.0, 4.0])
    expected = np.array([1.0, -2.0, 3.0, 4.0]) * np.exp(-rates)
    np.testing.assert_allclose(simulation.v, expected, rtol=1e-9)


def test_the_brake_holds_arms_against_gravity():
    """Braked arms at rest stay; moving ones come to rest and lose energy to the brake only."""
    still = arms(1000.0)
    for _ in range(100):
        still.step(None)
    np.testing.assert_allclose(still.q, still.team.q0, atol=1e-12)
    np.testing.assert_allclose(still.torque, still.team.gravity(still.q), atol=1e-12)
    moving = arms(1000.0)
    moving.v = np.array([1.0, -2.0, 0.1, 0.2])
    energies = []
    for _ in range(1000):
        moving.step(None)
        energies.append(0.5 * moving.v @ moving.team.state(moving.q, moving.v).M @ moving.v)
    assert (np.diff(energies) < 1e-12).all()
    assert energies[-1] < 0.3 * energies[0]


def test_time_is_counted_in_ticks():
    """The time of a tick has no drift, and continues after a reset."""
    simulation = masses(1000.0)
    for _ in range(300):
        simulation.step(np.array([1.0, 0.0, 0.0, 0.0]))
    assert simulation.now == 0.3
    simulation.push("a", np.ones(6), False, 1.0)
    simulation.reset()
    assert simulation.now == 0.3
    np.testing.assert_array_equal(simulation.q, simulation.team.q0)
    assert not simulation.v.any()
    assert not simulation.torque.any()
    assert not simulation.external_wrenches().any()


def test_equal_runs_are_bit_equal():
    """Two simulations of the same pushes and torques agree in every bit."""
    np.testing.assert_array_equal(simulated(200.0, True), simulated(200.0, True))
