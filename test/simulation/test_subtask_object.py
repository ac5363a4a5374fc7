# SPDX-License-Identifier: Apache-2.0
"""Object of Section V, held by the paper's team, against closed-form equations."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.integrate import solve_ivp

from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario import Scenario
from noninteract_ros.simulation.subtask_object import ObjectSettings, SubtaskObject
from noninteract_ros.subtasks.reference import Reference

PAPER = Path(__file__).resolve().parents[2] / "config" / "paper.yaml"
DURATION = 1.2


def scenario(rate: float, sign: str = "physical", **keys) -> Scenario:
    """Build the paper's scenario at a rate, with the object's sign and further keys changed."""
    values = yaml.safe_load(PAPER.read_text())["/**"]["ros__parameters"]
    values["rate"] = rate
    values["object"]["sign"] = sign
    return Scenario.from_dict(values | keys)


def human(t: float) -> Reference:
    """Return the paper's operator motion, from the start."""
    angle = 0.79 * t
    return Reference(
        np.array([2.0 * np.sin(angle), 1.0]),
        np.array([1.58 * np.cos(angle), 0.0]),
        np.array([-2.0 * 0.79**2 * np.sin(angle), 0.0]),
    )


def simulate(rate: float, sign: str) -> np.ndarray:
    """Return subtask values at each tick under the controller, shape (ticks, 4)."""
    given = scenario(rate, sign)
    team = given.build_team()
    stack = given.build_stack(team)
    controller = given.build_controller(team, stack)
    simulation = given.build_simulation(team, stack)
    values = []
    for _ in range(round(DURATION * rate)):
        now = simulation.now
        sources = [item.sources for item in controller.inputs.values()]
        sources[0]["human"].receive(now, human(now), now)
        sources[1]["autonomy"].receive(now, Reference.at_rest([1.0, 1.0]), now)
        tick = controller.step(now, simulation.q, simulation.v)
        values.append(tick.task.x)
        simulation.step(tick.torque)
    return np.array(values)


def exact(rate: float, sign: float, first: np.ndarray) -> np.ndarray:
    """Solve the scalar equations coordinate by coordinate.

    3 e'' + 53 e' + 25 e = s m_o x'' on the cooperative and 0.75 e'' + 25 e' + 50 e =
    s k_o (x - rest) on the relative subtask, with e the value less its reference.
    """
    m_o, k_o = sign * 1.0, sign * 20.0
    times = np.arange(round(DURATION * rate)) / rate
    columns = []
    for i in range(2):

        def cooperative(t, y, i=i):
            wanted = human(t)
            e, e_rate = y[0] - wanted.position[i], y[1] - wanted.velocity[i]
            pull = 3.0 * wanted.acceleration[i] - 53.0 * e_rate - 25.0 * e
            return [y[1], pull / (3.0 - m_o)]

        columns.append((cooperative, first[i]))
    for i in range(2, 4):

        def relative(t, y):
            return [y[1], (k_o * (y[0] - 1.0) - 25.0 * y[1] - 50.0 * (y[0] - 1.0)) / 0.75]

        columns.append((relative, first[i]))
    solutions = [
        solve_ivp(f, (0, DURATION), [x, 0.0], "DOP853", times, rtol=1e-11, atol=1e-13).y[0]
        for f, x in columns
    ]
    return np.array(solutions).T


@pytest.mark.parametrize(("sign", "value"), [("physical", -1.0), ("paper", 1.0)])
def test_subtasks_follow_their_scalar_equations(sign, value):
    """Each subtask obeys its own scalar equation, to 2e-3 m at 1 kHz and half that at 2 kHz."""
    deviations = []
    for rate in (1000.0, 2000.0):
        found = simulate(rate, sign)
        deviations.append(np.abs(found - exact(rate, value, found[0])).max())
    assert deviations[0] < 2e-3
    assert deviations[0] / deviations[1] == pytest.approx(2.0, rel=0.1)


def test_the_two_signs_are_not_the_same():
    """The printed sign of Section V gives another motion than the physical one."""
    first = np.array([0.0, 0.0, 0.6, 0.8])
    gap = np.abs(exact(100.0, -1.0, first) - exact(100.0, 1.0, first)).max(axis=0)
    assert gap[0] > 0.01
    assert gap[2] > 0.01


def held(**keys) -> tuple[Scenario, SubtaskObject]:
    given = scenario(1000.0)
    stack = given.build_stack(given.build_team())
    return given, SubtaskObject(ObjectSettings(**keys), stack)


def test_physical_object_carries_momentum_and_strains():
    """Free of torques the mass adds to the team's own, and the spring pulls towards its rest."""
    given, item = held(mass=1.0, stiffness=20.0, rest=(1.0, 1.0))
    team = given.build_team()
    state = team.state(np.array([1.0, 0.0, -1.0, 0.0]), np.zeros(4))
    A, b = item.torque_terms(state)
    # tau~_c = M_c J_c M^-1 tau = 3 kg * 0.5 * 4 m/s^2 = 6 N moves 3 kg + 1 kg.
    acceleration = np.linalg.solve(state.M - A, np.array([4.0, 0.0, 0.0, 0.0]))
    np.testing.assert_allclose(acceleration[:2] + acceleration[2:], [3.0, 0.0], atol=1e-12)
    # The relative value (2, 0) strains the spring by (1, -1): tau~_r = (-20, 20) N. Gamma brings
    # it to the joints as (2/3, -4/3), which moves the unlike robots' mean as little as the law.
    np.testing.assert_allclose(b, np.array([-40.0, 40.0, 80.0, -80.0]) / 3.0, atol=1e-12)


def test_reported_wrenches_have_the_object_s_torque():
    """The reported wrenches explain the acceleration beyond the control torque."""
    given = scenario(1000.0)
    team = given.build_team()
    simulation = given.build_simulation(team, given.build_stack(team))
    torque = np.array([1.0, 2.0, -1.0, 0.5])
    simulation.step(torque)
    state = team.state(simulation.q, simulation.v)
    external = team.external_torque(state, simulation.external_wrenches())
    assert np.abs(external).max() > 1.0
    acceleration = np.linalg.solve(state.M, torque + external)
    before = simulation.v.copy()
    simulation.step(torque)
    np.testing.assert_allclose((simulation.v - before) * 1000.0, acceleration, atol=0.05)


@pytest.mark.parametrize("law", ["noninteracting", "natural", "paper"])
def test_brake_brings_team_and_object_to_rest(law):
    """Without commands the team with the object comes to rest, after any law."""
    given = scenario(500.0, law=law)
    team = given.build_team()
    simulation = given.build_simulation(team, given.build_stack(team))
    simulation.v = np.array([1.0, -1.0, 0.5, 2.0])
    for _ in range(2000):
        simulation.step(None)
    assert np.abs(simulation.v).max() < 1e-3


@pytest.mark.parametrize(
    ("keys", "key", "words"),
    [
        ({"carried_by": "coop"}, "object.carried_by", ["'coop'", "cooperative | relative"]),
        ({"grasped_by": "none"}, "object.grasped_by", ["'none'", "cooperative"]),
        ({"stiffness": 1.0, "rest": (1.0,)}, "object.rest", ["[1.0]", "2 numbers"]),
        ({"stiffness": 1.0}, "object.rest", ["[]", "2 numbers"]),
    ],
)
def test_an_object_that_does_not_fit_is_rejected(keys, key, words):
    """Unknown subtasks and a rest value of the wrong size are rejected by key."""
    with pytest.raises(ScenarioError) as caught:
        held(**keys)
    assert caught.value.key == key
    assert all(word in str(caught.value) for word in words)


def test_a_mass_alone_needs_no_rest():
    """Without stiffness the rest value is not needed."""
    given, item = held(mass=2.0)
    team = given.build_team()
    A, b = item.torque_terms(team.state(team.q0, np.zeros(4)))
    assert A.any()
    assert not b.any()
