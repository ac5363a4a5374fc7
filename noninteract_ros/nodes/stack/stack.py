# SPDX-License-Identifier: Apache-2.0
"""The programs of a scenario, started together: as processes of their own, or in this one."""

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
GRACE = 10.0  # [s] time a program is given to end by itself


def programs_of(scenario: Scenario) -> list[str]:
    """Nodes that a scenario needs, besides the recorder."""
    names = ["robot_team", "controller"]
    names += ["haptic_emulator"] if scenario.haptic else []
    names += ["relative_planner"] if scenario.planner else []
    return names + (["operator_console"] if scenario.console else [])


class Stack(Protocol):
    """Running programs."""

    def problem(self) -> str:
        """What went wrong with a program, or an empty text."""

    def stop(self) -> None:
        """Ends all programs; the recorder last, so that it hears everything."""


class Processes:
    """Each program a process, with its log in `<out>/logs`.

    Args:
        names: Nodes to start.
        scenario_file: Their parameter file.
        out: Output folder; the recording goes to `run.mcap` in it.
        record: Whether there is a recorder.
        namespace: Where the programs live.
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
            # A session of its own: Ctrl-C at the terminal reaches the demo alone, which then
            # ends the programs in order.
            self._processes[name] = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                env=os.environ | {STARTER: str(os.getpid())},
            )

    def problem(self) -> str:
        """Which program has ended, with the last lines of its log."""
        for name, process in self._processes.items():
            if process.poll() is not None:
                return f"{name} {_end_of(process.returncode)}: {self._tail(name)}"
        return ""

    def _tail(self, name: str) -> str:
        lines = (self._logs / f"{name}.log").read_text(errors="replace").splitlines()
        return " / ".join(lines[-3:]) or "its log is empty"

    def stop(self) -> None:
        """SIGINT to all, the recorder last; SIGKILL to whom that does not end."""
        recorder = self._processes.pop("recorder", None)
        _end(list(self._processes.values()))
        self._processes.clear()
        if recorder is not None:
            _end([recorder])


def _end_of(status: int) -> str:
    """How a process has ended, in words."""
    if status >= 0:
        return f"ended with status {status}"
    return f"was ended by {signal.Signals(-status).name}"


def _end(processes: list[subprocess.Popen[bytes]]) -> None:
    for process in processes:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
    for process in processes:
        try:
            process.wait(GRACE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()


class InProcess:
    """All programs in this process: one executor in a thread, the recorder in another.

    Args:
        names: Nodes to start; the context must know their parameter file.
        out: Output folder.
        scenario_file: Kept in the recording.
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

    def problem(self) -> str:
        """What a thread raised."""
        return self._failure

    def stop(self) -> None:
        """Finishes the recording; the nodes end with the context."""
        self._stopping.set()
        self._threads["recorder"].join(GRACE)
        self._executor.shutdown(0.5)
        for node in self._nodes:
            node.context.try_shutdown()
        deadline = time.monotonic() + GRACE
        for thread in self._threads.values():
            thread.join(max(0.0, deadline - time.monotonic()))
