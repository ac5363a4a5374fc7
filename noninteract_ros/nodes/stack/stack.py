# SPDX-License-Identifier: Apache-2.0
"""Start and shutdown of a scenario's programs, as processes or in this process."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import rclpy
from rclpy.experimental import EventsExecutor

from noninteract_ros.nodes.common.node import NAMESPACE, ScenarioNode, spin
from noninteract_ros.nodes.common.program import STARTER
from noninteract_ros.nodes.controller.controller import Controller
from noninteract_ros.nodes.recording.recorder import RecorderNode
from noninteract_ros.nodes.sources.haptic_emulator import HapticEmulator
from noninteract_ros.nodes.sources.relative_planner import RelativePlanner
from noninteract_ros.nodes.stack.shared_memory import remove_abandoned
from noninteract_ros.nodes.team.robot_team import RobotTeam
from noninteract_ros.scenario import Scenario

NODES: dict[str, Callable[[], ScenarioNode]] = {
    "robot_team": RobotTeam,
    "controller": Controller,
    "haptic_emulator": HapticEmulator,
    "relative_planner": RelativePlanner,
}
SHUTDOWN_TIMEOUT = 10.0  # [s] after SIGINT, before SIGKILL


def scenario_programs(scenario: Scenario) -> list[str]:
    """Return the programs that a scenario needs, without the recorder."""
    names = ["robot_team", "controller"]
    names += ["haptic_emulator"] if scenario.haptic else []
    names += ["relative_planner"] if scenario.planner else []
    return names + (["operator_console"] if scenario.console else [])


class Stack(Protocol):
    """Running programs of a scenario."""

    def failure(self) -> str:
        """Return the failure of a program, or an empty text."""

    def stop(self) -> None:
        """Shut down all programs; the recorder last, so that it records everything."""


class Processes:
    """Programs as processes, with logs in `<out>/logs`.

    Args:
        names: Programs to start.
        scenario_file: Their parameter file.
        out: Output folder; the recording is `run.mcap` in it.
        record: Start a recorder too.
        namespace: Namespace of the programs.
    """

    def __init__(
        self,
        names: list[str],
        scenario_file: Path,
        out: Path,
        record: bool = True,
        namespace: str = NAMESPACE,
    ) -> None:
        self._logs = out / "logs"
        self._logs.mkdir(exist_ok=True)
        self._processes: dict[str, subprocess.Popen[bytes]] = {}
        shared = ["--ros-args", "--params-file", str(scenario_file), "-r", f"__ns:=/{namespace}"]
        remove_abandoned()
        recording = ["-p", f"output:={out / 'run.mcap'}", "-p", "overwrite:=true"]
        if record:
            self._start("recorder", [*shared, *recording])
        for name in names:
            self._start(name, shared)

    def _start(self, name: str, arguments: list[str]) -> None:
        command = [sys.executable, "-m", "noninteract_ros.nodes", name, *arguments]
        with (self._logs / f"{name}.log").open("wb") as log:
            # In a new session, Ctrl-C at the terminal reaches the demo only, which then shuts
            # the programs down in order.
            self._processes[name] = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                env=os.environ | {STARTER: str(os.getpid())},
            )

    def failure(self) -> str:
        """Return the name of a program that has ended, with the last lines of its log."""
        for name, process in self._processes.items():
            if process.poll() is not None:
                return f"{name} {_exit_text(process.returncode)}: {self._tail(name)}"
        return ""

    def _tail(self, name: str) -> str:
        lines = (self._logs / f"{name}.log").read_text(errors="replace").splitlines()
        return " / ".join(lines[-3:]) or "its log is empty"

    def stop(self) -> None:
        """Send SIGINT to all programs, the recorder last, and SIGKILL to those that do not end."""
        recorder = self._processes.pop("recorder", None)
        _terminate(list(self._processes.values()))
        self._processes.clear()
        if recorder is not None:
            _terminate([recorder])


def _exit_text(status: int) -> str:
    """Return a description of an exit status."""
    if status >= 0:
        return f"ended with status {status}"
    return f"was ended by {signal.Signals(-status).name}"


def _terminate(processes: list[subprocess.Popen[bytes]]) -> None:
    for process in processes:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
    for process in processes:
        try:
            process.wait(SHUTDOWN_TIMEOUT)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


class InProcess:
    """Programs as nodes of this process: one executor in a thread, the recorder in another.

    Args:
        names: Nodes to start; the context must have their parameter file.
        out: Output folder.
        scenario_file: Scenario that is stored in the recording.
    """

    def __init__(self, names: list[str], out: Path, scenario_file: Path) -> None:
        values = {"output": str(out / "run.mcap"), "overwrite": True}
        overrides = [rclpy.Parameter(name, value=value) for name, value in values.items()]
        self._recorder = RecorderNode(str(scenario_file), parameter_overrides=overrides)
        self._nodes = [NODES[name]() for name in names]
        self._executor = EventsExecutor()
        for node in self._nodes:
            self._executor.add_node(node)
        self._stopping = threading.Event()
        self._failure = ""
        self._threads: dict[str, threading.Thread] = {}
        self._thread("executor", spin, self._executor, self._recorder.context)
        self._thread("recorder", self._recorder.run, self._stopping.is_set)
        for node in self._nodes:
            if node.has_loop:
                self._thread(node.get_name(), node.loop)

    def _thread(self, name: str, target: Any, *arguments: Any) -> None:
        def run() -> None:
            try:
                target(*arguments)
            except Exception as error:
                self._failure = f"{name}: {error}"
                raise

        self._threads[name] = threading.Thread(target=run, daemon=True, name=name)
        self._threads[name].start()

    def failure(self) -> str:
        """Return what a thread raised, or an empty text."""
        return self._failure

    def stop(self) -> None:
        """Finish the recording, then shut down the nodes with their context."""
        self._stopping.set()
        self._threads["recorder"].join(SHUTDOWN_TIMEOUT)
        self._executor.shutdown(0.5)
        for node in self._nodes:
            node.context.try_shutdown()
        deadline = time.monotonic() + SHUTDOWN_TIMEOUT
        for thread in self._threads.values():
            thread.join(max(0.0, deadline - time.monotonic()))
