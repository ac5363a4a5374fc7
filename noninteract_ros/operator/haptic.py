# SPDX-License-Identifier: Apache-2.0
"""An emulated haptic device in an operator's hand."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.reference import Reference
from noninteract_ros.errors import InputError, ScenarioError
from noninteract_ros.operator import motion as motions
from noninteract_ros.operator.hand import Hand
from noninteract_ros.operator.motion import Motion
from noninteract_ros.operator.replay import read_recording, replay
from noninteract_ros.operator.schedule import Schedule
from noninteract_ros.schema import join, key


@dataclass(frozen=True)
class HapticSettings:
    """The block `haptic` of a scenario."""

    subtask: str = key("Subtask that the operator commands", "cooperative")
    motion: str = key(
        "Motion that the hand intends",
        "paper",
        choices=("paper", "circle", "waypoints", "replay", "still"),
    )
    start_time: float = key("Time from which the device speaks [s]", 0.0, minimum=0.0)
    stop_time: float = key("Time from which it is silent for good [s]; 0: never", 0.0, minimum=0.0)
    update_rate: float = key("Rate of its references [Hz]", 1000.0, positive=True)
    amplitude: tuple[float, ...] = key("paper: amplitude of each coordinate [m]", (2.0, 0.0))
    frequency: float = key("paper, circle: angular frequency [rad/s]", 0.79)
    offset: tuple[float, ...] = key("paper: value around which it swings [m]", (0.0, 1.0))
    centre: tuple[float, ...] = key("circle: its centre; still: the place of rest [m]", ())
    radius: float = key("circle: radius [m]", 0.5, minimum=0.0)
    ramp_time: float = key("circle: time to reach full rate from rest [s]", 1.0, minimum=0.0)
    points: tuple[float, ...] = key("waypoints: the points one after the other [m]", ())
    times: tuple[float, ...] = key(
        "waypoints: when each is reached, counted from start_time [s]", (), minimum=0.0
    )
    file: str = key(
        "replay: CSV file with the columns t [s], x, y, ... [m]; its first row is at start_time",
        "",
    )
    tremor_amplitude: float = key("Bound of the tremor in each coordinate [m]", 0.0, minimum=0.0)
    tremor_seed: int = key("Seed of the tremor's phases", 0, minimum=0)
    hand_mass: float = key("Mass of hand and device [kg]; 0: a rigid hand", 0.0, minimum=0.0)
    hand_damping: float = key("Damping of the hand's grip [N s/m]", 20.0, minimum=0.0)
    hand_stiffness: float = key("Stiffness of the hand's grip [N/m]", 300.0, minimum=0.0)
    dropout_times: tuple[float, ...] = key(
        "Start, end, start, end, ... of the dropouts of the connection [s]", (), minimum=0.0
    )


class HapticDevice:
    """Samples the hand's motion on the update grid; feels the feedback force.

    All times count from the start of the run. The motion `paper` runs in that time, as in the
    paper; every other motion counts from `start_time`.
    """

    def __init__(self, settings: HapticSettings, dim: int, path: str = "haptic") -> None:
        """Checks what the settings' own types and ranges leave open.

        Args:
            settings: The device and its motion.
            dim: Number of coordinates of the commanded subtask.
            path: Dotted key of the block, for error messages.

        Raises:
            ScenarioError: A key does not fit the others, the subtask or the file it names.
        """
        self._dim = dim
        self._schedule = Schedule(settings.update_rate, _windows(settings, path))
        self._motion = _intended(settings, dim, path)
        self._hand: Hand | None = None
        if settings.hand_mass > 0.0:
            self._hand = Hand(
                settings.hand_mass,
                settings.hand_damping,
                settings.hand_stiffness,
                1.0 / settings.update_rate,
                dim,
            )
        self._sampled: int | None = None

    def sample(self, t: float, feedback: Array | None = None) -> Reference | None:
        """The device's motion at an update instant.

        The feedback acts over the time since the last sample. A hand whose connection dropped out
        in between felt nothing meanwhile. The first sample, and one earlier than the last (the
        run was reset), start on the intended motion.

        Args:
            t: Time [s], taken to the nearest update instant.
            feedback: Force on the hand [N], shape (dim,); None for none.

        Returns:
            The reference; None before the start, after the stop and in a dropout.

        Raises:
            InputError: The feedback has another shape or is not finite.
        """
        force = self._checked(feedback)
        index = self._schedule.index(t)
        if self._schedule.window(index) is None:
            return None
        intended = self._motion(index / self._schedule.rate)
        if self._hand is None:
            return intended
        self._move(self._hand, index, force)
        return self._hand.deflect(intended, force)

    def next_update(self, t: float) -> float:
        """The first update instant later than `t` [s], spoken or not."""
        return self._schedule.next_update(t)

    def silent_until(self, t: float) -> float:
        """The first instant later than `t` [s] for which there is a sample; infinity if none."""
        return self._schedule.silent_until(t)

    def _move(self, hand: Hand, index: int, force: Array) -> None:
        if self._sampled is None or index < self._sampled:
            hand.reset()
        elif index > self._sampled:
            cut_off = self._schedule.window(self._sampled) != self._schedule.window(index)
            felt = np.zeros_like(force) if cut_off else force
            hand.advance(felt, index - self._sampled)
        self._sampled = index

    def _checked(self, feedback: Array | None) -> Array:
        if feedback is None:
            return np.zeros(self._dim)
        if feedback.shape != (self._dim,):
            raise InputError(f"feedback has shape {feedback.shape}, should be ({self._dim},)")
        if not np.isfinite(feedback).all():
            raise InputError(f"feedback is not finite: {feedback.tolist()}")
        return feedback


def _windows(settings: HapticSettings, path: str) -> list[tuple[float, float]]:
    """Times in which the device speaks, as pairs (begin, end) [s]."""
    begin, end = settings.start_time, settings.stop_time or math.inf
    if end <= begin:
        raise ScenarioError(join(path, "stop_time"), end, f"0, or > start_time ({begin:g})")
    bounds = settings.dropout_times
    if len(bounds) % 2 or any(a >= b for a, b in pairwise(bounds)):
        allowed = "pairs start, end in increasing order"
        raise ScenarioError(join(path, "dropout_times"), list(bounds), allowed)
    edges = [begin, *(min(max(bound, begin), end) for bound in bounds), end]
    return list(zip(edges[::2], edges[1::2], strict=True))


def _intended(settings: HapticSettings, dim: int, path: str) -> Motion:
    """The hand's motion over the time of the run, with its tremor."""
    builders = {
        "paper": _swing,
        "circle": _circle,
        "waypoints": _waypoints,
        "replay": _replay,
        "still": _still,
    }
    motion = builders[settings.motion](settings, dim, path)
    if settings.motion != "paper":
        motion = motions.delayed(motion, settings.start_time)
    if settings.tremor_amplitude > 0.0:
        motion = motions.with_tremor(motion, settings.tremor_amplitude, settings.tremor_seed, dim)
    return motion


def _swing(settings: HapticSettings, dim: int, path: str) -> Motion:
    amplitude = _vector(settings.amplitude, dim, join(path, "amplitude"))
    offset = _vector(settings.offset, dim, join(path, "offset"))
    return motions.swing(amplitude, settings.frequency, offset)


def _circle(settings: HapticSettings, dim: int, path: str) -> Motion:
    if dim < 2:
        allowed = f"a subtask of 2 or more coordinates; {settings.subtask} has {dim}"
        raise ScenarioError(join(path, "motion"), "circle", allowed)
    centre = _vector(settings.centre, dim, join(path, "centre"))
    return motions.circle(centre, settings.radius, settings.frequency, settings.ramp_time)


def _still(settings: HapticSettings, dim: int, path: str) -> Motion:
    return motions.still(_vector(settings.centre, dim, join(path, "centre")))


def _waypoints(settings: HapticSettings, dim: int, path: str) -> Motion:
    times = settings.times
    if len(times) < 2 or any(a >= b for a, b in pairwise(times)):
        raise ScenarioError(join(path, "times"), list(times), "2 or more increasing times")
    if len(settings.points) != dim * len(times):
        allowed = f"{dim * len(times)} numbers ({len(times)} times, {dim} coordinates each)"
        found = f"{len(settings.points)} numbers"
        raise ScenarioError(join(path, "points"), found, allowed)
    return motions.waypoints(times, np.reshape(settings.points, (len(times), dim)))


def _replay(settings: HapticSettings, dim: int, path: str) -> Motion:
    if not settings.file:
        raise ScenarioError(join(path, "file"), "nothing", "a CSV file (for motion: replay)")
    try:
        return replay(*read_recording(settings.file, dim))
    except InputError as error:
        allowed = f"a CSV with the columns t and {dim} coordinates, increasing t, finite numbers"
        raise ScenarioError(join(path, "file"), error, allowed) from error


def _vector(numbers: tuple[float, ...], dim: int, path: str) -> tuple[float, ...]:
    if len(numbers) != dim:
        raise ScenarioError(path, list(numbers), f"{dim} numbers, one per coordinate")
    return numbers
