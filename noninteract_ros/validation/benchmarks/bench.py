# SPDX-License-Identifier: Apache-2.0
"""`noninteract bench`: time per cycle, each compared with a baseline measured alongside."""

import os
import platform
import time
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from rich.table import Table

from noninteract_ros.arrays import Array
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import config_folders, find_scenario, read_parameters
from noninteract_ros.scenario.rehearsal import History, rehearse
from noninteract_ros.team.models.urdf_files import EXAMPLES, share_folders

BATCH = 50  # consecutive calls of one task
WARM_UP = 20  # calls that are not counted
PARTS = ("law", "node", "lockstep", "wall")
PACKAGES = ("numpy", "numba", "pin", "ros-jazzy-rclpy")


@dataclass(frozen=True)
class BenchSettings:
    """Extent of a benchmark.

    Attributes:
        ticks: Number of timed cycles of each task.
        rounds: Number of alternations of the programs and their baseline.
        seconds: Duration of each run of the programs [s].
    """

    ticks: int = 2000
    rounds: int = 2
    seconds: float = 4.0


@dataclass(frozen=True)
class Row:
    """Times of one task.

    Attributes:
        part: Part of the benchmark.
        name: Name of the task.
        times: Measured times [us], shape (count,).
        floor: Name of the baseline's row; empty for a baseline.
    """

    part: str
    name: str
    times: Array
    floor: str = ""

    @property
    def median(self) -> float:
        """Median [us]."""
        return float(np.median(self.times))

    @property
    def p10(self) -> float:
        """10th percentile [us]; less sensitive to the load of the machine than the median."""
        return float(np.percentile(self.times, 10))

    @property
    def p99(self) -> float:
        """99th percentile [us]."""
        return float(np.percentile(self.times, 99))


class Timed(Protocol):
    """Task to be timed repeatedly."""

    def prepare(self) -> None:
        """Prepare the next run; not timed."""

    def run(self) -> None:
        """Run once; timed."""


def time_alternately(tasks: Mapping[str, Timed], count: int) -> dict[str, Array]:
    """Return the times of each task [us], shape (count,), in alternating batches A B A B ...

    Alternation exposes all tasks to the same load of the machine.
    """
    times: dict[str, list[float]] = {name: [] for name in tasks}
    for task in tasks.values():
        for _ in range(WARM_UP):
            task.prepare()
            task.run()
    for done in range(0, count, BATCH):
        for name, task in tasks.items():
            for _ in range(min(BATCH, count - done)):
                task.prepare()
                start = time.perf_counter_ns()
                task.run()
                times[name].append(1e-3 * (time.perf_counter_ns() - start))
    return {name: np.array(found) for name, found in times.items()}


def bench_scenarios() -> dict[str, dict[str, Any]]:
    """Return the values of all scenarios whose robots are installed, by name."""
    names = {file.stem for folder in config_folders() for file in folder.glob("*.yaml")}
    files = {name: find_scenario(name) for name in sorted(names)}
    return {name: read_parameters(file) for name, file in files.items() if _installed(file)}


def _installed(file: Path) -> bool:
    """Return True if a scenario's robot models are installed (example-robot-data is an extra)."""
    installed = any((share / EXAMPLES).is_dir() for share in share_folders())
    return installed or EXAMPLES not in file.read_text()


@dataclass(frozen=True)
class BenchCase:
    """Recorded states of a scenario that are replayed while timing.

    Attributes:
        scenario: The scenario, in lockstep.
        history: Its first ticks.
    """

    scenario: Scenario
    history: History

    @classmethod
    def of(cls, values: Mapping[str, Any], ticks: int) -> "BenchCase":
        """Rehearse the first ticks of a scenario."""
        scenario = Scenario.from_dict(values)
        return cls(scenario, rehearse(scenario, ticks / scenario.general.rate))


def machine() -> dict[str, Any]:
    """Return hardware, versions and load of the machine."""
    return {
        "cpu": _cpu(),
        "cores": len(os.sched_getaffinity(0)),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
        **{name: _version(name) for name in PACKAGES},
        "load average before": load_average(),
    }


def load_average() -> list[float]:
    """Return the mean number of runnable tasks over 1, 5 and 15 minutes."""
    return [round(load, 2) for load in os.getloadavg()]


def _cpu() -> str:
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not from a wheel"


def as_dict(rows: list[Row], around: Mapping[str, Any]) -> dict[str, Any]:
    """Return the machine and the statistics of each row as a dictionary for JSON."""
    floors = {row.name: row for row in rows}
    figures = [
        {
            "part": row.part,
            "name": row.name,
            "p10 [us]": round(row.p10, 2),
            "median [us]": round(row.median, 2),
            "p99 [us]": round(row.p99, 2),
            "per second": round(1e6 / row.median, 1),
            "count": len(row.times),
            "floor": row.floor or None,
            "ratio": round(row.median / floors[row.floor].median, 2) if row.floor else None,
        }
        for row in rows
    ]
    return {"machine": dict(around), "rows": figures}


def table(figures: Mapping[str, Any]) -> Table:
    """Return the result of `as_dict` as a table for the terminal."""
    result = Table(title=_title(figures["machine"]), title_justify="left")
    for name in (
        "measured",
        "p10 [us]",
        "median [us]",
        "p99 [us]",
        "1/s",
        "count",
        "of its floor",
    ):
        result.add_column(name, justify="left" if name == "measured" else "right")
    last = ""
    for row in figures["rows"]:
        if row["part"] != last:
            result.add_section()
        last = row["part"]
        result.add_row(
            row["name"] if row["floor"] else f"[dim]{row['name']}[/]",
            f"{row['p10 [us]']:.1f}",
            f"{row['median [us]']:.1f}",
            f"{row['p99 [us]']:.1f}",
            f"{row['per second']:.0f}",
            str(row["count"]),
            f"{row['ratio']:.1f} x" if row["ratio"] else "[dim]floor[/]",
        )
    return result


def _title(around: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{name} {value}" if name != "cpu" else str(value) for name, value in around.items()
    )
