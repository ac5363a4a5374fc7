# SPDX-License-Identifier: Apache-2.0
"""The scenario of one run, as its programs are started with it."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from noninteract_ros.errors import ScenarioError
from noninteract_ros.nodes.common.parameter_files import write
from noninteract_ros.scenario.files import load_scenario, read_parameters


def prepare(
    source: Path,
    folder: Path,
    duration: float | None,
    rate_factor: float,
    values: Mapping[str, Any] | None = None,
) -> Path:
    """Writes the scenario as it is run: paused at the start, with an end, at its own rate.

    Args:
        source: The scenario's file.
        folder: Where the run's files go; made, if it is not there.
        duration: Simulated time [s]; None: the scenario's own.
        rate_factor: Multiplies the scenario's rate.
        values: Values instead of the file's, as with a console; such a run has no end but the one
            that is asked for.

    Raises:
        ScenarioError: The scenario, or the duration or factor, cannot be run.
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
