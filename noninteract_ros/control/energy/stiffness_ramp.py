# SPDX-License-Identifier: Apache-2.0
"""Ramp of stiffness that the tank pays for: stiffer springs store energy at once."""

from dataclasses import replace

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.energy.tank import EnergyTank, TankLevels, affordable
from noninteract_ros.control.law.impedance import Impedance


class StiffnessRamp:
    """Changes springs no faster than a fade and than the tank can pay.

    Args:
        duration: Shortest time that a whole change takes [s].
    """

    def __init__(self, duration: float) -> None:
        self._duration = duration
        self.reset()

    def reset(self) -> None:
        """End a change where it is."""
        self._start: Impedance | None = None
        self._goal: Impedance | None = None
        self._progress = 1.0
        self._waits = False

    def begin(self, now: Impedance, goal: Impedance) -> Impedance:
        """Return the impedance at the start of a change: its springs as they are, the rest new."""
        self.reset()
        start = replace(goal, stiffness=now.stiffness, max_force=now.max_force)
        if not _alike(start, goal):
            self._start, self._goal, self._progress = start, goal, 0.0
        return start

    @property
    def changing(self) -> bool:
        """True while a change is under way."""
        return self._start is not None

    @property
    def waiting(self) -> float | None:
        """Progress of a change, 0 to 1, that the tank holds up; None where it does not."""
        return self._progress if self._waits else None

    def advance(
        self,
        impedance: Impedance,
        e: Array,
        step: float,
        tank: EnergyTank | None,
        settings: TankLevels,
    ) -> Impedance:
        """Return the impedance one tick later.

        Args:
            impedance: Gains in force.
            e: Error, shape (n,).
            step: Time since the last tick [s].
            tank: The account that pays; None, if nothing has to be paid.
            settings: Its levels.
        """
        if self._start is None or self._goal is None:
            return impedance
        progress = min(1.0, self._progress + step / self._duration)
        self._waits = False
        if tank is not None:
            cost = _stored(self._at(progress), e) - _stored(impedance, e)
            share = affordable(tank, tank.nu * cost, settings)
            self._waits = share < 1.0
            progress = self._progress + share * (progress - self._progress)
        self._progress = progress
        found = self._at(progress)
        if progress == 1.0:
            self.reset()
        return found

    def _at(self, progress: float) -> Impedance:
        """Return the springs part of the way."""
        assert self._start is not None
        assert self._goal is not None
        if progress == 1.0:
            return self._goal
        springs = {}
        for name in ("stiffness", "max_force"):
            start, goal = getattr(self._start, name), getattr(self._goal, name)
            with np.errstate(invalid="ignore"):  # Both infinite, where linear.
                part = start + progress * (goal - start)
            springs[name] = np.where(np.isfinite(goal), part, goal)
        return replace(self._start, **springs)


def _alike(a: Impedance, b: Impedance) -> bool:
    return bool((a.stiffness == b.stiffness).all() and (a.max_force == b.max_force).all())


def _stored(impedance: Impedance, e: Array) -> float:
    return float(impedance.potential(e).sum())
