# SPDX-License-Identifier: Apache-2.0
"""Replay of a hand motion recorded as CSV."""

import csv
import math
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from noninteract_ros.arrays import Array
from noninteract_ros.control.reference import Reference
from noninteract_ros.errors import InputError
from noninteract_ros.operator.motion import Motion


def read_recording(path: str | Path, dim: int) -> tuple[Array, Array]:
    """Reads a recorded motion.

    Args:
        path: CSV file with a header: `t` [s], then one column per coordinate [m], as in `t, x, y`.
        dim: Number of coordinates.

    Returns:
        Times, shape (n,), increasing, and positions, shape (n, dim), n >= 2.

    Raises:
        InputError: The file cannot be read; the text names the line and what is wrong with it.
    """
    try:
        with open(path, encoding="utf-8-sig", newline="") as stream:
            lines = csv.reader(stream, skipinitialspace=True, strict=True)
            rows = [(lines.line_num, cells) for cells in lines if any(map(str.strip, cells))]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: {error}") from error
    _check_header(path, rows[0][1] if rows else [], dim)
    table: list[list[float]] = []
    for line, cells in rows[1:]:
        table.append(_numbers(path, line, cells, dim))
        if len(table) > 1 and table[-1][0] <= table[-2][0]:
            raise InputError(
                f"{path}, line {line}: t = {cells[0]} is not later than the line before"
            )
    if len(table) < 2:
        raise InputError(f"{path}: {len(table)} rows of numbers, at least 2 are needed")
    samples = np.array(table)
    return samples[:, 0], samples[:, 1:]


def _check_header(path: str | Path, cells: list[str], dim: int) -> None:
    names = [cell.strip() for cell in cells]
    if len(names) != dim + 1 or names[0] != "t":
        found = ", ".join(names) or "nothing"
        raise InputError(f"{path}: header is {found}, should be t and {dim} coordinates")
    if any(_is_number(name) for name in names):
        raise InputError(f"{path}: the first line must name the columns")


def _numbers(path: str | Path, line: int, cells: list[str], dim: int) -> list[float]:
    if len(cells) != dim + 1:
        raise InputError(f"{path}, line {line}: {len(cells)} columns, the header has {dim + 1}")
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


def replay(times: Array, positions: Array) -> Motion:
    """Replays a recording along its cubic spline, with the first sample at t = 0.

    The motion passes through every sample and is C2 between the first and the last. The spline's
    ends are free (not-a-knot): a recording that was cut in mid-motion is not braked to rest, which
    would ask for an acceleration that the hand never had. Outside, it rests at the end samples.

    Args:
        times: Increasing times [s], shape (n,), n >= 2.
        positions: Positions [m], shape (n, dim).
    """
    spline = CubicSpline(times - times[0], positions)
    rate, curvature = spline.derivative(1), spline.derivative(2)
    end = float(times[-1] - times[0])

    def motion(t: float) -> Reference:
        if t < 0.0 or t > end:
            return Reference.still(positions[0 if t < 0.0 else -1])
        return Reference(spline(t), rate(t), curvature(t))

    return motion
