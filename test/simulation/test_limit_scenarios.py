# SPDX-License-Identifier: Apache-2.0
"""Scenarios that reach limits: the effects occur, are bounded, are reported and end."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from noninteract_ros.control.telemetry.limit_activity import LimitActivity
from noninteract_ros.control.tick import Tick
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters
from noninteract_ros.scenario.rehearsal import Rehearsal

CONFIG = Path(__file__).resolve().parents[2] / "config"


class LimitScenario:
    """Scenario of the package at a lower rate, rehearsed tick by tick.

    Attributes:
        ticks: Result of the controller at each tick.
        wrenches: External wrenches on the tools, shape (ticks, N, 6).
        reported: Sets of reported conditions, in order of time.
    """

    def __init__(self, name: str, rate: float = 500.0, **keys: Any) -> None:
        values: dict[str, Any] = dict(read_parameters(CONFIG / f"{name}.yaml")) | {"rate": rate}
        for key, value in keys.items():
            block, _, inner = key.partition("__")
            values[block] = values[block] | {inner: value} if inner else value
        self.scenario = Scenario.from_dict(values)
        self.rehearsal = Rehearsal(self.scenario)
        self.team = self.rehearsal.team
        self.watch = LimitActivity(self.team.joint_names)
        self.ticks: list[Tick] = []
        self._wrenches: list[np.ndarray] = []
        self.reported: list[list[str]] = [[]]

    @property
    def wrenches(self) -> np.ndarray:
        return np.array(self._wrenches)

    def run(self, until: float) -> "LimitScenario":
        simulation = self.rehearsal.simulation
        while simulation.now < until - 1e-9:
            now = simulation.now
            self._wrenches.append(simulation.external_wrenches())
            self.ticks.append(self.rehearsal.step())
            self.watch.record(now, self.ticks[-1])
            conditions = self.watch.conditions(now)
            if sorted(conditions) != sorted(self.reported[-1]):
                self.reported.append(conditions)
        return self

    def column(self, pick: Callable[[Tick], Any]) -> np.ndarray:
        return np.array([pick(tick) for tick in self.ticks])


def torque(tick: Tick) -> np.ndarray:
    return tick.torque


def error(tick: Tick) -> np.ndarray:
    return np.abs(tick.error.e)


def test_singularity():
    """The law fades out and in without a step, the elbows never flip, and tracking resumes."""
    found = LimitScenario("singularity").run(10.0)
    shares, elbows = found.column(lambda t: t.law_share), found.column(lambda t: t.state.q[[1, 3]])
    assert shares[0] == shares[-1] == 1.0
    assert shares.min() < 0.1
    assert (np.sign(elbows) == [-1.0, 1.0]).all()
    assert np.abs(found.column(torque)).max() < 60.0
    assert np.abs(np.diff(found.column(torque), axis=0)).max() < 6.0
    errors = found.column(error)
    assert errors.max() > 0.2  # Beyond reach.
    assert errors[-1].max() < 1e-3
    assert found.reported == [[], ["near a singularity: recovering"], []]


def test_joint_limits():
    """No joint exceeds its limit, one is repelled, a fast one is braked; then both track."""
    found = LimitScenario("joint_limits").run(7.0)
    q, v = found.column(lambda t: t.state.q), found.column(lambda t: t.state.v)
    assert -1.9 <= q[:, 1].min() < -1.8
    free = LimitScenario("joint_limits", left=_unlimited("joint_limits")).run(7.0)
    assert free.column(lambda t: t.state.q[1]).min() < -2.0
    assert not any(tick.intervened for tick in free.ticks)
    fastest = np.abs(v[:, :2]).max()
    assert 1.5 < fastest < np.abs(free.column(lambda t: t.state.v[:2])).max()
    assert found.column(error)[-1].max() < 1e-3
    texts = {text for conditions in found.reported for text in conditions}
    assert "left/joint_2 at its position limit" in texts
    assert any(text.endswith("too fast") for text in texts)
    assert found.reported[-1] == []


def _unlimited(name: str) -> dict:
    block = dict(read_parameters(CONFIG / f"{name}.yaml")["left"])
    return {key: value for key, value in block.items() if not key.endswith("_limit")}


def test_effort_limits():
    """Torques and their rates keep their limits; the relative subtask is hardly affected."""
    found = LimitScenario("effort_limits").run(8.0)
    torques = found.column(torque)
    assert (np.abs(torques) <= found.team.effort_limits).all()
    assert (np.abs(torques).max(axis=0) == found.team.effort_limits).any()
    assert np.abs(np.diff(torques, axis=0)).max() <= 300.0 / 500.0 * (1.0 + 1e-9)
    shares = found.column(lambda t: t.safety.effort_share)
    assert shares.min() < 0.5
    # Until the push the grasp is kept, although the decoupling gives way first.
    errors = found.column(error)
    assert errors[: 5 * 500, :2].max() > 0.03
    assert errors[: 5 * 500, 2:].max() < 0.015
    assert errors[-1].max() < 1e-3
    texts = {text for conditions in found.reported for text in conditions}
    assert texts == {"at effort limits", "at the torque-rate limit"}
    assert found.reported[-1] == []


def test_wall():
    """Both tools press with half the cooperative force, slide along the wall, and separate."""
    found = LimitScenario("wall", law="natural").run(9.0)
    forces = -found.wrenches[:, :, 1]
    assert (forces >= 0.0).all()
    x = found.column(lambda t: t.task.x)
    sliding = slice(4 * 500, 5 * 500)
    np.testing.assert_allclose(forces[sliding], 6.0, rtol=0.02)
    assert np.ptp(x[sliding, 0]) > 0.15
    assert (x[:, 1] < 0.705).all()
    assert forces[:500].max() == forces[-500:].max() == 0.0
    assert found.column(error)[-1].max() < 1e-3
    assert not any(tick.intervened for tick in found.ticks)


def test_wall_under_the_gated_law():
    """The gated law presses with the force of its closed loop, from one tank, and separates."""
    found = LimitScenario("wall").run(9.0)
    wrenches = found.wrenches
    assert (wrenches[:, :, 1] <= 0.0).all()
    for k in range(4 * 500, 5 * 500, 50):
        tick = found.ticks[k]
        torque = found.rehearsal.team.external_torque(tick.state, wrenches[k])
        contact = tick.dynamics.decoupled_external_force(torque)
        np.testing.assert_allclose(contact[1], tick.feedback[1], rtol=0.02)
        assert contact[1] < -10.0
    assert np.abs(wrenches[-500:]).max() == 0.0
    assert found.column(error)[-1].max() < 1e-3
    assert not any(tick.intervened for tick in found.ticks)
    assert found.column(lambda t: t.account.tank.level).min() > 0.9


def test_carry():
    """Three robots carry a plate with small errors, are disturbed by a push, and recover."""
    found = LimitScenario("carry").run(9.0)
    errors = found.column(error)
    before, pushed, after = slice(4 * 500, 5 * 500), slice(5 * 500, 6 * 500), slice(-500, None)
    assert errors[before, :2].max() < 0.01
    assert errors[before, 2:].max() < 1e-3
    assert errors[pushed, :2].max() > 0.015
    assert errors[after].max() < 0.01
    # The plate's weight hangs on three grips, and accelerates with the team.
    weight = -found.wrenches[2 * 500 :, :, 2]
    np.testing.assert_allclose(weight, 2.0 * 9.81 / 3.0, rtol=1e-2)
    a = 500.0 * np.gradient(found.column(lambda t: t.x_rate)[:, :2], axis=0)
    carried = -found.wrenches[:, :, :2].sum(axis=1)
    assert np.abs(carried[before]).max() > 1.0
    np.testing.assert_allclose(carried[before], 2.0 * a[before], atol=0.05)
    balance = found.rehearsal.simulation.energy()
    assert balance.lost > 0.0


def spread(found: LimitScenario) -> np.ndarray:
    """Return the largest velocity of the team at each tick."""
    return np.abs(found.column(lambda t: t.state.v)).max(axis=1)


def door(law: str, until: float) -> LimitScenario:
    """Run the door at rest, without an operator, after a tiny push on one robot."""
    poke = {"robot": "outer", "start": 0.01, "duration": 0.01, "force": [0.0, 1e-3, 0.0]}
    still = {"formations": ["closed"], "closed": {"value": [0.501, 0.0]}}
    keys = {"pushes": ["poke"], "poke": poke, "planner": still, "haptic__start_time": 100.0}
    found = LimitScenario("door", 1000.0, law=law, **keys)
    return found.run(until)


def test_a_passive_door_destabilises_noninteracting_but_not_natural():
    """After a push of 1 mN the motion grows with 15 to 25 /s, or settles."""
    v = spread(door("noninteracting", 0.6))
    t = np.arange(len(v)) / 1000.0
    envelope = np.maximum.accumulate(v)
    growth = np.polyfit(t[200:], np.log(envelope[200:]), 1)[0]
    assert 15.0 < growth < 25.0
    v = spread(door("natural", 0.6))
    assert v[400:].max() < 0.01 * v.max()
    assert v.max() < 1e-4


def test_the_gated_law_settles_at_the_door():
    """Its tank pays for the oscillation, the gate closes, and the team comes to rest."""
    found = LimitScenario("door", 1000.0).run(6.0)
    accounts = [tick.account for tick in found.ticks]
    assert found.rehearsal.simulation.plant_q[-1] == pytest.approx(0.4, abs=1e-3)
    assert spread(found)[-1] < 1e-5
    sigma = np.array([account.tank.sigma for account in accounts])
    assert sigma[0] == 1.0
    assert 0.0 < sigma[-1] < 0.6
    assert np.ptp(sigma[-1000:]) == 0.0
    assert min(account.tank.level for account in accounts) > 0.0
    for account in accounts:
        assert account.sound
        assert account.residual == pytest.approx(-account.tank.lost, abs=account.bound)


def test_door():
    """Opened by 0.4 rad under the natural law, the door and its robots come to rest."""
    found = LimitScenario("door", 1000.0, law="natural").run(6.0)
    angle = found.rehearsal.simulation.plant_q[-1]
    assert angle == pytest.approx(0.4, abs=1e-3)
    assert spread(found)[-1] < 1e-5
    assert found.column(error).max() < 0.02
    x = found.ticks[-1].task.x
    np.testing.assert_allclose(x, [0.6093, 0.2576, 0.4614, 0.1951], atol=1e-3)
