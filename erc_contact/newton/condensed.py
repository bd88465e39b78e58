"""The contact problem condensed on the contact: residual and tangent, small and dense.

The unknowns are the displacements u_A whose equilibrium contains contact terms: those
that change what the contacts read, in an orthonormal basis
(:mod:`erc_contact.newton.linear.stiffness`). The contact equations depend on the
displacements u of the cells at the contact, on the jumps between bodies, and on the
multipliers lambda. All are affine functions of u_A:

    z = (u, jumps, lambda) = Z (u_A, 1),    B^T (area lambda) = K u_A - b_A,

with B what contacts read of u_A, K the elastic stiffness condensed on A and b_A the
condensed loads. The problem is ``K u_A - b_A + B^T e(z) = 0``, where e are the
equations of the method; for a method with a multiplier it is ``B^T e(z) = 0``. Its
tangent is ``K + B^T e'(z) Z``, or ``B^T e'(z) Z``. Newton's method for this problem has
the same iterates as Newton's method for the whole body, because the equations away from
the contact are linear and hold at every step.

The affine functions are in :mod:`erc_contact.newton.field_map`.

The dense matrices are on rank 0. It asks the other ranks to assemble the terms of their
facets (:mod:`erc_contact.newton.assembly`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from dolfinx import fem

from erc_contact.base.exceptions import raise_together, together
from erc_contact.base.sparse import Places
from erc_contact.model.contact.contact_values import gap_at_nodes
from erc_contact.model.model import Model
from erc_contact.newton.assembly import Assembly
from erc_contact.newton.contact_nodes import contact_normals
from erc_contact.newton.field_map import FieldMap
from erc_contact.newton.forms import ContactForms, Counts
from erc_contact.newton.linear.stiffness import Stiffness
from erc_contact.newton.shared_laws import laws_of
from namedmesh.base.ranks import from_first

SMALL_FORCE = 1e-6
"""Contact forces that count as none, over the forces with the contact glued [-]."""


class Condensed:
    """Represent the condensed contact problem of a model.

    Methods that take u_A, as :meth:`residual`, are called on rank 0 within :meth:`run`.

    Args:
        model: The scene on a mesh.
        forms: The equations of a method.
        stiffness: The condensed elastic stiffness.
        u_0: Its glued displacement under the loads [length].
        path: The central path of interior point steps; None without.

    Attributes:
        forms: The equations of the method, with the share of friction that
            :meth:`set_shares` sets.
        u: Displacement, up to date in the cells at the contact only [length]; for a
            method with multiplier its nodal values at the contact are the Bernstein
            coefficients.
        multipliers: Multiplier of each contact [force/area], or () for a method
            without.
        size: Number of unknowns u_A.
        schur: S_A, the glued stiffness condensed on A, on rank 0 [force/length], shape
            (A, A).
        matrix: K on rank 0 [force/length], shape (A, A).
        loads: b_A on rank 0 [force].
        normals: Normals of the foundation at the contact nodes of A, on rank 0 [-].
        length: Largest component of the glued displacement, of the slip before the step
            and of interferences, over all ranks [length].
        force: Size of the forces that cancel in the residual with these displacements,
            on rank 0 [force].
    """

    def __init__(
        self,
        model: Model,
        forms: ContactForms,
        stiffness: Stiffness,
        u_0: fem.Function,
        path: Any = None,
    ) -> None:
        self.model = model
        self.stiffness = stiffness
        self.forms = forms
        self.u = self.forms.u
        self.multipliers = self.forms.multipliers
        self.size = (
            len(stiffness.layer.numbers) if forms.method.in_layer else stiffness.contact_size
        )
        self.forms.set_displacement(u_0)
        self._last_u_A: np.ndarray | None = None
        self.matrix = self.schur = np.zeros((0, 0))
        self.loads = np.zeros(0)
        self._unheld: tuple[np.ndarray, np.ndarray] | None = None
        """K and b_A where springs hold the body, else None."""

        # Gathering is collective; the dense algebra is done on rank 0 alone.
        self.u_0 = stiffness.gather(u_0)
        jumps = _given_jumps(model)
        largest_u = float(abs(u_0.x.array).max(initial=0.0))
        largest_jump = float(abs(jumps.x.array).max(initial=0.0))
        self.length = max(model.space.comm.allgather(max(largest_u, largest_jump))) or 1.0
        jumps_A = stiffness.gather(jumps)[: self.size]
        glue_forces = stiffness.gather(stiffness.glue.times(u_0))[: self.size]
        together(model.space.comm, self._condense, jumps_A, glue_forces)
        self.normals = stiffness.gather(contact_normals(model))[: self.size]

        glued_A = self.u_0[: self.size]
        fields = FieldMap(self.forms, stiffness, self.size, glued_A, self.matrix, self.loads)
        self._fields = fields
        self.assembly = Assembly(self.forms, fields.readings, fields.columns, self.size, path)
        if self.assembly.positions is not None:
            self._by_fields = Places(*self.assembly.positions, (self.size, fields.size))

    def run(self, work: Callable[[], Any]) -> Any:
        """Do work on rank 0 with the help of the other ranks; return its result.

        The other ranks wait for the name of a method of :class:`.assembly.Assembly` and
        its arguments, and call it, until rank 0 sends None.
        """
        comm = self.model.space.comm
        result = None
        error = None
        if comm.rank == 0:
            try:
                result = work()
            except Exception as failure:
                error = failure
            from_first(comm, None)
        else:
            request = from_first(comm, None)
            while request is not None:
                name, *arguments = request
                getattr(self.assembly, name)(*arguments)
                request = from_first(comm, None)
        raise_together(comm, error)
        return from_first(comm, result)

    def residual(self, u_A: np.ndarray) -> np.ndarray:
        """Return the residual R(u_A) [force], on rank 0."""
        self.move(u_A)
        equations = self._on_all_ranks("residual")
        if not self.multipliers:
            equations += self.matrix @ u_A - self.loads
        return equations

    def tangent(self, u_A: np.ndarray) -> np.ndarray:
        """Return dR/du_A at u_A [force/length], shape (A, A), on rank 0."""
        self.move(u_A)
        entries = self._on_all_ranks("tangent")
        dense = np.asarray(self._by_fields.of(entries) @ self._fields.derivative)
        if not self.multipliers:
            dense += self.matrix
        return dense

    def status(self, u_A: np.ndarray) -> np.ndarray:
        """Return the status open (0), slip (1) or stick (2) for u_A, on rank 0.

        There is one at each point of all contact facets.
        """
        self.move(u_A)
        return self._on_all_ranks("status")

    def counts(self, u_A: np.ndarray) -> tuple[Counts, ...]:
        """Count the points of each contact by their status for u_A, on rank 0."""
        self.move(u_A)
        return self._on_all_ranks("counts")

    def set_shares(self, friction: float, gap: float) -> None:
        """Set the shares of friction and gaps on all ranks [-]."""
        self._on_all_ranks("set_shares", friction, gap)

    def along_path(self, name: str) -> Any:
        """Call a method of the central path on all ranks, from rank 0."""
        return self._on_all_ranks("along_path", name)

    def hold(self, weight: float, u_A: np.ndarray) -> None:
        """Hold the motions that no support holds where they are at u_A, on rank 0.

        K and b_A include the springs until the next call.

        Args:
            weight: Weight of the springs [-]; 0 for none.
            u_A: The displacement whose motions the springs keep [length].
        """
        if weight == 0.0 and self._unheld is None:
            return
        if self._unheld is None:
            self._unheld = self.matrix, self.loads
        self.matrix, self.loads = self._unheld
        if weight > 0.0:
            springs = weight * self.stiffness.springs(self.size)
            self.matrix = self.matrix + springs
            self.loads = self.loads + springs @ u_A
        else:
            self._unheld = None
        if self.multipliers:
            # Multipliers are reactions, of the springs, too.
            self._fields.set_reactions(self.matrix, self.loads)
            self._last_u_A = None

    def imbalance(self, u_A: np.ndarray) -> float:
        """Return the resultant of K u_A on free motions over the contact forces [-].

        It is round-off, on rank 0. Contacts that nothing presses have forces of
        round-off, too, so they count as :data:`SMALL_FORCE` at least.
        """
        if not self.stiffness.motions:
            return 0.0
        matrix, loads = self._unheld or (self.matrix, self.loads)
        elastic = matrix @ u_A
        resultants = self.stiffness.kernel(self.size).T @ elastic
        contact_forces = float(np.linalg.norm(elastic - loads))
        return float(np.linalg.norm(resultants)) / max(contact_forces, SMALL_FORCE * self.force)

    def from_contact(self, u_contact: np.ndarray) -> np.ndarray:
        """Return u_A [length] from the displacement of the contact nodes, on rank 0.

        The other nodes of A are in elastic equilibrium.
        """
        count = len(u_contact)
        _, lift = self.stiffness.reduce(count)
        return self.u_0[: self.size] + lift[: self.size] @ (u_contact - self.u_0[:count])

    def multipliers_at(self, u_A: np.ndarray) -> tuple[fem.Function, ...]:
        """Return the nodal multipliers for u_A [force/area]; collective."""
        comm = self.model.space.comm
        z = None
        if comm.rank == 0 and self.multipliers:
            z = self._fields_at(u_A)
        z = from_first(comm, z)
        if self._fields.multipliers is None:
            return ()
        self.assembly.set_fields(z)
        self._last_u_A = None
        return self.forms.nodal_multipliers(laws_of(self.forms, self._fields.multipliers))

    def _fields_at(self, u_A: np.ndarray) -> np.ndarray:
        """Return z for u_A, on rank 0."""
        return self._fields.derivative @ u_A + self._fields.constant

    def move(self, u_A: np.ndarray) -> None:
        """Set the fields of all ranks to u_A, on rank 0; nothing if they are there."""
        if self._last_u_A is None or not np.array_equal(self._last_u_A, u_A):
            self._on_all_ranks("set_fields", self._fields_at(u_A))
            self._last_u_A = u_A.copy()

    def _on_all_ranks(self, name: str, *arguments: Any) -> Any:
        """Call a method of the assembly on all ranks, from rank 0."""
        from_first(self.model.space.comm, (name, *arguments))
        return getattr(self.assembly, name)(*arguments)

    # -- set up

    def _condense(self, jumps_A: np.ndarray, glue_forces: np.ndarray) -> None:
        """Make the dense matrices on rank 0."""
        if self.stiffness.schur is None:
            return
        a = self.size
        glued_A = self.u_0[:a]
        self.schur, _ = self.stiffness.reduce(a)
        self.matrix = self.stiffness.unglue(a)
        self.loads = self.matrix @ glued_A + glue_forces
        forces = abs(self.matrix) @ np.maximum(abs(glued_A), abs(jumps_A))
        self.force = float(forces.max()) or 1.0


def _given_jumps(model: Model) -> fem.Function:
    """Return what the contacts do to bodies at rest [length].

    It is their slip at the end of the last step, and their interference: a gap below
    zero, and any gap of a bilateral contact. Bodies that supports move together have no
    other deformation.
    """
    given = model.space.function()
    for contact in model.contacts:
        trace = contact.trace
        if trace.before is None and contact.gap is None:
            continue
        gap = gap_at_nodes(model.space, contact)
        interference = gap if contact.bilateral else np.minimum(gap, 0.0)
        jump = interference[..., None] * trace.normals + trace.slip_before
        trace.assign(given.x.array, jump)
    return given
