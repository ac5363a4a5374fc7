# SPDX-License-Identifier: Apache-2.0
"""Forces that subtasks press with: on a wall until it vanishes, inside a grasp, within energy."""

from typing import Any

import numpy as np
import pytest

from noninteract_ros.control.law.force_goal import ForceGoals
from noninteract_ros.control.law.impedance import ImpedanceSettings
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.rehearsal import Rehearsal

ROBOTS: dict[str, Any] = {
    "robots": ["light", "heavy"],
    "gravity": [0.0, 0.0, 0.0],
    "telemetry_rate": 1000.0,
    "light": {"mass": 1.0, "initial_position": [-0.2, 0.0]},
    "heavy": {"mass": 4.0, "initial_position": [0.2, 0.0]},
    "subtasks": ["cooperative", "relative"],
}
GAINS = {"stiffness": [200.0], "damping": [60.0]}
WALL = {"kind": "wall", "point": [0.0, 0.001, 0.0], "normal": [0.0, -1.0, 0.0]}
PRESSING: dict[str, Any] = {
    "stiffness": [200.0, 0.0],
    "damping": [60.0],
    "force": [0.0, 10.0],
    "force_gain": [0.0, 10.0],
    "force_bound": [5.0],
}


def at_wall(**keys: Any) -> Rehearsal:
    """Two robots 1 mm before a wall that their mean is to press on with 10 N."""
    values = {
        **ROBOTS,
        "cooperative": {"kind": "cooperative_position", **PRESSING},
        "relative": {"kind": "relative_position", **GAINS},
        "surroundings": ["wall"],
        "wall": {**WALL, "stiffness": 5000.0, "damping": 0.5},
        **keys,
    }
    if "wall" not in values["surroundings"]:
        del values["wall"]
    return Rehearsal(Scenario.from_dict(values))


def pressed(run: Rehearsal, tick: Any) -> np.ndarray:
    """-(S' tau_e), by the simulation's own wrenches [N]."""
    wrenches = run.simulation.external_wrenches()
    return -tick.dynamics.force_of(run.team.external_torque(tick.state, wrenches))


@pytest.mark.parametrize("sensors", [["light", "heavy"], []], ids=["sensors", "observer"])
def test_a_wall_is_pressed_with_the_force_asked_for(sensors):
    """The team presses with 10 N to a percent, with sensors and without, gates open."""
    run = at_wall(force_sensors=sensors)
    for _ in range(3000):
        tick = run.step()
    assert pressed(run, tick)[1] == pytest.approx(10.0, rel=0.01)
    assert tick.account.tank.sigma == 1.0
    assert np.abs(tick.x_rate).max() < 1e-3


def test_a_wall_that_vanishes_lets_nothing_run_away():
    """When contact is lost the way gone on is what the tank pays for, ever slower."""
    run = at_wall(force_sensors=["light", "heavy"])
    for _ in range(2000):
        tick = run.step()
    level, start = tick.account.tank.level, tick.task.x[1]
    run.simulation.plant.couplings = type(run.simulation.plant.couplings)()
    ticks = [run.step() for _ in range(6000)]
    y = np.array([tick.task.x[1] for tick in ticks])
    settings, sigma = run.controller.gate.settings, ticks[-1].account.tank.sigma
    # Damping returns its share; below the full gate the force falls with the level that is left.
    budget = level - settings.full_gate * (1.0 + np.log(sigma))
    reach = budget / ((1.0 - settings.refill_fraction) * 10.0)
    assert y[-1] - start < 1.02 * reach
    assert y[-1] - start > 0.01
    assert ticks[-1].account.tank.sigma < 0.2
    speeds = np.abs([tick.x_rate[1] for tick in ticks])
    assert speeds[-1] < 0.1 * speeds.max()
    assert all(tick.account.sound for tick in ticks)


def test_an_object_is_held_with_an_inner_force():
    """The relative subtask squeezes an object with 6 N while the team carries it still."""
    squeeze = {"force": [-6.0, 0.0], "force_gain": [20.0, 0.0], "force_bound": [10.0]}
    run = at_wall(
        force_sensors=["light", "heavy"],
        cooperative={"kind": "cooperative_position", **GAINS},
        relative={"kind": "relative_position", **GAINS, **squeeze},
        surroundings=["box"],
        box={"kind": "rigid_object", "mass": 1.0, "size": [0.4, 0.1, 0.1]},
    )
    for _ in range(2500):
        tick = run.step()
    found = pressed(run, tick)
    assert found[2] == pytest.approx(-6.0, rel=0.01)
    assert np.abs(tick.x_rate).max() < 1e-3
    assert tick.account.tank.sigma == 1.0


def test_a_goal_comes_without_a_bump_and_is_paid():
    """Asked for at run time, the force fades in, and its work is the tank's loss."""
    run = at_wall(cooperative={"kind": "cooperative_position", **GAINS}, surroundings=[])
    same = at_wall(cooperative={"kind": "cooperative_position", **GAINS}, surroundings=[])
    for _ in range(50):
        run.step()
        same.step()
    run.controller.set_impedance(
        "cooperative", ImpedanceSettings((200.0,), (60.0,), force=(0.0, 10.0))
    )
    before = run.controller.gate.tank.level
    np.testing.assert_allclose(run.step().torque, same.step().torque, atol=1e-12)
    torques = np.array([run.step().torque for _ in range(400)])
    assert np.abs(np.diff(torques, axis=0)).max() < 0.5
    tick = run.step()
    work = 10.0 * tick.error.e[1]
    assert work > 0.1
    assert tick.account.tank.level < before
    for _ in range(3000):
        tick = run.step()
    assert tick.error.e[1] == pytest.approx(10.0 / 200.0, rel=0.02)


def test_integrals_stay_within_bounds_and_stand_still_while_held():
    """For any missing force, regulation adds no more than its bound, and nothing while held."""
    run = at_wall()
    impedance = run.controller.mode.impedance
    goals = ForceGoals(4)
    for _ in range(10_000):
        goals.advance(impedance, np.zeros(4), 1e-3, held=False)
    np.testing.assert_allclose(goals.wanted(impedance), [0.0, 15.0, 0.0, 0.0])
    goals.advance(impedance, np.full(4, 100.0), 1e-3, held=True)
    np.testing.assert_allclose(goals.wanted(impedance), [0.0, 15.0, 0.0, 0.0])
