# SPDX-License-Identifier: Apache-2.0
"""Interaction with a passive door: unstable under `noninteracting`, stable under `natural`."""

import numpy as np

from noninteract_ros.control.law.decoupling import TaskDynamics, task_dynamics
from noninteract_ros.subtasks.kinds.cooperative_position import CooperativePosition
from noninteract_ros.subtasks.kinds.relative_position import RelativePosition
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.models.point_mass import PointMass
from noninteract_ros.team.team import Team

MASSES = (1.0, 4.0)  # kg, one axis each
STIFFNESS = np.diag([10.0, 1825.0])  # cooperative, relative [N/m]
DAMPING_RATIOS = (0.84, 1.59)
DOOR_ANGLE = np.deg2rad(114.26)  # both robots hold one door, at different radii
DOOR_STIFFNESS = 50e3  # N/m


def two_robots_at_rest() -> TaskDynamics:
    """Return the task dynamics of two point masses at rest."""
    robots = [PointMass(mass=m, axes=("x",)).build(f"robot_{i}") for i, m in enumerate(MASSES)]
    team = Team(robots)
    kinds = CooperativePosition("cooperative_position"), RelativePosition("relative_position")
    names = "cooperative", "relative"
    subtasks = [kind.build(name, team) for name, kind in zip(names, kinds, strict=True)]
    stack = SubtaskStack(team, subtasks)
    state = team.state(team.q0, np.zeros(team.n))
    return task_dynamics(state, stack.evaluate(state), stack.slices, (None, None))


def largest_real_part(inertia: np.ndarray, damping: np.ndarray, spring: np.ndarray) -> float:
    """Return the largest real part of the eigenvalues [1/s].

    The system is inertia x'' + damping x' + spring x = 0.
    """
    zero, one = np.zeros((2, 2)), np.eye(2)
    accelerations = np.linalg.solve(inertia, np.hstack([-spring, -damping]))
    return float(np.linalg.eigvals(np.vstack([np.hstack([zero, one]), accelerations])).real.max())


def main() -> None:
    dynamics = two_robots_at_rest()
    decoupled = np.diag([part.item() for part in dynamics.inertias])
    damping = 2.0 * np.diag(DAMPING_RATIOS) * np.sqrt(STIFFNESS * decoupled)
    b = np.array([np.cos(DOOR_ANGLE), np.sin(DOOR_ANGLE)])
    door = dynamics.S.T @ np.outer(b, DOOR_STIFFNESS * b) @ dynamics.S  # S' tau_e = -door x
    # tau~_e = M_s Lambda^-1 S' tau_e: the noninteracting law reshapes the door's torque.
    reshaped = decoupled @ np.linalg.solve(dynamics.inertia, door)
    loops = {
        "noninteracting, free": (decoupled, STIFFNESS),
        "noninteracting, at the door": (decoupled, STIFFNESS + reshaped),
        "natural, at the door": (dynamics.inertia, STIFFNESS + door),
    }
    print("Largest real part of the closed loop's eigenvalues (positive: unstable)")
    for name, (inertia, spring) in loops.items():
        print(f"  {name:28} {largest_real_part(inertia, damping, spring):+8.3f} 1/s")


if __name__ == "__main__":
    main()
