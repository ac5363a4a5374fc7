# SPDX-License-Identifier: Apache-2.0
"""Controller node: live parameters, stop and resume, restarts."""

from typing import Any

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, WrenchStamped
from harness import Ros, Stack, paper
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.parameter import Parameter, parameter_value_to_python
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger
from waiting import until

from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.rehearsal import rehearse

JOINTS = ["robot_1/x", "robot_1/y", "robot_2/x", "robot_2/y"]
# The human strains the springs, so that each gain has an effect.
STRAINED: dict[str, Any] = {
    "haptic": {"motion": "still", "centre": [1.0, -0.5], "start_time": 0.0},
    "object": None,
    "force_sensors": None,
    "transition_time": 0.1,
}

SHAPED = {name: {"takeover": "shaped"} for name in ("cooperative", "relative")}


def change(ros: Ros, **values: Any) -> tuple[bool, str]:
    """Set parameters of the controller atomically; `__` stands for the dot in a key."""
    items = [Parameter(key.replace("__", "."), value=value) for key, value in values.items()]
    messages = [item.to_parameter_msg() for item in items]
    request = SetParametersAtomically.Request(parameters=messages)
    service = "controller/set_parameters_atomically"
    result = ros.call(SetParametersAtomically, service, request).result
    return result.successful, result.reason


def parameters(ros: Ros, *names: str) -> list[Any]:
    request = GetParameters.Request(names=list(names))
    values = ros.call(GetParameters, "controller/get_parameters", request).values
    return [parameter_value_to_python(value) for value in values]


def torque_steps(stack: Stack) -> np.ndarray:
    """Return the largest change of a joint torque between ticks [N]."""
    effort = stack.monitor.history(dict(stack.monitor.commands))[3]
    return np.abs(np.diff(effort, axis=0)).max(axis=1)


def test_law_and_gains_change_smoothly(ros: Ros) -> None:
    """Torques under strain are continuous, and the new gains come into force."""
    stack = ros.stack(paper(**STRAINED)).start()
    stack.run_until(0.2)
    before = stack.monitor.history(dict(stack.monitor.commands))[3][-1]
    ok, reason = change(
        ros,
        law="natural",
        cooperative__stiffness=[100.0, 100.0],
        relative__damping=[40.0, 40.0],
        relative__inertia=[1.5, 1.5],
    )
    assert ok, reason
    stack.run_until(stack.monitor.now + 0.15)
    until(lambda: stack.monitor.value("controller", "law") == "natural", "the law in force")
    assert change(ros, law="paper", cooperative__stiffness=[10.0, 10.0]) == (True, "")
    stack.run_until(stack.monitor.now + 0.15)
    names = ("law", "cooperative.stiffness", "relative.inertia")
    assert parameters(ros, *names) == ["paper", [10.0, 10.0], [1.5, 1.5]]
    changed = stack.monitor.value("controller", "changed parameters")
    assert changed == "cooperative.stiffness, law, relative.damping, relative.inertia"
    steps = torque_steps(stack)
    # A step to four times the stiffness would be 3 * 25 N/m * 0.9 m, shared by two robots.
    assert steps[5:].max() < 1.0
    after = stack.monitor.history(dict(stack.monitor.commands))[3]
    assert np.abs(after - before).max() > 5.0


REJECTED: list[tuple[dict[str, Any], str]] = [
    ({"law": "nointeracting"}, "law: found 'nointeracting', allowed: noninteracting | "),
    ({"tank__capacity": -1.0}, "tank.capacity: found -1.0, allowed: a number > 0"),
    ({"tank__reopening_level": 5.0}, "tank.reopening_level: found 5.0, allowed: above full_gate"),
    ({"cooperative__stiffness": [-1.0, 25.0]}, "cooperative.stiffness: found [-1.0, 25.0]"),
    ({"cooperative__stiffness": [1.0, 2.0, 3.0]}, "cooperative.stiffness: found [1.0, 2.0, 3.0]"),
    ({"relative__damping": [float("nan"), 1.0]}, "relative.damping: found [nan, 1.0]"),
    ({"relative__damping": [0.0, 0.0]}, "relative.damping: found [0.0, 0.0]"),
    ({"relative__damping": "stiff"}, "relative.damping: found 'stiff', allowed: a list"),
    ({"relative__authority": "robot"}, "relative.authority: found 'robot', allowed: "),
    ({"rate": 500.0}, "rate"),
    ({"relative__timeout": 2.0}, "relative.timeout"),
    ({"nonsense": 1.0}, "undeclared"),
    ({"law": "natural", "relative__damping": [-1.0, 1.0]}, "relative.damping"),
    ({"law": "natural", "rate": 500.0}, "rate"),
]


def test_rejected_changes_have_no_effect(ros: Ros) -> None:
    """The reason has the key; parameters and states stay the same bit by bit."""
    values = paper(**STRAINED)
    stack = ros.stack(values).start()
    stack.run_until(0.05)
    names = ("law", "cooperative.stiffness", "relative.damping", "relative.authority", "rate")
    before = parameters(ros, *names)
    for changes, expected in REJECTED:
        ok, reason = change(ros, **changes)
        assert not ok
        assert expected in reason
    assert parameters(ros, *names) == before
    t, q, _, effort = stack.monitor.history(dict(stack.monitor.states))
    expected_run = rehearse(Scenario.from_dict(values), t[-1])
    np.testing.assert_array_equal(q[:-1], expected_run.q)
    np.testing.assert_array_equal(effort[1:], expected_run.torque)


def test_unstable_laws_and_gains_are_rejected(ros: Ros) -> None:
    """The reason has a remedy; stable changes are accepted."""
    stack = ros.stack(paper(**STRAINED, law="noninteracting", rate=200.0)).start()
    stack.run_until(0.05)
    # M_r = 0.75 kg is stable up to 299 N s/m at 200 Hz; in Lambda the lighter robot has less.
    assert change(ros, relative__damping=[280.0, 280.0]) == (True, "")
    ok, reason = change(ros, law="natural")
    assert not ok
    assert "law natural, all subtasks: with the torque held over a tick of 5 ms" in reason
    assert "of its damping" in reason
    assert not change(ros, law="energy_gated")[0]
    assert not change(ros, relative__damping=[310.0, 310.0])[0]
    assert parameters(ros, "law", "relative.damping") == ["noninteracting", [280.0, 280.0]]
    assert change(ros, law="natural", relative__damping=[100.0, 100.0]) == (True, "")


def test_unstable_gains_may_be_reduced_in_steps(ros: Ros) -> None:
    """A team started with too much damping accepts less, even if it is still too much."""
    values = paper(**STRAINED, law="noninteracting", rate=200.0)
    values["relative"]["damping"] = [400.0, 400.0]
    ros.stack(values).start().run_until(0.02)
    assert not change(ros, relative__damping=[420.0, 420.0])[0]
    assert change(ros, relative__damping=[320.0, 320.0]) == (True, "")
    assert change(ros, relative__damping=[100.0, 100.0]) == (True, "")


def test_authority_changes_smoothly(ros: Ros) -> None:
    """`hold` keeps the value of the subtask, and the human takes over without a torque step."""
    changes = STRAINED | {
        "cooperative": {"takeover": "shaped"},
        "relative": {"takeover": "shaped"},
    }
    stack = ros.stack(paper(**changes)).start()
    stack.run_until(0.1)
    assert change(ros, cooperative__authority="hold") == (True, "")
    stack.run_until(stack.monitor.now + 0.1)
    until(lambda: stack.monitor.value("controller", "cooperative led by") == "hold", "hold")
    assert change(ros, cooperative__authority="human") == (True, "")
    stack.run_until(stack.monitor.now + 0.1)
    until(lambda: stack.monitor.value("controller", "cooperative led by") == "human", "human")
    # Within the jerk bound of 50 m/s^3 and masses of 3 kg, a tick changes less than this.
    assert torque_steps(stack).max() < 0.5


def test_stop_brakes_the_team_until_resume(ros: Ros) -> None:
    """A stop is latched and ignores the sources; resume follows them again, both smoothly."""
    changes = STRAINED | {
        "cooperative": {"takeover": "shaped"},
        "relative": {"takeover": "shaped"},
    }
    stack = ros.stack(paper(**changes)).start()
    stack.run_until(0.3)
    assert ros.call(Trigger, "controller/stop").success
    stack.monitor.wait_for_status("controller", "stopped")
    stack.run_until(stack.monitor.now + 1.0)
    _, q, v, _ = stack.monitor.history(dict(stack.monitor.states))
    assert np.abs(v[-1]).max() < 1e-3
    assert np.abs(v).max() > 0.05
    assert ros.call(Trigger, "controller/resume").success
    stack.run_until(stack.monitor.now + 0.4)
    stack.monitor.wait_for_status("controller", "running")
    assert np.abs(stack.monitor.history(dict(stack.monitor.states))[1][-1] - q[-1]).max() > 1e-3
    assert torque_steps(stack)[5:].max() < 0.5


def test_a_reset_of_the_team_restarts_the_subtasks(ros: Ros) -> None:
    """After the jump of the joints every subtask holds its value, then follows its source."""
    changes = STRAINED | {
        "cooperative": {"takeover": "shaped"},
        "relative": {"takeover": "shaped"},
    }
    stack = ros.stack(paper(**changes)).start()
    stack.run_until(0.6)
    assert ros.call(Trigger, "robot_team/reset").success
    now = stack.monitor.now
    stack.run_until(now + 0.2)
    until(lambda: "put back" in stack.monitor.value("controller", "last start"), "the new start")
    t, _, v, effort = stack.monitor.history(dict(stack.monitor.states))
    jump = int(np.argmin(np.abs(v[t > 0.3]).max(axis=1))) + int((t <= 0.3).sum())
    # The team is at rest: the first torque after the jump has no step of the springs.
    assert np.abs(effort[jump + 1]).max() < 0.5
    assert t[-1] > now


@pytest.mark.parametrize("when", [0.12, 0.6])
def test_a_reset_of_the_team_resets_the_energy_account(ros: Ros, when: float) -> None:
    """This includes resets by less than the threshold of a jump."""
    stack = ros.stack(paper(**STRAINED, telemetry_rate=1000.0)).start()
    accounts: list[dict[str, float]] = []

    def on_account(message: Float64MultiArray) -> None:
        labels = [item.label for item in message.layout.dim]
        accounts.append(dict(zip(labels, message.data, strict=True)))

    ros.probe.create_subscription(Float64MultiArray, "energy", on_account, 1000)
    stack.run_until(when)
    until(lambda: accounts and accounts[-1]["time"] >= when - 0.01, "the first account")
    spent = accounts[-1]
    assert spent["tank"] != 1.0
    assert ros.call(Trigger, "robot_team/reset").success
    stack.run_until(stack.monitor.now + 0.02)
    until(lambda: accounts[-1]["account"] > spent["account"], "a fresh account")
    fresh = next(item for item in accounts if item["account"] > spent["account"])
    assert (fresh["tank"], fresh["reserve"], fresh["lost"]) == (1.0, 2.0, 0.0)


def test_inputs_of_a_source_without_authority_have_no_effect(ros: Ros) -> None:
    """States stay the same bit by bit under set-points and forces of the other source."""
    values = paper()
    pose, wrench = PoseStamped(), WrenchStamped()
    pose.pose.position.x, wrench.wrench.force.y = 5.0, 40.0
    stack = ros.stack(values)
    publishers = [
        (ros.probe.create_publisher(type(message), f"{topic}/{kind}", 10), message)
        for topic in ("cooperative/autonomy", "relative/human")
        for message, kind in ((pose, "target_pose"), (wrench, "wrench"))
    ]
    ros.wait_for_subscribers(*(publisher for publisher, _ in publishers))
    stack.start()
    for ms in range(50, 400, 10):
        stack.run_until(ms / 1000)
        for publisher, message in publishers:
            publisher.publish(message)
    t, q, v, effort = stack.monitor.history(dict(stack.monitor.states))
    expected = rehearse(Scenario.from_dict(values), t[-1])
    np.testing.assert_array_equal(q[:-1], expected.q)
    np.testing.assert_array_equal(v[:-1], expected.v)
    np.testing.assert_array_equal(effort[1:], expected.torque)
    # The same inputs move the team once they have authority.
    assert change(ros, cooperative__authority="autonomy")[0]
    before = stack.monitor.newest().position

    def moved() -> bool:
        publishers[0][0].publish(pose)
        change = stack.monitor.newest().position - before
        return bool(change[0] > 0.01 and change[2] > 0.01)

    until(moved, "motion of the team")


def test_a_repeated_state_has_the_same_answer(ros: Ros) -> None:
    """In lockstep the answer to a repeated state is resent, not computed again."""
    values = paper(haptic=None, planner=None, lockstep_sources=None, force_sensors=None)
    controller = ros.make("controller", values)
    answers: list[bytes] = []
    ros.probe.create_subscription(JointState, "joint_commands", answers.append, 10, raw=True)
    states = ros.probe.create_publisher(JointState, "joint_states", 10)
    commands = [item for item in controller.publishers if "joint_commands" in item.topic_name]
    ros.wait_for_subscribers(states, *commands)
    codec = JointStateCodec(JOINTS)

    def state(stamp: int, x: float) -> None:
        states.publish(codec.encode(stamp, np.full(4, x), np.ones(4), np.zeros(4)))

    for _ in range(3):
        state(0, 0.0)
    ros.drain()
    assert len(answers) == 3
    assert len(set(answers)) == 1
    state(10**6, 0.001)
    ros.drain()
    assert len(answers) == 4
    assert answers[3] != answers[0]


@pytest.mark.parametrize("lockstep", [True, False], ids=["lockstep", "wall"])
def test_nothing_is_commanded_without_states(ros: Ros, lockstep: bool) -> None:
    """The first command answers the first state; inputs received before it have no effect."""
    alone = {"haptic": None, "planner": None, "lockstep_sources": None, "force_sensors": None}
    values = paper(lockstep=lockstep, **alone)
    monitor = ros.monitor(values)
    controller = ros.make("controller", values)
    target = ros.probe.create_publisher(PoseStamped, "cooperative/human/target_pose", 10)
    states = ros.probe.create_publisher(JointState, "joint_states", 10)
    commands = [item for item in controller.publishers if "joint_commands" in item.topic_name]
    ros.wait_for_subscribers(target, states, *commands)
    target.publish(PoseStamped())
    monitor.wait_for_status("controller", "waiting for the first state of the team")
    ros.drain()
    monitor.wait_for_timers("controller")
    stamp = ros.probe.get_clock().now().nanoseconds
    states.publish(JointStateCodec(JOINTS).encode(stamp, np.ones(4), np.zeros(4), np.zeros(4)))
    until(lambda: monitor.commands, "the first command")
    assert list(monitor.commands) == [stamp]
    assert monitor.value("controller", "rejected inputs") == ""
    assert controller.core.inputs["cooperative"].sources["human"].motion(np.inf) is None
