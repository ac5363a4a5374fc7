# SPDX-License-Identifier: Apache-2.0
"""The torque that is sent: within effort and rate limits, with what was cut from which part."""

from dataclasses import dataclass, replace

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.energy.command_log import Command, undivided
from noninteract_ros.control.energy.gate import TickTerms
from noninteract_ros.control.energy.tank import EnergyTank
from noninteract_ros.control.law.decoupling import TaskDynamics
from noninteract_ros.control.law.impedance import Impedance
from noninteract_ros.control.safety.joint_limits import Guard
from noninteract_ros.control.safety.settings import SafetySettings
from noninteract_ros.control.safety.torque_limits import (
    WHOLE,
    SafetyReport,
    Shares,
    fitting,
    slewed,
)
from noninteract_ros.team.team import Team

RATE_SHARE = 0.5  # of the rate limit that springs and dampers may use up at a speed
BRAKING = 0.9  # share of the dampers from which they come back when it was
RECOVERY = 0.3  # [s] in which gains come back after a rate limit was reached, where it fits
SLOWLY = 3.0  # [s] in which they do elsewhere


@dataclass(frozen=True, slots=True)
class Groups:
    """Torques of a command that limits scale as wholes, in the order in which they give way.

    Attributes:
        decoupling: What the tank pays, shape (n,) [N or N m].
        inputs: Feed-forward of references and force inputs, shape (n,).
        springs: Shape (n,).
        dampers: Shape (n,).
    """

    decoupling: Array
    inputs: Array
    springs: Array
    dampers: Array

    def scaled(self, shares: Shares) -> tuple[Array, ...]:
        """Return the torques with a share of each."""
        return (
            shares.decoupling * self.decoupling,
            shares.inputs * self.inputs,
            shares.springs * self.springs,
            shares.dampers * self.dampers,
        )


class TorqueLimiter:
    """Keeps commands within the limits of the joints' torques and of their rates.

    Args:
        team: The robots.
        settings: The rate limit.
    """

    def __init__(self, team: Team, settings: SafetySettings) -> None:
        self._team = team
        self._rate = settings.torque_rate
        self._limits = team.effort_limits
        self._limited = bool(np.isfinite(team.effort_limits).any())
        self._last: Array | None = None
        self._fit = 1.0

    def reset(self) -> None:
        """Drop the last torque, as when the team starts anew."""
        self._last, self._fit = None, 1.0

    def limit(
        self, command: Command, terms: TickTerms, tank: EnergyTank, guard: Guard, elapsed: float
    ) -> tuple[Command, SafetyReport]:
        """Return the command that is sent; always finite.

        Gravity, repulsion and brakes come first. Of what the law asks for beyond them the
        decoupling gives way first, then feed-forward and inputs, the springs, the dampers. At
        last each joint's change since the last tick is cut to the rate limit. A torque that is
        not finite is replaced by gravity and the robots' brakes.

        Args:
            command: What law and recovery ask for.
            terms: This tick.
            tank: The account, with the gates that the command has.
            guard: Repulsion and brakes.
            elapsed: Time since the last torque [s].
        """
        finite = bool(np.isfinite(command.torque).all())
        if not finite:
            g, damping = terms.dynamics.g, self._team.brake_damping
            command = undivided(g - damping * terms.v, terms.dynamics)
        fit = self._fit = self._fitting(terms, elapsed) if self._fit < 1.0 else 1.0
        torque = command.torque
        wanted = torque if guard.torque is None else torque + guard.torque
        beyond = self._limited and bool((np.abs(wanted) > self._limits).any())
        shares, clipped, effort_share = WHOLE, False, 1.0
        if beyond or fit < 1.0:
            command, shares, effort_share, clipped = self._cut(command, terms, tank, guard, fit)
        elif guard.torque is not None:
            command = replace(
                command, torque=wanted, other=guard.torque, repulsion=guard.repulsion
            )
        rate_share = 1.0
        if self._rate > 0.0 and self._last is not None:
            asked = command.torque
            sent, rate_share = slewed(asked, self._last, self._rate * elapsed)
            if rate_share < 1.0:
                self._fit = min(self._fit, self._fitting(terms, 0.0), BRAKING)
                late = sent - asked
                other = late if command.other is None else command.other + late
                command = replace(command, torque=sent, other=other)
        self._last = command.torque
        report = SafetyReport(
            shares=shares,
            effort_share=effort_share,
            rate_share=rate_share,
            rate_fit=fit,
            repelled=guard.repelled,
            too_fast=guard.too_fast,
            finite=finite,
            clipped=clipped,
        )
        return command, report

    def _cut(
        self, command: Command, terms: TickTerms, tank: EnergyTank, guard: Guard, fit: float
    ) -> tuple[Command, Shares, float, bool]:
        """Return the command with less of its parts, the shares, and whether the base is cut."""
        g = terms.dynamics.g
        base = g if guard.torque is None else g + guard.torque
        limits = self._limits
        held = np.clip(base, -limits, limits)
        full = np.abs(base) >= limits
        groups = groups_of(command, terms, tank)
        fits = Shares(springs=fit * fit, dampers=fit, decoupling=fit * fit)
        parts = groups.scaled(fits)
        counted = np.where(full, np.inf, limits)
        left = fitting(held, parts, counted) if self._limited else (1.0, 1.0, 1.0, 1.0)
        shares = Shares(
            decoupling=left[0] * fits.decoupling,
            inputs=left[1],
            springs=left[2] * fits.springs,
            dampers=left[3] * fits.dampers,
        )
        law = sum(groups.scaled(shares), np.zeros_like(g))
        torque = np.clip(held + law, -limits, limits)
        led, paid, damped = command.feed_forward, command.paid, command.damped
        dampers = terms.share * tank.damping * command.dampers
        undamped = command.impedance_force + dampers
        sent = Command(
            torque=torque,
            dynamics=command.dynamics,
            dampers=command.dampers,
            impedance_force=shares.springs * undamped - shares.dampers * dampers,
            decoupling_force=shares.decoupling * command.decoupling_force,
            input_force=shares.inputs * command.input_force,
            feed_forward=None if led is None else shares.inputs * led,
            paid=None if paid is None else shares.decoupling * paid,
            damped=None if damped is None else shares.dampers * damped,
            other=torque - g - law,
            repulsion=guard.repulsion,
        )
        return sent, shares, min(left), bool(full.any() and (held != base).any())

    def _fitting(self, terms: TickTerms, elapsed: float) -> float:
        """Return the share of the dampers, its square that of the springs, that the rate fits.

        Args:
            terms: This tick.
            elapsed: Time in which the share may have risen [s].
        """
        demand = rate_demand(terms.dynamics, terms.impedance, terms.error.e_rate)
        largest, room = float(demand.max()), RATE_SHARE * self._rate
        fit = 1.0 if largest <= room else float(np.sqrt(room / largest))
        # Gains that the rate does not fit come back slowly: what is fast may be over already.
        rise = elapsed / (RECOVERY if fit > self._fit else SLOWLY)
        return min(1.0, self._fit + rise) if elapsed > 0.0 else fit


def groups_of(command: Command, terms: TickTerms, tank: EnergyTank) -> Groups:
    """Return the torques of a command by the part of the law that they belong to."""
    dynamics, none = command.dynamics, np.zeros_like(command.torque)
    dampers = -terms.share * tank.damping * command.dampers
    decoupling = dynamics.torque_of(command.decoupling_force)
    inputs = dynamics.torque_of(command.input_force)
    return Groups(
        decoupling=decoupling if command.paid is None else decoupling + command.paid,
        inputs=inputs if command.feed_forward is None else inputs + command.feed_forward,
        springs=dynamics.torque_of(command.impedance_force - dampers),
        dampers=dynamics.torque_of(dampers) + (none if command.damped is None else command.damped),
    )


def rate_demand(dynamics: TaskDynamics, impedance: Impedance, e_rate: Array) -> Array:
    """Return a measure of the rate of springs and dampers at a speed, (n,) [N/s or N m/s].

    |J' K de| + |J' D J M^-1 J' D de|: springs as they stretch, dampers as they slow down. With a
    share f of the dampers and f^2 of the springs the damping ratios stay, and so do both terms
    but for the factor f^2.
    """
    stretched = dynamics.torque_of(impedance.stiffness * e_rate)
    slowing = dynamics.acceleration_under(dynamics.torque_of(impedance.damping * e_rate))
    slowed = dynamics.torque_of(impedance.damping * slowing)
    return np.abs(stretched) + np.abs(slowed)
