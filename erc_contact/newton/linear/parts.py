"""Parts of a body whose inner degrees of freedom are eliminated, and pairs of them.

Symbols: I the degrees of freedom of a part that are eliminated, B the others; K its
stiffness; ``S = K_BB - K_BI K_II^-1 K_IB``; ``g = b_B - K_BI K_II^-1 b_I`` the
condensed forces; L as in :mod:`erc_contact.newton.linear.stiffness`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from petsc4py import PETSc

from erc_contact.newton.linear.mumps import Factor, dense_factor, dense_solve, factorise


@dataclass(frozen=True, eq=False)
class Interface:
    """Hold what is left of the part of the body that one rank has, or several ranks.

    Attributes:
        numbers: Global numbers of B, ascending, shape (B,).
        count: How many of the ranks that touch them belong to the part, shape (B,).
        total: How many ranks touch them; one more in L, where they stay, shape (B,).
        schur: S [force/length], shape (B, B).
    """

    numbers: np.ndarray
    count: np.ndarray
    total: np.ndarray
    schur: np.ndarray


class Substructure:
    """Represent the part of one rank.

    Args:
        matrix: Stiffness of its cells [force/length], shape (n, n); the part frees it.
        numbers: Global numbers of its rows, shape (n,).
        total: How many ranks touch them; one more in L, shape (n,).

    Raises:
        InputError: If the matrix cannot be factorised.
    """

    def __init__(self, matrix: PETSc.Mat, numbers: np.ndarray, total: np.ndarray) -> None:
        self._matrix = matrix
        self._inner = total == 1
        outer = np.flatnonzero(~self._inner)
        self._outer = outer[np.argsort(numbers[outer])]
        self._numbers = numbers[self._outer]
        self._total = total[self._outer]
        self._factor: Factor | None = None
        if self._inner.any():
            self._factor = factorise(matrix, self._outer if len(outer) else None)
            if len(outer):
                self._factor.interior_only()

    def interface(self) -> Interface:
        """Return what is left of the part."""
        size = len(self._outer)
        if size == 0:
            schur = np.zeros((0, 0))
        elif self._factor is not None:
            schur = self._factor.schur_complement()
        else:
            whole = self._matrix.convert("dense", PETSc.Mat())
            schur = whole.getDenseArray()[np.ix_(self._outer, self._outer)]
        return Interface(self._numbers, np.ones_like(self._total), self._total, schur)

    def up(self, b: np.ndarray) -> np.ndarray:
        """Return the condensed forces at B [force] of forces b at all rows [force]."""
        if not b[self._inner].any():
            return b[self._outer]
        condensed = b - self._times(self._inside(b))
        return condensed[self._outer]

    def down(self, b: np.ndarray, u_B: np.ndarray) -> np.ndarray:
        """Return displacements of all rows [length] from displacements of B.

        Args:
            b: Forces at all rows [force], shape (n,).
            u_B: Displacements of B [length], shape (B,).
        """
        u = np.zeros_like(b)
        u[self._outer] = u_B
        return u + self._inside(b - self._times(u))

    def _inside(self, b: np.ndarray) -> np.ndarray:
        """Return ``K_II^-1 b_I`` [length], zero in B."""
        u, force = self._matrix.createVecs()
        u.set(0.0)
        if self._factor is not None:
            force.array[:] = b
            self._factor.solve(force, u)
        return np.where(self._inner, u.array_r, 0.0)

    def _times(self, u: np.ndarray) -> np.ndarray:
        """Return K u [force]."""
        x, y = self._matrix.createVecs()
        x.array[:] = u
        self._matrix.mult(x, y)
        return y.array_r

    def destroy(self) -> None:
        """Free PETSc's objects."""
        self._matrix.destroy()
        if self._factor is not None:
            self._factor.destroy()


class Separator:
    """Join two parts.

    Args:
        parts: What is left of them.

    Attributes:
        interface: What is left of the two parts.

    Raises:
        InputError: If what is between them cannot be factorised.
    """

    def __init__(self, *parts: Interface) -> None:
        all_numbers = np.concatenate([part.numbers for part in parts])
        all_counts = np.concatenate([part.count for part in parts])
        all_totals = np.concatenate([part.total for part in parts])
        numbers, place = np.unique(all_numbers, return_inverse=True)
        count = np.bincount(place, all_counts).astype(np.int64)
        total = np.zeros_like(count)
        total[place] = all_totals

        # I is what no rank outside touches; it comes first.
        order = np.argsort(count < total, kind="stable")
        rank = np.argsort(order)
        self._places = np.split(rank[place], [len(parts[0].numbers)])
        whole = np.zeros((len(numbers), len(numbers)))
        for part, places in zip(parts, self._places, strict=True):
            whole[np.ix_(places, places)] += part.schur
        i = int(np.count_nonzero(count == total))
        self._inner_size = i
        self._factor = dense_factor(whole[:i, :i], "cholesky")
        self._lift = dense_solve(self._factor, whole[:i, i:])
        schur = whole[i:, i:] - whole[i:, :i] @ self._lift
        outer = order[i:]
        self.interface = Interface(numbers[outer], count[outer], total[outer], schur)

    def up(self, *forces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return forces at I and condensed forces at B from the parts [force]."""
        b = np.zeros(sum(self._lift.shape))
        for force, places in zip(forces, self._places, strict=True):
            b[places] += force
        b_I = b[: self._inner_size]
        b_B = b[self._inner_size :]
        return b_I, b_B - self._lift.T @ b_I

    def down(self, b_I: np.ndarray, u_B: np.ndarray) -> list[np.ndarray]:
        """Return displacements of both parts [length].

        Args:
            b_I: Forces at I [force].
            u_B: Displacements of B [length].
        """
        u_I = dense_solve(self._factor, b_I) - self._lift @ u_B
        u = np.concatenate([u_I, u_B])
        return [u[places] for places in self._places]

    def destroy(self) -> None:
        """Free PETSc's objects."""
        self._factor.destroy()
