# SPDX-License-Identifier: Apache-2.0
"""kill -9 of each program: the others notice, stay safe, and go on when it is back."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from harness import Ros, TeamMonitor, paper
from programs import Programs
from waiting import until

NAMES = ["robot_team", "controller", "haptic_emulator", "relative_planner"]
RATE = 100.0

WITHOUT_TEAM = {
    "controller": "holding: no states from the team",
    "haptic_emulator": "no states from the team",
    "relative_planner": "no states from the team",
}
# Killed program: who says what about it, in lockstep and in wall time.
NOTICES = {
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
    """Whether a process speaks over memory that it shares with others."""
    return "/dev/shm/fastrtps_port" in Path(f"/proc/{process}/maps").read_text()


def running(monitor: TeamMonitor) -> bool:
    return all(monitor.status.get(name, (0, ""))[1] == "running" for name in NAMES)


@pytest.mark.parametrize("lockstep", [True, False], ids=["lockstep", "wall"])
def test_a_killed_program_is_noticed_and_may_return(
    ros: Ros, programs: Programs, lockstep: bool
) -> None:
    """Each neighbour says so, the team is at rest or led on, and all run on with the new one."""
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
        # It might hold a lock there when it is killed, for which the others would wait.
        assert not shares_memory(programs.running[victim].pid)
        programs.kill(victim)
        monitor.status.pop(victim)
        for name, text in NOTICES[victim][lockstep].items():
            monitor.wait_for_status(name, text)
        SAFE[victim](monitor, lockstep)
        programs.start(victim, values)
    until(lambda: running(monitor), "all run at the end")
    heard = len(monitor.states)
    until(lambda: len(monitor.states) > heard + 20, "the team moves on")


def led_on(monitor: TeamMonitor, lockstep: bool) -> None:
    """The team goes on without a source, and comes to rest."""
    heard = len(monitor.states)
    until(lambda: len(monitor.states) > heard + 20, "the team goes on")


def brakes(monitor: TeamMonitor, lockstep: bool) -> None:
    """Without commands the team stands still (lockstep), or brakes to rest (wall time)."""
    if lockstep:
        heard = len(monitor.states)
        until(monitor.has_new_status("robot_team"), "the team speaks on")
        assert len(monitor.states) == heard
    else:
        until(lambda: np.abs(monitor.newest().velocity).max() < 1e-3, "the team is at rest")


def holds(monitor: TeamMonitor, lockstep: bool) -> None:
    """Without states the controller commands nothing."""
    heard = len(monitor.commands)
    until(monitor.has_new_status("controller"), "the controller speaks on")
    assert len(monitor.commands) == heard
    if lockstep:  # The new team counts its time anew.
        monitor.states.clear()
        monitor.commands.clear()


SAFE: dict[str, Callable[[TeamMonitor, bool], None]] = {
    "haptic_emulator": led_on,
    "relative_planner": led_on,
    "controller": brakes,
    "robot_team": holds,
}
