# SPDX-License-Identifier: Apache-2.0
"""How means and differences mix the motions of the tools, and the way back.

Each robot k has h coordinates t_k: the velocity of its tool point along the axes in use, and its
angular velocity in axes of the tool. With them the rotation of a pair turns with
R_a (omega_a - omega_b), a plain difference like that of the points, so that mean c and edges r are

    c = sum over k of G_k t_k,        r_e = K_e (t_a - t_b) + H_e c,        K_e orthogonal

H is there where the edges are seen from the frame of the mean. The way back starts at the edges,
which give every t_k up to that of the first robot, and finds the latter by the mean. Every
operation works on columns, and none costs more than a constant times the number of robots.
"""

from dataclasses import dataclass

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.tree import Tree


@dataclass(frozen=True, slots=True)
class MixingTerms:
    """The mixing A at a state, for any number s of columns.

    Attributes:
        tree: The edges.
        G: Shape (N, h, h).
        K: Shape (N - 1, h, h).
        H: Shape (N - 1, h, h), or None in the world.
        G_rate: Time derivative of G.
        K_rate: Time derivative of K.
        H_rate: Time derivative of H.
        G_sum_inverse: Inverse of the sum of all G_k, shape (h, h).
    """

    tree: Tree
    G: Array
    K: Array
    H: Array | None
    G_rate: Array
    K_rate: Array
    H_rate: Array | None
    G_sum_inverse: Array

    def forward(self, t: Array) -> tuple[Array, Array]:
        """A t: mean (h, s) and edges (N - 1, h, s) of t, shape (N, h, s)."""
        c = (self.G @ t).sum(axis=0)
        r = self.K @ self.tree.differences(t)
        return c, r if self.H is None else r + self.H @ c

    def rate(self, t: Array) -> tuple[Array, Array]:
        """(dA/dt) t."""
        c_rate = (self.G_rate @ t).sum(axis=0)
        r_rate = self.K_rate @ self.tree.differences(t)
        if self.H is not None and self.H_rate is not None:
            r_rate = r_rate + self.H_rate @ (self.G @ t).sum(axis=0) + self.H @ c_rate
        return c_rate, r_rate

    def inverse(self, c: Array, r: Array) -> Array:
        """A^-1, shape (N, h, s)."""
        if self.H is not None:
            r = r - self.H @ c
        t = self.tree.down(_transposed(self.K) @ r)
        return t + self.G_sum_inverse @ (c - (self.G @ t).sum(axis=0))

    def transposed(self, f_c: Array, f_r: Array) -> Array:
        """A' f, shape (N, h, s)."""
        if self.H is not None:
            f_c = f_c + (_transposed(self.H) @ f_r).sum(axis=0)
        return _transposed(self.G) @ f_c + self.tree.gathered(_transposed(self.K) @ f_r)

    def inverse_transposed(self, f: Array) -> tuple[Array, Array]:
        """A^-T f: forces on mean (h, s) and edges (N - 1, h, s) of f, shape (N, h, s)."""
        f_c = self.G_sum_inverse.T @ f.sum(axis=0)
        f_r = self.K @ self.tree.up(f - _transposed(self.G) @ f_c)
        if self.H is not None:
            f_c = f_c - (_transposed(self.H) @ f_r).sum(axis=0)
        return f_c, f_r

    def of_mean(self) -> Array:
        """Columns of A^-1 that belong to the mean, shape (N, h, h)."""
        h = self.G.shape[-1]
        return self.inverse(np.eye(h), np.zeros((len(self.K), h, h)))

    def inverse_squares(self, of_mean: Array) -> Array:
        """Blocks on the diagonal of A^-1 A^-T, shape (N, h, h).

        The column of A^-1 for edge e is 1 beyond the edge minus Q_e, times K_e', where Q_e is the
        sum of the G_k beyond it divided by the sum of all.
        """
        identity = np.eye(self.G.shape[-1])
        Q = self.tree.up(self.G_sum_inverse @ self.G)
        along = self.tree.down(Q)
        common = (Q @ _transposed(Q)).sum(axis=0)
        own = self.tree.depth[:, None, None] * identity - along - _transposed(along)
        return of_mean @ _transposed(of_mean) + own + common


def _transposed(blocks: Array) -> Array:
    return blocks.transpose(0, 2, 1)
