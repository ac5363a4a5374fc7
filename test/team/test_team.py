# SPDX-License-Identifier: Apache-2.0
"""The team's model: inertia, Coriolis, gravity, tools and their derivatives."""

import numpy as np
import pytest
from planar_arms import PlanarArms, arm

from noninteract_ros.errors import TeamError
from noninteract_ros.team.models.point_mass import PointMass
from noninteract_ros.team.team import Team

STEP = 1e-6


def masses() -> Team:
    """Point masses of one, two and three axes with different masses."""
    return Team(
        [
            PointMass(1.0, axes=("z",)).build("a"),
            PointMass(2.5, axes=("y", "x")).build("b"),
            PointMass(0.4, axes=("x", "y", "z")).build("c"),
        ]
    )


def arms() -> Team:
    """Two different spatial arms of three joints, with Coriolis and gravity terms."""
    return Team(
        [
            arm("left", 1.0, 0.7, 0.5, axes="zyz", start=(0.1, 0.2, 0.3)),
            arm("right", 3.0, 2.0, 1.0, axes="yzy", start=(0.4, -0.8, 1.0)),
        ]
    )


TEAMS = [pytest.param(masses, id="masses"), pytest.param(arms, id="arms")]


def random_state(team: Team, seed: int = 3):
    rng = np.random.default_rng(seed)
    return team.integrate(team.q0, rng.normal(size=team.n)), rng.normal(size=team.n)


def along_motion(team: Team, q, v, quantity):
    """Time derivative of a quantity of the state while the team moves with v."""
    zero = np.zeros(team.n)
    after = quantity(team.state(team.integrate(q, STEP * v), zero))
    before = quantity(team.state(team.integrate(q, -STEP * v), zero))
    return (after - before) / (2.0 * STEP)


@pytest.mark.parametrize("build", TEAMS)
def test_inertia_is_symmetric_positive_definite_and_block_diagonal(build):
    """M is exactly symmetric and positive-definite, and no robot's inertia touches another's."""
    team = build()
    M = team.state(*random_state(team)).M
    np.testing.assert_array_equal(M, M.T)
    assert np.linalg.eigvalsh(M).min() > 1e-3
    for i, rows in enumerate(team.velocity_slices):
        for j, columns in enumerate(team.velocity_slices):
            assert i == j or not M[rows, columns].any()


def test_inertia_of_point_masses_is_their_mass():
    """Each axis of a point mass has its mass as inertia, whatever the axes and their order."""
    M = masses().state(*random_state(masses())).M
    np.testing.assert_allclose(M, np.diag([1.0, 2.5, 2.5, 0.4, 0.4, 0.4]), atol=1e-15)


@pytest.mark.parametrize("build", TEAMS)
def test_inertia_rate_minus_twice_coriolis_is_skew(build):
    """dM/dt, by differences along the motion, minus 2 C is skew (2)."""
    team = build()
    q, v = random_state(team)
    skew = along_motion(team, q, v, lambda state: state.M) - 2.0 * team.state(q, v).C
    np.testing.assert_allclose(skew, -skew.T, atol=1e-8)


def test_the_arms_have_coriolis_forces():
    """The skewness above is not that of a zero Coriolis matrix."""
    team = arms()
    assert np.abs(team.state(*random_state(team)).C).max() > 0.1


@pytest.mark.parametrize("build", TEAMS)
def test_gravity_is_the_gradient_of_the_potential_energy(build):
    """g(q) is the derivative of the weights' potential energy."""
    team = build()
    q, v = random_state(team)
    zero = np.zeros(team.n)

    def potential(step):
        return team.mechanical_energy(team.integrate(q, step), zero)

    gradient = [
        (potential(STEP * axis) - potential(-STEP * axis)) / (2 * STEP) for axis in np.eye(team.n)
    ]
    np.testing.assert_allclose(team.state(q, v).g, gradient, atol=1e-7)
    np.testing.assert_allclose(team.gravity(q), gradient, atol=1e-7)


def test_gravity_has_the_direction_of_the_scenario():
    """Gravity pulls each mass along its own axes with its weight."""
    robots = [PointMass(2.0, axes=("z", "x")).build("a"), PointMass(3.0).build("b")]
    state = Team(robots, (1.0, 0.0, -9.0)).state(np.zeros(4), np.zeros(4))
    np.testing.assert_allclose(state.g, [18.0, -2.0, -3.0, 0.0], atol=1e-14)


@pytest.mark.parametrize("build", TEAMS)
def test_tool_jacobians_and_rates_are_derivatives(build):
    """Tool Jacobians are the derivative of points and rotations, their rates that of theirs."""
    team = build()
    q, v = random_state(team)
    state = team.state(q, v)
    speed = along_motion(team, q, v, lambda other: other.tool_positions)
    np.testing.assert_allclose(state.tool_jacobians[:, :3] @ v, speed, atol=1e-8)
    rate = along_motion(team, q, v, lambda other: other.tool_jacobians)
    np.testing.assert_allclose(state.tool_jacobian_rates, rate, atol=1e-8)
    R = team.tool_rotations(q)
    R_rate = team.tool_rotations(team.integrate(q, STEP * v))
    R_rate = (R_rate - team.tool_rotations(team.integrate(q, -STEP * v))) / (2 * STEP)
    spin = R_rate @ R.transpose(0, 2, 1)
    omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1)
    np.testing.assert_allclose(state.tool_jacobians[:, 3:] @ v, omega, atol=1e-8)


@pytest.mark.parametrize("build", TEAMS)
def test_forward_and_inverse_dynamics_agree_with_the_matrices(build):
    """M a + C v + g is the inverse dynamics, and forward dynamics undoes it."""
    team = build()
    q, v = random_state(team)
    a = np.random.default_rng(5).normal(size=team.n)
    state = team.state(q, v)
    torque = state.M @ a + state.C @ v + state.g
    np.testing.assert_allclose(team.inverse_dynamics(q, v, a), torque, atol=1e-12)
    np.testing.assert_allclose(team.forward_dynamics(q, v, torque), a, atol=1e-10)


@pytest.mark.parametrize("build", TEAMS)
def test_wrenches_do_the_work_of_their_joint_torque(build):
    """The joint torque of tool wrenches has their power at any velocity."""
    team = build()
    q, v = random_state(team)
    state = team.state(q, v)
    wrenches = np.random.default_rng(7).normal(size=(len(team.names), 6))
    power = np.sum(wrenches * (state.tool_jacobians @ v))
    assert team.external_torque(state, wrenches) @ v == pytest.approx(power, rel=1e-12)


@pytest.mark.parametrize("build", TEAMS)
def test_tool_wrenches_reproduce_a_torque_and_are_the_smallest(build):
    """The reported wrenches have the joint torque asked for, and none smaller has it."""
    team = build()
    state = team.state(*random_state(team))
    torque = np.random.default_rng(9).normal(size=team.n)
    wrenches = team.tool_wrenches(state, torque)
    np.testing.assert_allclose(team.external_torque(state, wrenches), torque, atol=1e-10)
    for wrench, J, part in zip(wrenches, state.tool_jacobians, team.velocity_slices, strict=True):
        smallest = np.linalg.pinv(J[:, part].T) @ torque[part]
        np.testing.assert_allclose(wrench, smallest, atol=1e-10)


def test_states_do_not_share_memory():
    """A state keeps its numbers when the team computes the next one."""
    team = arms()
    first = team.state(*random_state(team))
    names = ("M", "C", "g", "tool_positions", "tool_jacobians", "tool_jacobian_rates")
    kept = {name: getattr(first, name).copy() for name in names}
    team.state(*random_state(team, seed=4))
    for name in names:
        np.testing.assert_array_equal(getattr(first, name), kept[name])


def test_closed_form_arms_agree_with_pinocchio():
    """The closed-form arms that other tests rely on have the dynamics that Pinocchio finds."""
    closed = PlanarArms(gravity=9.81)
    team = Team(closed.robots(), (0.0, -9.81, 0.0))
    for seed in range(5):
        ours = closed.random_state(np.random.default_rng(seed))
        theirs = team.state(ours.q, ours.v)
        np.testing.assert_allclose(ours.M, theirs.M, atol=1e-12)
        np.testing.assert_allclose(ours.C @ ours.v, theirs.C @ ours.v, atol=1e-12)
        np.testing.assert_allclose(ours.g, theirs.g, atol=1e-12)
        np.testing.assert_allclose(
            ours.tool_positions - closed.bases, theirs.tool_positions, atol=1e-12
        )
        np.testing.assert_allclose(ours.tool_jacobians, theirs.tool_jacobians, atol=1e-12)
        np.testing.assert_allclose(
            ours.tool_jacobian_rates, theirs.tool_jacobian_rates, atol=1e-12
        )


def test_names_positions_and_brakes_come_from_the_robots():
    """Joints are named after robot and axis; positions and brakes follow in the same order."""
    team = Team(
        [
            PointMass(1.0, axes=("y",), initial_position=(3.0,), brake_damping=7.0).build("p"),
            PointMass(1.0, axes=("z", "x"), initial_position=(4.0, 5.0)).build("q"),
        ]
    )
    assert team.joint_names == ("p/y", "q/z", "q/x")
    np.testing.assert_array_equal(team.q0, [3.0, 4.0, 5.0])
    np.testing.assert_array_equal(team.brake_damping, [7.0, 20.0, 20.0])
    points = team.state(team.q0, np.zeros(3)).tool_positions
    np.testing.assert_allclose(points, [[0.0, 3.0, 0.0], [5.0, 0.0, 4.0]], atol=1e-15)


@pytest.mark.parametrize(
    ("names", "words"),
    [(["solo"], ["at least 2", "found 1", "solo"]), (["a", "b", "a"], ["unique name", "'a'"])],
)
def test_one_robot_or_a_name_twice_is_refused(names, words):
    """A team of one, or with two robots of one name, is refused with what was found."""
    with pytest.raises(TeamError) as caught:
        Team([PointMass(1.0).build(name) for name in names])
    assert all(word in str(caught.value) for word in words)


def test_an_unknown_robot_is_named():
    """Asking for a robot that is not there names it and those that are."""
    with pytest.raises(TeamError, match=r"'d'.*\['a', 'b', 'c'\]"):
        masses().index("d")
    assert masses().index("c") == 2
