# SPDX-License-Identifier: Apache-2.0
"""What decoupling is good for: the same motion under other control, relative errors side by side.

Plain compliance control is no law of this package. It serves for comparison only: the impedance
of each subtask is mapped to the joints by J', gravity is compensated, and nothing else is known of
the dynamics,

    tau = J' (-D e_rate - h(e)) + g

It, and the law `natural`, see the inverse of the whole task inertia where the noninteracting law
sees M_i: gains that suit the one can be too much for the others at the same rate. Hence `share`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from rich.table import Table

from noninteract_ros.arrays import Array
from noninteract_ros.control.tick import Tick
from noninteract_ros.rehearsal import Rehearsal
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario_blocks import SubtaskSpec

COMPLIANCE = "compliance"


@dataclass(frozen=True)
class Errors:
    """Largest errors of one run.

    Attributes:
        law: What led it.
        rate: Ticks per second [Hz].
        position: Largest error of each subtask's positions [m], 0 where it has none.
        angle: Largest angle error of each subtask's rotations [rad], 0 where it has none.
        speed: Largest speed of the desired motions [m/s].
        turning: Largest angular speed of the desired motions [rad/s].
        intervened: Whether a limit of the joints or a singularity took part.
    """

    law: str
    rate: float
    position: dict[str, float]
    angle: dict[str, float]
    speed: float
    turning: float
    intervened: bool


class ComplianceRehearsal(Rehearsal):
    """A rehearsal whose team gets the torque of plain compliance control."""

    def command(self, tick: Tick) -> Array:
        """J' (-D e_rate - h(e)) + g at a tick, shape (n,) [N or N m]."""
        impedance, error = self.controller.mode.impedance, tick.error
        force = -impedance.damping * error.e_rate - impedance.force(error.e)
        return tick.task.J.T @ force + tick.state.g


def measure_law(
    scenario: Scenario, law: str, rate: float, duration: float, share: float = 1.0
) -> Errors:
    """Rehearses a scenario under a law, or under plain compliance control.

    Args:
        scenario: What to run.
        law: One of the laws, or `COMPLIANCE`.
        rate: Ticks per second, and updates of the hand [Hz].
        duration: How long [s].
        share: Share of the scenario's stiffness that is used; of its damping, the square root.
    """
    plain = law == COMPLIANCE
    general = replace(scenario.general, rate=rate, law="noninteracting" if plain else law)
    haptic = scenario.haptic and replace(scenario.haptic, update_rate=rate)
    kind = ComplianceRehearsal if plain else Rehearsal
    subtasks = {name: _softened(spec, share) for name, spec in scenario.subtasks.items()}
    rehearsal = kind(replace(scenario, general=general, haptic=haptic, subtasks=subtasks))
    rows = [_row(rehearsal) for _ in range(round(duration * rate))]
    e, speeds, acted = (np.array(column) for column in zip(*rows, strict=True))
    position, angle = {}, {}
    for task, part in zip(rehearsal.stack.subtasks, rehearsal.stack.slices, strict=True):
        linear, angular = e[:, part][:, task.layout.rates], e[:, part][:, task.layout.angular]
        position[task.name] = float(np.abs(linear).max(initial=0.0))
        angle[task.name] = float(np.linalg.norm(angular, axis=2).max(initial=0.0))
    speed, turning = speeds.max(axis=0)
    intervened = bool(acted.any()) and not plain
    return Errors(law, rate, position, angle, float(speed), float(turning), intervened)


def _softened(spec: SubtaskSpec, share: float) -> SubtaskSpec:
    """A subtask with a share of its stiffness, and as well damped as before."""
    stiffness = tuple(share * k for k in spec.impedance.stiffness)
    damping = tuple(share**0.5 * d for d in spec.impedance.damping)
    impedance = replace(spec.impedance, stiffness=stiffness, damping=damping)
    return replace(spec, impedance=impedance)


def _row(rehearsal: Rehearsal) -> tuple[Array, tuple[float, float], bool]:
    """Errors, largest desired speeds, and whether anything but the law acted, at the next tick."""
    tick = rehearsal.step()
    speed = turning = 0.0
    for task, led in zip(rehearsal.stack.subtasks, tick.led, strict=True):
        velocity, layout = led.reference.velocity, task.layout
        speed = max(speed, float(np.linalg.norm(velocity[layout.rates])))
        angular = np.linalg.norm(velocity[layout.angular], axis=1)
        turning = max(turning, float(angular.max(initial=0.0)))
    return tick.error.e, (speed, turning), tick.intervened


def errors_table(rows: Sequence[Errors]) -> Table:
    """A row for each run, for a terminal."""
    subtasks = list(rows[0].position) if rows else []
    table = Table("law", r"rate \[Hz]", *(rf"{name} \[m, rad]" for name in subtasks))
    for row in rows:
        cells = (f"{row.position[name]:.2g}, {row.angle[name]:.2g}" for name in subtasks)
        table.add_row(row.law, f"{row.rate:g}", *cells)
    return table
