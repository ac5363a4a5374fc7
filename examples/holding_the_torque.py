# SPDX-License-Identifier: Apache-2.0
"""Zero-order hold of the torque: coupling between subtasks of arms is of order 1 in the tick."""

import numpy as np

from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import find_scenario, read_parameters
from noninteract_ros.scenario.rehearsal import rehearse

DURATION = 2.0  # s
RATES = (250.0, 500.0, 1000.0)  # Hz


def displacements(rate: float) -> tuple[float, float]:
    """Return the displacement of the team and of the grasp due to the human input [m]."""
    scenario = Scenario.from_dict(read_parameters(find_scenario("planar_arms")) | {"rate": rate})
    with_human, without = (rehearse(scenario, DURATION, human=human).x for human in (True, False))
    distance = np.abs(with_human - without).max(axis=0)
    return distance[:2].max(), distance[2:].max()


def main() -> None:
    print("  rate [Hz]   cooperative [m]   relative [m]")
    for rate in RATES:
        cooperative, relative = displacements(rate)
        print(f"{rate:11.0f} {cooperative:17.3f} {relative:14.2e}")


if __name__ == "__main__":
    main()
