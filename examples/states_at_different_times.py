# SPDX-License-Identifier: Apache-2.0
"""Robots that tell their states at different times: what carrying the older ones on costs."""

from collections import deque

import numpy as np

from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import find_scenario, read_parameters
from noninteract_ros.scenario.rehearsal import Rehearsal
from noninteract_ros.team.state_assembler import PREDICTIONS, StateAssembler

DURATION = 2.5  # s
AGES = (0, 1, 2, 3)  # ms by which the states of the second robot are older


def late_eyes(rehearsal: Rehearsal, prediction: str, age: int) -> None:
    """Has the controller see the second robot as it was so many ticks ago, carried on to now."""
    team, step = rehearsal.team, rehearsal.controller.step
    assembler = StateAssembler(team.joint_names, prediction, max_skew=0.02)
    first, second = (np.arange(part.start, part.stop) for part in team.velocity_slices)
    told = deque(maxlen=age + 1)

    def seen(now, q, v, **more):
        told.append((round(1e9 * now), q, v))
        for joints, (stamp, position, velocity) in ((first, told[-1]), (second, told[0])):
            assembler.update(joints, stamp, position[joints], velocity[joints])
        state = assembler.assemble()
        return step(now, state.position, state.velocity, **more)

    rehearsal.controller.step = seen


def error(prediction: str, age: int) -> float:
    """How far the grasp of two arms, led at 0.5 m/s, is from where autonomy wants it [m]."""
    rehearsal = Rehearsal(Scenario.from_dict(read_parameters(find_scenario("planar_arms"))))
    late_eyes(rehearsal, prediction, age)
    largest = 0.0
    for _ in range(round(DURATION * 1000)):
        wanted = rehearsal.step().led[1].reference.position
        state = rehearsal.team.state(rehearsal.simulation.q, rehearsal.simulation.v)
        largest = max(largest, np.abs(rehearsal.stack.evaluate(state).x[2:] - wanted).max())
    return largest


def main() -> None:
    print(f"  age [ms]{''.join(f'{name:>16}' for name in PREDICTIONS)}   (relative error [m])")
    for age in AGES:
        errors = [error(prediction, age) for prediction in PREDICTIONS]
        print(f"{age:10d}{''.join(f'{value:16.1e}' for value in errors)}")


if __name__ == "__main__":
    main()
