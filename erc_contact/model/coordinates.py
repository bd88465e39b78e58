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
from erc_contact.model.space import Space
from erc_contact.model.trace import Trace, dofs_of


@dataclass(frozen=True, eq=False)
class Map:
    """Hold the entries of T, or of its inverse, beside the identity's rows.

    Attributes:
        rows: Degrees of freedom of this rank, whose rows are not those of the identity,
            shape (n,).
        own: Factor of the degree of freedom itself in these rows [-], shape (n,).
        other: Factor of that of the partner [-], shape (n,).
    """

    rows: np.ndarray
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
        partner: Global number of the partner of each node of this rank, or
            :data:`NO_PARTNER`, shape (nodes,).
        is_here: Which nodes are those of side 1 of a pair, shape (nodes,).
        fixed: Which components of x supports prescribe, shape (nodes, d).
        prescribed: Their values, zero elsewhere [length], a Function.

    Raises:
        InputError: If a node is in two pairs.
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
        self.partner = pairs.partner
        self.is_here = pairs.is_here
        self._swapped = pairs.is_swapped
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
        d = self._space.d
        nodal = values.x.array.reshape(-1, d)
        sums = self._space.function()
        of_sums = sums.x.array.reshape(-1, d)
        nodes = np.flatnonzero(self._depends & (self.partner_here != NO_PARTNER))
        nodes = nodes[nodes < self._space.V.dofmap.index_map.size_local]
        np.add.at(of_sums, self.partner_here[nodes], nodal[nodes])
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
        d = self._space.d
        partners = self.partner_here[entries.rows // d]
        known = partners != NO_PARTNER
        columns = partners * d + entries.rows % d
        size = len(self.partner) * d
        own = np.ones(size)
        own[entries.rows] = entries.own
        dofs = np.arange(size)
        return sparse(
            size,
            size,
            np.concatenate([dofs, entries.rows[known]]),
            np.concatenate([dofs, columns[known]]),
            [own, entries.other[known]],
        )

    @cached_property
    def inverse(self) -> PETSc.Mat:
        """Return the inverse of T of all ranks."""
        rows, is_here, swapped = self._paired_dofs
        # x_1 = u_1 - u_2 always; x_2 is u_2, or u_1 where it is swapped.
        own = np.where(is_here | ~swapped, 1.0, 0.0)
        other = np.where(is_here, -1.0, np.where(swapped, 1.0, 0.0))
        return self._distributed(Map(rows, own, other))

    @cached_property
    def inverse_transposed(self) -> PETSc.Mat:
        """Return the transpose of the inverse of T, of all ranks."""
        return self.inverse.transpose(PETSc.Mat())

    @cached_property
    def entries(self) -> Map:
        """Return the entries of T at the paired nodes of this rank."""
        rows, is_here, swapped = self._paired_dofs
        own = np.where(is_here & swapped, 0.0, 1.0)
        other = np.where(is_here, 1.0, np.where(swapped, -1.0, 0.0))
        return Map(rows, own, other)

    @cached_property
    def partner_here(self) -> np.ndarray:
        """Return the partner of each node as a node of this rank, shape (nodes,).

        It is :data:`NO_PARTNER`, too, where this rank does not have the partner.
        """
        result = np.full(len(self.partner), NO_PARTNER)
        paired = self.partner != NO_PARTNER
        index_map = self._space.V.dofmap.index_map
        result[paired] = index_map.global_to_local(self.partner[paired])
        return result

    def with_partners(self, nodes: np.ndarray) -> np.ndarray:
        """Mark nodes and those whose x their u depends on.

        Args:
            nodes: Which nodes of this rank are marked, shape (nodes,).
        """
        result = nodes.copy()
        used = nodes & self._depends
        partners = self.partner_here[used]
        result[partners[partners != NO_PARTNER]] = True
        return result

    @cached_property
    def _depends(self) -> np.ndarray:
        """Tell which nodes have a u that depends on the x of their partner."""
        return self.is_here | self._swapped.any(axis=1)

    @cached_property
    def _paired_dofs(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the degrees of freedom of paired nodes, shape (n,).

        And which of them are of side 1, and swapped.
        """
        nodes = np.flatnonzero(self.partner != NO_PARTNER)
        is_here = np.repeat(self.is_here[nodes], self._space.d)
        return dofs_of(nodes, self._space.d), is_here, self._swapped[nodes].ravel()

    def _supports(
        self, fixed: np.ndarray, prescribed: fem.Function
    ) -> tuple[np.ndarray, fem.Function]:
        """Return which components of x are fixed, and their values."""
        # A jump is fixed where both sides are, and u_2 or u_1 where one of them is.
        of_jumps = fixed & ~self._swapped
        of_displacements = fixed | self._swapped
        fixed_x = np.where(self.is_here[:, None], of_jumps, of_displacements)
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
        d = space.d
        index_map = space.V.dofmap.index_map
        owned = index_map.size_local * d
        first = index_map.local_range[0] * d
        dofs = np.arange(owned)
        own = np.ones(owned)
        of_rank = entries.rows < owned
        rows = entries.rows[of_rank]
        own[rows] = entries.own[of_rank]
        partners = self.partner[rows // d] * d + rows % d
        all_rows = np.concatenate([dofs, rows]) + first
        all_columns = np.concatenate([dofs + first, partners])
        values = np.concatenate([own, entries.other[of_rank]])

        matrix = PETSc.Mat().create(comm=space.comm)
        size = (owned, index_map.size_global * d)
        matrix.setSizes((size, size), bsize=d)
        matrix.setType("aij")
        matrix.setPreallocationCOO(
            all_rows.astype(PETSc.IntType), all_columns.astype(PETSc.IntType)
        )
        matrix.setValuesCOO(values)
        return matrix
