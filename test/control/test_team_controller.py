# SPDX-License-Identifier: Apache-2.0
"""The controller of a team in closed loop: noninteraction, changes without a bump, stops."""

from dataclasses import replace

import numpy as np
import pytest
from planar_arms import UNLIKE, PlanarArms

from noninteract_ros.control.controller import TeamController
from noninteract_ros.control.law.decoupling import LAWS, commanded_acceleration
from noninteract_ros.control.law.impedance import ImpedanceSettings, stack_impedance
from noninteract_ros.control.references.inputs import Force, Rate, Target
from noninteract_ros.control.references.subtask_input import InputSettings
from noninteract_ros.control.safety.continuity import JUMP
from noninteract_ros.control.tick import Tick
from noninteract_ros.errors import ScenarioError
from noninteract_ros.simulation.plant import Plant
from noninteract_ros.simulation.team_simulation import TeamSimulation
from noninteract_ros.subtasks.kinds.cooperative_position import CooperativePosition
from noninteract_ros.subtasks.kinds.relative_position import RelativePosition
from noninteract_ros.subtasks.reference import Reference
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

STEP = 1e-3
SOFT = ImpedanceSettings((25.0,), (20.0,))
STIFF = ImpedanceSettings((200.0,), (60.0,), inertia=(2.0,))
RELATIVE = ImpedanceSettings((50.0,), (25.0,))
COOPERATIVE, APART = slice(0, 2), slice(2, 4)


class ArmsLoop:
    """Two unlike planar arms in a vertical plane with their controller, at 1 kHz.

    Args:
        law: Law in force.
        takeover: How full references are taken over.
        keys: Further arguments of the controller.
    """

    def __init__(self, law: str = "noninteracting", takeover: str = "shaped", **keys) -> None:
        robots = PlanarArms(UNLIKE).robots()
        self.team = Team(
            [replace(robots[0], initial_position=np.array([2.2, -1.4])), robots[1]],
            (0.0, -9.81, 0.0),
        )
        subtasks = [
            CooperativePosition("cooperative_position").build("cooperative", self.team),
            RelativePosition("relative_position").build("relative", self.team),
        ]
        inputs = [InputSettings("human", takeover=takeover), InputSettings("autonomy")]
        stack = SubtaskStack(self.team, subtasks)
        self.controller = TeamController(self.team, stack, law, [SOFT, RELATIVE], inputs, **keys)
        self.simulation = TeamSimulation(Plant(self.team), 1.0 / STEP)

    @property
    def now(self) -> float:
        return self.simulation.now

    def say(self, item, subtask: str = "cooperative", source: str = "human") -> None:
        """An input of a source for now."""
        self.controller.inputs[subtask].sources[source].receive(self.now, item, self.now)

    def answer(self) -> Tick:
        """The controller's answer to the present state, without moving on."""
        return self.controller.step(self.now, self.simulation.q, self.simulation.v)

    def tick(self) -> Tick:
        """One tick of controller and team."""
        found = self.answer()
        self.simulation.step(found.torque)
        return found

    def run(self, count: int, rate=None) -> list[Tick]:
        """Several ticks, the human asking for a velocity at each."""
        found = []
        for _ in range(count):
            if rate is not None:
                self.say(Rate(np.array(rate)))
            found.append(self.tick())
        return found


def torques(ticks: list[Tick]) -> np.ndarray:
    return np.array([tick.torque for tick in ticks])


def test_first_torque_holds_the_team():
    """Without input the team is held where it stands, by its gravity torque, and stays."""
    loop = ArmsLoop()
    first = loop.tick()
    assert first.restarted == "the first state"
    np.testing.assert_allclose(first.torque, loop.team.gravity(loop.team.q0), atol=1e-12)
    assert np.abs(first.torque).max() > 5.0
    assert all(not tick.restarted for tick in loop.run(200))
    np.testing.assert_allclose(loop.simulation.q, loop.team.q0, atol=1e-9)


def test_torque_is_the_law_s():
    """The torque is M S (a - J_rate v) + C v + g for the commanded task acceleration."""
    loop = ArmsLoop()
    tick = loop.run(300, (0.1, 0.06))[-1]
    state, v = tick.state, tick.state.v
    acceleration = np.linalg.solve(tick.task.J, tick.task_acceleration - tick.task.J_rate @ v)
    expected = state.M @ acceleration + state.C @ v + state.g
    np.testing.assert_allclose(tick.torque, expected, atol=1e-10)
    np.testing.assert_allclose(tick.x_rate, tick.task.J @ v, atol=1e-12)


def test_a_led_subtask_moves_no_other():
    """A human motion of the mean leaves the arms' distance to what one tick's hold costs."""
    loop = ArmsLoop()
    ticks = loop.run(600, (0.1, 0.06))
    moved = ticks[-1].task.x - ticks[0].task.x
    assert np.abs(moved[COOPERATIVE]).min() > 0.02
    errors = np.abs([tick.error.e for tick in ticks])
    assert errors[:, APART].max() < 1e-4


def test_input_without_authority_leaves_torques_bit_equal():
    """Inputs of every kind from the source without authority change no bit of any torque."""
    alone, disturbed = ArmsLoop(), ArmsLoop()
    found = []
    for loop in (alone, disturbed):
        ticks = []
        for k in range(200):
            loop.say(Rate(np.array([0.2, 0.1])))
            if loop is disturbed:
                zero = np.zeros(2)
                loop.say(Target(np.ones(2), zero), "cooperative", "autonomy")
                loop.say(Force(np.ones(2)), "cooperative", "autonomy")
                loop.say(Reference(zero, zero + k, zero), "relative", "human")
                loop.say(Force(np.full(2, -7.0)), "relative", "human")
            ticks.append(loop.tick())
        found.append(torques(ticks))
    np.testing.assert_array_equal(*found)


CHANGES = [
    pytest.param(lambda c: c.set_impedance("cooperative", STIFF), id="gains"),
    pytest.param(lambda c: c.set_impedance("relative", STIFF), id="other gains"),
    pytest.param(lambda c: c.set_law("natural"), id="natural"),
    pytest.param(lambda c: c.set_law("paper"), id="paper"),
    pytest.param(lambda c: c.set_authority("cooperative", "autonomy"), id="authority"),
    pytest.param(lambda c: c.set_authority("cooperative", "hold"), id="hold"),
    pytest.param(lambda c: c.stop(), id="stop"),
    pytest.param(
        lambda c: (c.set_law("natural"), c.set_impedance("relative", STIFF), c.stop()), id="all"
    ),
]


def disturbed_loop(**keys) -> ArmsLoop:
    """A loop in full motion, with errors in both subtasks and a force input."""
    loop = ArmsLoop(**keys)
    loop.say(Force(np.array([2.0, -3.0])))
    loop.simulation.push("arm_1", np.array([6.0, 3.0, 0.0, 0.0, 0.0, 0.0]), False, 0.1)
    loop.run(150, (0.1, 0.06))
    e = loop.answer().error.e
    assert min(np.abs(e[COOPERATIVE]).max(), np.abs(e[APART]).max()) > 1e-3
    return loop


@pytest.mark.parametrize("change", CHANGES)
def test_torque_is_continuous_at_a_change(change):
    """At the tick of a change the torque is what it would be without it, and then goes on."""
    same, changed = disturbed_loop(), disturbed_loop()
    change(changed.controller)
    for loop in (same, changed):
        loop.say(Rate(np.array([0.1, 0.06])))
    expected, found = same.tick().torque, changed.tick().torque
    bump = np.abs(found - expected).max()
    # A change of authority shapes the reference: one tick of bounded jerk, 50 m/s^3.
    assert bump < 0.5
    after = np.diff([found, *torques(changed.run(100, (0.1, 0.06)))], axis=0)
    steady = np.diff([expected, *torques(same.run(100, (0.1, 0.06)))], axis=0)
    assert np.abs(after).max() < np.abs(steady).max() + 1.5


@pytest.mark.parametrize("change", [*CHANGES[:4], *CHANGES[6:]])
def test_changes_of_law_gains_and_stop_start_exactly_where_the_old_ones_were(change):
    """Gains, laws and stops fade from the very torque that was in force."""
    same, changed = disturbed_loop(), disturbed_loop()
    change(changed.controller)
    np.testing.assert_allclose(changed.tick().torque, same.tick().torque, atol=1e-10)


@pytest.mark.parametrize("law", LAWS)
def test_the_new_law_is_in_force_after_the_transition_time(law):
    """After the fade, not before, the torque is exactly the new law's with the new gains."""
    keys = {"transition_time": 0.05}
    loop = disturbed_loop(**keys)
    loop.controller.set_law(law)
    loop.controller.set_impedance("cooperative", STIFF)
    fading = loop.run(51, (0.1, 0.06))
    for tick, over in ((fading[25], False), (loop.tick(), True)):
        impedance = stack_impedance(loop.controller.stack.subtasks, [STIFF, RELATIVE])
        wanted = commanded_acceleration(law, tick.dynamics, tick.error, impedance)
        assert (np.abs(tick.task_acceleration - wanted).max() < 1e-9) == over


def test_a_fade_of_one_subtask_s_gains_is_felt_by_no_other():
    """While gains and inertia of one subtask fade, the other's acceleration is bit-equal."""
    same, changed = disturbed_loop(), disturbed_loop()
    changed.controller.set_impedance("cooperative", STIFF)
    for loop in (same, changed):
        loop.run(1)
    for k in range(40):
        # Both controllers answer the same states, so that only their gains differ.
        same.simulation.q, same.simulation.v = changed.simulation.q, changed.simulation.v
        for loop in (same, changed):
            loop.say(Rate(np.array([0.1, 0.06])))
        a, b = same.tick().task_acceleration, changed.tick().task_acceleration
        np.testing.assert_array_equal(a[APART], b[APART])
        assert k < 5 or np.abs(a[COOPERATIVE] - b[COOPERATIVE]).max() > 1e-3


def test_a_change_during_a_fade_is_continuous_too():
    """A second change half-way through a fade starts from the torque of the fade."""
    same, changed = disturbed_loop(), disturbed_loop()
    for loop in (same, changed):
        loop.controller.set_law("natural")
        loop.run(60, (0.1, 0.06))
    changed.controller.set_impedance("relative", STIFF)
    np.testing.assert_allclose(changed.tick().torque, same.tick().torque, atol=1e-10)


def test_stop_damps_to_rest_and_ignores_every_input():
    """Stopped, joint velocities decay at one rate to rest, whatever the sources say."""
    loop = disturbed_loop()
    loop.controller.stop()
    fastest = np.abs(loop.run(1)[0].x_rate).max()
    rate = 4.0 * np.sqrt(50.0 / fastest)  # Within 30 and 60 1/s.
    loop.run(120)
    v = loop.simulation.v.copy()
    assert np.abs(v).max() > 5e-3
    zero = np.zeros(2)
    for k in range(50):
        loop.say(Reference(zero + k, zero + 1.0, zero))
        loop.say(Force(np.full(2, 30.0)))
        led = loop.tick().led
        assert all(item.source == "hold" for item in led)
    np.testing.assert_allclose(loop.simulation.v, v * (1.0 - rate * STEP) ** 50, rtol=0.02)
    loop.run(300)
    assert np.abs(loop.simulation.v).max() < 1e-6


def test_stop_is_latched():
    """Changes of law, gains and authority, a gap and a reset of time leave a stop in force."""
    loop = disturbed_loop()
    loop.controller.stop()
    loop.run(2000)
    loop.controller.set_law("natural")
    loop.controller.set_impedance("relative", STIFF)
    loop.controller.set_authority("relative", "human")
    loop.controller.reset()
    q = loop.simulation.q.copy()
    loop.run(300, (0.5, 0.5))
    assert loop.controller.mode.stopped
    np.testing.assert_allclose(loop.simulation.q, q, atol=1e-6)


def test_inputs_do_not_pile_up_during_a_stop():
    """Inputs that fall due during a stop are removed from the queues of both sources."""
    loop = ArmsLoop()
    loop.controller.stop()
    loop.run(50, (0.1, 0.1))
    assert all(
        len(source._motions) <= 1
        for source in loop.controller.inputs["cooperative"].sources.values()
    )


@pytest.mark.parametrize("ticks", [3, 100, 3000])
def test_resume_has_no_torque_step_and_holds_where_it_is(ticks):
    """After a resume every subtask holds where it is, until it hears anew; no torque steps."""
    loop = disturbed_loop()
    loop.controller.stop()
    loop.run(ticks, (0.1, 0.06))
    same = loop.answer().torque
    loop.controller.resume()
    found = loop.tick()
    np.testing.assert_allclose(found.torque, same, atol=1e-10)
    held = found.task.x
    after = loop.run(500)
    jerks = np.diff([found.torque, *torques(after)], axis=0)
    assert np.abs(jerks).max() < 1.0
    for tick in after:
        targets = np.concatenate([item.reference.position for item in tick.led])
        np.testing.assert_allclose(targets, held, atol=1e-12)
        assert all(item.silent for item in tick.led)
    if ticks == 3000:
        np.testing.assert_allclose(after[-1].task.x, held, atol=1e-6)


def test_inputs_from_before_a_resume_are_forgotten():
    """A reference given during the stop does not start a motion at the resume."""
    loop = ArmsLoop()
    loop.controller.stop()
    loop.run(5, (0.1, 0.06))
    loop.controller.resume()
    ticks = loop.run(100)
    np.testing.assert_allclose(ticks[-1].task.x, ticks[0].task.x, atol=1e-9)
    loop.run(200, (0.1, 0.06))
    assert np.abs(loop.answer().task.x - ticks[0].task.x).max() > 1e-3


def test_a_team_put_elsewhere_starts_anew():
    """A jump of the state puts every subtask to rest where the team now is, and says which."""
    loop = disturbed_loop()
    loop.simulation.reset()
    loop.simulation.q[3] += 5.0 * JUMP
    tick = loop.answer()
    assert "joint_2 jumped by" in tick.restarted or "joint_1 jumped by" in tick.restarted
    np.testing.assert_allclose(tick.error.e, np.zeros(4), atol=1e-12)
    np.testing.assert_allclose(tick.torque, loop.team.gravity(loop.simulation.q), atol=1e-9)


@pytest.mark.parametrize("stops", [True, False])
def test_a_team_put_back_is_pushed_by_nothing_of_before(stops):
    """After a reset near the start no reference and no fading torque goes on."""
    loop = ArmsLoop()
    loop.run(60, (0.1, 0.06))
    spent = loop.controller.gate.account.number
    if stops:
        loop.controller.stop()
        loop.tick()
    loop.simulation.reset()
    loop.controller.reset_state()
    if stops:
        loop.controller.resume()
    ticks = loop.run(50)
    assert ticks[0].restarted == "put back to its start"
    assert ticks[0].account.number > spent
    for tick in ticks:
        np.testing.assert_allclose(tick.torque, loop.team.gravity(loop.team.q0), atol=1e-9)


def test_a_fast_team_seen_seldom_has_not_jumped():
    """A joint that moves as its velocity says has not been put elsewhere."""
    loop = ArmsLoop()
    loop.tick()
    v = np.array([3.0, 0.0, 0.0, 0.0])
    tick = loop.controller.step(0.101, loop.team.q0 + 0.1 * v, v)
    assert not tick.restarted


@pytest.mark.parametrize(("gap", "restarts"), [(0.199, False), (0.25, True)])
def test_a_gap_between_states_starts_anew(gap, restarts):
    """States that fail to come for longer than the timeout put every subtask to rest."""
    loop = disturbed_loop()
    q, v = loop.simulation.q, loop.simulation.v * 0.0
    tick = loop.controller.step(loop.now - STEP + gap, q, v)
    assert bool(tick.restarted) == restarts
    assert restarts == bool(np.abs(tick.error.e).max() < 1e-12)
    assert not restarts or tick.restarted.startswith("no state for 0.2")


def test_reset_forgets_the_past():
    """After a reset time may start anew, nothing is heard of the sources, and nothing jumps."""
    loop = disturbed_loop()
    loop.controller.reset()
    tick = loop.controller.step(0.0, loop.simulation.q, loop.simulation.v * 0.0)
    assert tick.restarted == "the first state"
    assert all(item.silent for item in tick.led)
    sources = loop.controller.inputs["cooperative"].sources.values()
    assert all(source.complete_until == -np.inf for source in sources)


def test_gains_that_do_not_fit_are_refused_and_nothing_changes():
    """A list of the wrong length raises and leaves mode, torques and later changes alone."""
    same, changed = disturbed_loop(), disturbed_loop()
    before = changed.controller.mode
    for bad in (
        ImpedanceSettings((1.0, 2.0, 3.0), (1.0,)),
        ImpedanceSettings((1.0,), ()),
        ImpedanceSettings((1.0,), (1.0,), potential="saturating"),
    ):
        with pytest.raises(ScenarioError, match=r"^cooperative\."):
            changed.controller.set_impedance("cooperative", bad)
    assert changed.controller.mode is before
    for loop in (same, changed):
        loop.controller.set_impedance("relative", STIFF)
    np.testing.assert_array_equal(torques(same.run(20)), torques(changed.run(20)))


def test_feedback_is_the_coupling_force():
    """The feedback of an operator is D e_rate + h(e) of the gains in force."""
    tick = disturbed_loop().tick()
    K, D = np.array([25.0, 25.0, 50.0, 50.0]), np.array([20.0, 20.0, 25.0, 25.0])
    np.testing.assert_allclose(tick.feedback, D * tick.error.e_rate + K * tick.error.e, rtol=1e-12)


def test_energy_of_a_tick_balances():
    """The energies of a tick obey (33) with the push that acts."""
    loop = disturbed_loop()
    tick = loop.tick()
    found = loop.controller.energy(tick, np.array([1.0, -2.0, 0.5, 3.0]))
    np.testing.assert_allclose(found.rate, found.supplied - found.dissipated, atol=1e-10)
    assert (found.storage > 0.0).all()


def test_two_equal_loops_are_bit_equal():
    """The same inputs give the same bits."""
    np.testing.assert_array_equal(
        torques(disturbed_loop().run(50)), torques(disturbed_loop().run(50))
    )
