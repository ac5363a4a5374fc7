# SPDX-License-Identifier: Apache-2.0
"""The controller on topics of each robot: exact together, good apart, still if one is late."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from harness import Ros
from own_robots import Hall, HandDriven, drivers, hand_driven, one_topic, own_robots
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState
from waiting import until

from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.nodes.messages.messages import SubtaskCodec
from noninteract_ros.scenario import Scenario

# The clock on the wall decides nothing in these tests.
PATIENT = {"state_timeout": 1000.0}


@pytest.fixture
def halls(ros: Ros) -> Iterator[Any]:
    """A maker of halls that are cleared away."""
    made: list[HandDriven] = []

    def make(**changes: Any) -> Hall:
        hall = Hall(ros, own_robots(**(PATIENT | changes)))
        made.append(hall.controller)
        return hall

    yield make
    for controller in made:
        controller.destroy_node()


def test_equal_stamps_are_the_single_topic_to_the_bit(ros: Ros) -> None:
    """States told robot by robot, in any order, are answered as the same states on one topic."""
    values = own_robots(**PATIENT)
    apart, together = hand_driven(ros, values), hand_driven(ros, one_topic(values))
    team = Scenario.from_dict(values).build_team()
    codec = JointStateCodec(team.joint_names)
    rng = np.random.default_rng(4)
    arms = drivers()
    for tick in range(1, 40):
        q, v = team.q0 + rng.uniform(-0.02, 0.02, 4), rng.uniform(-1.0, 1.0, 4)
        together.hear("/team/joint_states", codec.encode(10**6 * tick, q, v))
        together.run_once()
        for name in rng.permutation(team.names):
            part = team.velocity_slices[team.index(name)]
            data = arms[name].state(10**6 * tick, q[part], v[part])
            apart.hear(arms[name].states_topic, data)
        apart.run_once()
        assert together.said["/team/joint_commands"] == apart.said["/team/joint_commands"]
        expected = codec.decode(together.said["/team/joint_commands"][-1])
        told = codec.decode(apart.said["/team/joint_states"][-1])
        np.testing.assert_array_equal([told.position, told.velocity], [q, v])
        for name, arm in arms.items():
            part = team.velocity_slices[team.index(name)]
            arm.hear(apart.said[arm.effort_topic][-1])
            applied = arm.applied(team.gravity(q)[part])
            np.testing.assert_allclose(applied, expected.effort[part], rtol=1e-13, atol=1e-13)
    assert len(apart.said["/team/joint_commands"]) == 39
    apart.destroy_node()
    together.destroy_node()


class Human:
    """Leads the middle of the grasp in a hall there and back, at up to 0.5 m/s."""

    def __init__(self, hall: Hall) -> None:
        task = hall.stack.subtasks[0]
        self._hall, self._codec = hall, SubtaskCodec(task.name, task.elements, task.axes)
        self._start = hall.stack.evaluate(hall.team.state(hall.team.q0, np.zeros(4))).x[:2]

    def lead(self, now: float) -> None:
        """Says where the middle is to be at a time [s]."""
        w, along = 2.0 * np.pi / 0.8, np.array([0.04, -0.05])
        shape = np.array([1.0 - np.cos(w * now), w * np.sin(w * now), w**2 * np.cos(w * now)])
        position, velocity, acceleration = shape[:, None] * along
        words = self._codec.encode(0, self._start + position, velocity, acceleration)
        self._hall.controller.hear("/team/cooperative/human/reference", words)


def run(hall: Hall, age: int) -> tuple[float, float]:
    """Largest relative error [m] and joint acceleration [rad/s^2]; the right arm is heard late.

    Args:
        hall: A hall at two ticks a millisecond, in which the controller takes a turn each.
        age: How many ticks late.
    """
    told: list[bytes] = []
    human, error, acceleration = Human(hall), 0.0, 0.0
    for tick in range(round(0.5 * hall.simulation.rate)):
        told.append(hall.state("right"))
        if tick % 2 == 0:
            hall.tell("left")
            hall.controller.hear(hall.drivers["right"].states_topic, told[max(0, tick - age)])
            human.lead(hall.simulation.now)
            hall.turn()
        v = hall.simulation.v
        hall.step()
        error = max(error, hall.error("relative"))
        change = float(np.abs(hall.simulation.v - v).max())
        acceleration = max(acceleration, change * hall.simulation.rate)
    assert hall.status()[1] == "holding relative: source silent"
    return error, acceleration


@pytest.mark.parametrize("prediction", ["velocity", "acceleration"])
def test_states_of_different_times_cost_what_the_prediction_does(
    halls: Any, prediction: str
) -> None:
    """Constant velocity lets D / K times the velocity's error through; acceleration far less.

    The velocity of an arm with 1 m of reach is wrong by up to a d; in a slow motion the relative
    spring gives way to the damper's force by D / K of it.
    """
    changes = {"state_prediction": prediction, "cooperative": {"takeover": "direct"}}
    floor, _ = run(halls(**changes), 0)
    assert floor < 1e-5
    errors = []
    for age in (1, 3, 6):  # 0.5, 1.5 and 3 ms
        error, acceleration = run(halls(**changes), age)
        allowed = 90.0 / 900.0 * acceleration * age * 0.5e-3
        if prediction == "velocity":
            assert 0.1 * allowed < error < allowed + floor
        else:
            assert error < 0.02 * allowed + floor
        errors.append(error)
    if prediction == "velocity":
        np.testing.assert_allclose(np.array(errors) / errors[0], [1.0, 3.0, 6.0], rtol=0.03)


def test_a_late_robot_holds_the_whole_team_until_it_is_back(halls: Any) -> None:
    """Who is late is said; the others brake; nobody is pulled when it returns."""
    hall = halls(cooperative={"takeover": "direct"})
    human = Human(hall)
    for tick in range(300):
        human.lead(1e-3 * tick)
        hall.tell("left", "right")
        hall.turn()
        hall.step()
        hall.step()
    assert np.abs(hall.simulation.v[:2]).max() > 0.1
    assert hall.status()[0] < 2
    for tick in range(300, 700):
        human.lead(1e-3 * tick)
        hall.tell("left")
        hall.turn()
        expected = (2, "holding: states of right are more than 20 ms older than the others")
        assert (hall.status() == expected) == (tick > 340)
        hall.step()
        hall.step()
    assert np.abs(hall.simulation.v[:2]).max() < 1e-3
    told = deserialize_message(hall.controller.said["/team/joint_states"][-1], JointState)
    gravity = hall.team.gravity(np.array(told.position))
    np.testing.assert_allclose(hall.drivers["right"].applied(gravity[2:]), gravity[2:])
    assert hall.controller.core.mode.stopped
    assert not hall.controller.services_answer("resume").success
    for _ in range(30):
        hall.tell("left", "right")
        hall.turn()
        hall.step()
        hall.step()
    assert not hall.controller.core.mode.stopped
    assert hall.status()[1].startswith("holding cooperative, relative: source silent")


def test_a_hitch_is_waited_out(halls: Any) -> None:
    """After a silence of all somebody is heard first: the other is waited for, nobody stopped."""
    hall = halls()
    hall.tell("left", "right")
    hall.turn()
    for _ in range(50):
        hall.step()
    answers = hall.controller.said["/team/joint_commands"]
    for name, count in (("left", 1), ("right", 2)):
        hall.tell(name)
        hall.turn()
        assert len(answers) == count
        assert hall.status()[0] < 2


def test_a_stop_that_was_asked_for_outlasts_a_late_robot(halls: Any) -> None:
    """What a person stopped stays stopped."""
    hall = halls()
    for tick in range(100):
        hall.tell("left", *(("right",) if not 20 <= tick < 80 else ()))
        if tick == 70:
            assert hall.status()[0] == 2
            assert hall.controller.services_answer("stop").success
        hall.turn()
        hall.step()
        hall.step()
    assert hall.status() == (1, "stopped")


def test_before_every_robot_has_spoken_nothing_is_commanded(halls: Any) -> None:
    """Who has not is named; an arm of which one joint is missing has not."""
    hall = halls()
    hall.tell("left")
    hall.turn()
    assert hall.status() == (1, "waiting for the first state of right")
    half = JointState(name=["joint_2"], position=[1.8], velocity=[0.0])
    half.header.stamp.sec = 1
    hall.controller.hear("/team/right/joint_states", serialize_message(half))
    hall.turn()
    assert hall.status() == (1, "waiting for the first state of right")
    assert not hall.controller.said["/team/joint_commands"]
    half.name, half.position = ["joint_1"], [0.9]
    hall.controller.hear("/team/right/joint_states", serialize_message(half))
    hall.turn()
    assert len(hall.controller.said["/team/joint_commands"]) == 1


def test_without_states_torques_fade_to_gravity(halls: Any) -> None:
    """No torque of a motion stays in force where the states of all robots have stopped."""
    hall = halls(state_timeout=0.05, transition_time=0.05)
    hall.simulation.v = np.array([0.3, -0.2, 0.1, 0.4])
    for _ in range(20):
        hall.tell("left", "right")
        hall.turn()
        hall.step()
    told = deserialize_message(hall.controller.said["/team/joint_states"][-1], JointState)
    gravity = hall.team.gravity(np.array(told.position))
    left, right = hall.drivers["left"], hall.drivers["right"]
    assert left.applied(np.zeros(2)).any()
    assert np.abs(right.applied(gravity[2:]) - gravity[2:]).max() > 1e-3

    def faded() -> bool:
        hall.turn()
        left_alone = not left.applied(np.zeros(2)).any()
        return left_alone and np.allclose(right.applied(gravity[2:]), gravity[2:], rtol=1e-12)

    until(faded, "gravity alone")
