# SPDX-License-Identifier: Apache-2.0
"""Limits, armature, friction, brakes and continuous joints."""

import numpy as np
import pinocchio as pin
import pytest

from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario import Scenario
from noninteract_ros.schema import load
from noninteract_ros.team.joined_model import append_model
from noninteract_ros.team.models.planar_arm import PlanarArm
from noninteract_ros.team.models.point_mass import PointMass
from noninteract_ros.team.robot import Robot
from noninteract_ros.team.team import Team

STEP = 1e-6
RATE = 1000.0
ARM = {"model": "planar_arm", "link_lengths": [0.5, 0.5], "link_masses": [1.0, 1.0]}
MASS = {"model": "point_mass", "mass": 2.0}
SUBTASKS = {
    "subtasks": ["cooperative", "relative"],
    "cooperative": {"kind": "cooperative_position", "stiffness": [1.0], "damping": [1.0]},
    "relative": {"kind": "relative_position", "stiffness": [1.0], "damping": [1.0]},
}


def scenario(one: dict, other: dict, **keys) -> Scenario:
    """Scenario of two robots and their subtasks."""
    values = {"robots": ["one", "other"], "one": one, "other": other, "rate": RATE}
    return Scenario.from_dict(values | SUBTASKS | keys)


def simulation(one: dict, other: dict, **keys):
    given = scenario(one, other, **keys)
    team = given.build_team()
    return given.build_simulation(team, given.build_stack(team))


def arm(name: str, **keys) -> Robot:
    return load(PlanarArm, ARM | keys, name).build(name)


def mass(name: str, **keys) -> Robot:
    return load(PointMass, MASS | keys, name).build(name)


def turning_robot(name: str, start: float = 0.3) -> Robot:
    """A continuous joint between two prismatic ones, each with a mass."""
    model = pin.Model()
    parent = 0
    place = pin.SE3(np.eye(3), np.array([0.2, 0.1, 0.0]))
    for number, joint in enumerate((pin.JointModelPX(), pin.JointModelRUBZ(), pin.JointModelPY())):
        parent = model.addJoint(parent, joint, place, f"joint_{number + 1}")
        body = pin.Inertia(1.5, np.array([0.1, 0.2, 0.0]), 0.1 * np.eye(3))
        model.appendBodyToJoint(parent, body, pin.SE3.Identity())
    model.addFrame(pin.Frame("tool", parent, place, pin.FrameType.OP_FRAME))
    q = np.array([0.1, np.cos(start), np.sin(start), -0.2])
    return Robot(name, model, "tool", q, ("x", "y"), 1.0)


def turning_team() -> Team:
    return Team([mass("m"), turning_robot("a"), turning_robot("b", -2.0)])


def full_inertia(team: Team, q) -> np.ndarray:
    M = pin.crba(team.model, team.model.createData(), q)
    return np.triu(M) + np.triu(M, 1).T


def test_limits_are_those_of_the_scenario():
    """One number counts for all joints, a list for each; without one there is no limit."""
    team = Team(
        [
            arm("a", effort_limit=[50.0, 20.0], velocity_limit=[2.0], upper_limit=[1.0, 2.0]),
            mass("m", effort_limit=[7.0], lower_limit=[-3.0], upper_limit=[4.0, 5.0]),
        ]
    )
    np.testing.assert_array_equal(team.effort_limits, [50.0, 20.0, 7.0, 7.0])
    np.testing.assert_array_equal(team.velocity_limits, [2.0, 2.0, np.inf, np.inf])
    np.testing.assert_array_equal(
        team.position_limits, [[-np.inf, -np.inf, -3.0, -3.0], [1.0, 2.0, 4.0, 5.0]]
    )


def test_brakes_are_per_joint():
    """Each joint of an arm has the brake that the scenario gives it."""
    team = Team([arm("a", brake_damping=[3.0, 1.0]), mass("m", brake_damping=7.0)])
    np.testing.assert_array_equal(team.brake_damping, [3.0, 1.0, 7.0, 7.0])


@pytest.mark.parametrize("keys", [MASS, ARM], ids=["mass", "arm"])
@pytest.mark.parametrize(
    ("key", "value", "found", "allowed"),
    [
        ("effort_limit", [1.0, 2.0, 3.0], "[1.0, 2.0, 3.0]", "1 number, or 2"),
        ("effort_limit", [0.0], "[0.0]", "> 0"),
        ("velocity_limit", [-1.0], "[-1.0]", "> 0"),
        ("velocity_limit", 1.0, "1.0", "a list of numbers"),
        ("friction", [-1.0], "[-1.0]", ">= 0"),
        ("armature", [1.0] * 5, "[1.0, 1.0", "1 number, or 2"),
        ("initial_position", [0.0, 0.0, 0.0], "[0.0, 0.0, 0.0]", "2 numbers"),
    ],
)
def test_a_wrong_key_is_named_with_what_is_allowed(keys, key, value, found, allowed):
    """Every error has the full key, what was found and what is allowed."""
    with pytest.raises(ScenarioError) as caught:
        scenario(keys | {key: value}, MASS)
    assert caught.value.key == f"one.{key}"
    assert found in str(caught.value.found)
    assert allowed in caught.value.allowed


def test_limits_that_cross_are_refused():
    """A lowest position above the highest one names the joint and both."""
    with pytest.raises(ScenarioError, match=r"one\.upper_limit: found -1 for joint_2.*>= 0"):
        scenario(ARM | {"lower_limit": [0.0], "upper_limit": [1.0, -1.0]}, MASS)


@pytest.mark.parametrize(
    ("start", "found"), [([0.5, 2.5], "2.5 for joint_2"), ([], "0 for joint_1 by default")]
)
def test_a_start_beyond_the_limits_is_refused(start, found):
    """The initial position has to respect each joint's limits, also the one by default."""
    keys = {"lower_limit": [0.2], "upper_limit": [1.0, 2.0], "initial_position": start}
    with pytest.raises(ScenarioError, match=rf"one\.initial_position: found {found}, .*limits"):
        scenario(ARM | keys, MASS)


def test_a_start_on_a_limit_is_allowed():
    """The limit itself is within the limits."""
    robot = arm("a", upper_limit=[0.1, 0.2], initial_position=[0.1, 0.2])
    np.testing.assert_array_equal(robot.initial_position, [0.1, 0.2])


def test_armature_stands_on_the_diagonal_of_the_inertia_and_nowhere_else():
    """M gains the rotors' inertia; C, g and the tools stay as they are."""
    bare = Team([arm("a"), mass("m"), arm("b")])
    geared = Team([arm("a", armature=[0.3, 0.1]), mass("m", armature=[0.5]), arm("b")])
    rng = np.random.default_rng(0)
    q, v = rng.normal(size=6), rng.normal(size=6)
    without, with_it = bare.state(q, v), geared.state(q, v)
    rotors = np.diag([0.3, 0.1, 0.5, 0.5, 0.0, 0.0])
    np.testing.assert_allclose(with_it.M, without.M + rotors, atol=1e-14)
    for name in ("C", "g", "tool_positions", "tool_jacobians", "tool_jacobian_rates"):
        np.testing.assert_array_equal(getattr(with_it, name), getattr(without, name))


def test_all_of_pinocchio_agrees_on_the_armature():
    """Forward and inverse dynamics and kinetic energy have the armature that M has."""
    team = Team([arm("a", armature=[0.3, 0.1], plane="xz"), mass("m", axes=["x", "z"])])
    rng = np.random.default_rng(1)
    q, v, a = rng.normal(size=(3, 4))
    state = team.state(q, v)
    torque = state.M @ a + state.C @ v + state.g
    np.testing.assert_allclose(team.inverse_dynamics(q, v, a), torque, atol=1e-13)
    np.testing.assert_allclose(team.forward_dynamics(q, v, torque), a, atol=1e-12)
    np.testing.assert_allclose(full_inertia(team, q), state.M, atol=1e-14)
    kinetic = team.mechanical_energy(q, v) - team.mechanical_energy(q, np.zeros(4))
    assert kinetic == pytest.approx(0.5 * v @ state.M @ v, rel=1e-12)


def test_appending_a_model_keeps_armature_and_damping():
    """Both parts keep armature and damping, which Pinocchio's appendModel drops."""
    one, other = arm("a", armature=[0.3], friction=[0.1, 0.2]), mass("m", armature=[0.5])
    other.model.frames[other.model.nframes - 1].name = "end"
    joined = append_model(one.model, other.model, pin.SE3.Identity())
    np.testing.assert_array_equal(joined.armature, [0.3, 0.3, 0.5, 0.5])
    np.testing.assert_array_equal(joined.damping, [0.1, 0.2, 0.0, 0.0])


def test_the_controller_does_not_know_the_friction():
    """Torques of the law come from M, C and g, which are those without friction."""
    bare, rubbing = (Team([arm("a", friction=d), mass("m")]) for d in ([], [4.0, 2.0]))
    rng = np.random.default_rng(2)
    q, v, a = rng.normal(size=(3, 4))
    np.testing.assert_array_equal(rubbing.friction, [4.0, 2.0, 0.0, 0.0])
    for name in ("M", "C", "g"):
        np.testing.assert_array_equal(
            getattr(rubbing.state(q, v), name), getattr(bare.state(q, v), name)
        )
    np.testing.assert_array_equal(
        rubbing.inverse_dynamics(q, v, a), bare.inverse_dynamics(q, v, a)
    )
    np.testing.assert_array_equal(
        rubbing.forward_dynamics(q, v, a), bare.forward_dynamics(q, v, a)
    )


def test_friction_slows_a_mass_exponentially():
    """m dv/dt = -d v, on its own and while another robot is pushed, under zero torque."""
    push = {"robot": "other", "start": 0.25, "duration": 0.25, "force": [3.0, 0.0, 0.0]}
    plant = simulation(MASS | {"friction": [6.0, 0.0]}, MASS, pushes=["shove"], shove=push)
    plant.v = np.array([1.0, 1.0, 0.0, 0.0])
    for _ in range(500):
        plant.step(np.zeros(4))
    np.testing.assert_allclose(plant.v, [np.exp(-1.5), 1.0, 0.375, 0.0], atol=1e-12)


def test_friction_and_brake_add_up():
    """Without commands the brake works on top of the friction."""
    plant = simulation(MASS | {"friction": [6.0], "brake_damping": 10.0}, MASS)
    plant.v = np.array([1.0, 0.0, 0.0, 0.0])
    for _ in range(100):
        plant.step(None)
    assert plant.v[0] == pytest.approx(np.exp(-0.8), abs=1e-10)


def test_friction_takes_its_power_from_the_energy():
    """The energy loss of a coupled arm is the integral of v' d v, by Simpson's rule."""
    friction = np.array([0.4, 0.2, 0.0, 0.3])
    plant = simulation(
        ARM | {"friction": [0.4, 0.2], "plane": "xz"},
        ARM | {"friction": [0.0, 0.3], "plane": "xz", "armature": [0.05]},
    )
    plant.v = np.array([2.0, -3.0, 1.0, 4.0])
    team = plant.team
    before = team.mechanical_energy(plant.q, plant.v)
    power = [float(friction @ plant.v**2)]
    for _ in range(600):
        plant.step(np.zeros(4))
        power.append(float(friction @ plant.v**2))
    lost = (power[0] + power[-1] + 4 * sum(power[1:-1:2]) + 2 * sum(power[2:-1:2])) / 3 / RATE
    assert lost > 1.0
    assert before - team.mechanical_energy(plant.q, plant.v) == pytest.approx(lost, abs=1e-8)


def test_joint_positions_pass_unchanged_where_they_are_the_configuration():
    """Teams without continuous joints convert nothing, not even by a copy."""
    team = Team([arm("a"), mass("m")])
    q = np.arange(4.0)
    assert team.configuration_from_joints(q) is q
    assert team.joints_from_configuration(q) is q
    np.testing.assert_array_equal(team.difference(q, 3.0 * q), 2.0 * q)


def test_continuous_joints_have_one_angle_each():
    """n counts joints, positions are one number per joint, and the round trip is exact."""
    team = turning_team()
    assert team.n == len(team.joint_names) == 8
    assert team.q0.shape == (10,)
    np.testing.assert_allclose(
        team.joints_from_configuration(team.q0), [0.0, 0.0, 0.1, 0.3, -0.2, 0.1, -2.0, -0.2]
    )
    rng = np.random.default_rng(3)
    for _ in range(50):
        positions = rng.uniform(-np.pi, np.pi, 8)
        q = team.configuration_from_joints(positions)
        np.testing.assert_allclose(team.joints_from_configuration(q), positions, atol=1e-15)


def test_any_angle_comes_in_and_a_wrapped_one_goes_out():
    """Full turns make no difference, and half a turn is +pi, never -pi."""
    team = turning_team()
    for angle, wrapped in [
        (0.5 + 6 * np.pi, 0.5),
        (-0.5 - 4 * np.pi, -0.5),
        (np.pi, np.pi),
        (-np.pi, np.pi),
        (-np.nextafter(np.pi, 0.0), -np.nextafter(np.pi, 0.0)),
    ]:
        positions = np.zeros(8)
        positions[3] = angle
        out = team.joints_from_configuration(team.configuration_from_joints(positions))
        assert out[3] == pytest.approx(wrapped, abs=1e-14)
        assert -np.pi < out[3] <= np.pi


def test_integration_passes_half_a_turn():
    """A joint that turns steadily goes on beyond pi, and its configuration stays a rotation."""
    team = turning_team()
    q, step = team.q0, np.zeros(8)
    step[3] = 0.01
    for _ in range(2000):
        q = team.integrate(q, step)
    angle = team.joints_from_configuration(q)[3]
    assert angle == pytest.approx((0.3 + 20.0 + np.pi) % (2.0 * np.pi) - np.pi, abs=1e-11)
    assert np.hypot(q[3], q[4]) == pytest.approx(1.0, abs=1e-12)


def test_difference_takes_the_shortest_way_over_the_wrap():
    """From 3.1 to -3.1 rad is a small step forward; integration undoes the difference."""
    team = turning_team()
    positions = np.zeros(8)
    positions[3] = 3.1
    start = team.configuration_from_joints(positions)
    positions[3] = -3.1
    end = team.configuration_from_joints(positions)
    way = team.difference(start, end)
    np.testing.assert_allclose(way[3], 2.0 * np.pi - 6.2, atol=1e-14)
    np.testing.assert_allclose(team.integrate(start, way), end, atol=1e-14)


def test_dynamics_do_not_depend_on_full_turns():
    """M, C, g and tools are the same full turns away, and derivatives hold across the wrap."""
    team = turning_team()
    rng = np.random.default_rng(4)
    positions, v = rng.normal(size=8), rng.normal(size=8)
    positions[3] = np.pi
    q = team.configuration_from_joints(positions)
    state = team.state(q, v)
    turned = positions.copy()
    turned[3] += 4.0 * np.pi
    other = team.state(team.configuration_from_joints(turned), v)
    for name in ("M", "C", "g", "tool_positions", "tool_jacobians"):
        np.testing.assert_allclose(getattr(other, name), getattr(state, name), atol=1e-13)
    ahead = team.state(team.integrate(q, STEP * v), v)
    behind = team.state(team.integrate(q, -STEP * v), v)
    M_rate = (ahead.M - behind.M) / (2 * STEP)
    skew = M_rate - 2.0 * state.C
    np.testing.assert_allclose(skew, -skew.T, atol=1e-8)
    speed = (ahead.tool_positions - behind.tool_positions) / (2 * STEP)
    np.testing.assert_allclose(state.tool_jacobians[:, :3] @ v, speed, atol=1e-8)
