# SPDX-License-Identifier: Apache-2.0
"""The law: its decoupling, its Coriolis matrices and its two forms."""

import numpy as np
import pytest
from planar_arms import UNLIKE, PlanarArms, mixed_subtasks, slices_of, stack_of
from scipy.integrate import solve_ivp

from noninteract_ros.control.law.decoupling import (
    LAWS,
    TaskDynamics,
    TaskError,
    commanded_acceleration,
    paper_coriolis_force,
    task_dynamics,
)
from noninteract_ros.control.law.impedance import Impedance
from noninteract_ros.subtasks.subtask import SubtaskState
from noninteract_ros.team.team import TeamState
from noninteract_ros.validation.identities.plain_form import (
    block_diagonal,
    corollary_decoupling_matrix,
    decoupling_matrix,
    natural_torque,
    paper_subtask_coriolis,
    plain_torque,
    subtask_coriolis,
    task_coriolis,
)

STEP = 1e-6
STATES = range(40)


class Case:
    """Planar arms with their subtasks, natural inertias unless others are asked for."""

    def __init__(self, masses=UNLIKE, split=False, desired=None, gravity=9.81) -> None:
        self.arms = PlanarArms(masses, gravity)
        self.subtasks = mixed_subtasks(len(masses), split)
        self.slices = slices_of(self.subtasks)
        self.n = self.arms.n
        self.desired = (None,) * len(self.slices) if desired is None else desired
        self.impedance = Impedance(
            np.linspace(5.0, 40.0, self.n),
            np.linspace(3.0, 9.0, self.n),
            np.where(np.arange(self.n) % 3, np.inf, 2.0),
            self.desired,
        )

    def state(self, seed: int) -> TeamState:
        return self.arms.random_state(np.random.default_rng(seed))

    def error(self, seed: int) -> TaskError:
        rng = np.random.default_rng(1000 + seed)
        return TaskError(*rng.normal(size=(5, self.n)))

    def moving_error(self, state: TeamState, seed: int) -> TaskError:
        """A random tracking error that agrees with the state: x_rate = e_rate + reference."""
        error = self.error(seed)
        velocity = stack_of(self.subtasks, state).J @ state.v - error.e_rate
        return TaskError(
            error.e, error.e_rate, velocity, error.reference_acceleration, error.force
        )

    def dynamics(self, state: TeamState):
        return task_dynamics(state, stack_of(self.subtasks, state), self.slices, self.desired)

    def torque(self, law, state, error):
        dynamics = self.dynamics(state)
        acceleration = commanded_acceleration(law, dynamics, error, self.impedance)
        wanted = dynamics.joint_acceleration(state.v, acceleration)
        return dynamics.torque(state.v, wanted)

    def task_acceleration(self, state: TeamState, torque) -> np.ndarray:
        """d2x/dt2 of the stacked subtasks under a joint torque, from (3) and (6)."""
        task = stack_of(self.subtasks, state)
        return task.J @ self.arms.acceleration(state, torque) + task.J_rate @ state.v


CASES = [
    pytest.param({}, id="two arms"),
    pytest.param({"masses": (*UNLIKE, (2.0, 0.5))}, id="three arms, two subtasks"),
    pytest.param({"masses": (*UNLIKE, (2.0, 0.5)), "split": True}, id="three subtasks"),
    pytest.param({"desired": (np.array([2.0, 3.0]), None)}, id="one desired inertia"),
    pytest.param({"desired": (np.array([2.0, 3.0]), np.array([0.3, 1.0]))}, id="desired inertias"),
]


@pytest.mark.parametrize("keys", CASES)
def test_decoupling_matrix_makes_the_inertia_block_diagonal(keys):
    """J M^-1 Gamma is blkdiag(M_i^-1), Theorem 1, for any number of subtasks and remark 2."""
    case = Case(**keys)
    for seed in STATES:
        dynamics = case.dynamics(case.state(seed))
        decoupled = dynamics.J @ np.linalg.solve(dynamics.M, decoupling_matrix(dynamics))
        blocks = tuple(np.linalg.inv(inertia) for inertia in dynamics.inertias)
        expected = block_diagonal(dynamics, blocks)
        np.testing.assert_allclose(decoupled, expected, atol=1e-12 * np.abs(expected).max())


def test_natural_inertias_are_the_diagonal_blocks_of_the_task_inertia():
    """M_i is S_i' M S_i with J_i S_j the identity or zero, unless another is asked for."""
    case = Case(desired=(None, np.array([0.3, 1.0])))
    state = case.state(0)
    dynamics = case.dynamics(state)
    S_1 = dynamics.S[:, case.slices[0]]
    np.testing.assert_allclose(dynamics.J @ S_1, np.eye(4)[:, :2], atol=1e-12)
    np.testing.assert_allclose(dynamics.inertias[0], S_1.T @ state.M @ S_1, atol=1e-12)
    np.testing.assert_array_equal(dynamics.inertias[1], np.diag([0.3, 1.0]))


def test_corollary_gives_the_same_decoupling_matrix_for_two_subtasks():
    """Corollary 1, with (19) and (20) corrected, is Theorem 1's Gamma for p = 2."""
    case = Case()
    for seed in STATES:
        dynamics = case.dynamics(case.state(seed))
        J_1, J_2 = (dynamics.J[part] for part in case.slices)
        corollary = corollary_decoupling_matrix(dynamics.M, J_1, J_2)
        gamma = decoupling_matrix(dynamics)
        np.testing.assert_allclose(corollary, gamma, atol=1e-12 * np.abs(gamma).max())


def section_v():
    """M, J_1 and J_2 of the two point masses of Section V, 1 kg and 2 kg."""
    eye = np.eye(2)
    M = np.kron(np.diag([1.0, 2.0]), eye)
    return M, np.hstack([eye, eye]) / 2.0, np.hstack([eye, -eye])


def test_equation_20_as_printed_does_not_decouple():
    """With J M J' for J M^-1 J' the example of Section V keeps 0.125 I off the diagonal."""
    M, J_1, J_2 = section_v()

    def printed(J):
        return np.eye(4) - np.linalg.solve(M, J.T) @ np.linalg.solve(J @ M @ J.T, J)

    gamma = np.hstack([printed(J_2).T @ J_1.T, printed(J_1).T @ J_2.T])
    kept = (np.vstack([J_1, J_2]) @ np.linalg.solve(M, gamma))[:2, 2:]
    np.testing.assert_allclose(np.abs(kept), 0.125 * np.eye(2), atol=1e-15)
    corrected = np.vstack([J_1, J_2]) @ np.linalg.solve(
        M, corollary_decoupling_matrix(M, J_1, J_2)
    )
    inverses = np.diag([1 / 3, 1 / 3, 4 / 3, 4 / 3])
    np.testing.assert_allclose(corrected, inverses, atol=1e-15)


def test_inertias_of_section_v():
    """The point masses of 1 kg and 2 kg have M_c = 3 I kg and M_r = 0.75 I kg."""
    M, J_1, J_2 = section_v()
    zero = np.zeros(4)
    none = np.zeros((2, 6, 4))
    state = TeamState(
        zero, zero, M, np.zeros((4, 4)), zero, np.zeros((2, 3)), none, none, none[:, :3, :3]
    )
    slices = (slice(0, 2), slice(2, 4))
    task = SubtaskState(zero, np.vstack([J_1, J_2]), np.zeros((4, 4)))
    dynamics = task_dynamics(state, task, slices, (None, None))
    np.testing.assert_allclose(dynamics.inertias[0], 3.0 * np.eye(2), rtol=1e-14)
    np.testing.assert_allclose(dynamics.inertias[1], 0.75 * np.eye(2), rtol=1e-14)


def inertia_rates(case: Case, state: TeamState) -> list[np.ndarray]:
    """dM_i/dt by differences along the motion."""
    ends = [
        case.dynamics(case.arms.state(state.q + h * state.v, state.v)).inertias
        for h in (-STEP, STEP)
    ]
    return [(after - before) / (2 * STEP) for before, after in zip(*ends, strict=True)]


@pytest.mark.parametrize("keys", CASES)
def test_kept_coriolis_matrix_is_skew_with_the_inertia_rate(keys):
    """dM_i/dt - 2 C~_i is skew, by differences of M_i along the motion."""
    case = Case(**keys)
    for seed in STATES:
        state = case.state(seed)
        kept = subtask_coriolis(case.dynamics(state))
        for rate, C in zip(inertia_rates(case, state), kept, strict=True):
            skew = rate - 2.0 * C
            scale = max(1.0, np.abs(rate).max())
            np.testing.assert_allclose(skew, -skew.T, atol=1e-6 * scale)


def test_coriolis_matrix_of_theorem_2_is_not_skew_with_the_inertia_rate():
    """dM_i/dt - 2 C_s,ii has a symmetric part as large as dM_i/dt itself on unlike arms."""
    case = Case()
    ratios = []
    for seed in STATES:
        state = case.state(seed)
        kept = paper_subtask_coriolis(case.dynamics(state))
        for rate, C in zip(inertia_rates(case, state), kept, strict=True):
            skew = rate - 2.0 * C
            ratios.append(np.abs(skew + skew.T).max() / 2.0 / np.abs(rate).max())
    assert np.median(ratios) > 0.3


def test_whole_task_coriolis_matrix_is_skew_where_inertias_are_natural():
    """mu, which `natural` keeps, is S'(C S + M dS/dt): dLambda/dt - 2 mu is skew."""
    case = Case()
    for seed in range(10):
        state = case.state(seed)
        dynamics = case.dynamics(state)
        mu = np.column_stack([dynamics.natural_coriolis_force(axis) for axis in np.eye(4)])
        ends = [
            case.dynamics(case.arms.state(state.q + h * state.v, state.v)).inertia
            for h in (-STEP, STEP)
        ]
        skew = (ends[1] - ends[0]) / (2 * STEP) - 2.0 * mu
        np.testing.assert_allclose(skew, -skew.T, atol=1e-6 * max(1.0, np.abs(skew).max()))


@pytest.mark.parametrize("keys", CASES)
def test_coriolis_forces_are_those_of_the_matrices(keys):
    """The forces of the fast form are the products with the matrices of the plain form."""
    case = Case(**keys)
    for seed in range(10):
        dynamics = case.dynamics(case.state(seed))
        e_rate = case.error(seed).e_rate
        for force, matrices in (
            (TaskDynamics.coriolis_force, subtask_coriolis),
            (paper_coriolis_force, paper_subtask_coriolis),
        ):
            expected = block_diagonal(dynamics, matrices(dynamics)) @ e_rate
            np.testing.assert_allclose(
                force(dynamics, e_rate), expected, atol=1e-11 * max(1.0, np.abs(expected).max())
            )


def test_task_coriolis_matrix_is_that_of_the_task_accelerations():
    """M_s times the velocity part of the task acceleration is - C_s dx/dt (25)."""
    case = Case(gravity=0.0)
    state = case.state(1)
    dynamics = case.dynamics(state)
    free = case.task_acceleration(state, np.zeros(4))
    M_s = block_diagonal(dynamics, dynamics.inertias)
    x_rate = dynamics.J @ state.v
    np.testing.assert_allclose(M_s @ free, -task_coriolis(dynamics) @ x_rate, atol=1e-11)


@pytest.mark.parametrize("keys", CASES)
@pytest.mark.parametrize("law", LAWS)
def test_both_forms_of_the_torque_agree(law, keys):
    """alpha + Gamma tau~ and M a + C v + g are one torque to rounding, for every law."""
    case = Case(**keys)
    for seed in STATES:
        state = case.state(seed)
        error = case.moving_error(state, seed)
        dynamics = case.dynamics(state)
        if law == "natural":
            plain = natural_torque(dynamics, error, case.impedance)
        else:
            matrices = paper_subtask_coriolis if law == "paper" else subtask_coriolis
            plain = plain_torque(dynamics, state.v, error, case.impedance, matrices(dynamics))
        fast = case.torque(law, state, error)
        np.testing.assert_allclose(fast, plain, atol=1e-11 * np.abs(plain).max())


@pytest.mark.parametrize("keys", CASES)
def test_closed_loop_is_the_equation_promised(keys):
    """M_i e'' + (C~_i + D_i) e' + h_i(e_i) = tau~e_i + f_i under any external torque (29)."""
    case = Case(**keys)
    for seed in STATES:
        state = case.state(seed)
        error = case.moving_error(state, seed)
        dynamics = case.dynamics(state)
        external = np.random.default_rng(seed).normal(size=case.n)
        total = case.torque("noninteracting", state, error) + external
        e_rate_rate = case.task_acceleration(state, total) - error.reference_acceleration
        M_s = block_diagonal(dynamics, dynamics.inertias)
        damping = block_diagonal(dynamics, subtask_coriolis(dynamics))
        damping += np.diag(case.impedance.damping)
        left = M_s @ e_rate_rate + damping @ error.e_rate + case.impedance.force(error.e)
        right = np.linalg.solve(decoupling_matrix(dynamics), external) + error.force
        np.testing.assert_allclose(left, right, atol=1e-10 * max(1.0, np.abs(left).max()))


def test_natural_closed_loop_is_the_equation_promised():
    """Lambda e'' + (mu + D) e' + h(e) = S' tau_e + f under any external torque."""
    case = Case()
    for seed in STATES:
        state = case.state(seed)
        error = case.moving_error(state, seed)
        dynamics = case.dynamics(state)
        external = np.random.default_rng(seed).normal(size=case.n)
        total = case.torque("natural", state, error) + external
        e_rate_rate = case.task_acceleration(state, total) - error.reference_acceleration
        drift = dynamics.natural_coriolis_force(error.e_rate)
        left = dynamics.inertia @ e_rate_rate + drift + case.impedance.damping * error.e_rate
        left += case.impedance.force(error.e)
        right = dynamics.S.T @ external + error.force
        np.testing.assert_allclose(left, right, atol=1e-10 * max(1.0, np.abs(left).max()))


def test_decoupled_external_force_undoes_the_decoupling_matrix():
    """tau~e is Gamma^-1 tau_e, also with a desired inertia."""
    for desired in (None, (np.array([2.0, 3.0]), None)):
        case = Case(desired=desired)
        dynamics = case.dynamics(case.state(0))
        force = np.arange(1.0, 5.0)
        torque = decoupling_matrix(dynamics) @ force
        np.testing.assert_allclose(dynamics.decoupled_external_force(torque), force, rtol=1e-11)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("keys", CASES)
def test_input_to_one_subtask_moves_no_other_at_once(law, keys):
    """An input to one subtask leaves the others' accelerations, except under `natural`."""
    case = Case(**keys)
    crossed = 0.0
    for seed in range(10):
        state = case.state(seed)
        before, other = case.moving_error(state, seed), case.moving_error(state, seed + 50)
        for part in case.slices:
            # Velocity errors are left alone: they belong to the state that both share.
            changed = {
                name: getattr(before, name).copy()
                for name in ("e", "reference_acceleration", "force")
            }
            for name, values in changed.items():
                values[part] = getattr(other, name)[part]
            after = TaskError(
                changed["e"],
                before.e_rate,
                before.reference_velocity,
                changed["reference_acceleration"],
                changed["force"],
            )
            difference = case.task_acceleration(state, case.torque(law, state, after))
            difference -= case.task_acceleration(state, case.torque(law, state, before))
            assert np.abs(difference[part]).max() > 0.1
            difference[part] = 0.0
            crossed = max(crossed, np.abs(difference).max())
    assert crossed > 0.1 if law == "natural" else crossed < 1e-9


def follow(case: Case, law: str, references, push: np.ndarray, duration: float) -> np.ndarray:
    """Subtask values at times of a motion under a law, shape (times, n).

    Args:
        case: Arms, subtasks and gains.
        law: The law in force.
        references: Desired position, velocity, acceleration at a time and the start value.
        push: Constant external force tau~e on the subtasks.
        duration: End of the motion [s].
    """
    start = case.arms.state(np.array([0.5, 1.2, 2.4, -1.3]), np.zeros(4))
    x_0 = stack_of(case.subtasks, start).x

    def motion(t, y):
        state = case.arms.state(y[:4], y[4:])
        task = stack_of(case.subtasks, state)
        x, x_rate, x_rate_rate = references(t, x_0)
        error = TaskError(task.x - x, task.J @ state.v - x_rate, x_rate, x_rate_rate, np.zeros(4))
        external = decoupling_matrix(case.dynamics(state)) @ push
        total = case.torque(law, state, error) + external
        return np.concatenate([state.v, case.arms.acceleration(state, total)])

    y_0 = np.concatenate([start.q, np.zeros(4)])
    times = np.linspace(0.0, duration, 21)
    solved = solve_ivp(motion, (0.0, duration), y_0, "DOP853", times, rtol=1e-10, atol=1e-12)
    points = [stack_of(case.subtasks, case.arms.state(y[:4], y[4:])).x for y in solved.y.T]
    return np.array(points) - x_0


def swing(moved: slice):
    """References that swing in the coordinates `moved` and rest in the others."""

    def at(t, x_0):
        x, x_rate, x_rate_rate = x_0.copy(), np.zeros(4), np.zeros(4)
        x[moved] += 0.1 * (1.0 - np.cos(3.0 * t))
        x_rate[moved] = 0.3 * np.sin(3.0 * t)
        x_rate_rate[moved] = 0.9 * np.cos(3.0 * t)
        return x, x_rate, x_rate_rate

    return at


@pytest.mark.parametrize("led", [0, 1])
@pytest.mark.parametrize("law", ["noninteracting", "paper"])
def test_a_motion_of_one_subtask_moves_no_other(law, led):
    """A swinging reference and a push on one subtask of unlike arms leave the other still."""
    case = Case()
    moved, still = case.slices[led], case.slices[1 - led]
    push = np.zeros(4)
    push[moved] = 1.5
    way = follow(case, law, swing(moved), push, 0.8)
    assert np.abs(way[:, moved]).max() > 0.1
    assert np.abs(way[:, still]).max() < 1e-9


def test_a_push_on_one_subtask_moves_the_other_under_the_natural_law():
    """The comparison: the natural inertia of unlike arms carries a push over."""
    case = Case()
    push = np.array([1.5, 1.5, 0.0, 0.0])
    way = follow(case, "natural", swing(case.slices[0]), push, 0.8)
    assert np.abs(way[:, case.slices[1]]).max() > 1e-3


def test_references_alone_stay_apart_under_the_natural_law():
    """Starting on its references without a push, `natural` keeps them apart as well."""
    case = Case()
    way = follow(case, "natural", swing(case.slices[0]), np.zeros(4), 0.8)
    assert np.abs(way[:, case.slices[1]]).max() < 1e-9


@pytest.mark.parametrize("law", LAWS)
def test_target_equal_to_the_state_gives_the_holding_torque(law):
    """At rest on the reference the torque is gravity's alone."""
    case = Case()
    state = case.arms.state(case.state(0).q, np.zeros(4))
    torque = case.torque(law, state, TaskError(*np.zeros((5, 4))))
    assert np.abs(state.g).max() > 10.0
    np.testing.assert_allclose(torque, state.g, atol=1e-12)


def test_constant_desired_inertia_keeps_no_coriolis_matrix():
    """Remark 2: with a constant inertia C~_i is zero; the other subtask keeps its own."""
    case = Case(desired=(np.array([2.0, 3.0]), None))
    kept = subtask_coriolis(case.dynamics(case.state(0)))
    assert not kept[0].any()
    assert kept[1].any()
