# SPDX-License-Identifier: Apache-2.0
"""Remark 2: effect of the desired inertia M_i on force inputs and gains, but not on a push."""

from dataclasses import replace

import numpy as np

from noninteract_ros.control.law.decoupling import (
    TaskDynamics,
    TaskError,
    commanded_acceleration,
    task_dynamics,
)
from noninteract_ros.control.law.impedance import stack_impedance
from noninteract_ros.scenario.files import find_scenario, load_scenario

FORCE = np.array([6.0, 0.0, 0.0, 0.0])  # N, along x on the cooperative subtask
PUSH = np.array([6.0, 0.0, 0.0, 0.0])  # N, along x on robot_1
REST = TaskError(*np.zeros((5, 4)))


def main() -> None:
    scenario = load_scenario(find_scenario("paper"))
    team = scenario.build_team()
    stack = scenario.build_stack(team)
    settings = [spec.impedance for spec in scenario.subtasks.values()]
    state = team.state(team.q0, np.zeros(team.n))
    task = stack.evaluate(state)
    print("Initial acceleration and final displacement of the cooperative subtask along x")
    print("  M_c [kg]   6 N force input          6 N push on robot_1")
    for inertia in ((), (1.0,), (12.0,)):
        changed = [replace(settings[0], inertia=inertia), settings[1]]
        impedance = stack_impedance(stack.subtasks, changed)
        dynamics = task_dynamics(state, task, stack.slices, impedance.inertias)
        error = replace(REST, force=FORCE)
        commanded = commanded_acceleration("noninteracting", dynamics, error, impedance)[0]
        external = push_acceleration(dynamics)
        M_c, K_c = dynamics.inertias[0][0, 0], impedance.stiffness[0]
        print(
            f"{M_c:10.2f}   {commanded:5.2f} m/s^2, {M_c * commanded / K_c:4.2f} m"
            f"      {external:5.2f} m/s^2, {M_c * external / K_c:4.2f} m"
        )


def push_acceleration(dynamics: TaskDynamics) -> float:
    """Return J M^-1 tau_e [m/s^2] along x, which does not depend on Gamma."""
    return float((dynamics.J @ np.linalg.solve(dynamics.M, PUSH))[0])


if __name__ == "__main__":
    main()
