# SPDX-License-Identifier: Apache-2.0
"""Poses of teams of spatial arms: values, exact differentials, frames, and rejected settings."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from spatial_arms import random_state, spatial_arm, spatial_team

from noninteract_ros.errors import ScenarioError, SubtaskError
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.kinds.cooperative_pose import CooperativeOrientation, CooperativePose
from noninteract_ros.subtasks.kinds.cooperative_position import CooperativePosition
from noninteract_ros.subtasks.kinds.posture import Posture
from noninteract_ros.subtasks.kinds.relative_pose import RelativeOrientation, RelativePose
from noninteract_ros.subtasks.kinds.relative_position import RelativePosition
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.subtasks.team_rotation import TeamRotation
from noninteract_ros.team.models.point_mass import PointMass
from noninteract_ros.team.team import Team, TeamState

STEP = 1e-6
STATES = 25


def lead(**keys) -> CooperativePose:
    return CooperativePose("cooperative_pose", **keys)


def turn(**keys) -> CooperativeOrientation:
    return CooperativeOrientation("cooperative_orientation", **keys)


def grasp(**keys) -> RelativePose:
    return RelativePose("relative_pose", **keys)


def pair(**keys) -> RelativeOrientation:
    return RelativeOrientation("relative_orientation", **keys)


def distance(**keys) -> RelativePosition:
    return RelativePosition("relative_position", **keys)


def built(block, team: Team, frame=None) -> Subtask:
    """A subtask, with the one that gives its frame built before as `lead`."""
    giver = (frame or lead(alignment="start")).build("lead", team, {})
    return block.build("task", team, {"lead": giver})


STAR = ("arm_2", "arm_1", "arm_2", "arm_3")
UNEQUAL = (3.0, 1.0, 0.5)
CASES = [
    pytest.param(2, lead(), None, id="midpoint"),
    pytest.param(2, lead(alignment="start"), None, id="midpoint from the start"),
    pytest.param(2, lead(weights=(3.0, 1.0), axes=("z", "x")), None, id="unequal weights"),
    pytest.param(3, lead(), None, id="mean of three"),
    pytest.param(3, turn(weights=UNEQUAL, alignment="start"), None, id="weighted orientation"),
    pytest.param(3, turn(weights=(0.0, 1.0, 0.0)), None, id="one leads"),
    pytest.param(2, grasp(), None, id="relative in the world"),
    pytest.param(2, grasp(frame="lead"), None, id="relative to the midpoint"),
    pytest.param(3, grasp(frame="lead", edges=STAR), lead(weights=UNEQUAL), id="star, mean"),
    pytest.param(3, grasp(frame="lead", axes=("y", "x")), None, id="chosen axes of the frame"),
    pytest.param(3, pair(frame="lead", alignment="start"), turn(), id="relative orientation"),
    pytest.param(3, pair(edges=STAR), None, id="relative orientation in the world"),
    pytest.param(3, distance(frame="lead", axes=("z", "x")), turn(), id="turning formation"),
]


@pytest.mark.parametrize(("count", "block", "frame"), CASES)
def test_jacobian_and_rate_are_derivatives(count, block, frame):
    """J v is the velocity of the value along the motion and J_rate the rate of J, by differences.

    The frame's own turning is part of both.
    """
    team = spatial_team(count)
    task = built(block, team, frame)
    rng = np.random.default_rng(5)
    for _ in range(STATES):
        here = random_state(team, rng)
        before, after = (
            task.evaluate(team.state(team.integrate(here.q, h * here.v), here.v))
            for h in (-STEP, STEP)
        )
        found = task.evaluate(here)
        assert found.x.shape == (task.size,)
        assert found.J.shape == found.J_rate.shape == (task.dim, team.n)
        velocity = task.difference(after.x, before.x) / (2 * STEP)
        np.testing.assert_allclose(found.J @ here.v, velocity, atol=2e-8)
        np.testing.assert_allclose(found.J_rate, (after.J - before.J) / (2 * STEP), atol=5e-8)


@pytest.mark.parametrize(("count", "block", "frame"), CASES)
def test_each_column_of_the_jacobian_is_a_derivative(count, block, frame):
    """Every column of J, by differences along one joint, at rest."""
    team = spatial_team(count)
    task = built(block, team, frame)
    state = random_state(team, np.random.default_rng(8))
    J = task.evaluate(state).J
    for k, axis in enumerate(np.eye(team.n)):
        before, after = (
            task.evaluate(team.state(team.integrate(state.q, h * axis), 0.0 * axis)).x
            for h in (-STEP, STEP)
        )
        slope = task.difference(after, before) / (2 * STEP)
        np.testing.assert_allclose(J[:, k], slope, atol=2e-9)


def rotations_of(task: Subtask, state: TeamState) -> Rotation:
    x = task.evaluate(state).x
    return Rotation.from_quat(x[task.layout.quaternions])


def test_mean_orientation_is_scipy_s_midpoint_and_its_condition():
    """Half-way on the geodesic for two; for more the weighted rotation vectors cancel."""
    rng = np.random.default_rng(1)
    two, three = spatial_team(2), spatial_team(3)
    state = random_state(two, rng)
    first, second = Rotation.from_matrix(state.tool_rotations)
    midpoint = Rotation.from_rotvec(0.5 * (second * first.inv()).as_rotvec()) * first
    found = rotations_of(built(lead(), two), state)[0]
    np.testing.assert_allclose(found.as_matrix(), midpoint.as_matrix(), atol=1e-14)
    state = random_state(three, rng)
    found = rotations_of(built(turn(weights=UNEQUAL), three), state)[0]
    apart = (Rotation.from_matrix(state.tool_rotations) * found.inv()).as_rotvec()
    np.testing.assert_allclose(np.array(UNEQUAL) @ apart, np.zeros(3), atol=1e-13)


def test_midpoint_and_mean_of_two_are_the_same():
    """The closed form for two equal weights is what the implicit equation gives."""
    team = spatial_team(2)
    rng = np.random.default_rng(2)
    closed, implicit = (TeamRotation(np.array([0.5, 0.5]), None) for _ in range(2))
    implicit._halfway = False
    for _ in range(STATES):
        state = random_state(team, rng, 1.0)
        one, other = closed.evaluate(state), implicit.evaluate(state)
        for name in ("value", "J", "J_rate"):
            np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=1e-10)


def turned(state: TeamState, R: np.ndarray) -> TeamState:
    """The state with the whole team turned about the origin of the world, as one body."""
    return replace(
        state,
        tool_positions=state.tool_positions @ R.T,
        tool_rotations=R @ state.tool_rotations,
    )


@pytest.mark.parametrize("count", [2, 3])
def test_a_team_that_turns_as_one_body_keeps_its_grasp(count):
    """In the cooperative frame nothing changes; the cooperative orientation turns along."""
    team = spatial_team(count)
    state = random_state(team, np.random.default_rng(3))
    R = Rotation.from_rotvec([0.9, -1.4, 0.4])
    whole = turned(state, R.as_matrix())
    for block in (grasp(frame="lead"), distance(frame="lead"), pair(frame="lead")):
        # Offsets are on the tools' side, so the frame must turn with the tools.
        task = built(block, team, lead())
        moved = task.difference(task.evaluate(whole).x, task.evaluate(state).x)
        np.testing.assert_allclose(moved, np.zeros(task.dim), atol=1e-13)
    leading = built(lead(), team)
    before, after = (rotations_of(leading, item)[0] for item in (state, whole))
    np.testing.assert_allclose((after * before.inv()).as_matrix(), R.as_matrix(), atol=1e-13)
    np.testing.assert_allclose(
        leading.evaluate(whole).x[:3], R.apply(leading.evaluate(state).x[:3]), atol=1e-14
    )
    fixed = built(grasp(), team)
    assert np.abs(fixed.difference(fixed.evaluate(whole).x, fixed.evaluate(state).x)).max() > 0.1


def test_relative_rotation_leads_from_the_second_to_the_first():
    """In the world R_a = E R_b; in the frame, the same in its axes."""
    team = spatial_team(2)
    state = random_state(team, np.random.default_rng(4))
    a, b = Rotation.from_matrix(state.tool_rotations)
    world = rotations_of(built(pair(), team), state)[0]
    np.testing.assert_allclose((world * b).as_matrix(), a.as_matrix(), atol=1e-14)
    giver = lead()
    c = rotations_of(built(giver, team), state)[0]
    seen = rotations_of(built(pair(frame="lead"), team, giver), state)[0]
    np.testing.assert_allclose((c * seen * c.inv()).as_matrix(), world.as_matrix(), atol=1e-14)


def test_counted_from_the_start_every_orientation_is_the_identity_there():
    """With `start` the value at the initial configuration is no turn at all."""
    team = spatial_team(3)
    state = team.state(team.q0, np.zeros(team.n))
    giver = turn(alignment="start")
    for block in (giver, grasp(alignment="start"), pair(alignment="start", frame="lead")):
        angles = rotations_of(built(block, team, giver), state).magnitude()
        np.testing.assert_allclose(angles, 0.0, atol=1e-7)


def opposite() -> Team:
    """Two arms alike whose tools face opposite ways."""
    arms = [spatial_arm("left"), spatial_arm("right", base=(1.0, 0.0, 0.0), heading=np.pi - 0.02)]
    return Team(arms)


def test_tools_that_face_each_other_need_another_alignment():
    """Half a turn apart there is no midpoint: the error names `start`, which then works."""
    team = opposite()
    with pytest.raises(ScenarioError, match=r"task\.alignment: found 'tools', with tools 89 deg"):
        lead().build("task", team)
    task = built(lead(alignment="start"), team)
    state = random_state(team, np.random.default_rng(0))
    assert np.isfinite(task.evaluate(state).J_rate).all()


def test_a_midpoint_that_jumps_stays_bounded():
    """As the tools pass half a turn apart the midpoint jumps, with bounded J and J_rate."""
    rotation = TeamRotation(np.array([0.5, 0.5]), None)
    team = opposite()
    state = team.state(team.q0, np.ones(team.n))
    for angle in np.pi + np.array([-1e-3, -1e-9, 0.0, 1e-9, 1e-3]):
        R = Rotation.from_rotvec(angle * np.array([0.6, 0.0, 0.8])).as_matrix()
        first = state.tool_rotations[0]
        apart = replace(state, tool_rotations=np.array([first, R @ first]))
        found = rotation.evaluate(apart)
        # |J_c| <= (1 + tan(pi / 4)) |J_k|.
        largest = np.linalg.norm(state.tool_jacobians[:, 3:], axis=(1, 2)).max()
        assert np.linalg.norm(found.J) <= 2.0 * largest
        assert np.isfinite(found.J_rate).all()
        np.testing.assert_allclose(found.value[0] @ found.value[0].T, np.eye(3), atol=1e-14)


def test_a_team_is_led_and_grasped_without_internal_motion():
    """Poses and, for seven joints, a posture make a square Jacobian of full rank."""
    for axes, joints in (("zyzyzy", ()), ("zyzyzyz", ("arm_1/joint_1", "arm_2/joint_1"))):
        team = spatial_team(2, axes)
        first = lead().build("lead", team)
        parts = [first, grasp(frame="lead").build("grasp", team, {"lead": first})]
        if joints:
            parts.append(Posture("posture", joints).build("posture", team))
        stack = SubtaskStack(team, parts)
        assert stack.layout.size == stack.layout.dim + 2
        assert stack.value_slices[1] == slice(7, 14)
        assert stack.slices[1] == slice(6, 12)
        state = random_state(team, np.random.default_rng(6))
        other = random_state(team, np.random.default_rng(7))
        x, x_d = stack.evaluate(state).x, stack.evaluate(other).x
        e = stack.difference(x, x_d)
        for task, part, own in zip(parts, stack.slices, stack.value_slices, strict=True):
            np.testing.assert_array_equal(e[part], task.difference(x[own], x_d[own]))


def test_orientations_of_robots_that_do_not_turn_are_found_by_rank():
    """Assumption 3 names the subtask that the team cannot reach."""
    team = spatial_team(2, "zyz")
    first = turn().build("lead", team)
    second = pair().build("pair", team)
    SubtaskStack(team, [first, second])
    stuck = Team([spatial_arm("a", axes="zzz"), spatial_arm("b", axes="zzz")])
    parts = [turn().build("lead", stuck), pair().build("pair", stuck)]
    with pytest.raises(SubtaskError, match=r"rank 2 of 6 .*lead 1 of 3, pair 1 of 3"):
        SubtaskStack(stuck, parts)


def test_posture_is_the_joints_that_it_names():
    """Values are joint coordinates, in the order of the names."""
    team = spatial_team(2)
    joints = ("arm_2/joint_3", "arm_1/joint_5")
    task = Posture("posture", joints).build("task", team)
    state = random_state(team, np.random.default_rng(0))
    found = task.evaluate(state)
    assert (task.elements, task.axes, task.size, task.dim) == (joints, ("x",), 2, 2)
    np.testing.assert_array_equal(found.x, state.q[[8, 4]])
    np.testing.assert_array_equal(found.J @ state.v, state.v[[8, 4]])
    assert not found.J_rate.any()


def test_each_coordinate_has_its_unit():
    """Positions in metres, rotations in radians, joints as they slide or turn."""
    mixed = Team([spatial_arm("arm"), PointMass(1.0, axes=("x", "y")).build("mass")])
    slides = Posture("posture", ("mass/y", "arm/joint_2", "mass/x")).build("task", mixed)
    assert slides.units == ("m", "rad", "m")
    assert mixed.units == ("rad",) * 6 + ("m",) * 2
    found = slides.magnitudes(np.array([[-0.3, 0.2, 0.4], [0.0, -0.5, 0.0]]))
    np.testing.assert_array_equal(found["m"], [[0.3, 0.4], [0.0, 0.0]])
    np.testing.assert_array_equal(found["rad"], [[0.2], [0.5]])
    team = spatial_team(2)
    assert turn().build("lead", team).units == ("rad",) * 3
    task = lead().build("lead", team)
    assert task.units == ("m",) * 3 + ("rad",) * 3
    found = task.magnitudes(np.array([3.0, 0.0, 4.0, 0.0, 0.6, 0.8]))
    assert {unit: sizes.tolist() for unit, sizes in found.items()} == {"m": [5.0], "rad": [1.0]}


@pytest.mark.parametrize(
    ("block", "key", "words"),
    [
        (grasp(frame="lead"), "frame", ["found 'lead'", "allowed: world"]),
        (distance(frame="place"), "frame", ["found 'place'", "world | other"]),
        (grasp(edges=("arm_1",)), "edges", ["pairs of different robots"]),
        (lead(weights=(1.0,)), "weights", ["2 numbers"]),
        (lead(axes=("x", "x")), "axes", ["different ones"]),
        (Posture("posture", ()), "joints", ["found []", "arm_1/joint_1"]),
        (Posture("posture", ("arm_1/joint_1",) * 2), "joints", ["different ones"]),
        (Posture("posture", ("arm_1/joint_9",)), "joints", ["'arm_1/joint_9'", "arm_2/joint_6"]),
    ],
)
def test_what_does_not_fit_the_team_is_refused(block, key, words):
    """The error has the full key, what was found and what the team allows."""
    team = spatial_team(2)
    others = {
        "place": CooperativePosition("cooperative_position").build("place", team),
        "other": turn().build("other", team),
    }
    with pytest.raises(ScenarioError) as caught:
        block.build("task", team, others)
    assert caught.value.key == f"task.{key}"
    assert all(word in str(caught.value) for word in words)


def test_values_have_unit_quaternions():
    """At any state, x is a value of its layout."""
    team = spatial_team(3)
    task = built(grasp(frame="lead"), team)
    for seed in range(5):
        x = task.evaluate(random_state(team, np.random.default_rng(seed), 3.0)).x
        np.testing.assert_allclose(task.layout.checked(x), x, atol=1e-15)
        np.testing.assert_allclose(
            so3.normalized(x[task.layout.quaternions]), x[task.layout.quaternions], atol=1e-15
        )
