"""Describe nodal displacements by the jumps at contacts between bodies.

A contact between two bodies has pairs of nodes, one on each side. Its law is about the
jump ``w = u_1 - u_2`` of a pair. So the solver's unknowns x are w at the node of side 1
and u_2 at that of side 2, and u everywhere else:

    u = T x,    u_1 = x_1 + x_2,    u_2 = x_2.

In these coordinates the body has the stiffness ``T^T K T`` and the forces ``T^T f``,
and a contact between bodies acts on x_1 alone, as a rigid foundation acts on u. All of
the solver is so the same for both. Without such a contact T is the identity.

A component that a support fixes on side 1 alone has the value u_1 at the place of side
2, ``u_1 = x_2``, ``u_2 = x_2 - x_1``: there the support fixes x_2, and x_1 is the jump
again. Such a component is called *swapped*.

Where more than two bodies meet at a point, one of the nodes has a displacement as
unknown and the others have their jumps against it (:mod:`erc_contact.model.joints`).
The jump of a contact is there a sum of unknowns (:mod:`erc_contact.newton.jump_sums`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from dolfinx import fem, la
from petsc4py import PETSc

from erc_contact.base.sparse import sparse
from erc_contact.model.node_pairs import NO_PARTNER, no_pairs, node_pairs
from erc_contact.model.over_ranks import matrix_of_ranks
from erc_contact.model.space import Space
from erc_contact.model.trace import Trace, dofs_of


@dataclass(frozen=True, eq=False)
class Map:
    """Hold the entries of T, or of its inverse, beside the identity's rows.

    Attributes:
        rows: Degrees of freedom of this rank, whose rows are not those of the identity,
            shape (n,).
        columns: Global numbers of the other degrees of freedom in these rows, shape
            (n,).
        own: Factor of the degree of freedom itself in these rows [-], shape (n,).
        other: Factor of the other one [-], shape (n,).
    """

    rows: np.ndarray
    columns: np.ndarray
    own: np.ndarray
    other: np.ndarray


class Coordinates:
    """Change between nodal displacements u and the unknowns x; members are collective.

    Args:
        space: The mesh.
        traces: The displacements of the contacts.
        fixed: Which components supports prescribe at each node, shape (nodes, d).
        prescribed: Prescribed displacement, zero elsewhere [length].

    Attributes:
        is_identity: Whether u and x are the same, on all ranks.
        is_paired: Which nodes of this rank are at a contact between bodies, shape
            (nodes,).
        is_joint: Which of them are at points of several pairs, shape (nodes,).
        fixed: Which components of x supports prescribe, shape (nodes, d).
        prescribed: Their values, zero elsewhere [length], a Function.
    """

    def __init__(
        self,
        space: Space,
        traces: Sequence[Trace],
        fixed: np.ndarray,
        prescribed: fem.Function,
    ) -> None:
        self._space = space
        self.is_identity = all(trace.there is None for trace in traces)
        self.fixed = fixed
        self.prescribed = prescribed
        pairs = no_pairs(space) if self.is_identity else node_pairs(space, traces, fixed)
        self.is_paired = pairs.partner[:, 0] != NO_PARTNER
        self.is_joint = pairs.is_joint
        self._pairs = pairs
        if self.is_identity:
            return
        self.fixed, self.prescribed = self._supports(fixed, prescribed)

    def to_x(self, u: fem.Function) -> fem.Function:
        """Return x of a displacement u [length]; u itself where both are the same."""
        return u if self.is_identity else self._mapped(self.inverse, u)

    def to_u(self, x: fem.Function) -> fem.Function:
        """Return u of unknowns x [length]; x itself where both are the same."""
        return x if self.is_identity else self._mapped(self.matrix, x)

    def forces(self, f: PETSc.Vec) -> None:
        """Replace nodal forces by those on x, ``T^T f`` [force], in place."""
        if not self.is_identity:
            result = f.duplicate()
            self.matrix.multTranspose(f, result)
            result.copy(f)
            result.destroy()

    def forces_on_bodies(self, f: fem.Function) -> fem.Function:
        """Return nodal forces of forces on x [force], ``T^-T f``, from their owners."""
        if self.is_identity:
            return f
        return self._mapped(self.inverse_transposed, f)

    def add_to_partners(self, values: fem.Function) -> None:
        """Add values at nodes to those nodes whose x their u depends on, in place."""
        sums = self._space.function()
        entries = self.entries
        used = (entries.other != 0) & (self.columns_here >= 0)
        # Each node counts on the rank that owns it.
        used &= entries.rows < self._space.V.dofmap.index_map.size_local * self._space.d
        np.add.at(sums.x.array, self.columns_here[used], values.x.array[entries.rows[used]])
        sums.x.scatter_reverse(la.InsertMode.add)
        sums.x.scatter_forward()
        values.x.array[:] += sums.x.array

    @cached_property
    def matrix(self) -> PETSc.Mat:
        """Return T of all ranks."""
        return self._distributed(self.entries)

    @cached_property
    def other_unknowns(self) -> PETSc.Mat:
        """Return ``(T - I)^T``, from forces on u to those on the other unknowns."""
        difference = self.matrix.copy()
        difference.shift(-1.0)
        return difference.transpose()

    def of_bodies(self, matrix: PETSc.Mat, fixed: np.ndarray, diagonal: float) -> PETSc.Mat:
        """Return a matrix for x as one for u, ``T^-T A T^-1``.

        Args:
            matrix: A.
            fixed: Which degrees of freedom of this rank supports fix, shape (owned,).
                Their rows and columns become zero.
            diagonal: Entry on their diagonal.
        """
        result = matrix.ptap(self.inverse)
        result.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        first, _ = result.getOwnershipRange()
        rows = first + np.flatnonzero(fixed)
        result.zeroRowsColumns(rows.astype(PETSc.IntType), diag=diagonal)
        return result

    @cached_property
    def matrix_here(self) -> PETSc.Mat:
        """Return T between the degrees of freedom of this rank.

        It is right for the nodes of cells that this rank owns.
        """
        entries = self.entries
        size = self._space.node_count * self._space.d
        visible = self.columns_here >= 0
        own = np.ones(size)
        own[entries.rows] = entries.own
        dofs = np.arange(size)
        return sparse(
            size,
            size,
            np.concatenate([dofs, entries.rows[visible]]),
            np.concatenate([dofs, self.columns_here[visible]]),
            [own, entries.other[visible]],
        )

    @cached_property
    def inverse(self) -> PETSc.Mat:
        """Return the inverse of T of all ranks."""
        rows, has_jump, swapped = self._paired_dofs
        # x_1 = u_1 - u_2 always; x_2 is u_2, or u_1 where it is swapped.
        own = np.where(has_jump | ~swapped, 1.0, 0.0)
        other = np.where(has_jump, -1.0, np.where(swapped, 1.0, 0.0))
        return self._distributed(Map(rows, self._dofs(self._pairs.reference), own, other))

    @cached_property
    def inverse_transposed(self) -> PETSc.Mat:
        """Return the transpose of the inverse of T, of all ranks."""
        return self.inverse.transpose(PETSc.Mat())

    @cached_property
    def entries(self) -> Map:
        """Return the entries of T at the paired nodes of this rank."""
        rows, has_jump, swapped = self._paired_dofs
        own = np.where(has_jump & swapped, 0.0, 1.0)
        other = np.where(has_jump, 1.0, np.where(swapped, -1.0, 0.0))
        return Map(rows, self._dofs(self._pairs.partner), own, other)

    @cached_property
    def columns_here(self) -> np.ndarray:
        """Return the columns of :attr:`entries` as degrees of freedom of this rank.

        It is negative where this rank does not have the node. Shape (n,).
        """
        d = self._space.d
        columns = self.entries.columns
        nodes = self._space.V.dofmap.index_map.global_to_local(columns // d).astype(np.int64)
        return np.where(nodes >= 0, nodes * d + columns % d, NO_PARTNER)

    @cached_property
    def partner_here(self) -> np.ndarray:
        """Return the partner of each node of a pair as a node of this rank.

        It is negative where this rank does not have it, or there is none. Shape
        (nodes,).
        """
        result = np.full(len(self._pairs.partner), NO_PARTNER)
        numbers = self._pairs.partner[self.is_paired, 0]
        result[self.is_paired] = self._space.V.dofmap.index_map.global_to_local(numbers)
        return result

    def with_partners(self, nodes: np.ndarray) -> np.ndarray:
        """Mark nodes and those whose x their u depends on.

        Args:
            nodes: Which nodes of this rank are marked, shape (nodes,).
        """
        result = nodes.copy()
        entries = self.entries
        of_marked = nodes[entries.rows // self._space.d] & (entries.other != 0)
        columns = self.columns_here[of_marked]
        result[columns[columns >= 0] // self._space.d] = True
        return result

    @cached_property
    def _paired_dofs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the degrees of freedom of paired nodes, shape (n,).

        And which of them have a jump as unknown, and are swapped.
        """
        nodes = np.flatnonzero(self.is_paired)
        has_jump = np.repeat(self._pairs.has_jump[nodes], self._space.d)
        return dofs_of(nodes, self._space.d), has_jump, self._pairs.is_swapped[nodes].ravel()

    def _dofs(self, nodes: np.ndarray) -> np.ndarray:
        """Return global degrees of freedom, the paired ones of nodes (nodes, d)."""
        d = self._space.d
        return (nodes[self.is_paired] * d + np.arange(d)).ravel()

    def _supports(
        self, fixed: np.ndarray, prescribed: fem.Function
    ) -> tuple[np.ndarray, fem.Function]:
        """Return which components of x are fixed, and their values."""
        # A jump is fixed where both sides are, and u_2 or u_1 where one of them is.
        of_jumps = fixed & ~self._pairs.is_swapped
        of_displacements = fixed | self._pairs.is_swapped
        fixed_x = np.where(self._pairs.has_jump[:, None], of_jumps, of_displacements)
        values = self.to_x(prescribed)
        values.x.array[~fixed_x.ravel()] = 0.0
        return fixed_x, values

    def _mapped(self, matrix: PETSc.Mat, u: fem.Function) -> fem.Function:
        """Return the product of a matrix of all ranks and a Function, as a Function."""
        x, y = matrix.createVecs()
        owned = len(x.array_r)
        x.array[:] = u.x.array[:owned]
        matrix.mult(x, y)
        result = self._space.function()
        result.x.array[:owned] = y.array_r
        result.x.scatter_forward()
        x.destroy()
        y.destroy()
        return result

    def _distributed(self, entries: Map) -> PETSc.Mat:
        """Make a matrix of all ranks: the identity but for some rows."""
        space = self._space
        first, last = (number * space.d for number in space.V.dofmap.index_map.local_range)
        dofs = np.arange(first, last)
        own = np.ones(last - first)
        of_rank = entries.rows < last - first
        rows = entries.rows[of_rank]
        own[rows] = entries.own[of_rank]
        all_rows = [dofs, rows + first]
        all_columns = [dofs, entries.columns[of_rank]]
        values = [own, entries.other[of_rank]]
        if self._pairs.joints is not None:
            # With these zeros T^T K T has places for what contacts add at joints.
            coupled_rows, coupled_columns = self._pairs.joints.couplings(first, last, space.d)
            all_rows.append(coupled_rows)
            all_columns.append(coupled_columns)
            values.append(np.zeros(len(coupled_rows)))
        return matrix_of_ranks(
            space, np.concatenate(all_rows), np.concatenate(all_columns), np.concatenate(values)
        )
