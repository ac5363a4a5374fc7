# SPDX-License-Identifier: Apache-2.0
"""Programs in lockstep: every run equals the rehearsal."""

import numpy as np
import pytest
from harness import Ros, paper, unpause
from programs import Programs
from waiting import until

from noninteract_ros.nodes.messages.cdr import JointStateCodec
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.rehearsal import rehearse

NAMES = ["robot_team", "controller", "haptic_emulator", "relative_planner"]
TICKS = 1000


@pytest.mark.parametrize("run", [1, 2])
def test_every_run_equals_the_rehearsal(ros: Ros, programs: Programs, run: int) -> None:
    """States and commands of four processes equal the rehearsal bit by bit."""
    values = paper(start_paused=True, end_time=TICKS / 1000, haptic={"start_time": 0.2})
    monitor = ros.monitor(values)
    programs.start_all(NAMES, values, monitor)
    unpause(ros)
    monitor.wait_for_status("robot_team", "finished")
    until(lambda: len(monitor.commands) > TICKS, "the command that answers the last state")
    scenario = Scenario.from_dict(values)
    expected = rehearse(scenario, (TICKS + 1) / 1000)
    codec = JointStateCodec(scenario.build_team().joint_names)
    applied = np.vstack([np.zeros_like(expected.torque[0]), expected.torque[:-1]])
    for tick in range(TICKS + 1):
        stamp = 10**6 * tick
        state = codec.encode(stamp, expected.q[tick], expected.v[tick], applied[tick])
        assert monitor.states.pop(stamp) == state, f"state {tick}"
        command = codec.encode(stamp, effort=expected.torque[tick])
        assert monitor.commands.pop(stamp) == command, f"command {tick}"
    assert not monitor.states
    assert not monitor.commands


def test_feedback_is_exchanged_in_lockstep(ros: Ros) -> None:
    """Device and controller alternate as in the rehearsal."""
    values = paper(haptic={"hand_mass": 0.5}, end_time=0.3)
    stack = ros.stack(values).start()
    stack.monitor.wait_for_status("robot_team", "finished")
    expected = rehearse(Scenario.from_dict(stack.values), 0.3)
    _, q, _, effort = stack.monitor.history(stack.monitor.states)
    np.testing.assert_array_equal(q[:-1], expected.q)
    np.testing.assert_array_equal(effort[1:], expected.torque)
    rigid = rehearse(Scenario.from_dict(paper()), 0.3)
    assert np.abs(expected.desired - rigid.desired).max() > 1e-4


def test_missing_sources_time_out(ros: Ros) -> None:
    """A source that is not started, or ends, delays the team only until its timeout."""
    values = paper(haptic=None, lockstep_sources=["relative/autonomy"], lockstep_timeout=0.3)
    stack = ros.stack(values).start()
    stack.run_until(0.1)
    ros.remove(stack.nodes.pop("relative_planner"))
    stack.monitor.wait_for_status("controller", "running without relative/autonomy")
    now = stack.monitor.now
    stack.run_until(now + 0.1)
    ros.make("relative_planner", stack.values)
    stack.monitor.wait_for_status("controller", "holding cooperative")
