# SPDX-License-Identifier: Apache-2.0
"""Programs of the stack in separate processes."""

import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from harness import TeamMonitor
from repository import ROOT
from waiting import DEADLINE, REPORTS, until

from noninteract_ros.nodes.common.parameter_files import write


class Programs:
    """Launcher of programs as processes.

    Args:
        folder: Folder of parameter files and logs.
        domain: ROS domain of the programs.

    Attributes:
        environment: Environment of the processes.
        running: Running processes by program name.
    """

    def __init__(self, folder: Path, domain: int) -> None:
        self._folder = folder
        self.environment = os.environ | {
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "OPENBLAS_NUM_THREADS": "1",
        }
        self.running: dict[str, subprocess.Popen[str]] = {}
        REPORTS.append(self._report)
        self._started = 0

    def start(self, name: str, values: Mapping[str, Any]) -> subprocess.Popen[str]:
        """Start a program of the stack with a scenario."""
        parameters = ["--ros-args", "--params-file", str(self.write(values))]
        return self.python(name, "-m", "noninteract_ros.nodes", name, *parameters)

    def write(self, values: Mapping[str, Any]) -> Path:
        """Write the parameter file of a scenario."""
        file = self._folder / "scenario.yaml"
        write(file, values)
        return file

    def python(self, name: str, *arguments: str) -> subprocess.Popen[str]:
        """Start a Python program."""
        self._started += 1
        with self._log(name).open("a") as log:
            process = subprocess.Popen(
                [sys.executable, *arguments],
                env=self.environment,
                cwd=ROOT,
                stdout=log,
                stderr=log,
                text=True,
            )
        self.running[name] = process
        return process

    def start_all(
        self, names: Sequence[str], values: Mapping[str, Any], monitor: TeamMonitor
    ) -> None:
        """Start programs and wait until each publisher has matched all subscribers."""
        for name in names:
            self.start(name, values)
        until(lambda: all(self._matched(monitor, name) for name in names), f"{names} are ready")

    def _matched(self, monitor: TeamMonitor, name: str) -> bool:
        assert self.running[name].poll() is None, self.log(name)
        entries = monitor.status.get(name, (0, "", {}))[2].get("subscribers", "").split(", ")
        counts = [entry.rpartition(" ") for entry in entries]
        return len(counts) > 1 and all(
            int(count) == monitor.node.count_subscribers(topic)
            for topic, _, count in counts
            if topic.startswith("/team/")
        )

    def _log(self, name: str) -> Path:
        return self._folder / f"{name}.log"

    def log(self, name: str) -> str:
        """Return the output of a program."""
        return self._log(name).read_text()

    def _report(self) -> list[str]:
        """Return the end of each log, and the programs that have ended."""
        ended = {name: process.poll() for name, process in self.running.items()}
        return [
            f"{name} ended with {status}" for name, status in ended.items() if status is not None
        ] + [f"{file.name}: {file.read_text()[-500:]}" for file in self._folder.glob("*.log")]

    def kill(self, name: str) -> None:
        """Kill a program with SIGKILL."""
        process = self.running.pop(name)
        process.send_signal(signal.SIGKILL)
        process.wait(DEADLINE)

    def close(self) -> None:
        """Kill all programs."""
        for name in list(self.running):
            self.kill(name)
        REPORTS.remove(self._report)
