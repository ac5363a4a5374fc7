# SPDX-License-Identifier: Apache-2.0
"""Run of a scenario on the full stack, with a recording."""

import math
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import rclpy

from noninteract_ros.errors import ScenarioError
from noninteract_ros.nodes.common.node import NAMESPACE
from noninteract_ros.nodes.common.parameter_files import rewrite, write
from noninteract_ros.nodes.stack.monitor import Monitor, StackError
from noninteract_ros.nodes.stack.stack import InProcess, Processes, Stack, scenario_programs
from noninteract_ros.scenario.files import load_scenario, read_parameters

START_TIMEOUT = 180.0  # [s] long, because the first start on a machine compiles the law
STALL_TIMEOUT = 60.0  # [s] of wall time without a tick, after which a run is aborted
SETTLING_TIME = 0.2  # [s] at the end, for messages to the recorder that have to be sent again
DISCOVERY_TIME = 1.0  # [s] to discover other nodes in the namespace


def write_run_file(
    source: Path,
    folder: Path,
    duration: float | None,
    rate_factor: float,
    values: Mapping[str, Any] | None = None,
) -> Path:
    """Write the scenario of a run: paused at the start, with an end and its own rate.

    Args:
        source: File of the scenario.
        folder: Output folder; created if it does not exist.
        duration: Simulated time [s]; None: that of the scenario.
        rate_factor: Factor of the scenario's rate.
        values: Values instead of the file's, as with a console. Such a run ends only after a
            given `duration`.

    Returns:
        The written parameter file.

    Raises:
        ScenarioError: The scenario, the duration or the factor is invalid.
    """
    general = load_scenario(source).general
    if duration is not None and not duration > 0.0:
        raise ScenarioError("--duration", duration, "> 0")
    if not rate_factor > 0.0:
        raise ScenarioError("--rate-factor", rate_factor, "> 0")
    changes: dict[str, Any] = {
        "rate": general.rate * rate_factor,
        "duration": duration or general.duration,
        "end_time": duration or (0.0 if values else general.duration),
        "start_paused": True,
    }
    folder.mkdir(parents=True, exist_ok=True)
    file = write(folder / "scenario.yaml", {**(values or read_parameters(source)), **changes})
    load_scenario(file)
    return file


def run_demo(
    scenario_file: Path, out: Path, in_process: bool, progress: Callable[[float, str], None]
) -> None:
    """Start all programs of a scenario, run them to its `end_time`, and shut them down.

    Args:
        scenario_file: A scenario that starts paused and has an `end_time`.
        out: Output folder of `run.mcap` and the logs.
        in_process: Run all nodes in this process.
        progress: Receives the team's time [s] and the state of the run, a few times a second.

    Raises:
        StackError: A program ended, does not respond, or the team does not move.
        KeyboardInterrupt: The user interrupted the run; the recording is complete up to then.
    """
    scenario = load_scenario(scenario_file)
    names = scenario_programs(scenario)
    with TemporaryDirectory() as folder:
        arguments = ["--ros-args", "--params-file", str(scenario_file)]
        rclpy.init(
            args=rewrite(arguments, Path(folder)) if in_process else None,
            signal_handler_options=rclpy.SignalHandlerOptions.NO,
        )
        stack: Stack | None = None
        monitor = Monitor(NAMESPACE, lambda: stack.failure() if stack else "")
        try:
            if others := monitor.other_nodes(DISCOVERY_TIME):
                raise StackError(
                    f"/{NAMESPACE} is in use by {', '.join(others)}: stop them, or set another"
                    " ROS_DOMAIN_ID"
                )
            progress(0.0, "starting")
            if in_process:
                stack = InProcess(names, out, scenario_file)
            else:
                stack = Processes(names, scenario_file, out)
            monitor.wait_until_ready([*names, "recorder"], START_TIMEOUT)
            monitor.unpause(START_TIMEOUT)
            stall_timeout = STALL_TIMEOUT if not scenario.console else math.inf
            _wait_until_finished(monitor, progress, stall_timeout)
        finally:
            progress(monitor.time(), "shutting down")
            if stack is not None:
                stack.stop()
            monitor.close()
            rclpy.try_shutdown()


def run_with_console(scenario_file: Path, out: Path, report: Callable[[str], None]) -> None:
    """Run a scenario with a console, and report its address once the team moves.

    Args:
        scenario_file: Scenario as in `run_demo`; without an `end_time` it runs until interrupted.
        out: Output folder.
        report: Receives lines for the user.

    Raises:
        StackError: A program ended or does not respond.
        KeyboardInterrupt: The user interrupted the run; the recording is complete up to then.
    """
    log, waiting = out / "logs" / "operator_console.log", True

    def progress(now: float, state: str) -> None:
        nonlocal waiting
        if waiting and state == "running":
            waiting = False
            report(log.read_text().strip())
            report("Press Ctrl-C to stop.")

    run_demo(scenario_file, out, False, progress)


def _wait_until_finished(
    monitor: Monitor, progress: Callable[[float, str], None], stall_timeout: float
) -> None:
    """Report the progress until the team has finished; abort a run that stalls [s]."""
    last, moved_at = -1.0, time.monotonic()
    while not monitor.finished():
        monitor.spin(0.1)
        now = monitor.time()
        progress(now, "running")
        if now > last:
            last, moved_at = now, time.monotonic()
        elif time.monotonic() - moved_at > stall_timeout:
            texts = {name: status.text for name, status in monitor.status.items()}
            raise StackError(f"the team does not move after {now:.3f} s: {texts}")
    monitor.spin(SETTLING_TIME)
