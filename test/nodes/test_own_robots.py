# SPDX-License-Identifier: Apache-2.0
"""Controller with topics for each robot: equal, different and late stamps."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from harness import Ros
from own_robots import (
    SimulatedArms,
    SteppedController,
    drivers,
    own_robots,
    stepped_controller,
    with_team_topics,
)
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from waiting import until

from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.nodes.messages.messages import SubtaskCodec
from noninteract_ros.scenario import Scenario

# Wall time has no effect in these tests.
NO_TIMEOUT = {"state_timeout": 1000.0}


@pytest.fixture
def make_arms(ros: Ros) -> Iterator[Any]:
    """Factory of simulated arms whose controllers are destroyed after the test."""
    made: list[SteppedController] = []

    def make(**changes: Any) -> SimulatedArms:
        arms = SimulatedArms(ros, own_robots(**(NO_TIMEOUT | changes)))
        made.append(arms.controller)
        return arms

    yield make
    for controller in made:
        controller.destroy_node()


def test_equal_stamps_are_equivalent_to_a_single_topic(ros: Ros) -> None:
    """States received by robot, in any order, give the same commands as those on one topic."""
    values = own_robots(**NO_TIMEOUT)
    apart, together = (
        stepped_controller(ros, values),
        stepped_controller(ros, with_team_topics(values)),
    )
    team = Scenario.from_dict(values).build_team()
    codec = JointStateCodec(team.joint_names)
    rng = np.random.default_rng(4)
    arms = drivers()
    for tick in range(1, 40):
        q, v = team.q0 + rng.uniform(-0.02, 0.02, 4), rng.uniform(-1.0, 1.0, 4)
        together.receive("/team/joint_states", codec.encode(10**6 * tick, q, v))
        together.run_once()
        for name in rng.permutation(team.names):
            part = team.velocity_slices[team.index(name)]
            data = arms[name].state(10**6 * tick, q[part], v[part])
            apart.receive(arms[name].states_topic, data)
        apart.run_once()
        assert (
            together.published["/team/joint_commands"] == apart.published["/team/joint_commands"]
        )
        expected = codec.decode(together.published["/team/joint_commands"][-1])
        state = codec.decode(apart.published["/team/joint_states"][-1])
        np.testing.assert_array_equal([state.position, state.velocity], [q, v])
        for name, arm in arms.items():
            part = team.velocity_slices[team.index(name)]
            arm.receive(apart.published[arm.effort_topic][-1])
            applied = arm.applied(team.gravity(q)[part])
            np.testing.assert_allclose(applied, expected.effort[part], rtol=1e-13, atol=1e-13)
    assert len(apart.published["/team/joint_commands"]) == 39
    apart.destroy_node()
    together.destroy_node()


class Human:
    """Human source that moves the centre of the grasp back and forth at up to 0.5 m/s."""

    def __init__(self, arms: SimulatedArms) -> None:
        task = arms.stack.subtasks[0]
        self._arms, self._codec = arms, SubtaskCodec(task.name, task.elements, task.axes)
        self._start = arms.stack.evaluate(arms.team.state(arms.team.q0, np.zeros(4))).x[:2]

    def publish(self, now: float) -> None:
        """Deliver the reference of the centre at a time [s]."""
        w, along = 2.0 * np.pi / 0.8, np.array([0.04, -0.05])
        shape = np.array([1.0 - np.cos(w * now), w * np.sin(w * now), w**2 * np.cos(w * now)])
        position, velocity, acceleration = shape[:, None] * along
        message = self._codec.encode(0, self._start + position, velocity, acceleration)
        self._arms.controller.receive("/team/cooperative/human/reference", message)


def run(arms: SimulatedArms, age: int) -> tuple[float, float]:
    """Return the largest relative error [m] and joint acceleration [rad/s^2], one arm late.

    Args:
        arms: Arms at two ticks per millisecond; the controller runs once in a millisecond.
        age: Delay of the right arm's states [ticks].
    """
    states: list[bytes] = []
    human, error, acceleration = Human(arms), 0.0, 0.0
    for tick in range(round(0.5 * arms.simulation.rate)):
        states.append(arms.state("right"))
        if tick % 2 == 0:
            arms.publish_states("left")
            arms.controller.receive(arms.drivers["right"].states_topic, states[max(0, tick - age)])
            human.publish(arms.simulation.now)
            arms.run_controller()
        v = arms.simulation.v
        arms.step()
        error = max(error, arms.error("relative"))
        change = float(np.abs(arms.simulation.v - v).max())
        acceleration = max(acceleration, change * arms.simulation.rate)
    assert arms.status()[1] == "holding relative: source silent"
    return error, acceleration


@pytest.mark.parametrize("prediction", ["velocity", "acceleration"])
def test_errors_of_unequal_stamps_are_those_of_the_prediction(
    make_arms: Any, prediction: str
) -> None:
    """Constant velocity causes D / K times the velocity error; acceleration much less.

    The velocity of an arm with a reach of 1 m is wrong by up to a d. In a slow motion the damper
    force of this error displaces the relative spring by D / K of it.
    """
    changes = {"state_prediction": prediction, "cooperative": {"takeover": "direct"}}
    floor, _ = run(make_arms(**changes), 0)
    assert floor < 1e-5
    errors = []
    for age in (1, 3, 6):  # 0.5, 1.5 and 3 ms
        error, acceleration = run(make_arms(**changes), age)
        allowed = 90.0 / 900.0 * acceleration * age * 0.5e-3
        if prediction == "velocity":
            assert 0.1 * allowed < error < allowed + floor
        else:
            assert error < 0.02 * allowed + floor
        errors.append(error)
    if prediction == "velocity":
        np.testing.assert_allclose(np.array(errors) / errors[0], [1.0, 3.0, 6.0], rtol=0.03)


def test_a_late_robot_holds_the_whole_team(make_arms: Any) -> None:
    """Diagnostics name the late robot, the others brake, and its return moves no robot."""
    arms = make_arms(cooperative={"takeover": "direct"})
    human = Human(arms)
    for tick in range(300):
        human.publish(1e-3 * tick)
        arms.publish_states("left", "right")
        arms.run_controller()
        arms.step()
        arms.step()
    assert np.abs(arms.simulation.v[:2]).max() > 0.1
    assert arms.status()[0] < 2
    for tick in range(300, 700):
        human.publish(1e-3 * tick)
        arms.publish_states("left")
        arms.run_controller()
        expected = (2, "holding: states of right are more than 20 ms older than the others")
        assert (arms.status() == expected) == (tick > 340)
        arms.step()
        arms.step()
    assert np.abs(arms.simulation.v[:2]).max() < 1e-3
    received = deserialize_message(arms.controller.published["/team/joint_states"][-1], JointState)
    gravity = arms.team.gravity(np.array(received.position))
    np.testing.assert_allclose(arms.drivers["right"].applied(gravity[2:]), gravity[2:])
    assert arms.controller.core.mode.stopped
    assert not arms.controller.call_service("resume").success
    for _ in range(30):
        arms.publish_states("left", "right")
        arms.run_controller()
        arms.step()
        arms.step()
    assert not arms.controller.core.mode.stopped
    assert arms.status()[1].startswith("holding cooperative, relative: source silent")


def test_a_pause_of_all_robots_does_not_hold_the_team(make_arms: Any) -> None:
    """The first state after a pause waits for the other robot, without a hold."""
    arms = make_arms()
    arms.publish_states("left", "right")
    arms.run_controller()
    for _ in range(50):
        arms.step()
    answers = arms.controller.published["/team/joint_commands"]
    for name, count in (("left", 1), ("right", 2)):
        arms.publish_states(name)
        arms.run_controller()
        assert len(answers) == count
        assert arms.status()[0] < 2


def test_a_requested_stop_persists_after_a_late_robot(make_arms: Any) -> None:
    """Only the resume service ends a requested stop."""
    arms = make_arms()
    for tick in range(100):
        arms.publish_states("left", *(("right",) if not 20 <= tick < 80 else ()))
        if tick == 70:
            assert arms.status()[0] == 2
            assert arms.controller.call_service("stop").success
        arms.run_controller()
        arms.step()
        arms.step()
    assert arms.status() == (1, "stopped")


def test_nothing_is_commanded_before_all_robots_have_a_state(make_arms: Any) -> None:
    """Diagnostics name robots without a state, including those with a missing joint."""
    arms = make_arms()
    arms.publish_states("left")
    arms.run_controller()
    assert arms.status() == (1, "waiting for the first state of right")
    half = JointState(name=["joint_2"], position=[1.8], velocity=[0.0])
    half.header.stamp.sec = 1
    arms.controller.receive("/team/right/joint_states", serialize_message(half))
    arms.run_controller()
    assert arms.status() == (1, "waiting for the first state of right")
    assert not arms.controller.published["/team/joint_commands"]
    half.name, half.position = ["joint_1"], [0.9]
    arms.controller.receive("/team/right/joint_states", serialize_message(half))
    arms.run_controller()
    assert len(arms.controller.published["/team/joint_commands"]) == 1


def test_torques_fade_to_gravity_without_states(make_arms: Any) -> None:
    """No motion torque stays in force after the states of all robots have stopped."""
    arms = make_arms(state_timeout=0.05, transition_time=0.05)
    arms.simulation.v = np.array([0.3, -0.2, 0.1, 0.4])
    for _ in range(20):
        arms.publish_states("left", "right")
        arms.run_controller()
        arms.step()
    received = deserialize_message(arms.controller.published["/team/joint_states"][-1], JointState)
    gravity = arms.team.gravity(np.array(received.position))
    left, right = arms.drivers["left"], arms.drivers["right"]
    assert left.applied(np.zeros(2)).any()
    assert np.abs(right.applied(gravity[2:]) - gravity[2:]).max() > 1e-3

    def faded() -> bool:
        arms.run_controller()
        left_alone = not left.applied(np.zeros(2)).any()
        return left_alone and np.allclose(right.applied(gravity[2:]), gravity[2:], rtol=1e-12)

    until(faded, "gravity alone")
