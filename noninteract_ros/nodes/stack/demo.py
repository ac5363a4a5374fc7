# SPDX-License-Identifier: Apache-2.0
"""Runs a scenario on the full stack and leaves its recording behind."""

import math
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import rclpy

from noninteract_ros.nodes.common.node import NAMESPACE
from noninteract_ros.nodes.common.parameter_files import rewrite
from noninteract_ros.nodes.stack.monitor import Monitor, StackError
from noninteract_ros.nodes.stack.stack import InProcess, Processes, Stack, programs_of
from noninteract_ros.scenario.files import load_scenario

START_TIMEOUT = 180.0  # [s] at the first start on a machine the law is compiled
STALL_TIMEOUT = 60.0  # [s] wall time without a step after which a run is given up
SETTLING = 0.2  # [s] at the end, in which what was lost on its way to the recorder is sent again
LISTEN = 1.0  # [s] time to find out who else is in the namespace


def run_demo(
    scenario_file: Path, out: Path, in_process: bool, progress: Callable[[float, str], None]
) -> None:
    """Starts all programs of a scenario, lets them run to its `end_time`, and ends them.

    Args:
        scenario_file: A scenario that starts paused and has an `end_time`.
        out: Output folder, where `run.mcap` and the logs go.
        in_process: Whether all nodes live in this process.
        progress: Told the team's time [s] and the state in words, a few times a second.

    Raises:
        StackError: A program ended, does not answer or does not move.
        KeyboardInterrupt: The user ended the run; the recording is complete up to then.
    """
    scenario = load_scenario(scenario_file)
    names = programs_of(scenario)
    with TemporaryDirectory() as folder:
        arguments = ["--ros-args", "--params-file", str(scenario_file)]
        rclpy.init(
            args=rewrite(arguments, Path(folder)) if in_process else None,
            signal_handler_options=rclpy.SignalHandlerOptions.NO,
        )
        stack: Stack | None = None
        monitor = Monitor(NAMESPACE, lambda: stack.problem() if stack else "")
        try:
            if others := monitor.others(LISTEN):
                raise StackError(
                    f"/{NAMESPACE} is in use by {', '.join(others)}: end them, or set another"
                    " ROS_DOMAIN_ID"
                )
            progress(0.0, "starting")
            if in_process:
                stack = InProcess(names, out, scenario_file)
            else:
                stack = Processes(names, scenario_file, out)
            monitor.wait_until_ready([*names, "recorder"], START_TIMEOUT)
            monitor.begin(START_TIMEOUT)
            _follow(monitor, progress, STALL_TIMEOUT if not scenario.console else math.inf)
        finally:
            progress(monitor.time(), "ending")
            if stack is not None:
                stack.stop()
            monitor.close()
            rclpy.try_shutdown()


def run_with_console(scenario_file: Path, out: Path, say: Callable[[str], None]) -> None:
    """Runs a scenario that has a console, and says where that is once the team moves.

    Args:
        scenario_file: As `run_demo` has it; without an `end_time` it runs until it is interrupted.
        out: Output folder.
        say: Told lines for the user.

    Raises:
        StackError: A program ended or does not answer.
        KeyboardInterrupt: The user ended the run; the recording is complete up to then.
    """
    log, waiting = out / "logs" / "operator_console.log", True

    def progress(now: float, state: str) -> None:
        nonlocal waiting
        if waiting and state == "running":
            waiting = False
            say(log.read_text().strip())
            say("Ctrl-C ends it.")

    run_demo(scenario_file, out, False, progress)


def _follow(monitor: Monitor, progress: Callable[[float, str], None], patience: float) -> None:
    """Until the team is at its end; a run that stands still for too long [s] is given up."""
    last, moved_at = -1.0, time.monotonic()
    while not monitor.finished():
        monitor.spin(0.1)
        now = monitor.time()
        progress(now, "running")
        if now > last:
            last, moved_at = now, time.monotonic()
        elif time.monotonic() - moved_at > patience:
            told = {name: status.text for name, status in monitor.status.items()}
            raise StackError(f"the team stands still at {now:.3f} s: {told}")
    monitor.spin(SETTLING)
