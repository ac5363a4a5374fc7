# SPDX-License-Identifier: Apache-2.0
"""Equality of the robot-by-robot and the dense law, and linear cost in the number of robots."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spatial_arms import spatial_arm

from noninteract_ros.control.controller import TeamController
from noninteract_ros.control.energy.storage import energy
from noninteract_ros.control.fast.robotwise_evaluation import RobotwiseEvaluator
from noninteract_ros.control.law.decoupling import LAWS, TaskError, commanded_acceleration
from noninteract_ros.control.law.impedance import ImpedanceSettings, stack_impedance
from noninteract_ros.control.law.team_dynamics import DenseEvaluator
from noninteract_ros.control.references.subtask_input import InputSettings
from noninteract_ros.control.safety.singularity import regularity
from noninteract_ros.subtasks.kinds.cooperative_pose import CooperativeOrientation, CooperativePose
from noninteract_ros.subtasks.kinds.cooperative_position import CooperativePosition
from noninteract_ros.subtasks.kinds.posture import Posture
from noninteract_ros.subtasks.kinds.relative_pose import RelativeOrientation, RelativePose
from noninteract_ros.subtasks.kinds.relative_position import RelativePosition
from noninteract_ros.subtasks.mixing import EdgeMixing
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.models.point_mass import PointMass
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
    """One team in both forms, at a random state with random errors."""

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
        self.dense = DenseEvaluator(self.team, self.stack).evaluate(q, self.v, inertias)
        structure = RobotwiseEvaluator.of(self.team, self.stack)
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
    def test_find_the_same_torque(self, name, seed, chosen, law):
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

    def test_have_the_same_matrices(self, name, seed, chosen):
        pair = Pair(name, seed, chosen)
        for part in ("M", "C", "g", "J", "J_rate", "S", "MS", "inertia"):
            found = getattr(pair.structured.dynamics, part)
            assert_close(found, getattr(pair.dense.dynamics, part))
        for part in ("M", "tool_jacobians", "tool_positions"):
            assert_close(getattr(pair.structured.state, part), getattr(pair.dense.state, part))
        assert_close(pair.structured.task.J, pair.dense.task.J)


def test_other_subtasks_stay_dense():
    team = team_of(3)
    stack = stack_of(team)
    assert isinstance(RobotwiseEvaluator.of(team, stack), RobotwiseEvaluator)
    stack.subtasks[0].mixing = None
    assert RobotwiseEvaluator.of(team, stack) is None


@pytest.mark.parametrize("axes", [("x",), ("x", "z")])
def test_point_masses_have_it_too(axes):
    """Their terms are constant, and Pinocchio's arrays of a single joint are no matrices."""
    masses = zip(("light", "heavy", "last"), (1.0, 4.0, 2.0), strict=True)
    team = Team([PointMass(mass=mass, axes=axes).build(name) for name, mass in masses])
    lead = CooperativePosition("cooperative_position", weights=(1.0, 2.0, 1.0)).build("lead", team)
    gap = RelativePosition("relative_position").build("gap", team)
    stack = SubtaskStack(team, [gap, lead])
    structure, dense = RobotwiseEvaluator.of(team, stack), DenseEvaluator(team, stack)
    for seed in range(2):
        q, v, f = np.random.default_rng(seed).normal(size=(3, team.n))
        seen, wanted = (view.evaluate(q, v, (None, None)) for view in (structure, dense))
        assert_close(seen.task.x, wanted.task.x)
        assert_close(seen.task.J, wanted.task.J)
        for method in ("velocity", "divide_by_inertias", "multiply_by_inertias", "force_of"):
            assert_close(getattr(seen.dynamics, method)(f), getattr(wanted.dynamics, method)(f))
        assert_close(seen.dynamics.torque(v, f), wanted.dynamics.torque(v, f))


@pytest.mark.parametrize("edges", [("arm_1", "arm_2", "arm_2", "arm_1"), ("arm_1", "arm_2")])
def test_edges_that_are_no_tree_have_no_structure(edges):
    team = team_of(3)
    stack = stack_of(team)
    places = [(team.index(a), team.index(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    for subtask in stack.subtasks:
        if isinstance(subtask.mixing, EdgeMixing):
            subtask.mixing = replace(subtask.mixing, pairs=tuple(places))
    assert RobotwiseEvaluator.of(team, stack) is None


def test_a_controller_of_ten_arms_uses_it_through_every_change():
    team = team_of(10, ("zyzyzy",))
    stack = stack_of(team)
    settings = [ImpedanceSettings((40.0,), (9.0,)) for _ in stack.subtasks]
    inputs = [InputSettings() for _ in stack.subtasks]
    core, dense = (TeamController(team, stack, LAWS[0], settings, inputs) for _ in range(2))
    assert isinstance(core._view, RobotwiseEvaluator)
    dense._view = DenseEvaluator(team, stack)
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


WORK = """
import sys, numpy as np, test_structured
team = test_structured.team_of(int(sys.argv[1]), ("zyzyzyz",))
stack = test_structured.stack_of(team)
evaluator = test_structured.RobotwiseEvaluator.of(team, stack)
seen = evaluator.evaluate(team.q0, np.ones(team.n), (None,) * 3)

class Counted(np.ndarray):
    reads = 0
    def __getitem__(self, place):
        Counted.reads += 1
        return np.ndarray.__getitem__(self, place)

plan, blocks, mixers, inverse = seen.dynamics._inverse
shared = plan, blocks.view(Counted), mixers.view(Counted)
object.__setattr__(seen.dynamics, "_shared", shared)
object.__setattr__(seen.dynamics, "_inverse", (*shared, inverse))
task = test_structured.TaskError(*np.ones((5, team.n)))
gains = test_structured.stack_impedance(
    stack.subtasks, [test_structured.ImpedanceSettings((40.0,), (9.0,))] * 3
)
wanted = test_structured.commanded_acceleration("noninteracting", seen.dynamics, task, gains)
seen.dynamics.joint_acceleration(seen.state.v, wanted)
seen.dynamics.inverse_sizes
print(Counted.reads)
"""


def reads_of_law(count):
    """Number of times the law reads a number of the team, in its uncompiled functions."""
    paths = [str(Path(__file__).parent), *sys.path]
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, "-c", WORK, str(count)]
    return int(subprocess.run(command, env=environment, check=True, capture_output=True).stdout)


def test_the_work_grows_linearly():
    two, four, eight = (reads_of_law(count) for count in (2, 4, 8))
    assert two > 1000
    assert eight - four == pytest.approx(2 * (four - two), rel=1e-6)
