"""Measure the error of a displacement from anywhere, and say what causes it.

The pair of a displacement u bounds its error, whoever has computed it. The error has
three causes. Let u_r be the finite element solution for the contact traction r^ of the
pair. Both sigma^ and ``C eps(u_r)`` balance r^ and the loads on all fields of the
elements, so the bulk part is a sum of squares,

    |sigma^ - C eps(u^)|^2 = |sigma^ - C eps(u_r)|^2 + |u_r - u^|^2.

The first is what these elements cost with this traction, *the mesh*. The second is how
far u^ is from equilibrium with it, *the displacement*: the solver has not converged,
its data are others, or its numbers are rounded. The third is the contact part of e^2,
*the contact*: u penetrates or opens under pressure, or friction does not oppose slip.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.elastic import elastic_stress, macro_moduli
from erc_contact.admissible.equilibrate import equilibrate, equilibrated
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.springs import spring_squares
from erc_contact.admissible.tighten.iteration import TIGHTEN
from erc_contact.base.exceptions import InputError, NotBalanced
from erc_contact.error.constitutive import ConstitutiveError, constitutive_error
from erc_contact.error.numbers import ROUND_OFF
from erc_contact.model.contact.contact_values import gap_at_nodes
from erc_contact.model.contact.trace import split
from erc_contact.model.law.constitution import act
from erc_contact.newton.given import AnyField, solution_of, with_nitsche_tractions
from erc_contact.scene.potential import refuse_potential
from erc_contact.scene.scene import Scene
from erc_contact.scene.tied import Preload
from namedmesh import Domain
from namedmesh.base.html import table
from namedmesh.base.percent import percent
from namedmesh.files.displacements import FileField, from_file


@dataclass(frozen=True, eq=False)
class Certificate:
    """Hold the error of a displacement from anywhere, with its causes.

    Attributes:
        error: The error of its admissible pair, with all results.
        mesh: What the elements cost with the traction of the pair [sqrt(force length)].
        displacement: Distance of u^ to equilibrium with it [sqrt(force length)].
        contact: The contact part of e [sqrt(force length)]. The squares of these three
            sum to e^2.
        off_supports: Greatest difference of u to the supports [length], which u^ keeps.
        penetration: Greatest penetration of u into a foundation or the other body
            [length], which u^ does not have.
        interpolated: Whether the cells of a file were split, so that u is interpolated
            in them. What that loses is a part of the displacement's.

    Example:
        >>> certificate = ec.certify(scene, block, solution.u)
        >>> print(certificate)
        eps = 11.96%: the mesh 11.66%, the displacement 1.351%, the contact 2.327%.
        Most of it is the mesh: refine it, or take degree 2.
        u penetrates by up to 9.15e-05.
    """

    error: ConstitutiveError
    mesh: float
    displacement: float
    contact: float
    off_supports: float
    penetration: float
    interpolated: bool = False

    def __repr__(self) -> str:
        """Describe the certificate in a line."""
        return f"<Certificate: eps = {percent(self.error.relative)}, most of it {self.cause}>"

    def __str__(self) -> str:
        """Say how large the error is, and what causes it."""
        scale = self.error.scale or 1.0
        parts = {name: percent(part / scale) for name, part in self._parts.items()}
        shares = ", ".join(f"{name} {part}" for name, part in parts.items())
        words = [f"eps = {percent(self.error.relative)}: {shares}."]
        words.append(f"Most of it is {self.cause}: {ADVICE[self.cause]}.")
        if self.off_supports > 0:
            words.append(f"u differs from the supports by up to {self.off_supports:.3g}.")
        if self.penetration > 0:
            words.append(f"u penetrates by up to {self.penetration:.3g}.")
        if self.interpolated:
            words.append(
                "The cells of the file were split, and u is interpolated in them; what that loses "
                "counts as the displacement's."
            )
        return "\n".join(words)

    def _repr_html_(self) -> str:
        """Return the error and its causes as a table in a notebook."""
        scale = self.error.scale or 1.0
        rows = [("eps", percent(self.error.relative))]
        rows += [(name, percent(part / scale)) for name, part in self._parts.items()]
        rows += [("off the supports", f"{self.off_supports:.3g}")]
        rows += [("penetration", f"{self.penetration:.3g}")]
        return table(rows, caption="Certificate")

    @property
    def cause(self) -> str:
        """Return the greatest cause: the mesh, the displacement or the contact."""
        parts = self._parts
        return max(parts, key=lambda name: parts[name])

    @property
    def _parts(self) -> dict[str, float]:
        """Return the parts of e by the names of their causes."""
        return {
            "the mesh": self.mesh,
            "the displacement": self.displacement,
            "the contact": self.contact,
        }


ADVICE = {
    "the mesh": "refine it, or take degree 2",
    "the displacement": "where it keeps supports and gaps, it is not in equilibrium with its "
    "contact forces; look at the stiffness of its contact, the tolerance of its solver, its "
    "digits, and whether it has the same data",
    "the contact": "it penetrates, opens under pressure, or its friction does not oppose the slip; "
    "look at the contact method and its stiffness",
}
"""What to do about each cause."""


def certify(
    scene: Scene,
    domain: Domain,
    u: AnyField | str | Path,
    *,
    traction: Mapping[str, AnyField] | None = None,
    degree: int | None = None,
    tighten: int = TIGHTEN,
) -> Certificate:
    """Measure the error of a displacement that any solver has computed; collective.

    Its admissible pair is made as for a solution of the package: u^ is u where u keeps
    supports and gaps, r^ comes from its reactions or, if e is smaller with them, from
    the tractions of Nitsche's method, and sigma^ balances r^ and the loads. The error
    bounds the distance of u^ and of sigma^ to the exact solution, as it always does,
    whatever the quality of u.

    Args:
        scene: The problem that u is to solve.
        domain: The mesh on which u lives.
        u: The displacement [length]: a DOLFINx Function on ``domain.mesh``; or a
            callable of points of shape (d, n), which returns values of shape (d, n); or
            (points, values), arrays of shape (n, d) in any order, with a point at each
            node: the vertices, for degree 2 also the middles of edges; or the file of
            the results: .frd of CalculiX, Exodus, MED, XDMF, vtu. The domain is then
            read from the same file or has the same nodes. Quadrilaterals, hexahedra,
            prisms and pyramids are split, and u is interpolated.
        traction: Contact tractions that the solver has computed, by the names of
            contacts [force/area], each as u is given, at the nodes of the part. They
            act on the part that the contact is named after. r^ then comes from them.
        degree: Degree of the elements, 1 or 2; None takes the degree of a Function, 2
            if there are more points than vertices, for files 2 if their cells are of
            second order or are split, else 1.
        tighten: As in :func:`equilibrate`.

    Returns:
        The error with its causes.

    Raises:
        InputError: If u does not fit the mesh or the scene, or is not finite, or the
            shift of a preload is not known.
        NotHeldError: As in :func:`equilibrate`.
        NotBalanced: As there.

    Example:
        >>> rough = lambda x: 0.95 * np.array([0.0 * x[0], -0.05 * x[1] / 2.0])
        >>> ec.certify(scene, block, rough).cause
        'the displacement'
    """
    refuse_potential(scene.material, "certify()", "solve() and adapt() have an error for it.")
    _refuse_unknown_shifts(scene)
    field = from_file(domain.comm, u) if isinstance(u, str | Path) else u
    solution, off_supports = solution_of(scene, domain, field, degree, traction)
    penetration = 0.0
    model = solution.model
    for contact in model.contacts:
        if contact.stiffness is not None:
            continue  # a compliant foundation may be entered
        w_n = split(contact.trace.of(solution.u.x.array), contact.trace.normals).normal
        beyond = w_n - gap_at_nodes(model.space, contact)
        penetration = max(penetration, float(beyond.max(initial=0.0)))
    moved = float(abs(solution.u.x.array).max(initial=0.0))
    penetration, size = np.max(model.space.comm.allgather([penetration, moved]), axis=0)
    pair = equilibrated(solution, tighten, None, is_own=traction is None)
    error = constitutive_error(pair)
    # On curved contacts that are partly closed, reactions of coarse meshes give an e
    # that is up to 1.5 times as large. Each is a bound.
    with_tractions = with_nitsche_tractions(solution) if traction is None else None
    if with_tractions is not None:
        with suppress(NotBalanced):
            of_nitsche = constitutive_error(equilibrate(with_tractions, tighten))
            if of_nitsche.absolute < error.absolute:
                error = of_nitsche
    pair = error.admissible
    displacement_2 = _distance_to_equilibrium(pair)
    mesh_2 = max(error.bulk_error**2 - displacement_2, 0.0)
    return Certificate(
        error=error,
        mesh=float(np.sqrt(mesh_2)),
        displacement=float(np.sqrt(min(displacement_2, error.bulk_error**2))),
        contact=error.contact_error,
        off_supports=off_supports if off_supports > ROUND_OFF * size else 0.0,
        penetration=float(penetration) if penetration > ROUND_OFF * size else 0.0,
        interpolated=isinstance(field, FileField) and field.interpolated,
    )


def _refuse_unknown_shifts(scene: Scene) -> None:
    """Refuse a scene with preloads whose shift is to be found by a solution.

    Raises:
        InputError: If it has any.
    """
    preloads = [tie for tie in scene.ties if isinstance(tie, Preload)]
    unknown = [tie.facets for tie in preloads if tie.shortening is None]
    if unknown:
        raise InputError(
            f"certify: the shifts of the preloads at {unknown} are not known; give shortening= as "
            "the other code has it, or solve the scene with ec.adapt, which finds them."
        )


def _distance_to_equilibrium(pair: Admissible) -> float:
    """Compute ``|u_r - u^|^2`` [force length]; collective.

    The stress of u_r is the rebalanced one of the pair.
    """
    model = pair.model
    cells = pair.cell_geometry
    owned = model.domain.owned_cells
    _, _, weights = macro_points(model.space.d, model.space.degree)
    elastic = elastic_stress(model, cells, pair.displacement, owned)
    difference = pair.balanced.at_macro_points(model, cells) - elastic
    compliance = macro_moduli(model, cells, owned, inverse=True)
    squares = (act(compliance, difference) * difference).sum(axis=2) @ weights
    local = float(squares @ cells.volume[:owned])
    # Springs pull at u_r, so that all of the error in their law is this distance.
    of_springs, _ = spring_squares(model, pair.displacement, pair.spring_tractions)
    local += float(of_springs.sum())
    return float(model.space.comm.allreduce(local, MPI.SUM))
