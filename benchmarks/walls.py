# SPDX-License-Identifier: Apache-2.0
"""Cost of walls: `python benchmarks/walls.py`, in one process, with and without something near."""

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters
from noninteract_ros.scenario.rehearsal import Rehearsal

CONFIG = Path(__file__).parents[1] / "config" / "obstacles.yaml"
REPEATS = 300
NEAR = 1.3  # [s] into the scenario, when a hand is at the post


def clock(what: str, function: Callable[[], object]) -> None:
    """Print least and median time of calls [us]."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        function()
        times.append(1e6 * (time.perf_counter() - start))
    print(f"{what}: least {min(times):.0f} us, median {np.median(times):.0f} us")


def main() -> None:
    """Time distances, and ticks of the controller of the scenario `obstacles`."""
    values = read_parameters(CONFIG)
    without = {key: value for key, value in values.items() if key != "walls"}
    for name, content in (("without walls", without), ("with walls", values)):
        scenario = Scenario.from_dict(content)
        rehearsal = Rehearsal(scenario)
        scene = scenario.build_scene(rehearsal.team)
        for where, until in (("at the start", 0.05), ("at the post", NEAR)):
            while rehearsal.simulation.now < until:
                rehearsal.step()
            q, v, now = rehearsal.q, rehearsal.simulation.v, rehearsal.simulation.now
            later = iter(now + 0.001 * np.arange(REPEATS))
            step = rehearsal.controller.step
            clock(f"tick {name} {where}", lambda: step(next(later), q, v))  # noqa: B023
            if name == "with walls":
                pairs = len(scene.pairs.watched)
                clock(f"{pairs} pairs {where}", lambda: scene.evaluate(q, v, 0.07, 0.05))  # noqa: B023


if __name__ == "__main__":
    main()
