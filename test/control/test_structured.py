# SPDX-License-Identifier: Apache-2.0
"""The law robot by robot equals the dense one, at a cost that grows with the team, not faster."""

import numpy as np
import pytest
from spatial_arms import spatial_arm

from noninteract_ros.control.decoupling import LAWS, TaskError, commanded_acceleration
from noninteract_ros.control.energy import energy
from noninteract_ros.control.impedance import ImpedanceSettings, stack_impedance
from noninteract_ros.control.singularity import regularity
from noninteract_ros.control.structure import Structure
from noninteract_ros.control.subtask_input import InputSettings
from noninteract_ros.control.team_controller import TeamController
from noninteract_ros.control.team_view import DenseView
from noninteract_ros.control.tree import Tree
from noninteract_ros.subtasks.cooperative_pose import CooperativeOrientation, CooperativePose
from noninteract_ros.subtasks.cooperative_position import CooperativePosition
from noninteract_ros.subtasks.posture import Posture
from noninteract_ros.subtasks.relative_pose import RelativeOrientation, RelativePose
from noninteract_ros.subtasks.relative_position import RelativePosition
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

SIZES = ("zyzyzyz", "zyzyzy", "zyzyzyzy")  # joints of the arms, in turn
BRANCHED = ("arm_3", "arm_1", "arm_3", "arm_4", "arm_2", "arm_3", "arm_4", "arm_5")


def team_of(count, sizes=SIZES):
    start = np.array([0.3, -0.7, 0.4, 1.2, -0.5, 0.8, 0.2, 0.3])
    robots = []
    for i in range(count):
        axes = sizes[i % len(sizes)]
        q = start + 0.05 * np.sin(np.arange(8.0) + i)
        base = (0.1 * i, 0.7 * i, 0.0)
        robots.append(spatial_arm(f"arm_{i + 1}", 1.0 + i % 3, base, 0.1 * (i % 4), axes, q))
    return Team(robots)


def edges_of(count, shape):
    names = [f"arm_{i + 1}" for i in range(count)]
    if shape == "star":
        return tuple(name for other in names[1:] for name in (names[0], other))
    if shape == "branched":
        return BRANCHED
    return ()


def stack_of(team, shape="chain", frame="lead", split=False, weights=(), tools="tools"):
    """Pose and grasp, or positions and rotations apart, and the joints that are left."""
    edges = edges_of(len(team.robots), shape)
    if split:
        point = CooperativePosition("cooperative_position", weights=weights).build("point", team)
        lead = CooperativeOrientation("cooperative_orientation", weights, tools)
        others = {"lead": lead.build("lead", team)}
        apart = RelativePosition("relative_position", edges, frame).build("apart", team, others)
        turned = RelativeOrientation("relative_orientation", edges, "world", tools)
        parts = [turned.build("turned", team, others), point, apart, others["lead"]]
    else:
        pose = CooperativePose("cooperative_pose", (), weights, tools)
        others = {"lead": pose.build("lead", team)}
        gap = RelativePose("relative_pose", edges, frame, (), tools)
        parts = [others["lead"], gap.build("gap", team, others)]
    joints = [
        f"{robot.name}/joint_{number}"
        for robot in reversed(team.robots)
        for number in range(3, robot.model.nv - 3)
    ]
    if joints:
        parts.insert(1, Posture("posture", tuple(joints)).build("bend", team, others))
    return SubtaskStack(team, parts)


CASES = {
    "chain of 2": (2, {"weights": (1.0, 3.0)}, None),
    "chain of 5, world": (5, {"frame": "world"}, None),
    "star of 8": (8, {"shape": "star"}, None),
    "branched, weights": (5, {"shape": "branched", "weights": (1.0, 0.0, 2.0, 1.0, 0.5)}, None),
    "from the start": (4, {"tools": "start"}, None),
    "positions and rotations apart": (4, {"split": True, "shape": "star"}, None),
    "even arms without posture": (3, {}, ("zyzyzy",)),
    "even redundant arms": (3, {"frame": "world"}, ("zyzyzyz",)),
}


class Pair:
    """The same team both ways, at a random state with random errors."""

    def __init__(self, name, seed, chosen=False):
        count, keys, sizes = CASES[name]
        self.team = team_of(count, sizes or SIZES)
        self.stack = stack_of(self.team, **keys)
        rng = np.random.default_rng(seed)
        n = self.team.n
        settings = [ImpedanceSettings((40.0,), (9.0,)) for _ in self.stack.subtasks]
        if chosen:
            settings[-1] = ImpedanceSettings((40.0,), (9.0,), (2.5,))
        self.impedance = stack_impedance(self.stack.subtasks, settings)
        q = self.team.integrate(self.team.q0, rng.uniform(-0.3, 0.3, n))
        self.v, inertias = rng.normal(size=n), self.impedance.inertias
        self.dense = DenseView(self.team, self.stack).evaluate(q, self.v, inertias)
        structure = Structure.of(self.team, self.stack)
        assert structure is not None
        self.structured = structure.evaluate(q, self.v, inertias)
        self.error = TaskError(*rng.normal(size=(5, n)))
        self.external = rng.normal(size=n)

    def torque(self, seen, law):
        wanted = commanded_acceleration(law, seen.dynamics, self.error, self.impedance)
        joints = seen.dynamics.joint_acceleration(self.v, wanted)
        return self.team.inverse_dynamics(seen.state.q, self.v, joints)

    def energy(self, seen):
        wanted = commanded_acceleration("natural", seen.dynamics, self.error, self.impedance)
        return energy(seen.dynamics, self.error, self.impedance, wanted, self.external)


def assert_close(actual, expected):
    np.testing.assert_allclose(actual, expected, rtol=0.0, atol=1e-9 * np.abs(expected).max())


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("chosen", [False, True], ids=["own inertia", "desired inertia"])
class TestBothForms:
    def test_agree_in_values_and_velocities(self, name, seed, chosen):
        pair = Pair(name, seed, chosen)
        dense, structured = pair.dense, pair.structured
        assert_close(structured.task.x, dense.task.x)
        assert_close(structured.dynamics.velocity(pair.v), dense.task.J @ pair.v)
        a = pair.external
        for seen in (dense, structured):
            wanted = dense.task.J @ a + dense.task.J_rate @ pair.v
            assert_close(seen.dynamics.acceleration_of(pair.v, a), wanted)
            assert_close(seen.dynamics.joint_acceleration(pair.v, wanted), a)

    @pytest.mark.parametrize("law", ["noninteracting", "natural", "paper"])
    def test_ask_for_the_same_torque(self, name, seed, chosen, law):
        pair = Pair(name, seed, chosen)
        assert_close(pair.torque(pair.structured, law), pair.torque(pair.dense, law))

    def test_find_the_same_energies_and_forces(self, name, seed, chosen):
        pair = Pair(name, seed, chosen)
        found, wanted = pair.energy(pair.structured), pair.energy(pair.dense)
        for part in ("storage", "rate", "supplied", "dissipated"):
            assert_close(getattr(found, part), getattr(wanted, part))
        for force in ("decoupled_external_force", "force_of", "multiply_by_inertia"):
            structured, dense = pair.structured.dynamics, pair.dense.dynamics
            found = getattr(structured, force)(pair.external)
            assert_close(found, getattr(dense, force)(pair.external))

    def test_find_the_same_regularity(self, name, seed, chosen):
        pair = Pair(name, seed, chosen)
        found = regularity(pair.structured.dynamics.inverse_sizes)
        assert found == pytest.approx(regularity(pair.dense.dynamics.S), rel=1e-9)

    def test_have_the_same_matrices_for_who_asks(self, name, seed, chosen):
        pair = Pair(name, seed, chosen)
        for part in ("M", "C", "g", "J", "J_rate", "S", "MS", "inertia"):
            found = getattr(pair.structured.dynamics, part)
            assert_close(found, getattr(pair.dense.dynamics, part))
        for part in ("M", "tool_jacobians", "tool_positions"):
            assert_close(getattr(pair.structured.state, part), getattr(pair.dense.state, part))
        assert_close(pair.structured.task.J, pair.dense.task.J)


class TestTree:
    pairs = ((2, 0), (2, 3), (1, 2), (3, 4))

    def test_up_and_down_are_inverse_and_transposed(self):
        tree, rng = Tree(self.pairs), np.random.default_rng(0)
        gaps, f = rng.normal(size=(4, 3, 2)), rng.normal(size=(5, 3, 2))
        x = tree.down(gaps)
        assert not x[0].any()
        np.testing.assert_allclose(tree.differences(x), gaps, atol=1e-14)
        assert (tree.up(f) * gaps).sum() == pytest.approx((f * x).sum())
        assert (tree.gathered(gaps) * f).sum() == pytest.approx((gaps * tree.differences(f)).sum())
        np.testing.assert_array_equal(tree.depth, [0, 2, 1, 2, 3])

    @pytest.mark.parametrize("pairs", [((0, 1), (1, 0), (2, 3)), ((0, 1), (2, 4))])
    def test_refuses_what_is_no_tree(self, pairs):
        with pytest.raises(ValueError, match="the edges"):
            Tree(pairs)


def test_small_teams_and_other_subtasks_stay_dense():
    team = team_of(3)
    assert Structure.of(team_of(2), stack_of(team_of(2))) is None
    stack = stack_of(team)
    assert isinstance(Structure.of(team, stack, 3), Structure)
    stack.subtasks[0].mixing = None
    assert Structure.of(team, stack, 3) is None


def test_a_controller_of_ten_arms_uses_it_through_every_change():
    team = team_of(10, ("zyzyzy",))
    stack = stack_of(team)
    settings = [ImpedanceSettings((40.0,), (9.0,)) for _ in stack.subtasks]
    inputs = [InputSettings() for _ in stack.subtasks]
    core, dense = (TeamController(team, stack, LAWS[0], settings, inputs) for _ in range(2))
    assert isinstance(core._view, Structure)
    dense._view = DenseView(team, stack)
    rng = np.random.default_rng(0)
    q, v = team.q0, 0.1 * rng.normal(size=team.n)
    changes = [
        lambda item: None,
        lambda item: item.set_law("natural"),
        lambda item: item.set_impedance("gap", ImpedanceSettings((9.0,), (2.0,), (1.5,))),
        lambda item: item.set_law("paper"),
        lambda item: item.stop(),
        lambda item: None,
    ]
    for number, change in enumerate(changes):
        ticks = []
        for item in (core, dense):
            change(item)
            ticks.append(item.step(1e-3 * number, q, v))
        assert_close(ticks[0].torque, ticks[1].torque)
        assert_close(ticks[0].x_rate, ticks[1].x_rate)
        assert_close(ticks[0].task_acceleration, ticks[1].task_acceleration)
        assert ticks[0].regularity == pytest.approx(ticks[1].regularity, rel=1e-9)
        q = team.integrate(q, 1e-3 * v)


class Counted(np.ndarray):
    """An array that counts the numbers that operations on it, and on what follows, give."""

    total = 0

    def __array_ufunc__(self, ufunc, method, *inputs, **keys):
        plain = [np.asarray(item) if isinstance(item, Counted) else item for item in inputs]
        if "out" in keys:
            keys["out"] = tuple(
                np.asarray(item) if isinstance(item, Counted) else item for item in keys["out"]
            )
        result = getattr(ufunc, method)(*plain, **keys)
        Counted.total += np.size(result) if result is not None else 0
        return result.view(Counted) if isinstance(result, np.ndarray) else result


def results_of_law(count):
    """How many numbers the structured law computes at a state."""
    team = team_of(count, ("zyzyzyz",))
    stack = stack_of(team)
    impedance = stack_impedance(
        stack.subtasks, [ImpedanceSettings((40.0,), (9.0,)) for _ in stack.subtasks]
    )
    structure = Structure.of(team, stack)
    rng = np.random.default_rng(0)
    seen = structure.evaluate(team.q0, rng.normal(size=team.n), impedance.inertias)
    dynamics = seen.dynamics
    for name in ("T", "T_rate", "T_inverse", "L", "B", "motion", "drift"):
        object.__setattr__(dynamics, name, getattr(dynamics, name).view(Counted))
    for name in ("G", "K", "H", "G_rate", "K_rate", "H_rate"):
        object.__setattr__(dynamics.mixing, name, getattr(dynamics.mixing, name).view(Counted))
    Counted.total = 0
    error = TaskError(*rng.normal(size=(5, team.n)))
    wanted = commanded_acceleration("noninteracting", dynamics, error, impedance)
    dynamics.joint_acceleration(seen.state.v, wanted)
    dynamics.inverse_sizes  # noqa: B018
    return Counted.total


def test_the_work_grows_linearly():
    eight, sixteen, thirty_two = (results_of_law(count) for count in (8, 16, 32))
    assert eight > 1000
    assert thirty_two - sixteen == pytest.approx(2 * (sixteen - eight), rel=1e-6)
    assert thirty_two == pytest.approx(4 * eight, rel=0.02)
