# SPDX-License-Identifier: Apache-2.0
"""Mode of a controller, and the results of one step."""

from dataclasses import dataclass

from noninteract_ros.arrays import Array
from noninteract_ros.control.energy.account import EnergyAccount
from noninteract_ros.control.law.decoupling import TaskDynamics, TaskError
from noninteract_ros.control.law.impedance import Impedance
from noninteract_ros.control.references.subtask_input import SubtaskCommand
from noninteract_ros.control.safety.torque_limits import SafetyReport
from noninteract_ros.control.walls.state import WallReport
from noninteract_ros.subtasks.subtask import SubtaskState
from noninteract_ros.team.team import TeamState


@dataclass(frozen=True)
class Mode:
    """Law, gains and stop; a change is bumpless.

    Attributes:
        law: One of `decoupling.LAWS`.
        impedance: Gains of all subtasks.
        stopped: True while the team is damped to rest instead of following the law.
    """

    law: str
    impedance: Impedance
    stopped: bool = False


@dataclass(frozen=True, slots=True)
class Tick:
    """Results of one step of the controller.

    Attributes:
        torque: Control torque, shape (n,) [N or N m].
        state: Team dynamics at the state.
        task: Actual subtask values and Jacobians.
        x_rate: Actual subtask velocities, shape (n,) [m/s; rad/s].
        error: Tracking state of the subtasks.
        led: Command of each subtask.
        dynamics: Task dynamics at the state.
        task_acceleration: Commanded task acceleration before limits, shape (n,) [m/s^2].
        feedback: Coupling force D e_rate + h(e) of each subtask, which an operator's device
            feels, shape (n,) [N].
        law_share: Share of the decoupling that the state allows; below 1 near a singularity.
        regularity: Regularity of the task Jacobian, relative to the team's best.
        added_torque: Torque that limits of the joints added, shape (n,) [N or N m].
        safety: Their interventions.
        restarted: Why every subtask holds where it is, or "".
        account: The energy account as of this tick, kept whatever the law.
        law: Law in force.
        in_transition: True where the torque is not that of this law and these gains alone: a
            change fades, the team is or was stopped, or every subtask holds anew.
        walls: Walls at this tick; None without any.
    """

    torque: Array
    state: TeamState
    task: SubtaskState
    x_rate: Array
    error: TaskError
    led: tuple[SubtaskCommand, ...]
    dynamics: TaskDynamics
    task_acceleration: Array
    feedback: Array
    law_share: float
    regularity: float
    added_torque: Array
    safety: SafetyReport
    restarted: str
    account: EnergyAccount
    law: str
    in_transition: bool
    walls: WallReport | None = None

    @property
    def intervened(self) -> bool:
        """True where the torque is another one than the law's."""
        pushed = self.walls is not None and self.walls.active > 0
        return pushed or self.law_share < 1.0 or self.safety.acted or self.account.closing
