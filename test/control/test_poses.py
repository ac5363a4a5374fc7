# SPDX-License-Identifier: Apache-2.0
"""The law on SE(3): unlike spatial arms led by their pose, grasp and posture."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from spatial_arms import random_state, spatial_team

from noninteract_ros.control.energy.storage import Energy, energy
from noninteract_ros.control.law.decoupling import TaskError, commanded_acceleration, task_dynamics
from noninteract_ros.control.law.impedance import (
    Impedance,
    ImpedanceSettings,
    per_coordinate,
    stack_impedance,
)
from noninteract_ros.errors import ScenarioError
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.kinds.cooperative_pose import CooperativePose
from noninteract_ros.subtasks.kinds.posture import Posture
from noninteract_ros.subtasks.kinds.relative_pose import RelativePose
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team, TeamState
from noninteract_ros.validation.identities.plain_form import (
    block_diagonal,
    decoupling_matrix,
    natural_torque,
    paper_subtask_coriolis,
    plain_torque,
    subtask_coriolis,
)

STATES = range(30)
SETTINGS = ImpedanceSettings((90.0, 60.0, 30.0, 20.0), (9.0, 8.0, 7.0, 2.0))
BOUNDED = ImpedanceSettings(
    (90.0, 60.0, 30.0, 20.0), (9.0, 8.0, 7.0, 2.0), (), "saturating", (5.0, 6.0, 7.0, 1.5)
)
CHOSEN = ImpedanceSettings((90.0, 60.0, 30.0, 20.0), (9.0, 8.0, 7.0, 2.0), (4.0, 4.0, 4.0, 0.5))
BENT = ImpedanceSettings((15.0,), (2.0,))


class Case:
    """Two unlike arms, led by pose and grasp, and where they are redundant by a posture."""

    def __init__(self, redundant=False, frame="lead", settings=(SETTINGS, SETTINGS)) -> None:
        self.team: Team = spatial_team(2, "zyzyzyz" if redundant else "zyzyzy")
        first = CooperativePose("cooperative_pose").build("lead", self.team)
        others = {"lead": first}
        parts = [first, RelativePose("relative_pose", frame=frame).build("gap", self.team, others)]
        if redundant:
            joints = ("arm_1/joint_3", "arm_2/joint_3")
            parts.append(Posture("posture", joints).build("bend", self.team))
            settings = (*settings, BENT)
        self.stack = SubtaskStack(self.team, parts)
        self.impedance = stack_impedance(self.stack.subtasks, settings)

    def state(self, seed: int) -> TeamState:
        return random_state(self.team, np.random.default_rng(seed))

    def dynamics(self, state: TeamState):
        task = self.stack.evaluate(state)
        return task_dynamics(state, task, self.stack.slices, self.impedance.inertias)

    def error(self, state: TeamState, seed: int) -> TaskError:
        """Random desired motions; everything else as it follows."""
        rng, n = np.random.default_rng(100 + seed), self.team.n
        task = self.stack.evaluate(state)
        x_d = self.stack.layout.sum(task.x, rng.normal(size=n))
        velocity = rng.normal(size=n)
        e = self.stack.difference(task.x, x_d)
        rates = rng.normal(size=(2, n))
        return TaskError(e, task.J @ state.v - velocity, velocity, *rates)

    def torque(self, law: str, state: TeamState, error: TaskError) -> np.ndarray:
        dynamics = self.dynamics(state)
        wanted = commanded_acceleration(law, dynamics, error, self.impedance)
        return dynamics.torque(state.v, dynamics.joint_acceleration(state.v, wanted))


CASES = [
    pytest.param({}, id="poses"),
    pytest.param({"frame": "world"}, id="grasp in the world"),
    pytest.param({"redundant": True}, id="poses and posture"),
    pytest.param({"settings": (CHOSEN, BOUNDED)}, id="desired inertia, bounded forces"),
]


@pytest.mark.parametrize("keys", CASES)
def test_poses_are_decoupled(keys):
    """J M^-1 Gamma is block-diagonal to 1e-10 of its size."""
    case = Case(**keys)
    for seed in STATES:
        dynamics = case.dynamics(case.state(seed))
        found = dynamics.J @ np.linalg.solve(dynamics.M, decoupling_matrix(dynamics))
        blocks = tuple(np.linalg.inv(inertia) for inertia in dynamics.inertias)
        expected = block_diagonal(dynamics, blocks)
        np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("keys", CASES)
def test_both_forms_of_the_torque_agree(keys):
    """alpha + Gamma tau~_c and inverse dynamics of the commanded acceleration are the same."""
    case = Case(**keys)
    for seed in STATES:
        state = case.state(seed)
        error, dynamics = case.error(state, seed), case.dynamics(state)
        for law, kept in (
            ("noninteracting", subtask_coriolis(dynamics)),
            ("paper", paper_subtask_coriolis(dynamics)),
        ):
            plain = plain_torque(dynamics, state.v, error, case.impedance, kept)
            fast = case.torque(law, state, error)
            np.testing.assert_allclose(fast, plain, atol=1e-9 * np.abs(plain).max())
        plain = natural_torque(dynamics, error, case.impedance)
        fast = case.torque("natural", state, error)
        np.testing.assert_allclose(fast, plain, atol=1e-9 * np.abs(plain).max())


@pytest.mark.parametrize("keys", CASES)
def test_kept_coriolis_matrices_are_skew_with_the_inertia_rates(keys):
    """dM_i/dt - 2 C~_i is skew on SE(3) too, by differences along the motion."""
    case, step = Case(**keys), 1e-6
    for seed in range(8):
        state = case.state(seed)
        ends = [
            case.dynamics(
                case.team.state(case.team.integrate(state.q, h * state.v), state.v)
            ).inertias
            for h in (-step, step)
        ]
        kept = subtask_coriolis(case.dynamics(state))
        for before, after, C in zip(*ends, kept, strict=True):
            rate = (after - before) / (2 * step)
            skew = rate - 2.0 * C
            scale = max(1.0, np.abs(rate).max())
            np.testing.assert_allclose(skew, -skew.T, atol=1e-6 * scale)


POSE_GAINS = [
    Impedance(np.full(3, 7.0), np.ones(3), np.full(3, bound), (None,), np.array([[0, 1, 2]]))
    for bound in (np.inf, 2.0)
]


@pytest.mark.parametrize("gains", POSE_GAINS)
def test_the_potential_s_rate_is_its_force_times_the_plain_velocity_error(gains):
    """dV/dt = h' (omega - omega_d) for any two motions, however far apart: the gradient is exact.

    The desired rotation turns as well, and not about the axis of the error.
    """
    layout, rng, step = Layout((0,), (True,)), np.random.default_rng(0), 1e-6
    for _ in range(50):
        R, R_d = so3.normalized(rng.normal(size=(2, 4)))
        omega, omega_d = rng.normal(size=(2, 3))
        e = layout.difference(R, R_d)
        if np.linalg.norm(e) > np.pi - 1e-3:
            continue
        ends = [
            gains.potential(
                layout.difference(layout.sum(R, h * omega), layout.sum(R_d, h * omega_d))
            )
            for h in (-step, step)
        ]
        slope = (ends[1].sum() - ends[0].sum()) / (2 * step)
        assert gains.force(e) @ (omega - omega_d) == pytest.approx(slope, rel=1e-6, abs=1e-7)


def test_a_bounded_torque_is_bounded_as_a_whole_and_keeps_its_axis():
    """The saturating torque is along the error, below its bound, whatever the direction."""
    gains = POSE_GAINS[1]
    for e in np.random.default_rng(1).normal(size=(50, 3)):
        torque = gains.force(e)
        assert np.linalg.norm(torque) < 2.0
        np.testing.assert_allclose(np.cross(torque, e), np.zeros(3), atol=1e-14)
    far = gains.force(np.array([0.0, 3.0, 0.0]))
    assert 1.9 < far[1] < 2.0
    tiny = np.array([1e-6, -2e-6, 0.0])
    np.testing.assert_allclose(gains.force(tiny), 7.0 * tiny, rtol=1e-9)


def test_half_a_turn_away_the_torque_is_bounded_and_the_potential_continuous():
    """Across |e| = pi the torque changes to its opposite, the potential does not change."""
    layout, axis = Layout((0,), (True,)), np.array([0.0, 0.6, 0.8])
    for gains in POSE_GAINS:
        sides = [so3.exp((np.pi + over) * axis) for over in (-1e-9, 1e-9)]
        e = [layout.difference(side, layout.identity) for side in sides]
        torques = [gains.force(item) for item in e]
        np.testing.assert_allclose(torques[0], -torques[1], rtol=1e-8)
        assert np.linalg.norm(torques[0]) <= 7.0 * np.pi
        stored = [gains.potential(item).sum() for item in e]
        assert stored[0] == pytest.approx(stored[1], rel=1e-8)


class Motion:
    """A case under the law, with desired motions that turn, pushes and force inputs.

    Args:
        case: Arms, subtasks, gains.
        push: Size of a constant torque on the joints from outside.
        force: Size of a constant force input.
    """

    def __init__(self, case: Case, push: float = 0.0, force: float = 0.0) -> None:
        self.case, n = case, case.team.n
        rng = np.random.default_rng(11)
        self.push, self.force = push * rng.normal(size=n), force * rng.normal(size=n)
        self.amplitude = 0.05 * rng.normal(size=n)
        self.q = case.team.q0
        self.v = 0.2 * rng.normal(size=n)
        layout = case.stack.layout
        self.base = Reference.at_rest(
            case.stack.evaluate(case.team.state(self.q, self.v)).x, layout
        )

    def reference(self, t: float) -> Reference:
        phase = 2.0 * t + np.arange(self.case.team.n)
        gap = Reference(
            self.amplitude * np.sin(phase),
            2.0 * self.amplitude * np.cos(phase),
            -4.0 * self.amplitude * np.sin(phase),
        )
        return self.base.plus(gap, self.case.stack.layout)

    def at(self, t: float, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, Energy, TaskError]:
        """Joint acceleration, energies and tracking error."""
        case = self.case
        state, wanted = case.team.state(q, v), self.reference(t)
        task, dynamics = case.stack.evaluate(state), case.dynamics(state)
        e = case.stack.difference(task.x, wanted.position)
        rates = wanted.velocity, wanted.acceleration
        error = TaskError(e, task.J @ v - wanted.velocity, *rates, self.force)
        asked = commanded_acceleration("noninteracting", dynamics, error, case.impedance)
        torque = dynamics.torque(v, dynamics.joint_acceleration(v, asked))
        found = energy(dynamics, error, case.impedance, asked, self.push)
        return case.team.forward_dynamics(q, v, torque + self.push), found, error

    def rate(self, t: float, y: np.ndarray) -> np.ndarray:
        """Derivative of (q, v, supplied less dissipated energy of each subtask)."""
        n = self.case.team.n
        acceleration, found, _ = self.at(t, y[:n], y[n : 2 * n])
        return np.concatenate([y[n : 2 * n], acceleration, found.supplied - found.dissipated])

    def run(self, end: float, steps: int) -> list[tuple[np.ndarray, Energy, TaskError]]:
        """Energies given, energies and errors at each step of the classical Runge-Kutta method."""
        n, h = self.case.team.n, end / steps
        y = np.concatenate([self.q, self.v, np.zeros(len(self.case.stack.slices))])
        rows = []
        for k in range(steps + 1):
            t = k * h
            rows.append((y[2 * n :], *self.at(t, y[:n], y[n : 2 * n])[1:]))
            first = self.rate(t, y)
            second = self.rate(t + h / 2, y + h / 2 * first)
            third = self.rate(t + h / 2, y + h / 2 * second)
            last = self.rate(t + h, y + h * third)
            y = y + h / 6 * (first + 2 * (second + third) + last)
        return rows


DRIVEN = [
    pytest.param({}, {"push": 0.5, "force": 1.0}, id="driven poses"),
    pytest.param({"redundant": True}, {"push": 0.5}, id="with a posture"),
    pytest.param({"settings": (CHOSEN, BOUNDED)}, {"force": 2.0}, id="inertia, bounded forces"),
]


@pytest.mark.parametrize(("keys", "inputs"), DRIVEN)
def test_storage_follows_supplied_and_dissipated_power(keys, inputs):
    """(33) along motions on SE(3): rate = supplied - dissipated, and it is the slope of S_i."""
    step = 1e-3
    found = [item for _, item, _ in Motion(Case(**keys), **inputs).run(0.1, round(0.1 / step))]
    for before, now, after in zip(found, found[1:], found[2:], strict=False):
        np.testing.assert_allclose(now.rate, now.supplied - now.dissipated, atol=1e-9)
        slope = (after.storage - before.storage) / (2 * step)
        np.testing.assert_allclose(now.rate, slope, rtol=1e-3, atol=1e-3)
        assert (now.storage >= 0.0).all()


@pytest.mark.parametrize(("keys", "inputs"), DRIVEN)
def test_the_energy_balance_closes_with_the_integrator_s_order(keys, inputs):
    """Stored energy is supplied less dissipated energy; the rest falls as h^4."""
    rests = []
    for steps in (15, 30, 60):
        rows = Motion(Case(**keys), **inputs).run(0.3, steps)
        (_, start, _), (given, end, _) = rows[0], rows[-1]
        rests.append(np.abs(end.storage - start.storage - given).max())
    assert 10.0 < rests[0] / rests[1] < 26.0
    assert 10.0 < rests[1] / rests[2] < 26.0
    assert rests[-1] < 1e-7


def test_a_push_on_one_pose_moves_no_other():
    """Forces and errors of the led pose leave grasp and posture where they are to be."""
    motion = Motion(Case(redundant=True))
    case = motion.case
    motion.amplitude[6:] = 0.0  # Grasp and posture are to hold; the led pose swings.
    J = case.stack.evaluate(case.team.state(motion.q, motion.v)).J
    motion.v = np.linalg.solve(J, np.concatenate([np.full(6, 0.2), np.zeros(8)]))
    motion.force[:6] = [3.0, -2.0, 3.0, 2.0, 1.0, -2.0]
    errors = np.array([error.e for _, _, error in motion.run(0.3, 300)])
    assert np.abs(errors[:, :6]).max() > 0.03
    assert np.abs(errors[:, 6:]).max() < 1e-9


def test_the_sign_of_a_reference_s_quaternion_means_nothing():
    """Both quaternions of a desired rotation give the same torque."""
    case = Case()
    state = case.state(0)
    task = case.stack.evaluate(state)
    x_d = case.stack.layout.sum(task.x, np.linspace(-1.0, 1.0, 12))
    other = x_d.copy()
    other[case.stack.layout.quaternions[0]] *= -1.0
    np.testing.assert_array_equal(
        case.stack.difference(task.x, x_d), case.stack.difference(task.x, other)
    )


def test_gains_of_a_pose_are_one_per_axis_and_one_for_the_rotation():
    """The rotation's number holds about all axes; lists with three of its own are refused."""
    case = Case()
    task = case.stack.subtasks[0]
    np.testing.assert_array_equal(
        per_coordinate(task, "damping", (1.0, 2.0, 3.0, 4.0)), [1, 2, 3, 4, 4, 4]
    )
    np.testing.assert_array_equal(per_coordinate(task, "damping", (5.0,)), [5.0] * 6)
    with pytest.raises(ScenarioError) as caught:
        per_coordinate(task, "stiffness", (1.0, 1.0, 1.0, 4.0, 4.0, 5.0))
    assert str(caught.value).endswith(
        "allowed: 1 or 4 numbers (x, y, z, rotation of each element)"
    )
    np.testing.assert_array_equal(case.impedance.rotations, [[3, 4, 5], [9, 10, 11]])


def test_torque_turns_the_team_to_where_it_is_asked():
    """From rest the commanded acceleration leads along the error's axis, towards the target."""
    case = Case()
    state = case.team.state(case.team.q0, np.zeros(12))
    task = case.stack.evaluate(state)
    x_d = task.x.copy()
    turn = Rotation.from_rotvec([0.0, 0.0, 0.5])
    x_d[3:7] = (turn * Rotation.from_quat(x_d[3:7])).as_quat()
    e = case.stack.difference(task.x, x_d)
    np.testing.assert_allclose(e, np.eye(12)[5] * -0.5, atol=1e-12)
    dynamics = case.dynamics(state)
    error = TaskError(e, *np.zeros((4, 12)))
    wanted = commanded_acceleration("noninteracting", dynamics, error, case.impedance)
    np.testing.assert_allclose(wanted[6:], np.zeros(6), atol=1e-12)
    force = dynamics.inertias[0] @ wanted[:6]
    np.testing.assert_allclose(force, np.eye(6)[5] * 10.0, atol=1e-9)
