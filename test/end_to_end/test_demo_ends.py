# SPDX-License-Identifier: Apache-2.0
"""End of a demo after a program was killed."""

import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from harness import paper
from repository import ROOT
from waiting import DEADLINE, until

from noninteract_ros.nodes.common.parameter_files import write
from noninteract_ros.reporting.recording.repair import repair


def programs_of(process: int) -> dict[str, int]:
    """Return the ids of the programs that a process has started, by name."""
    processes = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((folder / "stat").read_text().rpartition(")")[2].split()[1])
            command = (folder / "cmdline").read_text().split("\0")
        except OSError:  # It has ended.
            continue
        if parent == process and len(command) > 3:
            processes[command[3]] = int(folder.name)  # python -m noninteract_ros.nodes NAME
    return processes


def alive(process: int) -> bool:
    """Return True if a process runs; a zombie does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.parametrize("victim", ["controller", "recorder", "demo"])
def test_all_programs_end_when_one_is_killed(victim: str, domain: int, tmp_path: Path) -> None:
    """The demo reports the program and the recording; programs end with the demo."""
    out = tmp_path / "run"
    alone = {"haptic": None, "planner": None, "lockstep_sources": None}
    scenario = write(tmp_path / "alone.yaml", paper(**alone))
    command = ["-m", "noninteract_ros.cli", "demo", str(scenario)]
    environment = {"ROS_DOMAIN_ID": str(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    with (tmp_path / "output").open("w") as output:
        demo = subprocess.Popen(
            [sys.executable, *command, "--duration", "1000", "--out", str(out)],
            cwd=ROOT,
            env=os.environ | environment | {"COLUMNS": "200"},
            stdout=output,
            stderr=output,
        )
    output_text = (tmp_path / "output").read_text
    recording, programs = out / "run.mcap", dict[str, int]()
    try:
        until(lambda: recording.exists() and recording.stat().st_size > 2**16, output_text)
        programs = programs_of(demo.pid)
        assert set(programs) == {"recorder", "robot_team", "controller"}
        os.kill({"demo": demo.pid, **programs}[victim], signal.SIGKILL)
        status = demo.wait(DEADLINE)
        until(lambda: not any(map(alive, programs.values())), lambda: f"the end of {programs}")
    finally:
        demo.kill()
        for process in filter(alive, programs.values()):
            os.kill(process, signal.SIGKILL)
    if victim == "demo":
        assert repair(recording).intact
        return
    assert status == 1
    assert re.search(f"noninteract: {victim} was ended by SIGKILL", output_text()), output_text()
    assert f"Recorded until the failure in {recording}" in output_text()
    assert repair(recording).intact == (victim != "recorder")
