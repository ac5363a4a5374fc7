# SPDX-License-Identifier: Apache-2.0
"""Gauntlet: its loops agree with the controller, its verdicts with each other."""

import json

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from noninteract_ros import cli
from noninteract_ros.control.controller import TeamController
from noninteract_ros.control.energy import tank as energy_tank
from noninteract_ros.control.energy.tank import Interval, TankSettings
from noninteract_ros.control.law.impedance import ImpedanceSettings
from noninteract_ros.control.references.subtask_input import InputSettings
from noninteract_ros.subtasks.kinds.cooperative_position import CooperativePosition
from noninteract_ros.subtasks.kinds.relative_position import RelativePosition
from noninteract_ros.subtasks.reference import Reference
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.models.planar_arm import PlanarArm
from noninteract_ros.team.models.point_mass import PointMass
from noninteract_ros.team.robot import Robot
from noninteract_ros.team.team import Team
from noninteract_ros.validation.gauntlet import cases, plant
from noninteract_ros.validation.gauntlet.account import account_step, full_tank, whole
from noninteract_ros.validation.gauntlet.arrays import SurroundingsArrays
from noninteract_ros.validation.gauntlet.cases import Case, make_case
from noninteract_ros.validation.gauntlet.check import counted, run_cases
from noninteract_ros.validation.gauntlet.judge import judge, trace
from noninteract_ros.validation.gauntlet.loop import growth_rate, plant_of
from noninteract_ros.validation.gauntlet.settings import LAWS, GauntletSettings
from noninteract_ros.validation.gauntlet.state import TRACED
from noninteract_ros.validation.gauntlet.surroundings import Element, assembled

AXES = ("x", "y")
HALF_TICK = 0.5e-3
# From the mean of two masses on one axis to planar arms, with and without weight.
CASES = (0, 3, 4, 9, 14)


def test_the_compiled_account_is_bit_equal_to_the_controllers() -> None:
    """Random intervals, booked one after the other by both, leave the same numbers."""
    levels = energy_tank.levels(TankSettings(), 1.0)
    ours, theirs = full_tank(levels, 0.3), energy_tank.full_tank(levels, 0.3)
    rng = np.random.default_rng(0)
    for _ in range(2000):
        works = rng.normal(0.0, 0.05, 3).tolist()
        potentials = rng.uniform(0.0, 1.0, 3).tolist()
        led, demand = rng.normal(0.0, (0.01, 20.0)).tolist()
        amounts = [1e-3, *works, *potentials, led, 1.0, demand]
        ours = account_step(ours, Interval(*amounts), levels)
        theirs = energy_tank.step(theirs, Interval(*amounts), levels)
        assert tuple(ours) == tuple(theirs)
    assert tuple(whole(ours, ours)) == tuple(energy_tank.whole(theirs, theirs))


def robots_of(case: Case) -> list[Robot]:
    """Build the robots of a case with the package's models."""
    if not case.arms:
        axes = AXES[: case.axes]
        masses = case.team.masses[:: case.axes]
        return [PointMass(float(m), axes=axes).build(f"r{i}") for i, m in enumerate(masses)]
    arms = []
    for i, (l1, l2, alpha, _, delta, *_) in enumerate(case.team.arms):
        m2 = 3.0 * delta / l2**2
        m1 = 3.0 * (alpha - m2 * l1**2 - delta) / l1**2
        start = tuple(case.start[0, 2 * i : 2 * i + 2])
        arm = PlanarArm(link_lengths=(l1, l2), link_masses=(m1, m2), initial_position=start)
        arms.append(arm.build(f"r{i}"))
    return arms


def controller_of(case: Case, law: str) -> TeamController:
    """Build the controller of a case, with references at zero error."""
    gravity = (0.0, -9.81, 0.0) if case.arms and case.team.arms[0, 6] else (0.0, 0.0, 0.0)
    team = Team(robots_of(case), gravity)
    axes = AXES[: case.axes]
    subtasks = [
        CooperativePosition("cooperative_position", axes=axes).build("mean", team),
        RelativePosition("relative_position", axes=axes).build("apart", team),
    ]
    K, D, first = case.team.stiffness, case.team.damping, case.team.first
    gains = [
        ImpedanceSettings(tuple(map(float, K[part])), tuple(map(float, D[part])))
        for part in (slice(0, first), slice(first, None))
    ]
    led = InputSettings("human", timeout=100.0, takeover="direct")
    controller = TeamController(team, SubtaskStack(team, subtasks), law, gains, [led, led])
    reference = case.team.mixing @ case.team.y_ref
    for item, part in zip(
        controller.inputs.values(), (slice(0, first), slice(first, None)), strict=True
    ):
        still = np.zeros(len(reference[part]))
        item.sources["human"].receive(0.0, Reference(reference[part], still, still), 0.0)
    return controller


@pytest.mark.parametrize(
    ("law", "delay", "drop"),
    [*((law, 0, 0.0) for law in LAWS), ("energy_gated", 3, 0.0), ("energy_gated", 0, 0.2)],
)
@pytest.mark.parametrize("index", CASES)
def test_torques_and_account_agree_with_the_controller(
    index: int, law: str, delay: int, drop: float
) -> None:
    """The controller has the same torques and account at the states of the gauntlet.

    A small tank runs empty, so that both gates move within the second.
    """
    tank = TankSettings(capacity=0.02, initial=0.01, reopening_level=0.015, full_gate=0.01)
    settings = GauntletSettings(delay=delay, drop=drop, tank=tank)
    case = make_case(2, index, settings.reaction)
    rows = trace(case, law, settings, 600, 1)
    controller = controller_of(case, law)
    controller.gate.settings = tank
    controller.gate.reset()
    n, m = case.team.n, case.start.shape[1]
    torques = rows[:, TRACED + 2 * m :]
    draws = np.random.RandomState(index)
    size = np.abs(torques).max()
    for k, row in enumerate(rows[: len(rows) - delay]):
        if k and drop and draws.random_sample() < drop:
            continue
        q, v = row[TRACED : TRACED + n], row[TRACED + m : TRACED + m + n]
        applied = torques[k - 1] if k and delay else None
        tick = controller.step(1e-3 * k, q.copy(), v.copy(), applied)
        np.testing.assert_allclose(tick.torque, torques[k + delay], atol=1e-9 * size)
        account = controller.gate.tank
        sigma = controller.gate.account.sigma
        found = sigma, account.nu, account.level, account.reserve, account.lost
        np.testing.assert_allclose(row[1:6], found, atol=1e-9)
    if law == "energy_gated":
        assert rows[:, 1].min() < 1.0 or rows[:, 3].min() > 0.01


def held_by_ode(case: Case, torque: np.ndarray) -> tuple[np.ndarray, float]:
    """Return state and heat after a tick of point masses, by an adaptive integrator."""
    around, n = case.around, case.team.n
    m = len(around.rest)
    inertia = around.inertia.copy()
    inertia[:n, :n] += np.diag(case.team.masses)

    def rate(t: float, state: np.ndarray) -> np.ndarray:
        z, z_rate = state[:m], state[m : 2 * m]
        force = around.rest - around.stiffness @ z - around.damping @ z_rate
        for b, k, gap in zip(
            around.directions, around.contact_stiffness, around.gaps, strict=True
        ):
            force = force - k * max(b @ z - gap, 0.0) * b
        force[:n] += torque
        heat = z_rate @ around.damping @ z_rate
        return np.concatenate([z_rate, np.linalg.solve(inertia, force), [heat]])

    start = np.concatenate([*case.start, [0.0]])
    end = solve_ivp(rate, (0.0, 1e-3), start, rtol=1e-12, atol=1e-13).y[:, -1]
    return end[: 2 * m], float(end[-1])


@pytest.mark.parametrize("index", [i for i in range(12) if i % cases.ARMS_EVERY != 4])
def test_a_tick_of_the_plant_agrees_with_an_integrator(index: int) -> None:
    """Exact discretization and midpoint rule agree with an adaptive method."""
    case = make_case(4, index, HALF_TICK)
    torque = np.linspace(-3.0, 5.0, case.team.n)
    z, z_rate = case.start[0].copy(), case.start[1].copy()
    heat = plant.advance(plant_of(case, 1e-3), case.team, case.around, 1e-3, z, z_rate, torque)
    wanted, wanted_heat = held_by_ode(case, torque)
    bound = 1e-9 if case.linear else 2e-3
    scale = np.abs(wanted).max()
    np.testing.assert_allclose(np.concatenate([z, z_rate]), wanted, atol=bound * scale)
    assert heat == pytest.approx(wanted_heat, rel=5e-2 if not case.linear else 1e-6, abs=1e-12)


def door() -> Case:
    """Return the example of the derivations: two robots on one door at different radii."""
    mixing = cases.task_matrix(2, 1)
    S = np.linalg.inv(mixing)
    masses = np.array([1.0, 4.0])
    own = np.diag(S.T @ np.diag(masses) @ S)
    K = np.array([10.0, 1825.0])
    D = 2.0 * np.array([0.84, 1.59]) * np.sqrt(K * own)
    angle = np.deg2rad(114.26)
    lever = Element("spring", np.array([np.cos(angle), np.sin(angle)]), 5e4)
    around = assembled([lever], 2)
    team = make_case(0, 0, HALF_TICK).team._replace(
        mixing=mixing, S=S, masses=masses, stiffness=K, damping=D
    )
    return Case(0, team, around, [lever], np.array([[0.01, 0.01], [0.0, 0.0]]), 2, 1)


def test_the_door_diverges_as_stated_and_settles_with_gates() -> None:
    """The noninteracting loop grows at 17.8 1/s, slightly less at 1 kHz; passive laws settle."""
    case = door()
    assert growth_rate(case, 1e-5, 0, 1.0, 1.0) == pytest.approx(17.76, abs=0.01)
    assert growth_rate(case, 1e-3, 0, 1.0, 1.0) == pytest.approx(17.68, abs=0.01)
    assert growth_rate(case, 1e-3, 0, 0.0, 1.0) < 0.0
    found = {item.law: item for item in judge(case, GauntletSettings())}
    assert found["noninteracting"].state == "unbounded"
    assert found["noninteracting"].agreed
    for law in ("natural", "energy_gated"):
        assert found[law].settled
        assert found[law].agreed
    assert found["energy_gated"].sigma_least < 0.7


def test_passive_laws_settle_and_the_noninteracting_law_may_not() -> None:
    """60 cases settle under passive laws, residuals are rounding, verdicts agree."""
    settings = GauntletSettings(cases=60, seed=1, jobs=1)
    verdicts = run_cases(settings)
    report = counted(settings, verdicts)
    assert report.passed
    names = {check.name for check in report.checks}
    assert {"not at rest, energy_gated", "unbounded, natural", "residual, natural"} <= names
    assert sum(item.unstable for item in verdicts if item.law == "noninteracting") >= 2
    assert sum(item.agreed is True for item in verdicts) > 100
    assert max(item.mismatch for item in verdicts if not item.unstable) < 1e-9


@pytest.mark.parametrize(
    ("tank", "claim"),
    [
        (TankSettings(refill_fraction=2.0), "residual, energy_gated"),
        (TankSettings(initial=1e6, capacity=1e6), "not at rest, energy_gated"),
    ],
)
def test_a_broken_account_fails(tank: TankSettings, claim: str) -> None:
    """Excessive refilling shows in the residual, an unlimited tank in the counts."""
    settings = GauntletSettings(
        cases=50, seed=1, jobs=1, laws=("energy_gated",), horizon=30.0, tank=tank
    )
    report = counted(settings, run_cases(settings))
    assert claim in {check.name for check in report.checks if check.passed is False}


def test_a_case_depends_on_its_number_alone() -> None:
    """Case 17 is the same for equal seeds and differs between seeds."""
    first, again = make_case(5, 17, HALF_TICK), make_case(5, 17, HALF_TICK)
    np.testing.assert_array_equal(first.start, again.start)
    np.testing.assert_array_equal(first.team.stiffness, again.team.stiffness)
    assert not np.array_equal(first.team.stiffness, make_case(6, 17, HALF_TICK).team.stiffness)


@pytest.mark.parametrize("index", range(40))
def test_surroundings_are_passive(index: int) -> None:
    """All matrices are symmetric and positive semidefinite, energies are not negative."""
    around: SurroundingsArrays = make_case(3, index, HALF_TICK).around
    for matrix in (around.inertia, around.stiffness, around.damping):
        np.testing.assert_allclose(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix).min() >= -1e-9 * max(1.0, np.abs(matrix).max())
    least = around.preload - 0.5 * around.rest @ np.linalg.pinv(around.stiffness) @ around.rest
    assert least >= -1e-9
    assert (around.contact_stiffness > 0.0).all()
    assert (around.gaps >= 0.0).all()


def test_the_command_reports_one_case_in_detail(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path
) -> None:
    """It prints tables and writes JSON to a file."""
    file = tmp_path / "case.json"
    arguments = ["check", "gauntlet", "--case", "3", "--seed", "1", "--json", str(file)]
    monkeypatch.setattr("sys.argv", ["noninteract", *arguments])
    assert cli.main() == 0
    assert "course under energy_gated" in capsys.readouterr().out.lower()
    report = json.loads(file.read_text())
    assert [row["law"] for row in report["outcomes"]] == list(LAWS)


def test_an_unknown_law_is_rejected(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The message lists the allowed laws."""
    monkeypatch.setattr("sys.argv", ["noninteract", "check", "gauntlet", "--law", "gated"])
    assert cli.main() == 2
    assert "energy_gated" in capsys.readouterr().err
