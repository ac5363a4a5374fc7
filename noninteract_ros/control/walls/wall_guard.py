# SPDX-License-Identifier: Apache-2.0
"""Walls in a controller: what they keep from tick to tick, references and torques."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.energy.external_torque import ExternalTorque
from noninteract_ros.control.law.team_dynamics import Evaluation
from noninteract_ros.control.references.subtask_input import SubtaskCommand
from noninteract_ros.control.walls.governor import Desired
from noninteract_ros.control.walls.state import WALLS_AT_START, WallReport
from noninteract_ros.subtasks.reference import Reference
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team

if TYPE_CHECKING:
    from noninteract_ros.control.walls.walls import Walls, WallView


class WallGuard:
    """Applies walls at each tick: `update`, `governed`, `forces`, `record`, in this order.

    Args:
        team: The robots.
        stack: Their subtasks.
        walls: Constraints that joints and bodies keep.
        observer_gain: Bandwidth of the momentum observer [1/s]. Walls have to know every external
            torque, also one that no tool's sensor measures.
    """

    def __init__(
        self, team: Team, stack: SubtaskStack, walls: "Walls", observer_gain: float
    ) -> None:
        self._stack, self._walls = stack, walls
        self._external = ExternalTorque(team, False, observer_gain)
        self._state = WALLS_AT_START
        self._view: WallView | None = None

    def reset(self) -> None:
        """Drop all that is kept from tick to tick."""
        self._external.reset()
        self._state = WALLS_AT_START

    def update(self, elapsed: float, seen: Evaluation, applied: Array | None) -> None:
        """Evaluate the walls at a state.

        Args:
            elapsed: Time since the last state [s].
            seen: The state.
            applied: Torque since then, shape (n,); None for the one that was recorded.
        """
        self._external.update(elapsed, seen.state.q, seen.state.v, applied)
        self._view = self._walls.view(seen, self._state)

    def governed(
        self, led: tuple[SubtaskCommand, ...], stopped: bool, regular: bool
    ) -> tuple[SubtaskCommand, ...]:
        """Return commands to subtasks whose references respect the walls.

        Args:
            led: Commands of the sources.
            stopped: True where the team is stopped.
            regular: True where the Jacobian has an inverse to rely on.
        """
        if stopped:
            self._state = replace(self._state, governed=None)
            return led
        parts = [item.reference for item in led]
        desired = Desired(
            np.concatenate([part.position for part in parts]),
            np.concatenate([part.velocity for part in parts]),
            np.concatenate([part.acceleration for part in parts]),
        )
        found, motion = self._walls.governed(self._seen(), desired, regular, self._state)
        self._state = replace(self._state, governed=motion)
        if found is desired:
            return led
        values, rates = self._stack.value_slices, self._stack.slices
        return tuple(
            replace(
                item,
                reference=Reference(
                    found.position[value], found.velocity[rate], found.acceleration[rate]
                ),
            )
            for item, value, rate in zip(led, values, rates, strict=True)
        )

    def forces(self, torque: Array, sigma: float) -> tuple[Array, Array]:
        """Return what walls add to a torque, shape (n,) each [N or N m].

        The first part is passive by itself, the tank pays for the second.

        Args:
            torque: What the law asks for, shape (n,).
            sigma: Share of the decoupling in force.
        """
        view = self._seen()
        state = view.seen.state
        acting = torque + self._external.torque(state, None) - state.C @ state.v - state.g
        added = self._walls.forces(view, view.M_inverse @ acting, sigma, self._state)
        self._state = added.state
        return added.passive, added.paid

    def record(self, torque: Array) -> None:
        """Store the torque that is sent, shape (n,)."""
        self._external.record(torque)

    def report(self) -> WallReport:
        """Return what the walls did at this tick."""
        view, state = self._seen(), self._state
        held = state.governed is not None
        return WallReport(view.least, view.nearest, len(state.multipliers), held)

    def _seen(self) -> "WallView":
        assert self._view is not None
        return self._view
