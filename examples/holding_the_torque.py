# SPDX-License-Identifier: Apache-2.0
"""Torque held over a tick: what crosses over on arms shrinks with the tick, in order 1."""

import numpy as np

from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import find_scenario, read_parameters
from noninteract_ros.scenario.rehearsal import rehearse

DURATION = 2.0  # s
RATES = (250.0, 500.0, 1000.0)  # Hz


def moved(rate: float) -> tuple[float, float]:
    """How far the human moves the team and, unasked, the grasp of two arms [m]."""
    scenario = Scenario.from_dict(read_parameters(find_scenario("planar_arms")) | {"rate": rate})
    led, alone = (rehearse(scenario, DURATION, human=human).x for human in (True, False))
    distance = np.abs(led - alone).max(axis=0)
    return distance[:2].max(), distance[2:].max()


def main() -> None:
    print("  rate [Hz]   cooperative [m]   relative [m]")
    for rate in RATES:
        cooperative, relative = moved(rate)
        print(f"{rate:11.0f} {cooperative:17.3f} {relative:14.2e}")


if __name__ == "__main__":
    main()
