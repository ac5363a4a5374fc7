# SPDX-License-Identifier: Apache-2.0
"""Generated planar arms against formulas on paper, and the scenario that leads two of them."""

from pathlib import Path

import numpy as np
import pytest
from planar_arms import PlanarArms

from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario.files import load_scenario
from noninteract_ros.scenario.rehearsal import Rehearsal
from noninteract_ros.schema import load
from noninteract_ros.team.models.planar_arm import PlanarArm
from noninteract_ros.team.team import Team

SCENARIO = Path(__file__).resolve().parents[2] / "config" / "planar_arms.yaml"
GRAVITY = 9.81
LENGTHS, MASSES = (0.7, 0.4), (3.0, 1.2)


def block(**keys) -> PlanarArm:
    given = {"link_lengths": list(LENGTHS), "link_masses": list(MASSES)} | keys
    return load(PlanarArm, given, "arm")


def team_with(block: PlanarArm) -> Team:
    """A team whose first robot is the arm in question."""
    return Team([block.build("arm"), block.build("other")], (0.0, 0.0, -GRAVITY))


class Formulas:
    """Two links of which one has mass m, length l, centre of mass at r and inertia I about it."""

    def __init__(self, location: str) -> None:
        share = {"rod": 0.5, "tip": 1.0}[location]
        (self.l_1, self.l_2), (self.m_1, self.m_2) = LENGTHS, MASSES
        self.r_1, self.r_2 = share * self.l_1, share * self.l_2
        spread = {"rod": 1.0 / 12.0, "tip": 0.0}[location]
        self.I_1, self.I_2 = spread * self.m_1 * self.l_1**2, spread * self.m_2 * self.l_2**2

    def M(self, q):
        mixed = self.m_2 * self.l_1 * self.r_2 * np.cos(q[1])
        far = self.I_2 + self.m_2 * self.r_2**2
        near = self.I_1 + self.m_1 * self.r_1**2 + self.m_2 * self.l_1**2
        return np.array([[near + far + 2.0 * mixed, far + mixed], [far + mixed, far]])

    def velocity_force(self, q, v):
        h = self.m_2 * self.l_1 * self.r_2 * np.sin(q[1])
        return np.array([-h * v[1] * (2.0 * v[0] + v[1]), h * v[0] ** 2])

    def gravity(self, q):
        outer = self.m_2 * self.r_2 * np.cos(q[0] + q[1])
        inner = (self.m_1 * self.r_1 + self.m_2 * self.l_1) * np.cos(q[0])
        return GRAVITY * np.array([inner + outer, outer])

    def tool(self, q):
        """Tool point and its Jacobian, in the plane."""
        a, b = q[0], q[0] + q[1]
        point = self.l_1 * np.array([np.cos(a), np.sin(a)]) + self.l_2 * np.array(
            [np.cos(b), np.sin(b)]
        )
        outer = self.l_2 * np.array([-np.sin(b), np.cos(b)])
        inner = self.l_1 * np.array([-np.sin(a), np.cos(a)])
        return point, np.column_stack([inner + outer, outer])


@pytest.mark.parametrize("location", ["rod", "tip"])
@pytest.mark.parametrize("plane", ["xy", "xz", "yz"])
def test_dynamics_and_kinematics_are_those_on_paper(location, plane):
    """M, C v, g, tool and Jacobian of two links agree with the closed form in each plane."""
    team, formulas = team_with(block(mass_location=location, plane=plane)), Formulas(location)
    rows = ["xyz".index(axis) for axis in plane]
    rng = np.random.default_rng(0)
    for _ in range(20):
        q, v = rng.uniform(-3.0, 3.0, 4), rng.normal(size=4)
        state = team.state(q, v)
        np.testing.assert_allclose(state.M[:2, :2], formulas.M(q), atol=1e-13)
        np.testing.assert_allclose(
            (state.C @ v)[:2], formulas.velocity_force(q[:2], v[:2]), atol=1e-13
        )
        weight = formulas.gravity(q) if plane != "xy" else np.zeros(2)
        np.testing.assert_allclose(state.g[:2], weight, atol=1e-13)
        point, J = formulas.tool(q)
        np.testing.assert_allclose(state.tool_positions[0][rows], point, atol=1e-14)
        np.testing.assert_allclose(state.tool_jacobians[0][rows, :2], J, atol=1e-14)


def test_the_arms_of_the_derivations_can_be_made():
    """Links of 0.5 m with masses at their tips are the arms of the derivations."""
    closed = PlanarArms()
    keys = {"link_lengths": [0.5, 0.5], "mass_location": "tip"}
    arms = [
        block(link_masses=list(masses), base_pose=[*base.tolist(), 0.0, 0.0, 0.0, 1.0], **keys)
        for masses, base in zip(closed.masses, closed.bases, strict=True)
    ]
    team = Team([arm.build(f"arm_{i}") for i, arm in enumerate(arms)])
    ours = closed.random_state(np.random.default_rng(1))
    theirs = team.state(ours.q, ours.v)
    for name in ("M", "g", "tool_positions", "tool_jacobians", "tool_jacobian_rates"):
        np.testing.assert_allclose(getattr(theirs, name), getattr(ours, name), atol=1e-12)
    np.testing.assert_allclose(theirs.C @ ours.v, ours.C @ ours.v, atol=1e-12)


@pytest.mark.parametrize(
    ("keys", "axes"),
    [
        ({}, ("x", "y")),
        ({"plane": "xz"}, ("x", "z")),
        ({"plane": "yz"}, ("y", "z")),
        ({"base_pose": [0.0, 0.0, 0.0, 0.5**0.5, 0.0, 0.0, 0.5**0.5]}, ("x", "z")),
        ({"link_lengths": [0.3, 0.2, 0.1], "link_masses": [1.0, 1.0, 1.0]}, ("x", "y")),
    ],
)
def test_axes_are_those_of_the_plane_in_the_world(keys, axes):
    """The tool translates along the plane's axes, turned with the base; rounding adds none."""
    assert block(**keys).build("arm").axes == axes


def test_joints_turn_without_a_limit_that_is_not_asked_for():
    """Positions, speeds and torques are unlimited by default, and names count the joints."""
    team = team_with(block())
    assert team.joint_names == ("arm/joint_1", "arm/joint_2", "other/joint_1", "other/joint_2")
    assert np.isinf(team.effort_limits).all()
    assert np.isinf(team.velocity_limits).all()
    np.testing.assert_array_equal(team.position_limits, [[-np.inf] * 4, [np.inf] * 4])


@pytest.mark.parametrize(
    ("keys", "key", "found", "allowed"),
    [
        ({"link_lengths": []}, "link_lengths", "an empty list", "1 or more"),
        ({"link_lengths": [0.0, 1.0]}, "link_lengths", "[0.0, 1.0]", "> 0"),
        ({"link_masses": [1.0]}, "link_masses", "[1.0]", "2 numbers"),
        ({"mass_location": "middle"}, "mass_location", "'middle'", "rod | tip"),
        ({"plane": "zx"}, "plane", "'zx'", "xz"),
        ({"initial_position": [1.0]}, "initial_position", "[1.0]", "'joint_2'"),
        ({"brake_damping": [1.0, 1.0, 1.0]}, "brake_damping", "[1.0, 1.0, 1.0]", "1 number, or 2"),
        ({"base_pose": [0.0, 0.0]}, "base_pose", "[0.0, 0.0]", "x y z qx qy qz qw"),
        ({"base_pose": [0.0] * 6 + [0.9]}, "base_pose", "length 0.9", "length 1"),
    ],
)
def test_a_wrong_key_is_named_with_what_is_allowed(keys, key, found, allowed):
    """Every error has the full key, what was found and what is allowed."""
    with pytest.raises(ScenarioError) as caught:
        block(**keys).build("arm")
    assert caught.value.key == f"arm.{key}"
    assert found in str(caught.value.found)
    assert allowed in caught.value.allowed


def test_the_scenario_keeps_the_grasp_on_its_circle():
    """Leading the pair moves the grasp by a few micrometres, far from any singularity."""
    rehearsal = Rehearsal(load_scenario(SCENARIO))
    history = rehearsal.run(4.0)
    error = np.abs(history.x - history.desired)
    assert np.linalg.norm(history.x_rate[:, :2], axis=1).max() > 0.49
    assert error[:, 2:].max() < 1e-5
    assert error[:, :2].max() < 1e-4
    for q, v in zip(history.q[::100], history.v[::100], strict=True):
        J = rehearsal.stack.evaluate(rehearsal.team.state(q, v)).J
        assert np.linalg.svd(J, compute_uv=False).min() > 0.15
    assert (np.abs(history.torque) < rehearsal.team.effort_limits).all()
    assert (np.abs(history.v) < rehearsal.team.velocity_limits).all()
