# SPDX-License-Identifier: Apache-2.0
"""Walls: multipliers, rows, who gives way, the barrier; each by an independent route."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from spatial_arms import random_state, spatial_team

from noninteract_ros.arrays import Array
from noninteract_ros.control.fast.kernels.active_set import multipliers
from noninteract_ros.control.law.team_dynamics import DenseEvaluator, Evaluation
from noninteract_ros.control.walls.barrier import barrier_push
from noninteract_ros.control.walls.mobility import FIRM, giving_way, row_scales
from noninteract_ros.control.walls.rows import PAIRS, SPEED_TIME, JointRows, pair_rows
from noninteract_ros.control.walls.settings import WallSettings
from noninteract_ros.control.walls.state import WALLS_AT_START
from noninteract_ros.control.walls.walls import Walls
from noninteract_ros.subtasks.kinds.cooperative_pose import CooperativePose
from noninteract_ros.subtasks.kinds.relative_pose import RelativePose
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.geometry.bodies import link_bodies
from noninteract_ros.team.geometry.clearance import Clearances, CollisionGeometry
from noninteract_ros.team.geometry.obstacles import CapsuleObstacle
from noninteract_ros.team.models.point_mass import PointMass
from noninteract_ros.team.team import Team, TeamState

SETTINGS, WIDE = WallSettings(), WallSettings(margin=0.3)
PERIOD = 0.001


def random_problem(rng: np.random.Generator, rows: int, n: int = 8) -> tuple[Array, Array, Array]:
    """Weights W, rows C and demands, feasible or not."""
    root = rng.normal(size=(n, n))
    return root @ root.T / n + 0.1 * np.eye(n), rng.normal(size=(rows, n)), rng.normal(size=rows)


@pytest.mark.parametrize("rows", [1, 4, 8, 20])
def test_multipliers_meet_the_conditions_of_optimality(rows: int) -> None:
    """l >= 0, G l >= demand, and each row has its demand met exactly or does not push."""
    rng = np.random.default_rng(rows)
    for _ in range(30):
        W, C, demand = random_problem(rng, rows)
        G = C @ W @ C.T
        scale = 1.0 / np.sqrt(np.diag(G))
        G = G * scale[:, None] * scale + 1e-7 * np.eye(rows)
        found = np.maximum(rng.normal(size=rows), 0.0)  # Any start gives the same.
        assert multipliers(G, demand, found)
        left = G @ found - demand
        assert found.min() >= 0.0
        size = 1.0 + np.abs(found).max()
        assert left.min() >= -1e-8 * size
        assert np.abs(left * found).max() <= 1e-8 * size**2


def test_the_nearest_acceleration_is_that_of_a_general_solver() -> None:
    """Multipliers give the same point as SLSQP on the primal problem."""
    rng = np.random.default_rng(3)
    for _ in range(5):
        W, C, demand = random_problem(rng, 4)
        a = rng.normal(size=8)
        found = np.zeros(4)
        multipliers(C @ W @ C.T, demand - C @ a, found)
        inverse = np.linalg.inv(W)
        best = minimize(
            lambda x, a=a, inverse=inverse: float((x - a) @ inverse @ (x - a)),
            a,
            method="SLSQP",
            constraints={"type": "ineq", "fun": lambda x, C=C, demand=demand: C @ x - demand},
            options={"maxiter": 300, "ftol": 1e-14},
        )
        assert a + W @ C.T @ found == pytest.approx(best.x, abs=1e-5)


def test_an_approach_ends_at_the_margin() -> None:
    """With a = b at every instant the gap falls like exp(-k t) and never turns negative."""
    settings = WallSettings(margin=0.1, rate=20.0)
    gap, rate, step = 0.3, -5.0, 1e-4
    lowest = gap
    for _ in range(20000):
        found = Clearances(
            np.array([0]),
            np.array([gap + 0.1]),
            np.zeros((1, 2, 3)),
            np.zeros((1, 3)),
            np.ones((1, 1)),
            np.array([rate]),
            np.zeros(1),
            gap,
        )
        acceleration = float(pair_rows(found, np.array([0.1]), settings.rate).b[0])
        gap += step * rate + 0.5 * step**2 * acceleration
        rate += step * acceleration
        lowest = min(lowest, gap)
    assert lowest >= -1e-9
    assert gap == pytest.approx(0.0, abs=1e-6)


def team_with_limits() -> Team:
    """Two arms whose joints have limits of position and speed."""
    robots = list(spatial_team().robots)
    for robot in robots:
        robot.model.upperPositionLimit = np.full(robot.model.nq, 3.0)
        robot.model.lowerPositionLimit = np.full(robot.model.nq, -3.0)
        robot.model.upperVelocityLimit = np.full(robot.model.nv, 2.0)
        robot.model.lowerVelocityLimit = np.full(robot.model.nv, -2.0)
    return Team(robots)


def test_a_joint_beyond_its_speed_is_braked_and_one_inside_a_margin_is_not_thrown_out() -> None:
    """Rows ask for the speed's excess back in SPEED_TIME; at the start none asks for anything."""
    team = team_with_limits()
    start = team.joints_from_configuration(team.q0)
    start[0] = 2.95  # Inside the margin of 0.1.
    rows = JointRows(team, SETTINGS, start)
    still = rows.at(start, np.zeros(team.n))
    assert (still.b <= 1e-12).all()
    v = np.zeros(team.n)
    v[3] = 2.0
    fast = rows.at(start, v)
    worst = int(fast.b.argmax())
    assert fast.b[worst] == pytest.approx((2.0 - 0.9 * 2.0) / SPEED_TIME)
    assert fast.C[worst, 3] == -1.0


def stack_of(team: Team) -> SubtaskStack:
    """Pose of the grasp and pose between the tools."""
    lead = CooperativePose("cooperative_pose").build("lead", team, {})
    grasp = RelativePose("relative_pose").build("grasp", team, {"lead": lead})
    return SubtaskStack(team, [lead, grasp])


def test_mobilities_add_up_and_a_firm_order_hardly_moves() -> None:
    """All orders alike give M^-1; with a firm grasp a push moves it by 1e-8 of what it would."""
    team = spatial_team()
    stack = stack_of(team)
    rng = np.random.default_rng(0)
    lead, grasp = (np.arange(part.start, part.stop) for part in stack.slices)
    for _ in range(10):
        state = random_state(team, rng)
        J, M_inverse = stack.evaluate(state).J, np.linalg.inv(state.M)
        scales = row_scales(J, M_inverse)
        alike = giving_way(J, M_inverse, [np.arange(team.n)], scales)
        assert np.abs(alike - M_inverse).max() <= 1e-12 * np.abs(M_inverse).max()
        W = giving_way(J, M_inverse, [grasp, lead], scales)
        assert pytest.approx(W.T, abs=1e-12) == W
        assert np.linalg.eigvalsh(W).min() > 0.0
        push = rng.normal(size=team.n)
        moved = (J @ W @ push)[grasp] / scales[grasp]
        alone = (J @ M_inverse @ push)[grasp] / scales[grasp]
        assert np.abs(moved).max() <= 10.0 / FIRM * np.abs(alone).max() + 1e-9


def scene() -> tuple[CollisionGeometry, Team]:
    """Two spatial arms and a post between them."""
    team = spatial_team()
    post = CapsuleObstacle(start=(0.4, 0.35, 0.0), end=(0.45, 0.4, 1.0), radius=0.05).body("post")
    bodies = [body for robot in team.robots for body in link_bodies(robot, [], team)]
    return CollisionGeometry(team, [*bodies, post]), team


def test_the_barrier_pushes_by_the_gradient_of_its_potential() -> None:
    """Without motion its torque is -dV/dq, found by differences of V with the same stiffness."""
    geometry, team = scene()
    rng = np.random.default_rng(1)
    step, still = 1e-6, np.zeros(team.n)
    M_inverse = np.linalg.inv(team.state(team.q0, still).M)
    for _ in range(5):
        q = random_state(team, rng).q
        found = geometry.evaluate(q, still)
        begins = np.where(found.distances < 0.2, found.distances + 0.01, 0.0)
        pushed = barrier_push(found, begins, M_inverse, {}, 1e4, PERIOD)
        assert pushed.stiffness

        def potential(direction: Array, q: Array = q, pushed=pushed, begins=begins) -> float:
            there = geometry.evaluate(team.integrate(q, direction), still)
            return barrier_push(there, begins, M_inverse, pushed.stiffness, 1e4, PERIOD).potential

        direction = rng.normal(size=team.n)
        slope = (potential(step * direction) - potential(-step * direction)) / (2.0 * step)
        assert pushed.torque @ direction == pytest.approx(-slope, rel=1e-3, abs=1e-6)


def test_the_barrier_s_damping_takes_energy_and_never_pulls() -> None:
    """At any velocity the push beyond -dV/dq takes power, and a row's push is not negative."""
    geometry, team = scene()
    rng = np.random.default_rng(4)
    for _ in range(20):
        state = random_state(team, rng)
        M_inverse = np.linalg.inv(state.M)
        found = geometry.evaluate(state.q, state.v)
        begins = found.distances + 0.01
        moving = barrier_push(found, begins, M_inverse, {}, 1e4, PERIOD)
        still = replace(found, rates=np.zeros_like(found.rates))
        resting = barrier_push(still, begins, M_inverse, moving.stiffness, 1e4, PERIOD)
        assert state.v @ (moving.torque - resting.torque) <= 1e-12


def seen(stack: SubtaskStack, team: Team, state: TeamState) -> Evaluation:
    """The state as a controller evaluates it."""
    inertias = (None,) * len(stack.subtasks)
    return DenseEvaluator(team, stack).evaluate(state.q, state.v, inertias)


def walls(orders: tuple[int, int] = (1, 0)) -> tuple[Walls, SubtaskStack, Team]:
    """Walls of two spatial arms beside a post."""
    geometry, team = scene()
    stack = stack_of(team)
    return Walls(team, stack, orders, geometry, WIDE, PERIOD), stack, team


@pytest.mark.parametrize("sigma", [0.0, 0.4, 1.0])
def test_forces_lead_to_an_acceleration_within_the_walls(sigma: float) -> None:
    """For any request all rows hold after the walls' forces, at any sigma."""
    found, stack, team = walls()
    rng = np.random.default_rng(7)
    pushed = 0
    for _ in range(20):
        state = random_state(team, rng, 0.2)
        view = found.view(seen(stack, team, state), WALLS_AT_START)
        wanted = 500.0 * rng.normal(size=team.n)
        forces = found.forces(view, wanted, sigma, WALLS_AT_START)
        a = wanted + view.M_inverse @ (forces.passive - view.barrier.torque + forces.paid)
        size = 1.0 + np.abs(view.rows.b).max() + np.abs(a).max()
        assert (view.rows.C @ a - view.rows.b).min() >= -1e-5 * size
        pushed += forces.active > 0
        again = found.forces(view, wanted, sigma, forces.state)
        assert again.passive == pytest.approx(forces.passive, rel=1e-6, abs=1e-6)
    assert pushed > 5


def test_without_sigma_walls_push_along_their_normals_and_nobody_pays() -> None:
    """At sigma = 0 the force is C'l, and takes power from every approach."""
    found, stack, team = walls()
    rng = np.random.default_rng(8)
    for _ in range(20):
        state = random_state(team, rng, 0.2)
        view = found.view(seen(stack, team, state), WALLS_AT_START)
        wanted = 500.0 * rng.normal(size=team.n)
        forces = found.forces(view, wanted, 0.0, WALLS_AT_START)
        assert not forces.paid.any()
        keys = dict(zip(view.rows.labels.tolist(), view.rows.C, strict=True))
        along = sum(
            (value * keys[key] for key, value in forces.state.multipliers.items()),
            np.zeros(team.n),
        )
        assert forces.passive == pytest.approx(along + view.barrier.torque, rel=1e-9, abs=1e-6)


def test_far_from_everything_walls_do_nothing_to_the_bit() -> None:
    """Two masses far apart get no force at all."""
    masses = [PointMass(1.0, initial_position=(x, 0.0)).build(f"m{x}") for x in (0, 3)]
    team = Team(masses)
    bodies = [body for robot in team.robots for body in link_bodies(robot, [], team)]
    stack = _positions(team)
    found = Walls(team, stack, (1, 0), CollisionGeometry(team, bodies), SETTINGS, PERIOD)
    state = team.state(team.q0, np.full(team.n, 0.3))
    view = found.view(seen(stack, team, state), WALLS_AT_START)
    forces = found.forces(view, np.ones(team.n), 1.0, WALLS_AT_START)
    assert not forces.passive.any()
    assert not forces.paid.any()
    assert forces.active == 0


def test_two_masses_that_are_led_into_each_other_stop_at_the_margin() -> None:
    """Head on at 1 m/s with a force behind, held torques: never nearer than the margin."""
    masses = [PointMass(m, initial_position=(x, 0.0)).build(f"m{x}") for m, x in ((1, 0), (4, 1))]
    team = Team(masses)
    bodies = [body for robot in team.robots for body in link_bodies(robot, [], team)]
    stack = _positions(team)
    found = Walls(team, stack, (1, 0), CollisionGeometry(team, bodies), SETTINGS, PERIOD)
    q, v, kept = team.q0.copy(), np.array([1.0, 0.0, -1.0, 0.0]), WALLS_AT_START
    torque = np.array([5.0, 0.0, -5.0, 0.0])
    nearest = np.inf
    for _ in range(3000):
        state = team.state(q, v)
        view = found.view(seen(stack, team, state), kept)
        a = view.M_inverse @ torque
        forces = found.forces(view, a, 0.0, kept)
        kept = forces.state
        a = a + view.M_inverse @ forces.passive
        q, v = q + PERIOD * v + 0.5 * PERIOD**2 * a, v + PERIOD * a
        nearest = min(nearest, float(q[2] - q[0]))
    assert nearest >= SETTINGS.margin - 1e-3
    assert np.abs(v[[0, 2]] - v[[0, 2]].mean()).max() < 1e-3
    assert PAIRS in kept.multipliers


def _positions(team: Team) -> SubtaskStack:
    from noninteract_ros.subtasks.kinds.cooperative_position import CooperativePosition
    from noninteract_ros.subtasks.kinds.relative_position import RelativePosition

    lead = CooperativePosition("cooperative_position").build("lead", team)
    gap = RelativePosition("relative_position").build("gap", team)
    return SubtaskStack(team, [lead, gap])
