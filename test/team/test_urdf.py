# SPDX-License-Identifier: Apache-2.0
"""Robots from URDF: dynamics, bases, locked and continuous joints, limits, and what is refused."""

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from planar_arms import UNLIKE, PlanarArms

from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario.files import load_scenario
from noninteract_ros.schema import load
from noninteract_ros.subtasks.kinds.posture import Posture
from noninteract_ros.team.models import urdf_files as urdf_files
from noninteract_ros.team.models.planar_arm import PlanarArm
from noninteract_ros.team.models.point_mass import PointMass
from noninteract_ros.team.models.urdf_robot import UrdfRobot
from noninteract_ros.team.robot import Robot
from noninteract_ros.team.team import Team

STEP = 1e-6
SNIPPETS = st.sampled_from(
    [
        "", "<", ">", "/>", '"', "&", "&#0;", "&lt;", "<!--", "-->", "<![CDATA[", "]]>", "</link>",
        "<robot>", "</robot>", '<link name="upper"/>', "<mimic/>", "<inertial/>", "<limit/>", "é",
        "0", "-1", "1,0", "1e300", "nan", "inf", " 1 2", "upper", "shoulder", "tip", "continuous",
        "fixed", "prismatic", "floating", "<x>" * 500, "9" * 400, "\x00", "\ud800", "<?xml ?>",
    ]
)  # fmt: skip
PANDA = "example-robot-data/panda_description/urdf/panda.urdf"
UR5 = "package://example-robot-data/robots/ur_description/urdf/ur5_robot.urdf"
KINOVA = "example-robot-data/kinova_description/robots/kinova.urdf"
FINGERS = ["panda_finger_joint1", "panda_finger_joint2"]
READY = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]
QUARTER = 0.5**0.5  # sine and cosine of half a quarter turn


def link(name: str, mass: float, x: float) -> str:
    inertia = 'ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"'
    body = f'<origin xyz="{x} 0 0"/><mass value="{mass}"/><inertia {inertia}/>'
    return f'<link name="{name}"><inertial>{body}</inertial></link>'


def joint(name: str, kind: str, ends: tuple[str, str], x: float = 0.0, inside: str = "") -> str:
    parent, child = ends
    limit = '<limit lower="-2" upper="2.5" effort="30" velocity="4"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x} 0 0"/><axis xyz="0 0 1"/>{limit}{inside}</joint>'
    )


def planar(masses=(1.0, 1.0), kind: str = "revolute", inside: str = "") -> str:
    """Two links of 0.5 m with masses at their tips; the second joint is of a kind."""
    parts = [
        '<link name="base"/>',
        link("upper", masses[0], 0.5),
        link("lower", masses[1], 0.5),
        '<link name="tip"/>',
        joint("shoulder", "revolute", ("base", "upper")),
        joint("elbow", kind, ("upper", "lower"), 0.5, inside),
        joint("wrist", "fixed", ("lower", "tip"), 0.5),
    ]
    return f'<robot name="arm">{"".join(parts)}</robot>'


def build(name: str = "arm", **keys) -> Robot:
    given = keys if "urdf" in keys else {"urdf_text": planar()} | keys
    return load(UrdfRobot, {"tool_frame": "tip"} | given, name).build(name)


def panda(name: str = "panda", **keys) -> Robot:
    return build(
        name,
        **{
            "urdf": PANDA,
            "tool_frame": "panda_hand_tcp",
            "locked_joints": FINGERS,
            "initial_position": READY,
        }
        | keys,
    )


def mixed_team() -> Team:
    """A Panda, a UR5 elsewhere and turned, and a point mass; rotors and all."""
    ur5 = build("ur5", urdf=UR5, tool_frame="tool0", base_pose=[1, 0, 0.2, 0, 0, QUARTER, QUARTER])
    geared = panda(armature=[0.2] * 4 + [0.1] * 3, base_pose=[0, 0.5, 0, 0, 0, 0, 1])
    return Team([geared, ur5, PointMass(2.0, axes=("x", "y", "z")).build("ball")])


def random_state(team: Team, rng: np.random.Generator):
    return team.integrate(team.q0, rng.uniform(-1.0, 1.0, team.n)), rng.normal(size=team.n)


def test_urdf_arms_have_the_closed_form_dynamics():
    """M, C v, g, tools and Jacobians of two URDF arms at their bases are those on paper."""
    closed = PlanarArms(gravity=9.81)
    robots = [
        build(f"arm_{i}", urdf_text=planar(masses), base_pose=[*base, 0.0, 0.0, 0.0, 1.0])
        for i, (masses, base) in enumerate(
            zip(UNLIKE, [base.tolist() for base in closed.bases], strict=True)
        )
    ]
    team = Team(robots, (0.0, -9.81, 0.0))
    for seed in range(10):
        ours = closed.random_state(np.random.default_rng(seed))
        theirs = team.state(ours.q, ours.v)
        for name in ("M", "g", "tool_positions", "tool_jacobians", "tool_jacobian_rates"):
            np.testing.assert_allclose(getattr(theirs, name), getattr(ours, name), atol=1e-12)
        np.testing.assert_allclose(theirs.C @ ours.v, ours.C @ ours.v, atol=1e-12)


def test_file_and_text_give_the_same_robot(tmp_path, monkeypatch):
    """A path from the working directory, an absolute one, a package's and the text are one."""
    folder = tmp_path / "share" / "my_robots" / "urdf"
    folder.mkdir(parents=True)
    (folder / "arm.urdf").write_text(planar())
    monkeypatch.chdir(folder)
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path}")
    text = build().model
    for urdf in ("arm.urdf", str(folder / "arm.urdf"), "package://my_robots/urdf/arm.urdf"):
        assert build(urdf=urdf).model == text


def test_names_are_prefixed_by_the_robot():
    """Joints are called <robot>/<joint>, in the order of the robots, without locked ones."""
    team = mixed_team()
    assert team.n == 7 + 6 + 3
    assert team.joint_names[:2] == ("panda/panda_joint1", "panda/panda_joint2")
    assert team.joint_names[7] == "ur5/shoulder_pan_joint"
    assert team.joint_names[-3:] == ("ball/x", "ball/y", "ball/z")
    assert not any("finger" in name for name in team.joint_names)
    assert [part.stop - part.start for part in team.velocity_slices] == [7, 6, 3]


def test_two_robots_of_one_urdf_differ_by_name_and_base():
    """Two robots of one URDF do not conflict, and the second tool is at its own base."""
    turned = [0.8, 0.0, 0.1, 0.0, 0.0, 1.0, 0.0]  # half a turn about z
    team = Team([panda("left"), panda("right", base_pose=turned)])
    points = team.state(team.q0, np.zeros(team.n)).tool_positions
    np.testing.assert_allclose(points[1], np.array([0.8, 0, 0.1]) + points[0] * [-1, -1, 1])


def test_base_pose_moves_all_and_turns_the_weight():
    """Positions and rotations follow the base; gravity stays in the world."""
    team = Team(
        [build("a"), build("b", base_pose=[0.1, -0.2, 0.3, QUARTER, 0.0, 0.0, QUARTER])],
        (0.0, 0.0, -9.81),
    )
    q = np.array([0.3, 0.7, 0.3, 0.7])
    state = team.state(q, np.zeros(4))
    x, y, _ = state.tool_positions[0]
    np.testing.assert_allclose(state.tool_positions[1], [0.1 + x, -0.2, 0.3 + y], atol=1e-14)
    R = team.tool_rotations(q)
    upright = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    np.testing.assert_allclose(R[1], upright @ R[0], atol=1e-14)
    closed = PlanarArms(((1.0, 1.0), (1.0, 1.0)), gravity=9.81).state(q, np.zeros(4))
    np.testing.assert_allclose(state.g, [0.0, 0.0, *closed.g[2:]], atol=1e-12)


def test_a_rounded_quaternion_is_taken_as_a_unit_one():
    """Four digits are enough; the rotation is exact nevertheless."""
    robot = build(base_pose=[0, 0, 0, 0, 0, 0.7071, 0.7071])
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    np.testing.assert_allclose(robot.base_pose.rotation, quarter, atol=1e-15)


def test_locked_joints_weigh_but_do_not_move():
    """A Panda with locked fingers has the dynamics of the whole one whose fingers are at rest."""
    path = urdf_files.read_urdf("panda.urdf", PANDA)
    whole = pin.buildModelFromXML(path)
    data = whole.createData()
    team = Team([panda(locked_positions=[0.03, 0.01]), PointMass(1.0).build("m")])
    rng = np.random.default_rng(5)
    for _ in range(10):
        q, v = random_state(team, rng)
        state = team.state(q, v)
        full_q, full_v = np.append(q[:7], [0.03, 0.01]), np.append(v[:7], [0.0, 0.0])
        M = pin.crba(whole, data, full_q)[:7, :7]
        np.testing.assert_allclose(np.triu(state.M[:7, :7]), np.triu(M), atol=1e-12)
        bias = pin.nonLinearEffects(whole, data, full_q, full_v)[:7]
        np.testing.assert_allclose((state.C @ v + state.g)[:7], bias, atol=1e-11)
        tool = whole.getFrameId("panda_hand_tcp")
        J = pin.computeFrameJacobian(whole, data, full_q, tool, pin.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(state.tool_jacobians[0][:, :7], J[:, :7], atol=1e-12)


def test_one_locked_position_counts_for_all():
    """Fingers are opened by one number, as lists of joints are everywhere."""
    both, one = (panda(locked_positions=width) for width in ([0.02, 0.02], [0.02]))
    assert both.model == one.model


def test_limits_come_from_the_urdf_unless_given():
    """Efforts, velocities and positions are the URDF's; an effort given here replaces it."""
    robot = panda()
    np.testing.assert_allclose(robot.effort_limits, [87.0] * 4 + [12.0] * 3)
    np.testing.assert_allclose(robot.velocity_limits, [2.175] * 4 + [2.61] * 3)
    np.testing.assert_allclose(robot.position_limits[:, 3], [-3.0718, -0.0698])
    np.testing.assert_array_equal(panda(effort_limit=[5.0]).effort_limits, [5.0] * 7)
    np.testing.assert_array_equal(build(upper_limit=[1.0, 2.0]).position_limits[1], [1.0, 2.0])


def test_an_effort_or_speed_of_zero_in_the_urdf_is_no_limit():
    """Many files have zero there, which does not mean a joint without torque."""
    text = planar().replace('effort="30" velocity="4"', 'effort="0" velocity="0"')
    robot = build(urdf_text=text)
    assert np.isinf(robot.effort_limits).all()
    assert np.isinf(robot.velocity_limits).all()


def test_damping_in_the_urdf_is_not_used():
    """Friction is that of the scenario, and none by default."""
    damped = planar(inside='<dynamics damping="3" friction="1"/>')
    np.testing.assert_array_equal(build(urdf_text=damped).model.damping, [0.0, 0.0])
    np.testing.assert_array_equal(
        build(urdf_text=damped, friction=[0.5]).model.damping, [0.5, 0.5]
    )


def test_tool_axes_are_found():
    """A planar URDF moves along two axes of the world, a Panda along three."""
    assert build().axes == ("x", "y")
    assert build(base_pose=[0, 0, 0, QUARTER, 0, 0, QUARTER]).axes == ("x", "z")
    assert panda().axes == ("x", "y", "z")


def test_a_joint_and_a_link_of_one_name_are_no_conflict():
    """URDF allows it; the tool is the link, and the joint can be locked by its name."""
    text = planar().replace('name="wrist"', 'name="tip"').replace('name="elbow"', 'name="lower"')
    robots = [build("a", urdf_text=text), build("b", urdf_text=text, tool_frame="lower")]
    team = Team(robots)
    points = team.state(np.zeros(4), np.zeros(4)).tool_positions
    np.testing.assert_allclose(points, [[1.0, 0.0, 0.0], [0.5, 0.0, 0.0]], atol=1e-15)
    assert build(urdf_text=text, locked_joints=["lower"]).model.names[1] == "shoulder"


def test_continuous_joints_take_any_angle_and_have_no_limit():
    """A Kinova arm turns without end; its joints have one position each all the same."""
    start = [7.0, 3.0, 3.0, -9.0, 0.6, 1.0]
    robots = [
        build(name, urdf=KINOVA, tool_frame="j2s6s200_end_effector", initial_position=start)
        for name in ("left", "right")
    ]
    team = Team(robots)
    assert (team.n, len(team.q0)) == (12, 18)
    wrapped = (np.array(start) + np.pi) % (2.0 * np.pi) - np.pi
    np.testing.assert_allclose(team.joints_from_configuration(team.q0)[:6], wrapped, atol=1e-14)
    assert np.isinf(team.position_limits[:, 0]).all()
    assert np.isfinite(team.position_limits[:, 1]).all()
    check_differentials(team)


def check_differentials(team: Team) -> None:
    """Tool Jacobians and their rates, and M and C, against differences along the motion."""
    rng = np.random.default_rng(6)
    for _ in range(5):
        q, v = random_state(team, rng)
        state = team.state(q, v)
        ahead = team.state(team.integrate(q, STEP * v), v)
        behind = team.state(team.integrate(q, -STEP * v), v)
        speed = (ahead.tool_positions - behind.tool_positions) / (2 * STEP)
        np.testing.assert_allclose(state.tool_jacobians[:, :3] @ v, speed, atol=1e-8)
        rate = (ahead.tool_jacobians - behind.tool_jacobians) / (2 * STEP)
        np.testing.assert_allclose(state.tool_jacobian_rates, rate, atol=1e-8)
        skew = (ahead.M - behind.M) / (2 * STEP) - 2.0 * state.C
        np.testing.assert_allclose(skew, -skew.T, atol=1e-7)


def test_a_mixed_team_has_exact_differentials():
    """Panda, UR5 and point mass: Jacobians, their rates and skewness hold for the whole."""
    check_differentials(mixed_team())


def test_a_mixed_team_has_one_consistent_inertia():
    """M is symmetric, positive and block-diagonal by robot; forward undoes inverse dynamics."""
    team = mixed_team()
    rng = np.random.default_rng(7)
    for _ in range(5):
        q, v = random_state(team, rng)
        state, a = team.state(q, v), rng.normal(size=team.n)
        assert np.linalg.eigvalsh(state.M).min() > 1e-4
        for i, rows in enumerate(team.velocity_slices):
            for j, columns in enumerate(team.velocity_slices):
                assert i == j or not state.M[rows, columns].any()
        torque = team.inverse_dynamics(q, v, a)
        np.testing.assert_allclose(state.M @ a + state.C @ v + state.g, torque, atol=1e-11)
        np.testing.assert_allclose(team.forward_dynamics(q, v, torque), a, atol=1e-9)


def test_a_scenario_file_may_mix_models(tmp_path, monkeypatch):
    """URDF, generated arm and point mass are led by one scenario, axes those they share."""
    monkeypatch.chdir(tmp_path)
    Path("arm.urdf").write_text(planar())
    arm = {"initial_position": [0.5, 1.0]}
    values = {
        "robots": ["a", "b", "c"],
        "a": arm | {"model": "urdf", "urdf": "arm.urdf", "tool_frame": "tip"},
        "b": arm | {"model": "planar_arm", "link_lengths": [1, 1], "link_masses": [1, 1]},
        "c": {"model": "point_mass", "mass": 1.0, "axes": ["x", "y"]},
        "subtasks": ["cooperative", "relative"],
        "cooperative": {"kind": "cooperative_position", "stiffness": [9], "damping": [9]},
        "relative": {"kind": "relative_position", "stiffness": [9], "damping": [9]},
    }
    Path("mixed.yaml").write_text(yaml.safe_dump({"/**": {"ros__parameters": values}}))
    scenario = load_scenario(Path("mixed.yaml"))
    team = scenario.build_team()
    stack = scenario.build_stack(team)
    assert [task.axes for task in stack.subtasks] == [("x", "y")] * 2
    assert team.joint_names[:3] == ("a/shoulder", "a/elbow", "b/joint_1")
    known = {name for name, *_ in scenario.parameters()}
    assert {"a.urdf", "a.locked_joints", "b.plane", "c.effort_limit"} <= known


def refused(**keys) -> ScenarioError:
    with pytest.raises(ScenarioError) as caught:
        build(**keys)
    return caught.value


@pytest.mark.parametrize(
    ("keys", "key", "found", "allowed"),
    [
        ({"tool_frame": "tipp"}, "tool_frame", "'tipp'", "tip | base"),
        ({"locked_joints": ["elbo"]}, "locked_joints", "'elbo'", "elbow | shoulder"),
        ({"locked_joints": ["elbow"] * 2}, "locked_joints", "'elbow'", "each once"),
        ({"locked_joints": ["elbow", "shoulder"]}, "locked_joints", "all joints", "at least one"),
        ({"locked_joints": ["wrist"]}, "locked_joints", "'wrist'", "shoulder"),
        (
            {"locked_joints": ["elbow"], "locked_positions": [1.0, 2.0]},
            "locked_positions",
            "[1.0, 2.0]",
            "['elbow']",
        ),
        (
            {"locked_joints": ["elbow"], "locked_positions": [3.0]},
            "locked_positions",
            "3 for elbow",
            "<= 2.5",
        ),
        ({"locked_positions": [0.1]}, "locked_positions", "[0.1]", "locked_joints"),
        ({"initial_position": [0.0, 2.6]}, "initial_position", "2.6 for elbow", "<= 2.5"),
        ({"initial_position": [0.0]}, "initial_position", "[0.0]", "'shoulder', 'elbow'"),
        ({"base_pose": [0.0] * 7}, "base_pose", "length 0", "length 1"),
        ({"urdf_text": ""}, "urdf", "neither", "one of them"),
        ({"urdf": "x", "urdf_text": "y"}, "urdf", "both", "one of them"),
        ({"urdf_text": "hello"}, "urdf_text", "not XML", "a URDF"),
        ({"urdf_text": "<model/>"}, "urdf_text", "<model>", "<robot>"),
        ({"urdf_text": "<robot name='x'/>"}, "urdf_text", "parsed", "valid URDF"),
        (
            {"urdf_text": planar(kind="planar")},
            "urdf_text",
            "'elbow' of type 'planar'",
            "revolute",
        ),
        (
            {"urdf_text": planar(kind="floating")},
            "urdf_text",
            "'elbow' of type 'floating'",
            "fixed",
        ),
        ({"urdf_text": planar(kind="ball")}, "urdf_text", "'elbow' of type 'ball'", "continuous"),
        (
            {"urdf_text": planar(inside='<mimic joint="shoulder"/>')},
            "urdf_text",
            "'elbow', which mimics 'shoulder'",
            "locked_joints",
        ),
        (
            {"urdf_text": '<robot xmlns:xacro="http://ros.org/xacro"><xacro:a/></robot>'},
            "urdf_text",
            "xacro",
            "by xacro",
        ),
        (
            {"urdf_text": planar(kind="continuous"), "upper_limit": [1.0]},
            "upper_limit",
            "[1.0]",
            "continuous",
        ),
    ],
)
def test_what_cannot_be_used_is_refused_by_key(keys, key, found, allowed):
    """Every error has the full key, what was found and what is allowed."""
    error = refused(**keys)
    assert error.key == f"arm.{key}"
    assert found in str(error.found)
    assert allowed in error.allowed


def test_a_joint_that_moves_no_mass_is_refused():
    """A singular inertia would divide by zero later; armature makes it regular."""
    massless = planar((1.0, 0.0))
    error = refused(urdf_text=massless)
    assert error.key == "arm"
    assert "elbow" in error.found
    assert "armature" in error.allowed
    assert build(urdf_text=massless, armature=[0.0, 0.1]).model.nv == 2


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('<mass value="1.0"/>', '<mass value="1,0"/>', "link 'upper' with <mass value='1,0'>"),
        ('<mass value="1.0"/>', '<mass value=""/>', "link 'upper' with <mass value=''>"),
        ('<mass value="1.0"/>', '<mass value="nan"/>', "link 'upper' with <mass value='nan'>"),
        ('<mass value="1.0"/>', '<mass value="-1"/>', "link 'upper' with the mass -1"),
        ('<mass value="1.0"/>', "", "link 'upper' with <inertial> without <mass>"),
        ('ixx="0"', "", "link 'upper' with <inertia ixx=''>"),
        ('lower="-2"', 'lower="-2 rad"', "joint 'shoulder' with <limit lower='-2 rad'>"),
        ('xyz="0 0 1"', 'xyz="0 1"', "joint 'shoulder' with <axis xyz='0 1'>"),
    ],
)
def test_what_is_not_understood_is_refused(old, new, words):
    """A part that the parser of URDFs would drop or misread is an error with link or joint."""
    error = refused(urdf_text=planar().replace(old, new, 1))
    assert error.key == "arm.urdf_text"
    assert words in str(error.found)


def test_an_inertial_without_inertia_is_refused():
    """A link has no rotational inertia of 0 by omission."""
    text = re.sub("<inertia [^>]*>", "", planar(), count=1)
    assert "without <inertia>" in str(refused(urdf_text=text).found)
    text = re.sub("<inertial>.*?</inertial>", "<inertial/>", planar(), count=1)
    assert "without <mass>" in str(refused(urdf_text=text).found)


@pytest.mark.parametrize("ends", ['lower="0" upper="0"', ""])
def test_a_joint_without_range_is_refused(ends):
    """Limits that a URDF leaves out are 0; the joint would be walled in."""
    text = planar().replace('lower="-2" upper="2.5"', ends, 1)
    error = refused(urdf_text=text)
    assert error.key == "arm.lower_limit"
    assert error.found == "joint shoulder that can only be at 0"
    assert "locked_joints" in error.allowed
    ranges = {"lower_limit": [-1.0], "upper_limit": [1.0]}
    assert build(urdf_text=text, **ranges).model.nv == 2
    assert build(urdf_text=text, locked_joints=["shoulder"]).model.nv == 1


@pytest.mark.parametrize(
    "data",
    [
        planar().replace("<robot ", '<robot xmlns="http://www.ros.org" ').encode(),
        b'<?xml version="1.0" encoding="iso-8859-1"?><!-- \xe9 -->' + planar().encode(),
        b'\n <?xml version="1.0"?>' + planar().encode(),
        b"\xef\xbb\xbf" + planar().encode(),
        planar().replace("<link", "<!-- a -- b --><link", 1).encode(),
    ],
    ids=["namespace", "encoding", "leading blank", "byte order mark", "comment"],
)
def test_files_are_read_as_by_the_tools_of_robots(tmp_path, data):
    """Namespaces, declared encodings, leading blanks and any comment are accepted."""
    file = tmp_path / "arm.urdf"
    file.write_bytes(data)
    assert build(urdf=str(file)).model.nv == 2


def test_a_fixed_joint_may_mimic():
    """A fixed joint has no motion, so its <mimic> means nothing."""
    text = planar().replace('type="fixed">', 'type="fixed"><mimic joint="shoulder"/>')
    assert "mimic" in text
    assert build(urdf_text=text).model.nv == 2


def test_names_are_listed_in_order():
    """Lists of allowed names are sorted, after the closest one, and have no universe."""
    assert refused(urdf_text=planar(), tool_frame="x").allowed == (
        "base | elbow | lower | shoulder | tip | upper | wrist"
    )
    assert refused(urdf_text=planar(), locked_joints=["x"]).allowed.endswith("elbow | shoulder")
    team = Team([build("a", urdf_text=planar()), build("b", urdf_text=planar(kind="continuous"))])
    with pytest.raises(ScenarioError) as caught:
        Posture("posture", ("b/wrist",)).build("posture", team)
    assert caught.value.found == "'b/wrist'"
    assert sorted(caught.value.allowed.split(" | ")) == [
        "a/elbow",
        "a/shoulder",
        "b/elbow",
        "b/shoulder",
    ]


def test_a_posture_of_continuous_joints_goes_the_shorter_way_round():
    """The coordinate of a continuous joint is an angle; its error is at most half a turn."""
    team = Team([build("a", urdf_text=planar()), build("b", urdf_text=planar(kind="continuous"))])
    task = Posture("posture", ("a/elbow", "b/elbow")).build("posture", team)
    q = team.configuration_from_joints(np.array([0.1, 0.2, 0.3, 3.0]))
    found = task.evaluate(team.state(q, np.zeros(4)))
    np.testing.assert_allclose(found.x, [0.2, 3.0], rtol=1e-12)
    np.testing.assert_array_equal(found.J, np.eye(4)[[1, 3]])
    error = task.difference(found.x, np.array([0.0, -3.0]))
    np.testing.assert_allclose(error, [0.2, 6.0 - 2.0 * np.pi], rtol=1e-12)
    turned = team.integrate(q, np.array([0.0, 0.0, 0.0, 0.2]))
    value = task.evaluate(team.state(turned, np.zeros(4))).x[1]
    assert value == pytest.approx(3.2 - 2.0 * np.pi)


@settings(max_examples=1000, deadline=None, derandomize=True, database=None)
@given(data=st.data())
def test_mutations(data):
    """A URDF with slices replaced is read or refused; nothing else is raised."""
    text = planar()
    for _ in range(data.draw(st.integers(1, 3))):
        start = data.draw(st.integers(0, len(text)))
        size = data.draw(st.sampled_from([0, 1, 2, 8, 40]))
        text = text[:start] + data.draw(SNIPPETS) + text[start + size :]
    try:
        build(urdf_text=text)
    except ScenarioError as error:
        assert error.key.startswith("arm")  # noqa: PT017


def test_a_mimicking_joint_may_be_locked():
    """Fingers that mimic each other do no harm once they are locked."""
    text = planar(inside='<mimic joint="shoulder"/>')
    assert build(urdf_text=text, locked_joints=["elbow"]).model.nv == 1


def test_missing_files_are_named_with_where_they_could_be(tmp_path, monkeypatch):
    """A missing file, package or robot is reported with the searched places or known names."""
    monkeypatch.chdir(tmp_path)
    error = refused(urdf="nothing.urdf")
    assert error.key == "arm.urdf"
    assert "nothing.urdf" in error.found
    assert str(tmp_path) in error.allowed
    assert "AMENT_PREFIX_PATH" in refused(urdf="package://nobody/a.urdf").allowed
    wrong = PANDA.replace("panda.urdf", "pandas.urdf")
    assert PANDA in refused(urdf=wrong).allowed
    wrong = UR5.replace("ur5_robot", "ur5robot")
    assert UR5 in refused(urdf=wrong).allowed


def test_a_missing_collection_of_robots_says_how_to_install_it(monkeypatch):
    """Without example-robot-data the error has the command that brings it."""
    monkeypatch.setattr(urdf_files, "share_folders", list)
    for urdf in (PANDA, UR5):
        assert "pip install 'noninteract_ros[robots]'" in refused(urdf=urdf).allowed


def test_a_file_that_is_no_text_is_refused(tmp_path):
    """Bytes that are no text, such as a mesh, are named as what they are."""
    (tmp_path / "mesh.stl").write_bytes(b"\xff\xfe\x00\x80")
    error = refused(urdf=str(tmp_path / "mesh.stl"))
    assert error.key == "arm.urdf"
    assert "no text" in error.found


def test_a_generated_arm_equals_its_urdf():
    """planar_arm and urdf with the same numbers are the same robot to the law."""
    keys = {"link_lengths": [0.5, 0.5], "link_masses": [1.0, 2.0], "mass_location": "tip"}
    generated = load(PlanarArm, keys, "a").build("a")
    team = Team([generated, build("b", urdf_text=planar((1.0, 2.0)))])
    half = np.random.default_rng(8).normal(size=(2, 2))
    state = team.state(np.tile(half[0], 2), np.tile(half[1], 2))
    np.testing.assert_allclose(state.M[:2, :2], state.M[2:, 2:], atol=1e-14)
    np.testing.assert_allclose(state.C[:2, :2], state.C[2:, 2:], atol=1e-14)
    np.testing.assert_allclose(state.tool_positions[0], state.tool_positions[1], atol=1e-14)
