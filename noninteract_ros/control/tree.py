# SPDX-License-Identifier: Apache-2.0
"""Sums along a tree of robots, whose number of operations is linear in the number of robots."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from noninteract_ros.arrays import Array

Places = NDArray[np.intp]


class Tree:
    """Robots joined by edges without a loop; the first robot is the root.

    Args:
        pairs: First and second robot of each edge.

    Attributes:
        depth: Number of edges from the root to each robot, shape (N,).

    Raises:
        ValueError: The edges do not join all robots, or have a loop.
    """

    def __init__(self, pairs: Sequence[tuple[int, int]]) -> None:
        count = len(pairs) + 1
        around: list[list[tuple[int, int, float]]] = [[] for _ in range(count)]
        for edge, (first, second) in enumerate(pairs):
            if max(first, second) >= count:
                raise ValueError("the edges are too few for all robots")
            around[first].append((second, edge, -1.0))
            around[second].append((first, edge, 1.0))
        self.first, self.second = np.array(pairs, dtype=np.intp).T
        self._walk(around)
        ends = np.concatenate([self.first, self.second])
        self._incident = np.argsort(ends, kind="stable")
        self._from = np.searchsorted(ends[self._incident], np.arange(count))

    def _walk(self, around: list[list[tuple[int, int, float]]]) -> None:
        """Robots in the order of a walk from the root, and the edges down and up again."""
        count = len(around)
        self.depth = np.zeros(count)
        self._entry, self._begin, self._end = (np.zeros(count, dtype=np.intp) for _ in range(3))
        self._child = np.zeros(count - 1, dtype=np.intp)
        self._sign = np.zeros((count - 1, 1, 1))
        order, steps = [0], []
        stack = [(0, -1, iter(around[0]))]
        while stack:
            robot, by, neighbours = stack[-1]
            for other, edge, sign in neighbours:
                if edge == by:
                    continue
                if other in order:
                    raise ValueError("the edges have a loop")
                self._child[edge], self._sign[edge] = other, sign
                steps.append((edge, sign))
                self._entry[other], self._begin[other] = len(steps), len(order)
                self.depth[other] = self.depth[robot] + 1.0
                order.append(other)
                stack.append((other, edge, iter(around[other])))
                break
            else:
                self._end[robot] = len(order)
                if by >= 0:
                    steps.append((by, -self._sign[by, 0, 0]))
                stack.pop()
        if len(order) < count:
            raise ValueError("the edges do not join all robots")
        self._order: Places = np.array(order, dtype=np.intp)
        steps = steps[: self._entry.max()]  # Nobody needs the way back from the last robot.
        self._edges: Places = np.array([edge for edge, _ in steps], dtype=np.intp)
        self._signs = np.array([sign for _, sign in steps])[:, None, None]

    def differences(self, x: Array) -> Array:
        """x[first] - x[second] of each edge, shape (N - 1, h, s), of x, shape (N, h, s)."""
        return x[self.first] - x[self.second]

    def gathered(self, f: Array) -> Array:
        """The transposed `differences`, shape (N, h, s), of f, shape (N - 1, h, s)."""
        both = np.concatenate([f, -f])[self._incident]
        return np.add.reduceat(both, self._from)

    def down(self, gaps: Array) -> Array:
        """x with these differences and zero at the root, shape (N, h, s)."""
        sums = np.zeros((len(self._edges) + 1, *gaps.shape[1:]))
        np.cumsum(gaps[self._edges] * self._signs, axis=0, out=sums[1:])
        return sums[self._entry]

    def up(self, f: Array) -> Array:
        """The transposed `down`, shape (N - 1, h, s): sums of f beyond each edge."""
        sums = np.zeros((len(f) + 1, *f.shape[1:]))
        np.cumsum(f[self._order], axis=0, out=sums[1:])
        beyond = sums[self._end[self._child]] - sums[self._begin[self._child]]
        return self._sign * beyond
