# SPDX-License-Identifier: Apache-2.0
"""Robot states of different ages: error of the law with predicted states."""

from collections import deque

import numpy as np

from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import find_scenario, read_parameters
from noninteract_ros.scenario.rehearsal import Rehearsal
from noninteract_ros.team.state_assembler import PREDICTIONS, StateAssembler

DURATION = 2.5  # s
AGES = (0, 1, 2, 3)  # ms, age of the second robot's states relative to the first


def delay_second_robot(rehearsal: Rehearsal, prediction: str, age: int) -> None:
    """Delay the second robot's states by `age` ticks, and predict them to the current time."""
    team, step = rehearsal.team, rehearsal.controller.step
    assembler = StateAssembler(team.joint_names, prediction, max_skew=0.02)
    first, second = (np.arange(part.start, part.stop) for part in team.velocity_slices)
    states = deque(maxlen=age + 1)

    def delayed_step(now, q, v, **more):
        states.append((round(1e9 * now), q, v))
        for joints, (stamp, position, velocity) in ((first, states[-1]), (second, states[0])):
            assembler.update(joints, stamp, position[joints], velocity[joints])
        state = assembler.assemble()
        return step(now, state.position, state.velocity, **more)

    rehearsal.controller.step = delayed_step


def error(prediction: str, age: int) -> float:
    """Return the largest error of the grasp of two arms in motion at 0.5 m/s [m]."""
    rehearsal = Rehearsal(Scenario.from_dict(read_parameters(find_scenario("planar_arms"))))
    delay_second_robot(rehearsal, prediction, age)
    largest = 0.0
    for _ in range(round(DURATION * 1000)):
        desired = rehearsal.step().led[1].reference.position
        state = rehearsal.team.state(rehearsal.simulation.q, rehearsal.simulation.v)
        largest = max(largest, np.abs(rehearsal.stack.evaluate(state).x[2:] - desired).max())
    return largest


def main() -> None:
    print(f"  age [ms]{''.join(f'{name:>16}' for name in PREDICTIONS)}   (relative error [m])")
    for age in AGES:
        errors = [error(prediction, age) for prediction in PREDICTIONS]
        print(f"{age:10d}{''.join(f'{value:16.1e}' for value in errors)}")


if __name__ == "__main__":
    main()
