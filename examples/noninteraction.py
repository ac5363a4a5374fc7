# SPDX-License-Identifier: Apache-2.0
"""Noninteraction: a human reference step moves the formation only under `natural`."""

import numpy as np

from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import find_scenario, read_parameters
from noninteract_ros.scenario.rehearsal import rehearse

DURATION = 3.0  # s
CHANGES = {"rate": 500.0, "haptic": {"subtask": "cooperative", "start_time": 1.0}}


def coupling(law: str) -> float:
    """Return the displacement of the formation between runs with and without the human [m]."""
    values = read_parameters(find_scenario("paper")) | CHANGES | {"law": law}
    scenario = Scenario.from_dict(values)
    with_human, without = (rehearse(scenario, DURATION, human=human) for human in (True, False))
    relative = slice(2, 4)
    return float(np.abs(with_human.x - without.x)[:, relative].max())


def main() -> None:
    print("Masses 1 kg and 2 kg; the cooperative reference steps by about 1 m at t = 1 s.")
    print("Largest displacement of the relative subtask:")
    for law in ("natural", "noninteracting"):
        print(f"  {law:15} {coupling(law):.3g} m")


if __name__ == "__main__":
    main()
