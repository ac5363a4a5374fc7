# SPDX-License-Identifier: Apache-2.0
"""The mixing A of the tools' motions into mean and edges, its rate and its inverse.

The inverse starts at the edges, which determine every motion relative to the first robot, and
finds the motion of the first robot from the mean. All functions work on s columns: c of the mean
has shape (1, h, s), r of the edges (N - 1, h, s), and own vectors, shape (N, m, s), have the
tools' coordinates first.
"""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.compiler import FIRST, inner
from noninteract_ros.control.fast.kernels.array_parts import Indices, MixingArrays
from noninteract_ros.control.fast.kernels.blocks import (
    add,
    add_product,
    add_transposed_product,
    clear,
    product,
    transposed_product,
)


@inner
def mix(steps: Indices, framed: bool, A: MixingArrays, own: Array, c: Array, r: Array) -> None:
    """Write A t: mean and edges."""
    clear(c, FIRST, c.shape[1])
    for k in range(len(own)):
        add_product(1.0, A.G, k, own, k, c, FIRST)
    for step in range(len(steps)):
        edge, side = steps[step, 0], float(steps[step, 3])
        product(A.K, edge, own, steps[step, 1], r, edge)
        for i in range(r.shape[1]):
            for j in range(r.shape[2]):
                r[edge, i, j] *= -side
        add_product(side, A.K, edge, own, steps[step, 2], r, edge)
        if framed:
            add_product(1.0, A.H, edge, c, FIRST, r, edge)


@inner
def add_mix_rate(
    scale: float, steps: Indices, framed: bool, A: MixingArrays, own: Array, c: Array, r: Array
) -> None:
    """Add scale (dA/dt) t to mean and edges."""
    h = c.shape[1]
    turning, mean = np.zeros(c.shape), np.zeros(c.shape)
    for k in range(len(own)):
        add_product(scale, A.G_rate, k, own, k, turning, FIRST)
        if framed:
            add_product(scale, A.G, k, own, k, mean, FIRST)
    add(1.0, turning, FIRST, c, FIRST, h)
    for step in range(len(steps)):
        edge, side = steps[step, 0], scale * steps[step, 3]
        add_product(side, A.K_rate, edge, own, steps[step, 2], r, edge)
        add_product(-side, A.K_rate, edge, own, steps[step, 1], r, edge)
        if framed:
            add_product(1.0, A.H_rate, edge, mean, FIRST, r, edge)
            add_product(1.0, A.H, edge, turning, FIRST, r, edge)


@inner
def unmix(
    steps: Indices, framed: bool, A: MixingArrays, G_inverse: Array, c: Array, r: Array, own: Array
) -> None:
    """Write A^-1 (c, r): tool coordinates of own motions; overwrites c and, if framed, r."""
    h = c.shape[1]
    shift = np.empty(c.shape)
    clear(own, FIRST, h)
    for step in range(len(steps)):
        edge, parent, child = steps[step, 0], steps[step, 1], steps[step, 2]
        if framed:
            add_product(-1.0, A.H, edge, c, FIRST, r, edge)
        clear(own, child, h)
        add_transposed_product(float(steps[step, 3]), A.K, edge, r, edge, own, child)
        add(1.0, own, parent, own, child, h)
    for k in range(len(own)):
        add_product(-1.0, A.G, k, own, k, c, FIRST)
    product(G_inverse, FIRST, c, FIRST, shift, FIRST)
    for k in range(len(own)):
        add(1.0, shift, FIRST, own, k, h)


@inner
def mix_transposed(
    steps: Indices, framed: bool, A: MixingArrays, c: Array, r: Array, own: Array
) -> None:
    """Write A' f: tool forces of forces on mean and edges; overwrites c if framed."""
    if framed:
        for edge in range(len(r)):
            add_transposed_product(1.0, A.H, edge, r, edge, c, FIRST)
    for k in range(len(own)):
        transposed_product(A.G, k, c, FIRST, own, k)
    for step in range(len(steps)):
        edge, side = steps[step, 0], float(steps[step, 3])
        add_transposed_product(side, A.K, edge, r, edge, own, steps[step, 2])
        add_transposed_product(-side, A.K, edge, r, edge, own, steps[step, 1])


@inner
def unmix_transposed(
    steps: Indices, framed: bool, A: MixingArrays, G_inverse: Array, own: Array, c: Array, r: Array
) -> None:
    """Write A^-T f: forces on mean and edges of tool forces, which are overwritten."""
    h = c.shape[1]
    total = np.zeros(c.shape)
    for k in range(len(own)):
        add(1.0, own, k, total, FIRST, h)
    transposed_product(G_inverse, FIRST, total, FIRST, c, FIRST)
    for k in range(len(own)):
        add_transposed_product(-1.0, A.G, k, c, FIRST, own, k)
    for step in range(len(steps) - 1, -1, -1):
        edge, child = steps[step, 0], steps[step, 2]
        clear(r, edge, h)
        add_product(float(steps[step, 3]), A.K, edge, own, child, r, edge)
        add(1.0, own, child, own, steps[step, 1], h)
    if framed:
        for edge in range(len(r)):
            add_transposed_product(-1.0, A.H, edge, r, edge, c, FIRST)


@inner
def inverse_squares(steps: Indices, A: MixingArrays, G_inverse: Array) -> Array:
    """Return the diagonal blocks of A^-1 A^-T, shape (N, h, h).

    The column of A^-1 for edge e is 1 beyond the edge minus Q_e, times K_e', where Q_e is the sum
    of the G_k beyond it divided by the sum of all.
    """
    h = G_inverse.shape[1]
    squares, beyond = np.zeros(A.G.shape), A.G.copy()
    common, Q = np.zeros((h, h)), np.empty((1, h, h))
    for step in range(len(steps) - 1, -1, -1):
        parent, child = steps[step, 1], steps[step, 2]
        product(G_inverse, FIRST, beyond, child, Q, FIRST)
        add(1.0, beyond, child, beyond, parent, h)
        for i in range(h):
            for j in range(h):
                squares[child, i, j] = (1.0 if i == j else 0.0) - Q[0, i, j] - Q[0, j, i]
                for k in range(h):
                    common[i, j] += Q[0, i, k] * Q[0, j, k]
    for step in range(len(steps)):
        add(1.0, squares, steps[step, 1], squares, steps[step, 2], h)
    for robot in range(len(squares)):
        for i in range(h):
            for j in range(h):
                squares[robot, i, j] += common[i, j]
                for k in range(h):
                    squares[robot, i, j] += A.B[robot, i, k] * A.B[robot, j, k]
    return squares
