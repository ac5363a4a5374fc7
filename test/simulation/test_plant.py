# SPDX-License-Identifier: Apache-2.0
"""Team, bodies and couplings as one plant: balance of energy, order, wrenches, motion."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from planar_arms import PlanarArms
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from noninteract_ros.simulation.environment import Door, RigidObject, SurroundingBlock, Wall
from noninteract_ros.simulation.integrator import runge_kutta_step
from noninteract_ros.simulation.plant import Plant
from noninteract_ros.simulation.push import ScheduledPush
from noninteract_ros.simulation.team_simulation import TeamSimulation
from noninteract_ros.team.models.planar_arm import PlanarArm
from noninteract_ros.team.models.point_mass import PointMass
from noninteract_ros.team.team import Team

STEP = 0.05  # Duration of a control torque [s].


def masses(count: int = 2) -> Team:
    """Build point masses in space, 1 m apart."""
    blocks = [
        PointMass(1.0 + i, axes=("x", "y", "z"), initial_position=(float(i), 0.1 * i, 0.0))
        for i in range(count)
    ]
    return Team([block.build(f"mass_{i}") for i, block in enumerate(blocks)])


def arms(**keys) -> Team:
    """Build two unlike planar arms in a vertical plane."""
    shared = {"plane": "xz", "armature": (0.2,)} | keys
    left = PlanarArm((0.5, 0.4), (1.0, 1.5), initial_position=(1.4, -1.2), **shared)
    base = (1.2, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    right = PlanarArm(
        (0.4, 0.5), (3.0, 2.0), initial_position=(0.9, 1.8), base_pose=base, **shared
    )
    return Team([left.build("left"), right.build("right")])


def plant_of(team: Team, **surroundings: SurroundingBlock) -> Plant:
    parts = [item.build(name, team) for name, item in surroundings.items()]
    return Plant(
        team, [b for bodies, _ in parts for b in bodies], [c for _, some in parts for c in some]
    )


def carried(rate: float) -> TeamSimulation:
    """Build three pushed masses with a rotating box in elastic, damped grips."""
    box = RigidObject(
        "rigid_object", 2.0, (0.6, 0.3, 0.2), (), 150.0, 3.0, 4.0, 0.05
    )  # fmt: skip
    pushes = [ScheduledPush("mass_0", 0.1, 0.1, (0.0, 9.0, 4.0), (0.1, 0.2, 0.3))]
    return TeamSimulation(plant_of(masses(3), box=box), rate, None, pushes)


def at_a_door(rate: float) -> TeamSimulation:
    """Build arms with friction at a damped door, one of them pushed at its elbow."""
    door = Door(
        "door", (0.6, 0.0, 0.0), 0.4, (0.0, 1.0, 0.1), 0.3, stiffness=200.0, damping=4.0
    )  # fmt: skip
    pushes = [ScheduledPush("right", 0.05, 0.1, (5.0, 0.0, -3.0), frame="joint_2")]
    return TeamSimulation(plant_of(arms(friction=(0.5, 0.2)), door=door), rate, None, pushes)


def in_a_wall(rate: float) -> TeamSimulation:
    """Build arms whose tools stay in a soft, tilted wall."""
    wall = Wall("wall", (0.0, 0.0, 0.1), (0.1, 0.0, 1.0), 12.0, 0.2)
    simulation = TeamSimulation(plant_of(arms(), wall=wall), rate)
    simulation.q = np.array([-1.4, 1.2, -0.9, -1.8])
    return simulation


def run(simulation: TeamSimulation, duration: float, size: float, seed: int = 0) -> float:
    """Apply random held torques; return the largest error of the energy balance [J]."""
    rng = np.random.default_rng(seed)
    start, residual = simulation.energy().stored, 0.0
    for _ in range(round(duration / STEP)):
        torque = simulation.team.gravity(simulation.team.q0)
        torque = torque + rng.uniform(-size, size, simulation.team.n)
        for _ in range(round(STEP * simulation.rate)):
            simulation.step(torque)
        now = simulation.energy()
        balance = now.stored - start + now.lost - now.controls - now.pushes
        residual = max(residual, abs(balance))
    return residual


@pytest.mark.parametrize(
    ("build", "rates"), [(carried, 200.0), (at_a_door, 400.0), (in_a_wall, 200.0)]
)
def test_energy_is_in_balance_to_the_integrator_s_order(
    build: Callable[[float], TeamSimulation], rates: float
) -> None:
    """Work in = growth of storage + losses; halving the step divides the rest by 16 at least."""
    coarse = run(build(rates), 0.4, 3.0)
    simulation = build(2.0 * rates)
    fine = run(simulation, 0.4, 3.0)
    account = simulation.energy()
    assert min(abs(account.controls), account.lost) > 1e-3
    assert fine < 1e-5 * abs(account.controls)
    assert coarse / fine > 14.0
    assert simulation.external_wrenches().any(axis=1).all()  # All contacts are closed.


def test_no_term_of_the_balance_is_zero():
    """Pushes did work, heat was lost, and energy was stored in the runs above."""
    simulation = carried(400.0)
    before = simulation.energy()
    assert before.controls == before.pushes == before.lost == 0.0
    run(simulation, 0.4, 3.0)
    after = simulation.energy()
    assert min(map(abs, (after.stored - before.stored, after.pushes, after.lost))) > 0.01
    simulation.reset()
    assert simulation.energy() == before


def test_contact_with_a_wall_reduces_the_order_but_keeps_the_balance():
    """Contact starts and ends within a tick; the balance error still falls with the tick."""
    wall = Wall("wall", (0.0, 0.0, -0.1), (0.0, 0.0, 1.0), 2e3, 0.2)
    residuals = []
    for rate in (500.0, 2000.0, 8000.0):
        simulation = TeamSimulation(plant_of(masses(), wall=wall), rate)
        residual, start = 0.0, simulation.energy().stored
        for _ in range(round(1.0 * rate)):
            simulation.step(np.zeros(6))
            now = simulation.energy()
            residual = max(residual, abs(now.stored - start + now.lost))
        assert now.lost > 0.1  # It bounced.
        residuals.append(residual)
    assert residuals[0] < 1e-2
    assert residuals[2] < residuals[1] / 3.0 < residuals[0] / 9.0


def free_flight(count: int, chart: bool = True) -> np.ndarray:
    """Return pose and velocity of a tumbling box after 1 s in a number of steps."""
    box = RigidObject("rigid_object", 2.0, (0.6, 0.3, 0.1), (), 0.0, 0.0)
    plant = plant_of(masses(), box=box)
    if not chart:
        plant.chart_velocity = lambda q_0, q, v: v
    q, v = plant.q0, np.zeros(plant.model.nv)
    v[6:] = 0.3, -0.2, 0.5, 1.0, 4.0, -2.0

    def derivative(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return plant.acceleration(q, v, np.zeros(plant.model.nv)), np.zeros(0)

    for _ in range(count):
        q, v, _ = runge_kutta_step(plant, derivative, q, v, 1.0 / count)
    return np.concatenate([q[6:], v[6:]])


def euler() -> np.ndarray:
    """Return the same by Euler's equations with a rotation matrix, integrated by scipy."""
    x, y, z = 0.6, 0.3, 0.1
    inertia = 2.0 / 12.0 * np.array([y * y + z * z, x * x + z * z, x * x + y * y])

    def rates(t: float, s: np.ndarray) -> np.ndarray:
        R, w = s[6:15].reshape(3, 3), s[15:]
        spin = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
        turning = -np.cross(w, inertia * w) / inertia
        return np.concatenate([s[3:6], [0.0, 0.0, -9.81], (R @ spin).ravel(), turning])

    start = np.concatenate([np.zeros(3), [0.3, -0.2, 0.5], np.eye(3).ravel(), [1.0, 4.0, -2.0]])
    s = solve_ivp(rates, (0.0, 1.0), start, "DOP853", rtol=1e-12, atol=1e-13).y[:, -1]
    R = s[6:15].reshape(3, 3)
    quaternion = Rotation.from_matrix(R).as_quat()
    return np.concatenate([s[:3], quaternion, R.T @ s[3:6], s[15:]])


def test_a_free_body_obeys_euler_s_equations_to_fourth_order():
    """Box in free flight against scipy; the curved space keeps the order of the method."""
    exact = euler()

    def error(found: np.ndarray) -> float:
        found[3:7] *= np.sign(found[3:7] @ exact[3:7])
        return float(np.abs(found - exact).max())

    coarse, fine = error(free_flight(100)), error(free_flight(200))
    assert fine < 1e-6
    assert coarse / fine == pytest.approx(16.0, rel=0.15)
    # Without the chart the error is of first order in the turn within a step.
    assert error(free_flight(200, chart=False)) > 100.0 * fine


def test_arms_do_not_need_the_chart():
    """On joints that commute the tangent vector's rate is the velocity itself."""
    rng = np.random.default_rng(0)
    flat = plant_of(arms(), door=Door("door", (0.6, 0.0, 0.0), 0.4, (0.0, 1.0, 0.0)))
    v = rng.uniform(-1.0, 1.0, flat.model.nv)
    assert flat.chart_velocity(flat.q0, flat.integrate(flat.q0, 0.1 * v), v) is v


def door_swing(damping: float) -> float:
    """Return the angular velocity of a free door after 1 s, from 2 rad/s."""
    door = Door("door", (0.0, 0.0, 0.0), 0.5, (0.0, 0.0, 3.0), damping, (), 0.0, 0.0)
    plant = plant_of(masses(), door=door)
    q, v = plant.q0, np.zeros(plant.model.nv)
    v[-1] = 2.0

    def derivative(q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        load = plant.external_loads(q, v).coupling_torque - plant.friction * v
        return plant.acceleration(q, v, load), np.zeros(0)

    for _ in range(100):
        q, v, _ = runge_kutta_step(plant, derivative, q, v, 0.01)
    return float(v[-1])


def test_a_hinge_is_damped_by_its_inertia():
    """v' = -(c/I) v; without damping the velocity is constant."""
    assert door_swing(0.0) == pytest.approx(2.0, rel=1e-12)
    assert door_swing(0.4) == pytest.approx(2.0 * np.exp(-0.8), rel=1e-8)


def test_friction_dissipates():
    """Masses with friction slow down by v' = -(f/m) v, and the lost energy is dissipated."""
    team = Team([PointMass(2.0, friction=(0.5,)).build("a"), PointMass(4.0).build("b")])
    simulation = TeamSimulation(Plant(team), 100.0)
    simulation.v = np.array([3.0, -1.0, 2.0, 0.5])
    before = simulation.energy()
    for _ in range(100):
        simulation.step(np.zeros(4))
    expected = np.array([3.0, -1.0, 2.0, 0.5]) * np.exp([-0.25, -0.25, 0.0, 0.0])
    np.testing.assert_allclose(simulation.v, expected, rtol=1e-9)
    lost = 0.5 * 2.0 * 10.0 * (1.0 - np.exp(-0.5))
    assert simulation.energy().lost == pytest.approx(lost, rel=1e-9)
    assert before.stored - simulation.energy().stored == pytest.approx(lost, rel=1e-9)


def test_grips_carry_the_weight_of_a_held_object():
    """At rest the grips carry the box's weight, which is the wrench on the tools."""
    box = RigidObject("rigid_object", 2.0, (0.6, 0.1, 0.1), (), 500.0, 30.0, 10.0, 1.0)
    simulation = TeamSimulation(plant_of(masses(), box=box), 500.0)
    team = simulation.team
    pins = np.array([0.0, 0.0, 0.0, 1.0, 0.1, 0.0])
    for _ in range(4000):
        hold = team.gravity(simulation.q) - 4e3 * (simulation.q - pins) - 200.0 * simulation.v
        simulation.step(hold)
    wrenches = simulation.external_wrenches()
    np.testing.assert_allclose(wrenches[:, 2], -9.81, rtol=1e-6)
    np.testing.assert_allclose(wrenches[:, :2], 0.0, atol=1e-5)


def test_reported_wrenches_are_what_the_grips_exert():
    """Reported wrenches are spring and damper forces, computed from tool and handle motions."""
    simulation = at_a_door(500.0)
    run(simulation, 0.4, 9.0)
    plant, team = simulation.plant, simulation.team
    state = team.state(simulation.q, simulation.v)
    axis = np.array([0.0, 1.0, 0.1]) / np.sqrt(1.01)
    angle = simulation.plant_q[-1]
    assert abs(angle) > 0.01
    start = team.state(team.q0, np.zeros(4)).tool_positions
    hinge = np.array([0.6, 0.0, 0.0])
    arm = Rotation.from_rotvec(angle * axis).apply(start - hinge)
    omega = simulation._v[-1] * axis
    speeds = state.tool_jacobians[:, :3] @ simulation.v
    expected = 200.0 * (hinge + arm - state.tool_positions)
    expected += 4.0 * (np.cross(omega, arm) - speeds)
    found = simulation.external_wrenches()
    np.testing.assert_allclose(found[:, :3], expected, atol=1e-9)
    assert not found[:, 3:].any()
    # The opposite forces act on the door, at the handles.
    torque = plant.external_loads(simulation.plant_q, simulation._v).coupling_torque
    assert torque[-1] == pytest.approx(-np.cross(arm, expected).sum(axis=0) @ axis)


def test_a_team_in_contact_obeys_its_reported_wrenches():
    """M a + C v + g = torque - friction + J' w with the reported wrenches w."""
    simulation = at_a_door(20000.0)
    for _ in range(2000):
        simulation.step(simulation.team.gravity(simulation.q))
    team, torque = simulation.team, np.array([1.0, -2.0, 0.5, 3.0])
    state = team.state(simulation.q, simulation.v)
    elbow = np.array([5.0, 0.0, -3.0])
    shoulder_to_elbow = 0.4 * np.array([np.cos(state.q[2]), 0.0, np.sin(state.q[2])])
    # About the arm's own z axis, which is -y of the world in the plane xz.
    pushed = np.array([0.0, 0.0, -np.cross(shoulder_to_elbow, elbow)[1], 0.0])
    load = torque + team.external_torque(state, simulation.external_wrenches())
    load = load + pushed - team.friction * state.v
    expected = np.linalg.solve(state.M, load - state.C @ state.v - state.g)
    simulation.step(torque)
    np.testing.assert_allclose(20000.0 * (simulation.v - state.v), expected, rtol=1e-3, atol=1e-3)


ELBOW = np.array([2.0, -1.0, 0.0])


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        # joint_2 is at (l cos q1, l sin q1) = the elbow: only joint 1 has a lever.
        ({"force": tuple(ELBOW), "frame": "joint_2"}, lambda l1, l2: [np.cross(l1, ELBOW)[2], 0]),
        (
            {"force": tuple(ELBOW), "frame": "tool"},
            lambda l1, l2: [np.cross(l1 + l2, ELBOW)[2], np.cross(l2, ELBOW)[2]],
        ),
        (
            {"force": tuple(ELBOW)},
            lambda l1, l2: [np.cross(l1 + l2, ELBOW)[2], np.cross(l2, ELBOW)[2]],
        ),
        ({"force": tuple(ELBOW), "frame": "joint_1"}, lambda l1, l2: [0.0, 0.0]),
        # Torques turn the link that the frame belongs to.
        (
            {"force": (0.0,) * 3, "torque": (0.0, 0.0, 3.0), "frame": "joint_1"},
            lambda l1, l2: [3.0, 0.0],
        ),
        (
            {"force": (0.0,) * 3, "torque": (0.0, 0.0, 3.0), "frame": "joint_2"},
            lambda l1, l2: [3.0, 3.0],
        ),
    ],
)
def test_a_push_acts_at_its_frame(keys: dict, expected: Callable) -> None:
    """Joint torques equal the analytic ones for pushes on tool, elbow and base, and torques."""
    team = Team(
        [
            PlanarArm((0.5, 0.3), (1.0, 1.5), initial_position=(0.7, 0.9)).build(name)
            for name in ("left", "right")
        ]
    )
    push = ScheduledPush("right", 0.0, 1.0, **keys)
    push.check("push", team)
    simulation = TeamSimulation(Plant(team), 1e4, None, [push])
    state = team.state(team.q0, np.zeros(4))
    simulation.step(np.zeros(4))
    found = state.M @ (1e4 * simulation.v)
    first = 0.5 * np.array([np.cos(0.7), np.sin(0.7), 0.0])
    second = 0.3 * np.array([np.cos(1.6), np.sin(1.6), 0.0])
    np.testing.assert_allclose(found, [0.0, 0.0, *expected(first, second)], atol=1e-3)
    sensed = np.array([*keys["force"], *keys.get("torque", (0.0,) * 3)])
    if not push.on_tool(team):
        sensed = np.zeros(6)
    np.testing.assert_array_equal(simulation.external_wrenches()[1], sensed)


def test_bodies_do_not_change_the_team_s_coordinates():
    """The team's joints come first, with their armature; bodies start at the tools."""
    team = arms()
    plant = plant_of(team, box=RigidObject("rigid_object", 1.0, held_by=("left",)))
    assert tuple(plant.model.names[1 : team.n + 1]) == team.joint_names
    np.testing.assert_array_equal(plant.model.armature[: team.n], team.model.armature)
    np.testing.assert_array_equal(plant.q0[: team.n], team.q0)
    loads = plant.external_loads(plant.q0, np.zeros(plant.model.nv))
    np.testing.assert_allclose(loads.coupling_torque, 0.0, atol=1e-9)
    assert len(plant.couplings) == 1
    rng = np.random.default_rng(0)
    v, load = rng.uniform(-1.0, 1.0, (2, plant.model.nv))
    free = team.forward_dynamics(team.q0, v[: team.n], load[: team.n])
    np.testing.assert_allclose(plant.acceleration(plant.q0, v, load)[: team.n], free, rtol=1e-9)


def test_a_loose_body_does_not_change_the_team_s_motion():
    """Closed-form arms move equally with and without a loose box."""
    robots = PlanarArms().robots()
    torque = np.array([1.0, 2.0, -3.0, 0.5])

    def end(**around: SurroundingBlock) -> np.ndarray:
        simulation = TeamSimulation(plant_of(Team(robots), **around), 200.0)
        for _ in range(100):
            simulation.step(torque)
        return simulation.q

    loose = RigidObject("rigid_object", 1.0, stiffness=0.0, damping=0.0)
    np.testing.assert_allclose(end(box=loose), end(), rtol=1e-12)


def test_unknown_frames_are_an_error():
    """A coupling with an unknown frame is an error."""
    wall = Wall("wall", (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)).build("wall", masses())[1]
    couplings: Sequence = [wall[0].__class__(("nothing",), *[0.0] * 4)]
    with pytest.raises(KeyError, match="nothing"):
        Plant(masses(), (), couplings)
