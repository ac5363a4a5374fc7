# SPDX-License-Identifier: Apache-2.0
"""Independent plant: MuJoCo's dynamics of two Pandas under the controller of this package."""

import importlib.util
from typing import Any

import numpy as np
import pytest
from harness import Ros, merged
from programs import Programs
from repository import ROOT
from waiting import until

from noninteract_ros.arrays import Array
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters
from noninteract_ros.scenario.rehearsal import History, Rehearsal, rehearse

mujoco = pytest.importorskip("mujoco", reason="MuJoCo comes with the extra [peer]")

EXAMPLE = ROOT / "examples" / "mujoco_team.py"
BOUND = 1e-6  # [rad, m] largest difference of the plants, and largest coupling of subtasks
ROUNDING = 1e-11  # [rad, m] largest accumulated rounding error of either plant
SOURCES = ("haptic_emulator", "relative_planner", "controller")


def load_example() -> Any:
    spec = importlib.util.spec_from_file_location("mujoco_team", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def pandas(**changes: Any) -> dict[str, Any]:
    """Return the scenario of two freely moving Pandas with changes."""
    return merged(read_parameters(ROOT / "config" / "dual_panda_free.yaml"), changes)


def calm() -> dict[str, Any]:
    """Return a scenario in which the human moves the pair by 0.16 m and 17 degrees in 4.4 s."""
    whole = pandas()["haptic"]
    points, orientations = whole["points"][:6], whole["orientations"][:8]
    way = {"times": [0.0, 4.4], "points": points, "orientations": orientations}
    stiff = {"stiffness": [2000.0], "damping": [50.0]}
    return pandas(haptic=way, posture=stiff, end_time=5.0)


class MujocoRehearsal(Rehearsal):
    """Rehearsal of a scenario with MuJoCo instead of the simulated team."""

    def __init__(self, values: dict[str, Any], substeps: int, human: bool = True) -> None:
        super().__init__(Scenario.from_dict(values), human)
        self._model = load_example().team_model(values)
        self._model.opt.timestep = 1.0 / values["rate"] / substeps
        self._data, self._substeps = mujoco.MjData(self._model), substeps
        self._data.qpos = self.simulation.q
        self.simulation.step = self._step  # type: ignore[method-assign]

    def _step(self, torque: Array | None) -> None:
        assert torque is not None
        self._data.qfrc_applied = torque
        mujoco.mj_step(self._model, self._data, self._substeps)
        self.simulation.q, self.simulation.v = self._data.qpos.copy(), self._data.qvel.copy()
        self.simulation.tick += 1


def largest(difference: Array) -> float:
    return float(np.abs(difference).max())


def crossing(led: History, alone: History, dim: int = 6) -> Array:
    """Return the motion of the other subtasks' coordinates due to the human."""
    return led.x[:, dim + 1 :] - alone.x[:, dim + 1 :]


@pytest.mark.parametrize("armature", [0.0, 0.3])
def test_both_plants_have_the_same_dynamics(armature: float) -> None:
    """Inertia and bias forces of MuJoCo and Pinocchio agree to rounding at random states."""
    joints = {"armature": [armature], "friction": [2.0 * armature]}
    values = pandas(panda_1=joints, panda_2=joints)
    team = Scenario.from_dict(values).build_team()
    model = load_example().team_model(values)
    data = mujoco.MjData(model)
    names = [model.joint(number).name for number in range(model.njnt)]
    assert names == list(team.joint_names)
    rng = np.random.default_rng(0)
    for _ in range(50):
        q, v = rng.uniform(-2.0, 2.0, (2, team.n))
        data.qpos, data.qvel = q, v
        mujoco.mj_forward(model, data)
        M = np.zeros((team.n, team.n))
        mujoco.mj_fullM(model, data, M)
        bias = team.inverse_dynamics(q, v, np.zeros(team.n))
        assert largest(M - team.state(q, v).M) < 1e-10
        assert largest(data.qfrc_bias - bias) < 1e-10
        assert largest(data.qfrc_passive + team.friction * v) < 1e-10


def test_the_plants_differ_by_the_integration_error() -> None:
    """Equal methods and steps agree to rounding; half the step removes 15/16 of the error."""
    values = pandas()
    ours = rehearse(Scenario.from_dict(values), 0.7)
    same, half, quarter = (MujocoRehearsal(values, n).run(0.7).q for n in (1, 2, 4))
    assert largest(same - ours.q) < ROUNDING / 100
    assert ROUNDING / 100 < largest(half - ours.q) < ROUNDING
    remaining = largest(quarter - half) / largest(half - ours.q)
    assert remaining == pytest.approx(1 / 16, rel=0.1)


def test_coupling_is_due_to_sampling_alone() -> None:
    """At 0.5 m/s and 1 rad/s it halves with the tick and extrapolates to zero."""
    slow, fast = (
        crossing(*(MujocoRehearsal(values, 2, human).run(0.8) for human in (True, False)))
        for rate in (1000.0, 2000.0)
        if (values := pandas(rate=rate, haptic={"update_rate": rate}))
    )
    fast = fast[::2]
    assert largest(fast) / largest(slow) == pytest.approx(0.5, rel=0.02)
    assert largest(slow) > 10 * BOUND
    assert largest(2.0 * fast - slow) < BOUND


def test_mujoco_over_dds_agrees_with_the_rehearsal_and_stays_decoupled(
    ros: Ros, programs: Programs
) -> None:
    """Both bounds hold over five seconds of the real programs with MuJoCo as plant."""
    values = calm()
    monitor = ros.monitor(values)
    file = programs.write(values)
    plant = programs.python("mujoco_team", str(EXAMPLE), str(file))
    until(lambda: monitor.states, "the first state of MuJoCo")
    for name in SOURCES:
        programs.start(name, values)
    assert plant.wait(300.0) == 0, programs.log("mujoco_team")
    until(lambda: monitor.now >= 5.0, "the last state of MuJoCo")

    scenario = Scenario.from_dict(values)
    expected = rehearse(scenario, 5.001)
    t, q, v, _ = monitor.history(monitor.states)
    assert len(t) == len(expected.t) == 5001
    assert largest(q - expected.q) < BOUND
    assert largest(q - q[0]) > 0.1

    team = scenario.build_team()
    stack = scenario.build_stack(team)
    x = np.array([stack.evaluate(team.state(*row)).x for row in zip(q, v, strict=True)])
    alone = rehearse(scenario, 5.001, human=False)
    assert largest(x[:, 7:] - alone.x[:, 7:]) < BOUND
    np.testing.assert_allclose(np.abs(x - x[0]).max(axis=0)[:3], [0.06, 0.14, 0.07], rtol=1e-4)
