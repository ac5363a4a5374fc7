# SPDX-License-Identifier: Apache-2.0
"""Emulated haptic device in an operator's hand."""

import math
from itertools import pairwise

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError, ScenarioError
from noninteract_ros.schema import join
from noninteract_ros.sources.human.device_dynamics import DeviceDynamics
from noninteract_ros.sources.human.hand import Hand, RotatingHand
from noninteract_ros.sources.human.haptic_settings import HapticSettings
from noninteract_ros.sources.human.intended_motion import intended_motion
from noninteract_ros.sources.port import limit_norm
from noninteract_ros.sources.schedule import Schedule
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference


class HapticDevice:
    """Motion of the hand and device, sampled on the update grid under the feedback force.

    All times count from the start of the run. The motion `paper` runs in that time, as in the
    paper; every other motion counts from `start_time`.

    Args:
        settings: The device and its motion.
        layout: Layout of the commanded subtask's values.
        path: Dotted key of the block, for error messages.

    Raises:
        ScenarioError: A key does not fit the other keys, the subtask or the file it names.
    """

    def __init__(self, settings: HapticSettings, layout: Layout, path: str = "haptic") -> None:
        self._layout, self._settings = layout, settings
        self._schedule = Schedule(settings.update_rate, _windows(settings, path))
        self._motion = intended_motion(settings, layout, path)
        self._hand = _hand(settings, layout) if settings.hand_mass > 0.0 else None
        self._dynamics = DeviceDynamics.of(settings, layout, path)
        self._sampled: int | None = None

    def sample(self, t: float, feedback: Array | None = None) -> Reference | None:
        """Return the device's motion at an update instant.

        The feedback acts over the time since the last sample; across a dropout of the connection
        no feedback acts. The first sample, and one earlier than the last (the run was reset),
        start on the intended motion.

        Args:
            t: Time [s], rounded to the nearest update instant.
            feedback: Force on the hand [N; N m], shape (dim,); None for none.

        Returns:
            The reference; None before the start, after the stop and during a dropout.

        Raises:
            InputError: The feedback has the wrong shape or is not finite.
        """
        force = self.saturate(self.checked(feedback))
        index = self._schedule.index(t)
        if self._schedule.window(index) is None:
            return None
        intended = self._motion(index / self._schedule.rate)
        if self._hand is None:
            return intended
        self._move(self._hand, index, force)
        if self._dynamics:
            force = self._dynamics.force(force, intended, self._hand)
        return self._hand.deflect(intended, force)

    def saturate(self, force: Array) -> Array:
        """Limit a force to the device's force and torque limits [N; N m], shape (dim,)."""
        force = limit_norm(force, self._layout.rates, self._settings.force_limit)
        return limit_norm(force, self._layout.angular.ravel(), self._settings.torque_limit)

    def next_update(self, t: float) -> float:
        """Return the first update instant after `t` [s], with or without a sample."""
        return self._schedule.next_update(t)

    def next_sample(self, t: float) -> float:
        """Return the first instant after `t` with a sample [s]; infinity if there is none."""
        return self._schedule.next_sample(t)

    def _move(self, hand: Hand | RotatingHand, index: int, force: Array) -> None:
        before, self._sampled = self._sampled, index
        if before is None or index < before:
            hand.reset()
            if self._dynamics:
                self._dynamics.reset()
        elif index > before:
            dropout = self._schedule.window(before) != self._schedule.window(index)
            feedback = np.zeros_like(force) if dropout else force
            if not self._dynamics:
                hand.advance(feedback, index - before)
                return
            for past in range(before, index):
                self._dynamics.update(hand)
                intended = self._motion(past / self._schedule.rate)
                hand.advance(self._dynamics.force(feedback, intended, hand), 1)

    def checked(self, feedback: Array | None) -> Array:
        """Return a valid feedback [N; N m], zeros for None.

        Raises:
            InputError: The feedback has the wrong shape or is not finite.
        """
        if feedback is None:
            return np.zeros(self._layout.dim)
        if feedback.shape != (self._layout.dim,):
            shape = f"({self._layout.dim},)"
            raise InputError(f"feedback has shape {feedback.shape}, should be {shape}")
        if not np.isfinite(feedback).all():
            raise InputError(f"feedback is not finite: {feedback.tolist()}")
        return feedback


def _windows(settings: HapticSettings, path: str) -> list[tuple[float, float]]:
    """Return the time windows with samples, as pairs (begin, end) [s]."""
    begin, end = settings.start_time, settings.stop_time or math.inf
    if end <= begin:
        raise ScenarioError(join(path, "stop_time"), end, f"0, or > start_time ({begin:g})")
    bounds = settings.dropout_times
    if len(bounds) % 2 or any(a >= b for a, b in pairwise(bounds)):
        allowed = "pairs start, end in increasing order"
        raise ScenarioError(join(path, "dropout_times"), list(bounds), allowed)
    edges = [begin, *(min(max(bound, begin), end) for bound in bounds), end]
    return list(zip(edges[::2], edges[1::2], strict=True))


def _hand(settings: HapticSettings, layout: Layout) -> Hand | RotatingHand:
    period = 1.0 / settings.update_rate
    mass = settings.hand_mass + settings.device_mass
    damping = settings.hand_damping + settings.device_damping
    translation = Hand(mass, damping, settings.hand_stiffness, period, layout.rates.size)
    if not layout.rotates:
        return translation
    rotation = Hand(
        settings.hand_inertia,
        settings.hand_turning_damping,
        settings.hand_turning_stiffness,
        period,
        layout.angular.size,
    )
    return RotatingHand(translation, rotation, layout)
