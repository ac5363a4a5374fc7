# SPDX-License-Identifier: Apache-2.0
"""SIGKILL of each program: the others report it, stay safe, and continue after a restart."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from harness import Ros, TeamMonitor, paper
from programs import Programs
from waiting import until

from noninteract_ros.nodes.common.team_status import main_state

NAMES = ["robot_team", "controller", "haptic_emulator", "relative_planner"]
RATE = 100.0

WITHOUT_TEAM = {
    "controller": "holding: no states from the team",
    "haptic_emulator": "no states from the team",
    "relative_planner": "no states from the team",
}
# Status of other nodes after a program is killed, in lockstep and in wall time.
STATUS = {
    "haptic_emulator": {
        True: {"controller": "running without cooperative/human"},
        False: {"controller": "holding cooperative: source silent"},
    },
    "relative_planner": {
        True: {"controller": "running without relative/autonomy"},
        False: {"controller": "holding relative: source silent"},
    },
    "controller": {
        True: {"robot_team": "waiting for the command that answers the state"},
        False: {"robot_team": "braking: command timeout"},
    },
    "robot_team": {True: WITHOUT_TEAM, False: WITHOUT_TEAM},
}


def shares_memory(process: int) -> bool:
    """Return True if a process uses the shared memory transport."""
    return "/dev/shm/fastrtps_port" in Path(f"/proc/{process}/maps").read_text()


def running(monitor: TeamMonitor) -> bool:
    return all(main_state(monitor.status.get(name, (0, ""))[1]) == "running" for name in NAMES)


@pytest.mark.parametrize("lockstep", [True, False], ids=["lockstep", "wall"])
def test_the_stack_continues_after_a_killed_program_restarts(
    ros: Ros, programs: Programs, lockstep: bool
) -> None:
    """Other nodes report it, the team rests or continues, and all run after the restart."""
    values = paper(
        rate=RATE,
        telemetry_rate=RATE,
        lockstep=lockstep,
        lockstep_timeout=0.5,
        command_timeout=0.3,
        haptic={"motion": "still", "centre": [0.5, 0.5], "start_time": 0.0},
        cooperative={"takeover": "shaped"},
        relative={"takeover": "shaped"},
    )
    monitor = ros.monitor(values)
    programs.environment.pop("FASTRTPS_DEFAULT_PROFILES_FILE", None)
    for name in NAMES:
        programs.start(name, values)
    for victim in NAMES:
        until(lambda: running(monitor), f"all run, before {victim} is killed")
        # It might hold a lock there when it is killed, which would block the others.
        assert not shares_memory(programs.running[victim].pid)
        programs.kill(victim)
        monitor.status.pop(victim)
        for name, text in STATUS[victim][lockstep].items():
            monitor.wait_for_status(name, text)
        CHECKS[victim](monitor, lockstep)
        programs.start(victim, values)
    until(lambda: running(monitor), "all run at the end")
    count = len(monitor.states)
    until(lambda: len(monitor.states) > count + 20, "further states")


def check_continues(monitor: TeamMonitor, lockstep: bool) -> None:
    """Check that the team continues without a source."""
    count = len(monitor.states)
    until(lambda: len(monitor.states) > count + 20, "further states")


def check_brakes(monitor: TeamMonitor, lockstep: bool) -> None:
    """Check that a team without commands waits (lockstep), or brakes to rest (wall time)."""
    if lockstep:
        now, count = monitor.now, monitor.received["joint_states"]
        until(lambda: monitor.received["joint_states"] > count + 1, "the last state again")
        assert monitor.now == now
    else:
        until(lambda: np.abs(monitor.newest().velocity).max() < 1e-3, "the team is at rest")


def check_no_commands(monitor: TeamMonitor, lockstep: bool) -> None:
    """Check that the controller publishes no commands without states."""
    count = monitor.received["joint_commands"]
    monitor.wait_for_timers("controller")
    assert monitor.received["joint_commands"] == count
    if lockstep:  # The time of the restarted team begins at zero.
        monitor.states.clear()
        monitor.commands.clear()


CHECKS: dict[str, Callable[[TeamMonitor, bool], None]] = {
    "haptic_emulator": check_continues,
    "relative_planner": check_continues,
    "controller": check_brakes,
    "robot_team": check_no_commands,
}
