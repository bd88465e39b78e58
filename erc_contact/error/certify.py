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

A displacement u_f that lives in other cells is interpolated, and loses something. Its
own error is measured in its own cells, up to the cost of *the transfer* e_T at contacts
(:mod:`erc_contact.error.transfer`). Where e_T is more than a tenth of it, the mesh is
refined there. The mesh has no equation for what u_f is between its nodes. So the bulk
part of this error is *the mesh*, but for the energy by which u was lifted out of what
it penetrates, which is *the contact*'s.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.cells import cell_geometry
from erc_contact.admissible.elastic import elastic_stress, macro_moduli, moduli, strains_at
from erc_contact.admissible.equilibrate import equilibrate, equilibrated
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.springs import spring_squares
from erc_contact.admissible.tighten.iteration import TIGHTEN
from erc_contact.base.exceptions import InputError, NotBalanced
from erc_contact.error.constitutive import ConstitutiveError, constitutive_error
from erc_contact.error.numbers import ROUND_OFF
from erc_contact.error.shifts import with_shifts_of
from erc_contact.error.strategy import largest, refined
from erc_contact.error.transfer import gain_in_file, transfer_squares
from erc_contact.model.contact.contact_values import distance_at_nodes
from erc_contact.model.files import interpolated
from erc_contact.model.given_forces import stressed_sides
from erc_contact.model.law.constitution import act
from erc_contact.model.model import Model
from erc_contact.model.promises import bind
from erc_contact.newton.given import AnyField, solution_of, with_nitsche_tractions
from erc_contact.scene.potential import refuse_potential
from erc_contact.scene.scene import Scene
from erc_contact.scene.tied import Preload
from namedmesh import Domain
from namedmesh.base.html import table
from namedmesh.base.percent import percent
from namedmesh.base.ranks import greatest
from namedmesh.for_solvers import FieldOnMesh, FileField, from_file
from namedmesh.simplex import rule

BY_ADAPT = (
    "ec.adapt, ec.evolve and `erc-contact solve` compute it with its error; of the result of "
    "another code the stress that belongs to its displacement is not known."
)
"""What to do with a material with a potential."""
TENTH = 0.1
"""Cost of a transfer over the error above which the mesh is refined [-]."""
AHEAD = 0.8
"""By how much less than a tenth of e it is to be, as e is less in its own cells [-]."""
FRACTION = 0.7
"""Share of e_T^2 in the cells that are refined [-]."""
MOST_CELLS = 100_000
"""Greatest number of cells of a mesh that is refined for a transfer."""
LOSSLESS = 1e-3
"""What an interpolation changes over e that is none [-]."""
DIGITS = 1e-5
"""What it changes over the scale of eps that is the digits of a file [-]."""


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
        lift: Energy norm of what supports and gaps change of u [sqrt(force length)].
        absolute: e of u in its own cells [sqrt(force length)]. It is ``error.absolute``
            unless u comes from a file with other cells than the mesh.
        transfer: The cost e_T of its transfer [sqrt(force length)]: the error of the
            result in the file, corrected as u^ is, is at most ``absolute + transfer``.
        interpolated: Whether u lives in cells that the mesh does not have.

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
    lift: float
    absolute: float
    transfer: float = 0.0
    interpolated: bool = False

    def __repr__(self) -> str:
        """Describe the certificate in a line."""
        return f"<Certificate: eps = {percent(self.relative)}, most of it {self.cause}>"

    def __str__(self) -> str:
        """Say how large the error is, and what causes it."""
        parts = {name: percent(self.share(part)) for name, part in self.causes.items()}
        shares = ", ".join(f"{name} {part}" for name, part in parts.items())
        words = [f"eps = {percent(self.relative)}: {shares}."]
        words.append(f"Most of it is {self.cause}: {ADVICE[self.cause]}.")
        if self.off_supports > 0:
            words.append(f"u differs from the supports by up to {self._off_supports}.")
        if self.penetration > 0:
            words.append(f"u penetrates by up to {self._penetration}.")
        if self.interpolated:
            words.append(
                "It is the error in the cells of the file, up to the transfer from them at "
                f"contacts and ties, which costs {percent(self.share(self.transfer))}."
            )
        return "\n".join(words)

    def _repr_html_(self) -> str:
        """Return the error and its causes as a table in a notebook."""
        rows = [("eps", percent(self.relative))]
        rows += [(name, percent(self.share(part))) for name, part in self.causes.items()]
        if self.interpolated:
            rows += [("the transfer", percent(self.share(self.transfer)))]
        rows += [("off the supports", self._off_supports)]
        rows += [("penetration", self._penetration)]
        return table(rows, caption="Certificate")

    @property
    def _off_supports(self) -> str:
        """Write the difference to the supports with its unit."""
        return f"{self.off_supports:.3g}{self.error.solution.scene.unit('length')}"

    @property
    def _penetration(self) -> str:
        """Write the penetration with its unit."""
        return f"{self.penetration:.3g}{self.error.solution.scene.unit('length')}"

    def share(self, part: float) -> float:
        """Return a part of e over the scale of eps [-]."""
        return part / (self.error.scale or 1.0)

    @property
    def relative(self) -> float:
        """Return eps of u in its own cells [-]."""
        return self.share(self.absolute) if self.error.scale > 0 else 0.0

    @property
    def total(self) -> float:
        """Return eps with the transfer and the estimate of the geometry [-]."""
        if self.error.scale <= 0:
            return 0.0
        with_transfer = self.absolute + self.transfer
        return self.share(float(np.hypot(with_transfer, self.error.geometry_error)))

    @property
    def cause(self) -> str:
        """Return the greatest cause: the mesh, the displacement or the contact."""
        causes = self.causes
        return max(causes, key=lambda name: causes[name])

    @property
    def causes(self) -> dict[str, float]:
        """Return the parts of e by the names of their causes [sqrt(force length)].

        Their squares sum to e^2.
        """
        if not self.interpolated:
            return {
                "the mesh": self.mesh,
                "the displacement": self.displacement,
                "the contact": self.contact,
            }
        bulk_2 = max(self.absolute**2 - self.contact**2, 0.0)
        lifted_2 = min(self.lift**2, bulk_2) if self.penetration > 0 else 0.0
        return {
            "the mesh": float(np.sqrt(bulk_2 - lifted_2)),
            "the contact": float(np.sqrt(self.contact**2 + lifted_2)),
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
    u: AnyField | FileField | str | Path,
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
        scene: The problem that u is to solve. Preloads by a force get the shifts that
            the file of u has; ``error.solution.scene`` tells them.
        domain: The mesh on which u lives.
        u: The displacement [length]: a DOLFINx Function on ``domain.mesh``; or a
            callable of points of shape (d, n), which returns values of shape (d, n); or
            (points, values), arrays of shape (n, d) in any order, with a point at each
            node: the vertices, for degree 2 also the middles of edges; or the file of
            the results: .frd of CalculiX, Exodus, MED, XDMF, vtk, vtu, by its content.
            Its cells may be of any shape and need not match the mesh: body by body u is
            interpolated by their own shape functions, and where that costs more than a
            tenth of e, the mesh is refined, up to 100 000 cells.
        traction: Contact tractions that the solver has computed, by the names of
            contacts [force/area], each as u is given, at the nodes of the part. They
            act on the part that the contact is named after. r^ then comes from them.
        degree: Degree of the elements, 1 or 2; None takes the degree of a Function, 2
            if there are more points than vertices, for files 1 if all cells are
            triangles or tetrahedra of first order, else 2.
        tighten: As in :func:`equilibrate`.

    Returns:
        The error with its causes.

    Raises:
        InputError: If u does not fit the mesh or the scene, or is not finite, or the
            shift of a preload is not known, or nodes are farther outside of the bodies
            of a file than half of a cell.
        NotHeldError: As in :func:`equilibrate`.
        NotBalanced: As there.

    Example:
        >>> rough = lambda x: 0.95 * np.array([0.0 * x[0], -0.05 * x[1] / 2.0])
        >>> ec.certify(scene, block, rough).cause
        'the displacement'
    """
    refuse_potential(scene.material, "certify()", BY_ADAPT)
    file = from_file(domain.comm, u) if isinstance(u, str | Path) else u
    if not isinstance(file, FileField):
        _refuse_unknown_shifts(scene)
        return _certificate(scene, domain, file, traction, degree, tighten)[0]
    scene = with_shifts_of(scene, domain, file)
    _refuse_unknown_shifts(scene)
    # The mesh of a solution is one body at ties.
    domain = domain.tied([tie.sides for tie in scene.ties])
    while True:
        field = FieldOnMesh(domain, file)
        certificate, given = _certificate(scene, domain, field, traction, degree, tighten)
        cost, whole = transfer_squares(certificate.error.model, given, field)
        error = certificate.error
        goal = max(AHEAD * TENTH * error.absolute, DIGITS * error.scale)
        finer = None
        # Tractions are given at the nodes of this mesh.
        if _norm(domain, cost) > goal and traction is None:
            finer = _with_less_transfer(error, file, goal)
        if finer is None:
            return _in_file(certificate, given, field, _norm(domain, cost), _norm(domain, whole))
        domain = finer


def _certificate(
    scene: Scene,
    domain: Domain,
    u: AnyField,
    traction: Mapping[str, AnyField] | None,
    degree: int | None,
    tighten: int,
) -> tuple[Certificate, fem.Function]:
    """Measure the error on a mesh, see :func:`certify`; collective.

    Returns:
        The certificate, and u as it is given at the nodes.
    """
    solution, given = solution_of(scene, domain, u, degree, traction)
    model = solution.model
    penetration = _greatest_penetration(model, solution.u)
    off_supports = greatest(domain.comm, solution.u.x.array - given.x.array)
    # Supports are prescribed to all digits, and files have six.
    none = ROUND_OFF * greatest(domain.comm, solution.u.x.array)
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
    certificate = Certificate(
        error=error,
        mesh=float(np.sqrt(mesh_2)),
        displacement=float(np.sqrt(min(displacement_2, error.bulk_error**2))),
        contact=error.contact_error,
        off_supports=off_supports if off_supports > none else 0.0,
        penetration=penetration if penetration > none else 0.0,
        lift=_distance(model, pair.displacement, given),
        absolute=error.absolute,
    )
    return certificate, given


def _in_file(
    certificate: Certificate, u: fem.Function, field: FieldOnMesh, cost: float, whole: float
) -> Certificate:
    """Return a certificate of a displacement in the cells of its file; collective.

    Args:
        certificate: The certificate of the interpolated displacement.
        u: This displacement, as the nodes have it.
        field: The displacement of the file.
        cost: The cost of the transfer e_T [sqrt(force length)].
        whole: Energy norm of what the interpolation changes [sqrt(force length)].
    """
    error = certificate.error
    if whole <= max(LOSSLESS * error.absolute, DIGITS * error.scale):
        # Linear cells may be split without loss, and are still no cells of the mesh.
        is_same = field.field.has_elements_of(error.degree)
        return replace(certificate, interpolated=not is_same)
    gain = gain_in_file(error.admissible, u, field)
    absolute = float(np.sqrt(max(error.absolute**2 + gain, 0.0)))
    transfer = cost if cost > ROUND_OFF * absolute else 0.0
    return replace(certificate, absolute=absolute, transfer=transfer, interpolated=True)


def _with_less_transfer(error: ConstitutiveError, file: FileField, goal: float) -> Domain | None:
    """Refine a mesh where the transfer costs most; collective.

    Args:
        error: The error on the mesh.
        file: The displacement of the file.
        goal: Cost that the transfer is to have [sqrt(force length)].

    Returns:
        The finer mesh; None if it would have too many cells.
    """
    domain = error.domain
    while True:
        model = bind(error.solution.scene, domain, error.degree)
        field = FieldOnMesh(domain, file)
        cost, _ = transfer_squares(model, interpolated(model, field), field)
        if _norm(domain, cost) <= goal:
            return domain
        marked = largest(domain.comm, np.sqrt(cost), FRACTION)
        try:
            domain = refined(domain, marked, MOST_CELLS)
        except InputError:
            return None


def _norm(domain: Domain, squares: np.ndarray) -> float:
    """Return the root of the sum of the squares of all ranks; collective."""
    return float(np.sqrt(domain.comm.allreduce(float(squares.sum()), MPI.SUM)))


def _greatest_penetration(model: Model, u: fem.Function) -> float:
    """Return by how much u enters foundations or other bodies [length]; collective."""
    penetration = 0.0
    for contact in model.contacts:
        if contact.stiffness is not None:
            continue  # a compliant foundation may be entered
        beyond = -distance_at_nodes(model.space, contact, u.x.array)
        penetration = max(penetration, float(beyond.max(initial=0.0)))
    return float(model.space.comm.allreduce(penetration, MPI.MAX))


def _refuse_unknown_shifts(scene: Scene) -> None:
    """Refuse a scene with shifts that are to be found by a solution.

    Raises:
        InputError: If it has any.
    """
    preloads = [tie for tie in scene.ties if isinstance(tie, Preload)]
    unknown = [tie.facets for tie in preloads if tie.shortening is None]
    stressed = [sides.facets for sides in stressed_sides(scene.contacts)]
    if stressed:
        raise InputError(
            f"certify: the mean strain of the periodic sides at {stressed} is not known; give"
            " mean_strain= as the other code has it, or solve the scene with ec.adapt, which finds"
            " it."
        )
    if unknown:
        raise InputError(
            f"certify: the shifts of the preloads at {unknown} are not known; give the file of the "
            "results, which tells them, or shortening= as the other code has it, or solve the "
            "scene with ec.adapt, which finds them."
        )


def _distance(model: Model, u: fem.Function, v: fem.Function) -> float:
    """Compute ``|u - v|`` of displacements [sqrt(force length)]; collective."""
    difference = model.space.function()
    difference.x.array[:] = u.x.array - v.x.array
    cells = cell_geometry(model.space)
    owned = model.domain.owned_cells
    points, weights = rule(model.space.d, 2 * model.space.degree)
    strain = strains_at(model.space, cells, difference, points, owned)
    stress = act(moduli(model, cells, points, owned), strain)
    squares = (stress * strain).sum(axis=2) @ weights * cells.volume[:owned]
    return _norm(model.domain, squares)


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
