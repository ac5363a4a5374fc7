# SPDX-License-Identifier: Apache-2.0
"""Intended motion of the hand, built from the keys of a scenario."""

from itertools import pairwise

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError, ScenarioError
from noninteract_ros.schema import join
from noninteract_ros.sources.human import motion as motions
from noninteract_ros.sources.human.haptic_settings import HapticSettings
from noninteract_ros.sources.human.motion import Trajectory
from noninteract_ros.sources.human.replay import read_recording, replay
from noninteract_ros.subtasks.layout import Layout


def intended_motion(settings: HapticSettings, layout: Layout, path: str) -> Trajectory:
    """Build the hand's motion over the time of the run, with its tremor.

    Args:
        settings: The device and its motion.
        layout: Layout of the commanded subtask's values.
        path: Dotted key of the block, for error messages.

    Raises:
        ScenarioError: A key does not fit the other keys, the subtask or the file it names.
    """
    builders = {
        "paper": _swing,
        "circle": _circle,
        "waypoints": _waypoints,
        "replay": _replay,
        "still": _still,
    }
    motion = builders[settings.motion](settings, layout, path)
    if settings.motion != "paper":
        motion = motions.delayed(motion, settings.start_time)
    if settings.tremor_amplitude > 0.0 or settings.tremor_angle > 0.0:
        bounds = np.full(layout.dim, settings.tremor_amplitude)
        bounds[layout.angular] = settings.tremor_angle
        motion = motions.with_tremor(motion, bounds, settings.tremor_seed, layout)
    return motion


def _swing(settings: HapticSettings, layout: Layout, path: str) -> Trajectory:
    amplitude = _vector(settings.amplitude, layout, join(path, "amplitude"))
    offset = _vector(settings.offset, layout, join(path, "offset"))
    translation = motions.swing(amplitude, settings.frequency, offset)
    if not layout.rotates:
        return translation
    angles = _rotation(settings, layout, path)
    rotation = motions.swing(angles, settings.frequency, np.zeros_like(angles))
    return motions.with_rotation(
        translation, rotation, _orientation(settings, layout, path), layout
    )


def _circle(settings: HapticSettings, layout: Layout, path: str) -> Trajectory:
    count = layout.rates.size
    if count < 2:
        allowed = f"a subtask of 2 or more coordinates; {settings.subtask} has {count}"
        raise ScenarioError(join(path, "motion"), "circle", allowed)
    centre = _vector(settings.centre, layout, join(path, "centre"))
    pace = settings.frequency, settings.ramp_time
    translation = motions.circle(centre, settings.radius, *pace)
    if not layout.rotates:
        return translation
    rotation = motions.rocking(_rotation(settings, layout, path), *pace)
    return motions.with_rotation(
        translation, rotation, _orientation(settings, layout, path), layout
    )


def _still(settings: HapticSettings, layout: Layout, path: str) -> Trajectory:
    value = layout.identity.copy()
    value[layout.values] = _vector(settings.centre, layout, join(path, "centre"))
    value[layout.quaternions] = _orientation(settings, layout, path)
    return motions.still(value, layout)


def _waypoints(settings: HapticSettings, layout: Layout, path: str) -> Trajectory:
    times, count = settings.times, layout.values.size
    if len(times) < 2 or any(a >= b for a, b in pairwise(times)):
        raise ScenarioError(join(path, "times"), list(times), "2 or more increasing times")
    if len(settings.points) != count * len(times):
        allowed = f"{count * len(times)} numbers ({len(times)} times, {count} coordinates each)"
        found = f"{len(settings.points)} numbers"
        raise ScenarioError(join(path, "points"), found, allowed)
    values = np.tile(layout.identity, (len(times), 1))
    values[:, layout.values] = np.reshape(settings.points, (len(times), count))
    values[:, layout.quaternions] = _orientation(settings, layout, path)
    if settings.orientations:
        where = join(path, "orientations")
        shape = (len(times), *layout.quaternions.shape)
        values[:, layout.quaternions] = _quaternions(settings.orientations, shape, where)
    return motions.waypoints(times, values, layout)


def _replay(settings: HapticSettings, layout: Layout, path: str) -> Trajectory:
    if not settings.file:
        raise ScenarioError(join(path, "file"), "nothing", "a CSV file (for motion: replay)")
    size = layout.size
    try:
        times, values = read_recording(settings.file, size)
        return replay(times, layout.checked(values), layout)
    except InputError as error:
        allowed = f"a CSV with the columns t and {size} coordinates, increasing t, finite numbers"
        raise ScenarioError(join(path, "file"), error, allowed) from error


def _vector(numbers: tuple[float, ...], layout: Layout, path: str) -> tuple[float, ...]:
    count = layout.rates.size
    if len(numbers) != count:
        raise ScenarioError(path, list(numbers), f"{count} numbers, one per coordinate")
    return numbers


def _rotation(settings: HapticSettings, layout: Layout, path: str) -> Array:
    count = layout.angular.size
    found = settings.rotation or (0.0,) * count
    if len(found) != count:
        allowed = f"{count} numbers, three per rotation"
        raise ScenarioError(join(path, "rotation"), list(found), allowed)
    return np.array(found)


def _orientation(settings: HapticSettings, layout: Layout, path: str) -> Array:
    """Return the orientations that the motion holds or oscillates about, shape (r, 4)."""
    where, shape = join(path, "orientation"), layout.quaternions.shape
    if not settings.orientation:
        return layout.identity[layout.quaternions]
    return _quaternions(settings.orientation, shape, where)


def _quaternions(numbers: tuple[float, ...], shape: tuple[int, ...], path: str) -> Array:
    """Return unit quaternions of a shape (..., 4) from a sequence of numbers."""
    count = int(np.prod(shape))
    if len(numbers) != count:
        allowed = f"{count} numbers, x, y, z, w of {count // 4} quaternions"
        raise ScenarioError(path, f"{len(numbers)} numbers", allowed)
    try:
        rows = np.reshape(numbers, (-1, 4))
        return Layout((0,), (True,)).checked(rows).reshape(shape)
    except InputError as error:
        raise ScenarioError(path, list(numbers), f"unit quaternions ({error})") from error
