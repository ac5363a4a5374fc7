# SPDX-License-Identifier: Apache-2.0
"""The account bound to a team: balances at any rate, under delay and loss, and what it gates."""

from collections import deque
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from planar_arms import UNLIKE, PlanarArms
from test_structured import Pair, assert_close

from noninteract_ros.control.controller import TeamController
from noninteract_ros.control.law.decoupling import commanded_acceleration
from noninteract_ros.control.law.gated_law import decoupling, gated_acceleration
from noninteract_ros.control.law.impedance import ImpedanceSettings
from noninteract_ros.control.references.subtask_input import InputSettings
from noninteract_ros.simulation.plant import Plant
from noninteract_ros.simulation.team_simulation import TeamSimulation
from noninteract_ros.subtasks.kinds.cooperative_position import CooperativePosition
from noninteract_ros.subtasks.kinds.relative_position import RelativePosition
from noninteract_ros.subtasks.reference import Reference
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

PUSH = np.array([25.0, -20.0, 0.0, 0.0, 0.0, 0.0])
SOFT = ImpedanceSettings((80.0,), (25.0,))


class DelayedLoop:
    """Two unlike arms under gravity, one of them pushed for 0.2 s, with commands that come late.

    Args:
        rate: Ticks per second [Hz].
        delay: Ticks by which a command comes late.
        loss: Share of the states that never come.
        law: Law in force.
        damping: Factor of the damping.
        push: Factor of the push.
    """

    def __init__(
        self,
        rate: float = 1000.0,
        delay: int = 0,
        loss: float = 0.0,
        law: str = "energy_gated",
        damping: float = 0.2,
        push: float = 1.0,
    ) -> None:
        self.team = Team(PlanarArms(UNLIKE).robots(), (0.0, -9.81, 0.0))
        subtasks = [
            CooperativePosition("cooperative_position").build("cooperative", self.team),
            RelativePosition("relative_position").build("relative", self.team),
        ]
        self.stack = SubtaskStack(self.team, subtasks)
        gains = replace(SOFT, damping=(damping * SOFT.damping[0],))
        inputs = [InputSettings("human", takeover="direct"), InputSettings()]
        self.core = TeamController(self.team, self.stack, law, [gains, gains], inputs)
        self.simulation = TeamSimulation(Plant(self.team), rate)
        self._late = deque([self.team.gravity(self.team.q0)] * delay)
        self._reports = bool(delay or loss)
        self._push = push * PUSH
        self._rng, self._loss = np.random.default_rng(0), loss
        self._torque = self.team.gravity(self.team.q0)
        self._start: tuple[float, float] | None = None
        self.tick: Any = None

    def run(self, seconds: float, push: bool = True) -> list[Any]:
        """The ticks that were answered."""
        found = []
        for _ in range(round(seconds * self.simulation.rate)):
            if push and self.simulation.now < 0.2:
                self.simulation.push("arm_1", self._push, False, 1.5 / self.simulation.rate)
            if self.tick is None or self._rng.random() >= self._loss:
                found.append(self.answer())
            self._late.append(self._torque)
            self.simulation.step(self._late.popleft())
        return found

    def answer(self) -> Any:
        """The controller's answer to the present state."""
        simulation = self.simulation
        applied = simulation.torque if self._reports and self.tick else None
        self.tick = self.core.step(simulation.now, simulation.q, simulation.v, applied)
        self._torque = self.tick.torque
        if self._start is None:
            self._start = self._ledger()
        return self.tick

    def _ledger(self) -> tuple[float, float]:
        simulation = self.simulation
        stored = self.team.mechanical_energy(simulation.q, simulation.v)
        return stored, simulation.energy().controls

    def received(self) -> float:
        """Work of the surroundings, by the simulation's own ledger [J]."""
        now = self._ledger()
        assert self._start is not None
        return (now[0] - self._start[0]) - (now[1] - self._start[1])


@pytest.mark.parametrize("rate", [100.0, 250.0, 1000.0])
def test_the_account_balances_at_any_rate(rate):
    """The account infers the work of a push, to the integrator; W grows by no more."""
    loop = DelayedLoop(rate)
    loop.run(0.6)
    account = loop.answer().account
    assert account.received == pytest.approx(loop.received(), abs=3e-6 * (1000.0 / rate) ** 3)
    assert account.received > 0.1
    assert account.sound
    assert account.residual == pytest.approx(-account.tank.lost, abs=account.bound)
    assert account.bound < 1e-9


@pytest.mark.parametrize(("delay", "loss"), [(0, 0.05), (1, 0.0), (3, 0.0), (10, 0.0)])
def test_the_torque_that_was_applied_is_accounted_for(delay, loss):
    """Late commands and lost states are inside the account: the ledger's work is still met."""
    loop = DelayedLoop(delay=delay, loss=loss, damping=1.0)
    loop.run(0.6)
    account = loop.answer().account
    assert account.received == pytest.approx(loop.received(), abs=1e-5)
    assert account.sound
    assert account.residual == pytest.approx(-account.tank.lost, abs=account.bound)


def test_the_last_command_would_not_do():
    """With commands three ticks late, taking the last one for the applied one misses the work."""
    loop = DelayedLoop(delay=3, damping=1.0)
    loop._reports = False
    loop.run(0.6)
    assert abs(loop.answer().account.received - loop.received()) > 1e-3


def test_open_gates_give_the_noninteracting_torque_to_the_bit():
    """A push that the tank can pay for changes no bit of any torque."""
    laws = ("energy_gated", "noninteracting")
    gated, plain = (DelayedLoop(law=law, damping=1.0, push=0.3).run(0.5) for law in laws)
    for a, b in zip(gated, plain, strict=True):
        assert a.account.tank.sigma == 1.0
        np.testing.assert_array_equal(a.torque, b.torque)


@pytest.mark.parametrize("name", ["star of 8", "chain of 5, world", "branched, weights"])
def test_half_open_gates_are_the_same_robot_by_robot(name):
    """Dense and structured, with gates between 0 and 1, ask for one acceleration."""
    pair, found = Pair(name, 0), []
    tank = DelayedLoop().core.gate.tank
    tank = tank._replace(sigma=0.4, nu=0.7, damping=0.9)
    gates = tank.sigma, tank.nu, tank.damping
    for seen in (pair.structured, pair.dense):
        arguments = (seen.dynamics, pair.error, pair.impedance)
        added = decoupling(*arguments)
        assert added.power == pytest.approx(float(pair.error.e_rate @ added.force))
        found.append(
            np.concatenate([gated_acceleration(*arguments[:2], added, *gates), added.force])
        )
    assert_close(*found)


@pytest.mark.parametrize("damping", [1.0, 0.6])
@pytest.mark.parametrize("nu", [1.0, 0.7])
@pytest.mark.parametrize("sigma", [0.0, 0.4, 1.0])
def test_gates_mix_both_laws_with_the_springs_and_dampers_in_force(sigma, nu, damping):
    """sigma of noninteracting, the rest natural, both with a share of stiffness and damping."""
    pair = Pair("star of 8", 0)
    dynamics, error, impedance = pair.dense.dynamics, pair.error, pair.impedance
    added = decoupling(dynamics, error, impedance)
    found = gated_acceleration(dynamics, error, added, sigma, nu, damping)
    assert np.isinf(impedance.max_force).all()  # So that a share of the stiffness is one of h.
    weaker = replace(
        impedance, stiffness=nu * impedance.stiffness, damping=damping * impedance.damping
    )
    natural, complete = (
        commanded_acceleration(law, dynamics, error, weaker)
        for law in ("natural", "noninteracting")
    )
    np.testing.assert_allclose(found, (1.0 - sigma) * natural + sigma * complete, rtol=1e-9)


def test_references_that_jump_leave_the_gates_open():
    """Free motion of unlike arms after jumps of a reference, with little more than a full gate."""
    loop = DelayedLoop(damping=0.2)
    gate, zero = loop.core.gate, np.zeros(2)
    gate.settings = replace(gate.settings, initial=0.3, refill_fraction=0.0)
    gate.reset()
    loop.run(0.01, push=False)
    start = loop.tick.task.x[:2]
    ticks = []
    for k in range(8):
        goal = start + 0.15 * (1 - k % 2) * np.array([1.0, 0.6])
        for _ in range(100):
            now = loop.simulation.now
            source = loop.core.inputs["cooperative"].sources["human"]
            source.receive(now, Reference(goal, zero, zero), now)
            ticks += loop.run(1e-3, push=False)
    assert max(np.abs(tick.error.e).max() for tick in ticks) > 0.1
    assert min(tick.account.tank.sigma for tick in ticks) == 1.0


def test_a_change_of_law_keeps_the_account():
    """Turned on, the gated law goes on with what is left, from the torque in force."""
    loop, same = DelayedLoop(law="natural"), DelayedLoop(law="natural")
    for item in (loop, same):
        item.run(0.1)
    before = loop.tick.account
    assert before.sigma == 0.0
    loop.core.set_law("energy_gated")
    np.testing.assert_allclose(loop.answer().torque, same.answer().torque, atol=1e-10)
    account = loop.tick.account
    assert account.number == before.number
    assert account.sigma == 1.0
    assert account.tank.level == pytest.approx(before.tank.level, abs=0.02)


def test_stiffer_springs_wait_until_they_are_paid():
    """A stiffness whose energy is not there comes in part, says so, and whole after a refill."""
    loop = DelayedLoop(damping=1.0)
    loop.run(0.2)
    loop.simulation.v *= 0.0  # Held where it is, as against a stop.
    core, settings = loop.core, loop.core.gate.settings
    q, v, now = loop.simulation.q.copy(), loop.simulation.v.copy(), loop.simulation.now
    strained = core.step(now, q, v).error.e
    before = core.gate.tank
    stiff = 2.5 * settings.initial / float(strained @ strained) * 2.0
    core.set_impedance("cooperative", ImpedanceSettings((stiff,), SOFT.damping))
    core.set_impedance("relative", ImpedanceSettings((stiff,), SOFT.damping))
    tick = loop.tick
    for k in range(1, 400):
        tick = core.step(now + 1e-3 * k, q, v)
    waiting = core.springs_waiting
    assert waiting is not None
    assert 0.0 < waiting < 0.9
    assert tick.account.tank.level == pytest.approx(settings.full_gate, abs=0.02)
    paid = before.level - tick.account.tank.level
    grown = tick.account.tank.potential - before.potential
    assert grown == pytest.approx(paid, abs=1e-9)
    core.gate.refill()
    for k in range(400, 800):
        tick = core.step(now + 1e-3 * k, q, v)
    assert core.springs_waiting is None
    np.testing.assert_allclose(core.mode.impedance.stiffness, stiff)
    assert tick.account.residual == pytest.approx(-tick.account.tank.lost, abs=1e-9)


def test_a_stop_is_no_loss_to_the_tank():
    """The damping of a stop is booked as damping: the tank has no less after it."""
    loop = DelayedLoop(damping=1.0)
    loop.run(0.15)
    loop.core.stop()
    loop.run(1.0, push=False)
    assert loop.tick.account.tank.level >= loop.core.gate.settings.initial
    assert loop.tick.account.sound
