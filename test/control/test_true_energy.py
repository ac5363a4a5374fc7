# SPDX-License-Identifier: Apache-2.0
"""The account against the true energy of robots that are not the controller's model."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from planar_arms import UNLIKE, PlanarArms
from test_energy_gate import SOFT, DelayedLoop
from test_singularity import SingularityLoop, controller, team

from noninteract_ros.control.controller import TeamController
from noninteract_ros.control.energy.account import model_error_text
from noninteract_ros.control.energy.tank import EnergyTank, TankSettings
from noninteract_ros.simulation.plant import Plant
from noninteract_ros.simulation.team_simulation import TeamSimulation
from noninteract_ros.subtasks.reference import Reference
from noninteract_ros.team.team import Team

STEP = 1e-3


def circling(loop: DelayedLoop, seconds: float, rate: float) -> float:
    """Largest imbalance of received energy with a moving reference that nobody touches [J]."""
    start = loop.answer().task.x[:2]
    loop.simulation.step(loop.tick.torque)
    worst = 0.0
    for _ in range(round(seconds * rate) - 1):
        now = loop.simulation.now
        a = 2.0 * np.pi * 1.25 * now
        size = 0.05 * np.array([1.0, 0.6])
        wave = np.array([1.0 - np.cos(a), np.sin(a) * np.sin(a)])
        rates = np.array([np.sin(a), np.sin(2.0 * a)]) * 2.0 * np.pi * 1.25
        bends = np.array([np.cos(a), 2.0 * np.cos(2.0 * a)]) * (2.0 * np.pi * 1.25) ** 2
        reference = Reference(start + size * wave, size * rates, size * bends)
        loop.core.inputs["cooperative"].sources["human"].receive(now, reference, now)
        loop.run(1.0 / rate, push=False)
        worst = max(worst, abs(loop.tick.account.received))
    return worst


def test_the_account_balances_while_references_move():
    """Nobody touches the team: nothing is received, to second order in the period."""
    errors = []
    for rate in (500.0, 1000.0):
        loop = DelayedLoop(rate)
        loop.simulation.v = np.array([0.8, -0.6, 0.5, 0.4])  # Beyond what the reference asks.
        errors.append(circling(loop, 0.5, rate))
    assert errors[1] < 3e-5  # With Y held over a tick: 1.6 mJ, and half of it at twice the rate.
    assert errors[1] < 0.35 * errors[0]


class OtherRobots(DelayedLoop):
    """The loop of the energy gate on robots with other masses than the controller's model."""

    def __init__(self, factor: float, **keys: Any) -> None:
        super().__init__(**keys)
        arms = PlanarArms([[f * factor for f in masses] for masses in UNLIKE])
        self.true = Team(arms.robots(), (0.0, -9.81, 0.0))
        self.simulation = TeamSimulation(Plant(self.true), self.simulation.rate)

    def true_storage(self) -> float:
        """W with the kinetic and potential energy of the true robots [J]."""
        q, v = self.simulation.q, self.simulation.v
        tank: EnergyTank = self.tick.account.tank
        lifted = self.team.mechanical_energy(q, np.zeros_like(v))
        held = tank.nu * tank.potential + tank.margins + tank.reserve + tank.level
        return self.true.mechanical_energy(q, v) - lifted + held


@pytest.mark.parametrize("factor", [0.6, 1.4])
def test_no_inertia_is_needed_where_references_rest(factor: float):
    """With masses that are 40 % off the true storage grows by what a push did, less the loss."""
    loop = OtherRobots(factor, damping=1.0)
    loop.answer()
    start, ledger = loop.true_storage(), loop.simulation.energy()
    loop.simulation.step(loop.tick.torque)
    loop.run(0.8)
    loop.answer()
    pushed = loop.simulation.energy().pushes - ledger.pushes
    assert abs(pushed) > 0.05
    tank = loop.tick.account.tank
    came_in = pushed + tank.brought + tank.granted - tank.lost
    assert loop.true_storage() - start == pytest.approx(came_in, abs=1e-5)


SMALL = TankSettings(capacity=0.1, initial=0.1, reserve=0.1, full_gate=0.02, reopening_level=0.05)


@pytest.mark.parametrize("factor", [1.0, 2.5])
def test_a_wrong_model_is_named(factor: float):
    """Forces and motion disagree on the received energy where the robots are not the model."""
    loop = OtherRobots(factor, damping=1.0)
    loop.answer()
    loop.simulation.step(loop.tick.torque)
    loop.run(0.15)
    loop.answer()
    pushed = loop.simulation.energy().pushes
    text = model_error_text(loop.tick.account, pushed, abs(pushed))
    assert bool(text) == (factor != 1.0)


def drawn_in_turns(
    core: TeamController, path: Any, turns: int = 8, ticks: int = 1000
) -> tuple[list[float], list[Any]]:
    """Energy that the environment draws in each turn of a slow closed path of the joints.

    The velocity that is reported is a twentieth of the true one, so that dampers hide nothing.
    """
    drawn, seen, now = [], [], 0.0
    core.step(now, path(0.0), np.zeros(core.team.n))
    for _ in range(turns):
        work, start = 0.0, core.gate.account
        for i in range(ticks):
            q, ahead = path(i / ticks), path((i + 1) / ticks)
            now += STEP
            tick = core.step(now, q, (ahead - q) / (20.0 * STEP))
            work += float((tick.torque - tick.state.g) @ (ahead - q))
            if i % 50 == 0:
                seen.append(tick)
        drawn.append(work)
        end = core.gate.account
        assert end.received - start.received == pytest.approx(-work, abs=0.02)
    return drawn, seen


def loop_of(q0: np.ndarray, size: np.ndarray) -> Any:
    """A closed path that begins and ends at q0."""

    def path(turn: float) -> np.ndarray:
        a = 2.0 * np.pi * turn
        return q0 + size * np.array([1.0 - np.cos(a), np.sin(a), 0.0, 0.0])

    return path


@pytest.mark.parametrize("law", ["energy_gated", "natural"])
def test_a_crank_at_effort_limits_draws_nothing(law: str):
    """A tool led slowly round and round through the limits draws what is in the account, once."""
    given = team(effort_limit=(14.0, 7.0))
    path = loop_of(given.q0, np.array([0.25, 0.35, 0.0, 0.0]))
    drawn, seen = drawn_in_turns(controller(given, law, tank=SMALL), path)
    assert min(tick.safety.effort_share for tick in seen) < 0.7
    assert sum(drawn) < SMALL.initial + SMALL.reserve
    assert max(drawn[-2:]) < 5e-3


@pytest.mark.parametrize("law", ["energy_gated", "natural"])
def test_a_crank_near_a_singularity_draws_nothing(law: str):
    """The same where one arm is stretched, so that the decoupling has a share below 1."""
    given = team(start=((1.9, -1.6), (1.3, 0.2)))
    path = loop_of(given.q0, np.array([0.15, 0.2, 0.0, 0.0]))
    drawn, seen = drawn_in_turns(controller(given, law, tank=SMALL), path)
    assert min(tick.law_share for tick in seen) < 1.0
    assert sum(drawn) < SMALL.initial + SMALL.reserve + 0.02


def test_a_joint_that_starts_on_its_limit_stays_there():
    """Nothing is released: the joint is let out slowly, as the tank pays."""
    given = team(lower_limit=(1.9, -2.5), upper_limit=(2.9, 2.5), start=((1.9, -1.6), (1.9, 1.6)))
    loop = SingularityLoop(given, "energy_gated")
    first = loop.tick()
    np.testing.assert_allclose(first.torque, first.state.g, atol=1e-9)
    ticks = [loop.tick() for _ in range(2500)]
    assert max(np.abs(tick.state.v).max() for tick in ticks) < 0.3
    assert ticks[-1].state.q[0] > 1.93
    assert np.abs(ticks[-1].state.v).max() < 1e-2
    assert ticks[-1].account.tank.level >= 0.25 - 1e-6
    assert ticks[-1].account.sound


def in_debt(loop: SingularityLoop, debt: float) -> None:
    """Leave a reserve overdrawn, as after a hit that drives could not follow."""
    gate = loop.controller.gate
    account = gate.account
    less = account.tank._replace(reserve=-debt)
    gate._account = replace(account, tank=less, start=account.start - debt - account.tank.reserve)


def test_a_debt_is_repaid_by_damping():
    """With an overdrawn reserve the team is damped, and springs come back."""
    loop = SingularityLoop(team(), "energy_gated")
    loop.tick()
    loop.simulation.v = np.array([3.0, -2.0, 2.0, 1.0])
    loop.tick()
    in_debt(loop, 1.0)
    ticks = [loop.tick() for _ in range(3000)]
    assert ticks[0].account.tank.nu == 0.0
    assert ticks[0].account.tank.damping == 1.0
    assert np.abs(ticks[-1].state.v).max() < 1e-2
    assert ticks[-1].account.tank.nu > 0.5
    assert ticks[-1].account.sound


def test_a_wrong_weight_sinks_slowly_without_springs():
    """Gravity compensation that lacks 5 % and no springs: dampers bound the speed."""
    loop = OtherRobots(1.05, damping=4.0)
    loop.answer()
    gate = loop.core.gate
    gate._account = replace(gate.account, tank=gate.tank._replace(reserve=-50.0))
    loop.run(1.0, push=False)
    assert loop.tick.account.tank.nu == 0.0
    assert np.abs(loop.simulation.v).max() < 0.3


def test_an_account_lasts_for_life():
    """Switching laws, stopping, resuming, gaps and resets of the state grant nothing."""
    loop = DelayedLoop(damping=1.0)
    loop.run(0.2)
    core = loop.core
    spent = core.gate.tank._replace(level=0.1, reserve=0.4)
    core.gate._account = replace(core.gate.account, tank=spent)
    total = [spent.level + spent.reserve + spent.nu * spent.potential]

    def answer(now: float) -> None:
        tick = core.step(now, loop.team.q0, np.zeros(4))
        tank = tick.account.tank
        total.append(tank.level + tank.reserve + tank.nu * tank.potential)

    now = loop.simulation.now
    for k, change in enumerate(
        (
            lambda: core.set_law("natural"),
            lambda: core.set_law("energy_gated"),
            lambda: core.set_law("noninteracting"),
            lambda: core.set_law("energy_gated"),
            core.stop,
            core.resume,
            core.reset_state,
            lambda: None,
        )
    ):
        change()
        answer(now + 0.5 * (k + 1))  # Each after a gap.
        answer(now + 0.5 * (k + 1) + STEP)
    assert max(total[1:]) <= total[0] + 1e-9
    core.reset()
    answer(0.0)
    settings = core.gate.settings
    assert core.gate.tank.level == pytest.approx(settings.initial)
    assert SOFT.damping[0] > 0.0
