# SPDX-License-Identifier: Apache-2.0
"""`noninteract bench` with tiny settings: completeness of the results, not their speed."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from noninteract_ros import cli
from noninteract_ros.validation.benchmarks import bench
from noninteract_ros.validation.benchmarks.bench import Row, as_dict, time_alternately

FIGURES = ("median [us]", "p99 [us]", "per second", "count")


@pytest.fixture(autouse=True)
def own_domain(monkeypatch: pytest.MonkeyPatch, domain: int) -> None:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(domain))
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


def run(monkeypatch: pytest.MonkeyPatch, folder: Path, *arguments: str) -> dict[str, Any]:
    """Run the command and return its JSON."""
    file = folder / "bench.json"
    monkeypatch.setattr("sys.argv", ["noninteract", "bench", "--json", str(file), *arguments])
    assert cli.main() == 0
    return json.loads(file.read_text())


def rows_of(figures: dict[str, Any]) -> dict[str, dict[str, Any]]:
    rows = {row["name"]: row for row in figures["rows"]}
    for row in rows.values():
        assert all(row[name] > 0 for name in FIGURES)
        assert row["floor"] is None or row["floor"] in rows
    return rows


def test_law_and_node_are_timed_for_every_scenario(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each scenario has rows of law and controller node with Pinocchio's terms as floor."""
    parts = ("--part", "law", "--part", "node")
    figures = run(monkeypatch, tmp_path, *parts, "--ticks", "12")
    rows = rows_of(figures)
    for name in ("paper", "formation", "planar_arms"):
        for what in ("law", "whole step"):
            assert rows[f"{what}, {name}"]["floor"] == f"Pinocchio's terms, {name}"
        assert rows[f"controller node, {name}"]["count"] == 12
    assert {"cpu", "cores", "python", "load average before", "load average after"} <= set(
        figures["machine"]
    )
    assert "floor" in capsys.readouterr().out


def test_programs_are_timed_with_their_baselines(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Lockstep is timed with and without recorder, wall time against plain sleep."""
    parts = ("--part", "lockstep", "--part", "wall")
    rows = rows_of(run(monkeypatch, tmp_path, *parts, "--rounds", "1", "--seconds", "0.5"))
    assert rows["lockstep tick, paper"]["floor"] == "raw round trip of two processes"
    assert rows["lockstep tick, paper, recorded"]["floor"] == "raw round trip of two processes"
    jitter = rows["commands in wall time, paper, period error"]
    assert jitter["floor"] == "absolute sleep alone, period error"


def test_an_unknown_part_is_rejected(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The exit status is 2 and the message lists the parts."""
    monkeypatch.setattr("sys.argv", ["noninteract", "bench", "--part", "lawn"])
    assert cli.main() == 2
    assert "law | node | lockstep | wall" in capsys.readouterr().err


def test_tasks_alternate() -> None:
    """Two tasks are timed in alternating batches after a warm-up; each run is prepared once."""
    calls: list[str] = []

    class RecordedTask:
        def __init__(self, name: str) -> None:
            self.name = name

        def prepare(self) -> None:
            calls.append(f"prepare {self.name}")

        def run(self) -> None:
            calls.append(self.name)

    times = time_alternately({name: RecordedTask(name) for name in "ab"}, 2 * bench.BATCH)
    assert [len(found) for found in times.values()] == [2 * bench.BATCH] * 2
    runs = [call for call in calls if len(call) == 1]
    assert calls[::2] == [f"prepare {name}" for name in runs]
    batch = ["a"] * bench.BATCH + ["b"] * bench.BATCH
    assert runs == ["a"] * bench.WARM_UP + ["b"] * bench.WARM_UP + 2 * batch


def test_figures_are_those_of_the_times() -> None:
    """Median, 99th percentile, rate and ratio to the floor follow from the times."""
    times = np.arange(1.0, 202.0)
    rows = [Row("law", "law", times, "terms"), Row("law", "terms", np.full(3, 10.0))]
    law, terms = as_dict(rows, {})["rows"]
    assert law["median [us]"] == 101.0
    assert law["p99 [us]"] == 199.0
    assert law["per second"] == pytest.approx(1e6 / 101.0, rel=1e-4)
    assert law["ratio"] == 10.1
    assert terms["ratio"] is None
