# SPDX-License-Identifier: Apache-2.0
"""Replay of a hand motion recorded as CSV."""

import csv
import math
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from noninteract_ros.arrays import Array
from noninteract_ros.errors import InputError
from noninteract_ros.sources.human.motion import Trajectory
from noninteract_ros.subtasks.layout import Layout
from noninteract_ros.subtasks.reference import Reference


def read_recording(path: str | Path, size: int) -> tuple[Array, Array]:
    """Read a recorded motion.

    Args:
        path: CSV file with a header: `t` [s], then one column per number of a value [m], as in
            `t, x, y` or `t, x, y, z, qx, qy, qz, qw`.
        size: Count of numbers in a value.

    Returns:
        Times, shape (n,), increasing, and values, shape (n, size), n >= 2.

    Raises:
        InputError: The file is not a valid recording; the text names the line and the error.
    """
    try:
        with open(path, encoding="utf-8-sig", newline="") as stream:
            lines = csv.reader(stream, skipinitialspace=True, strict=True)
            rows = [(lines.line_num, cells) for cells in lines if any(map(str.strip, cells))]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: {error}") from error
    _check_header(path, rows[0][1] if rows else [], size)
    table: list[list[float]] = []
    for line, cells in rows[1:]:
        table.append(_numbers(path, line, cells, size))
        if len(table) > 1 and table[-1][0] <= table[-2][0]:
            raise InputError(
                f"{path}, line {line}: t = {cells[0]} is not later than the line before"
            )
    if len(table) < 2:
        raise InputError(f"{path}: {len(table)} rows of numbers, at least 2 are needed")
    samples = np.array(table)
    return samples[:, 0], samples[:, 1:]


def _check_header(path: str | Path, cells: list[str], size: int) -> None:
    names = [cell.strip() for cell in cells]
    if len(names) != size + 1 or names[0] != "t":
        found = ", ".join(names) or "nothing"
        raise InputError(f"{path}: header is {found}, should be t and {size} coordinates")
    if any(_is_number(name) for name in names):
        raise InputError(f"{path}: the first line must name the columns")


def _numbers(path: str | Path, line: int, cells: list[str], size: int) -> list[float]:
    if len(cells) != size + 1:
        raise InputError(f"{path}, line {line}: {len(cells)} columns, the header has {size + 1}")
    for cell in cells:
        if not (_is_number(cell) and math.isfinite(float(cell))):
            raise InputError(f"{path}, line {line}: '{cell.strip()}' is not a finite number")
    return [float(cell) for cell in cells]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def replay(times: Array, values: Array, layout: Layout | None = None) -> Trajectory:
    """Build a replay of a recording along its cubic spline, with the first sample at t = 0.

    The motion passes through every sample and is C2 between the first and the last. Outside, it
    rests at the end samples. The spline's ends are free (not-a-knot): braking a recording that was
    cut in mid-motion would need an acceleration that the hand never had. Rotations follow scipy's
    spline on SO(3), also C2, with zero angular acceleration at its ends.

    Args:
        times: Increasing times [s], shape (n,), n >= 2.
        values: Values [m; quaternions], shape (n, size).
        layout: Layout of a value; plain numbers, if None.
    """
    layout = layout or Layout.scalars(values.shape[1])
    since = times - times[0]
    plain = CubicSpline(since, values[:, layout.values])
    rotations = [
        RotationSpline(since, Rotation.from_quat(values[:, part])) for part in layout.quaternions
    ]

    def motion(t: float) -> Reference:
        if t < 0.0 or t > since[-1]:
            return Reference.at_rest(values[0 if t < 0.0 else -1], layout)
        x, v, a = np.empty(layout.size), np.empty(layout.dim), np.empty(layout.dim)
        x[layout.values], v[layout.rates], a[layout.rates] = (
            plain(t, order) for order in range(3)
        )
        for spline, part, angular in zip(
            rotations, layout.quaternions, layout.angular, strict=True
        ):
            rotation = spline(t)
            x[part] = rotation.as_quat()
            v[angular], a[angular] = rotation.apply(
                [spline(t, 1), spline(t, 2)]
            )  # From body axes.
        return Reference(x, v, a)

    return motion
