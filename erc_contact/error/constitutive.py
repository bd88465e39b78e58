"""The error in the constitutive relation of an admissible pair.

It is global, in parts, and per element:

    e^2 = |sigma^ - C eps(u^)|^2
          + 2 int_GammaC ( b(p^) |w_t - s| + r^_t.(w_t - s) + r^_n (w_n - g) )     (16)
    eps = e / |sigma^ + C eps(u^)|                                                 (17)

in energy norms ``|sigma|^2 = int C^-1 sigma : sigma``, with ``p^ = -r^_n`` and b the
friction bound of the law: mu p for Coulomb, given for Tresca. In a step of a history, s
is the tangential displacement at the end of the last step, and e bounds the error of
this step given its history; without history s is zero. Both terms are never negative,
and e = 0 only for the solution. For frictionless contact and Tresca friction e
bounds the errors of u^ and of sigma^ with constant 1:

    |u - u^|^2 + |sigma - sigma^|^2
        + 2 int_GammaC (b(p) - b(p^))(|w_t - s| - |w^_t - s|)  <=  e^2.

If the bound depends on the pressure, as Coulomb's does, the third term is a product of
two errors and has no sign. Then e is a bound up to this term, not a guarantee. On a
bilateral contact ``w_n = g``, as on a support. Compliant foundations have another last
product (:mod:`.foundations`). With given strains eps_0 the strain in (16) and (17) is
``eps(u^) - eps_0``.

Where moduli, gap or friction bound vary inside cells, the integrals are adapted to
them, and e contains what they leave unknown. The part of the data that the mesh cannot
represent is the oscillation. It is reported in addition to e.

Source: Coorevits, Hild, Hjiaj, equations (16)-(18); the gap g and s are ours.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from mpi4py import MPI

from erc_contact.admissible.fields import FIELD_DEGREE, integral
from erc_contact.admissible.pair import Admissible
from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl
from erc_contact.base.views import view_of
from erc_contact.error.bulk import body_error, spring_error
from erc_contact.error.contact import contact_law_error
from erc_contact.error.fenchel import fenchel_error
from erc_contact.error.geometry import geometry_squares
from erc_contact.error.numbers import ROUND_OFF
from erc_contact.error.oscillation import (
    UNKNOWN_SHARE,
    Oscillations,
    of_history,
    of_loads,
    of_supports,
)
from erc_contact.error.strain_round_off import round_off, strain_round_off
from erc_contact.error.tiny_edges import tell_tiny_edges
from erc_contact.model.contact.friction import depends_on_pressure
from erc_contact.model.contact_area import ContactArea
from erc_contact.model.contact_force import ContactForce
from erc_contact.model.data.values import DATA_DEGREE
from erc_contact.model.forces import Force
from erc_contact.model.greatest import find_maximum
from erc_contact.model.maximum import Maximum
from erc_contact.model.model import Model
from erc_contact.model.von_mises import von_mises
from erc_contact.newton.solution import Solution
from erc_contact.results.forces import force, reactions
from erc_contact.results.points import Values, along, at
from erc_contact.results.profile import contact_area, contact_force, profile
from erc_contact.results.stresses import mean_stress
from erc_contact.results.true_gaps import gap_deviation
from erc_contact.scene.potential import refuse_potential
from namedmesh import Domain
from namedmesh.base.html import table
from namedmesh.base.percent import percent
from namedmesh.simplex import barycentric, lattice

NOISE = 100.0
"""Multiple of the accuracy of energy norms below which they count as zero.

It is used where given strains are all that acts: what is left of a free expansion.
"""


@dataclass(frozen=True, eq=False)
class ConstitutiveError:
    """Hold the error of an admissible pair.

    Attributes:
        admissible: The pair.
        absolute: e (16) [sqrt(force length)].
        scale: ``|sigma^ + C eps(u^)|`` [sqrt(force length)].
        bulk_error: Bulk part of e.
        contact_error: Contact part of e; ``bulk_error^2 + contact_error^2 = e^2``.
        geometry_error: Estimate of the error by the flat facets of a curved body
            [sqrt(force length)], not part of e. Half of its square is about the change
            of the potential energy by the facets, mostly 1 to 3 times, see
            ``erc_contact.error.geometry``. It is zero if all facets are exact, and
            if only a mesh is known: the body is then the mesh.
        round_off: Bound of the round-off of ``C eps(u^)`` [sqrt(force length)], which e
            contains. It matters where u^ is 1e12 times its differences.
        oscillations: Parts of the data that the mesh cannot represent, estimates
            without constants of Korn and Poincare type, not part of e.
        indicators: The local error indicators eps_E (18) of the owned cells [-]; the
            squares sum to eps^2 over all ranks.
        total_indicators: The same with the share of the geometry, which refinement
            uses; the squares sum to total^2.
        seconds: Wall time, the largest over the ranks [s].

    Example:
        >>> error
        <ConstitutiveError: eps = 12.34%, e = 0.1241, 16 cells of degree 1>
        >>> norm = np.linalg.norm(error.indicators)  # on one rank
        >>> bool(np.isclose(norm, error.relative))
        True
    """

    admissible: Admissible
    absolute: float
    scale: float
    bulk_error: float
    contact_error: float
    geometry_error: float
    round_off: float
    oscillations: Oscillations
    indicators: np.ndarray
    total_indicators: np.ndarray
    seconds: float

    def __repr__(self) -> str:
        """Describe the error in a line; nothing is collective."""
        geometry = f", {percent(self.total)} with the geometry" if self.geometry_error > 0 else ""
        size = f"{self.domain.cells} cells of degree {self.degree}"
        if self.scale == 0:
            return f"<ConstitutiveError: no stress but round-off, eps = 0, e = 0, {size}>"
        eps = percent(self.relative)
        return f"<ConstitutiveError: eps = {eps}{geometry}, e = {self._in_words}, {size}>"

    def _repr_html_(self) -> str:
        """Show the error in a notebook; nothing is collective."""
        scale = self.scale or 1.0
        parts = {
            "eps": self.absolute,
            "bulk part": self.bulk_error,
            "contact part": self.contact_error,
            "geometry, an estimate beside eps": self.geometry_error,
            "data the mesh does not represent, an estimate beside eps": self.oscillation,
        }
        rows: list[tuple[str, object]] = []
        for name, part in parts.items():
            rows.append((name, percent(part / scale)))
        rows.append(("e", self._in_words))
        rows += [("cells", self.domain.cells), ("degree", self.degree)]
        return table(rows, caption="Error in the constitutive relation")

    @property
    def _in_words(self) -> str:
        """Write e with its unit."""
        return f"{self.absolute:.4g}{self.model.scene.unit('sqrt(force length)')}"

    @property
    def relative(self) -> float:
        """Return eps (17) [-]; 0 by convention without stress but round-off."""
        return self.absolute / self.scale if self.scale > 0 else 0.0

    @property
    def total(self) -> float:
        """Return eps with the estimate of the geometry [-].

        A run lowers it to its accuracy. It is eps for straight bodies.
        """
        if self.scale <= 0:
            return 0.0
        return float(np.hypot(self.absolute, self.geometry_error)) / self.scale

    @property
    def pressure_dependent(self) -> tuple[str, ...]:
        """Return the names of contacts with a friction bound that depends on pressure.

        With such a contact e is a bound up to the third term.
        """
        contacts = self.model.contacts
        return tuple(c.name for c in contacts if depends_on_pressure(c.friction))

    @property
    def guaranteed(self) -> bool:
        """Tell whether friction law, data and shape allow proved bounds.

        See :class:`erc_contact.Bounds`.
        """
        exact = max(self.oscillation, self.geometry_error) <= ROUND_OFF * self.scale
        # Normals that turn are interpolated, so that each mesh has its own problem.
        of_mesh = any(contact.is_of_mesh for contact in self.model.contacts)
        return exact and not of_mesh and not self.pressure_dependent

    @property
    def solution(self) -> Solution:
        """Return the solution that the pair comes from."""
        return self.admissible.solution

    @property
    def model(self) -> Model:
        """Return the scene on the mesh, with forms."""
        return self.solution.model

    @property
    def domain(self) -> Domain:
        """Return the mesh with names."""
        return self.solution.domain

    @property
    def degree(self) -> int:
        """Return the degree of the displacement."""
        return self.model.space.degree

    def force(self, part: str) -> Force:
        """Return a part's force, see :func:`erc_contact.results.force`; collective."""
        return force(self.admissible, part)

    def reactions(self) -> dict[str, Force]:
        """Return all forces, see :func:`erc_contact.results.reactions`; collective."""
        return reactions(self.admissible)

    def profile(self, contact: str) -> np.ndarray:
        """Return a profile, see :func:`erc_contact.results.profile`; collective."""
        return profile(self.admissible, contact)

    def contact_area(self, contact: str) -> ContactArea:
        """Return where a contact ends, :func:`erc_contact.results.contact_area`."""
        return contact_area(self.admissible, contact, relative_error=self.total)

    def contact_force(self, contact: str) -> ContactForce:
        """Return forces and pressures, :func:`erc_contact.results.contact_force`."""
        return contact_force(self.admissible, contact, relative_error=self.total)

    def gap_deviation(self, contact: str) -> float:
        """Return :func:`erc_contact.results.gap_deviation` [length]; collective."""
        return gap_deviation(self.admissible, contact)

    def at(self, points: Any) -> Values:
        """Return values at points, see :func:`erc_contact.results.at`; collective."""
        return at(self.admissible, points)

    def along(self, start: Any, stop: Any, count: int = 101) -> np.ndarray:
        """Tabulate values on a line, :func:`erc_contact.results.along`; collective."""
        return along(self.admissible, start, stop, count)

    def show(self) -> Any:
        """Show the deformed body with stress, error and pressure in 3D; collective.

        A notebook shows the view by itself, ``show().save(path)`` writes its page. See
        :func:`erc_contact.output.show_error`.
        """
        return view_of(self)

    def integrate(self, density: Callable[[Ufl, Ufl], Ufl], degree: int = FIELD_DEGREE) -> float:
        """Integrate a density, UFL of u^ and sigma^, over the body; collective.

        Example:
            >>> round(error.integrate(lambda u, sigma: sigma[0, 1] - sigma[1, 0]), 12)
            0.0
        """
        pair = self.admissible
        value = density(pair.displacement, pair.stress_function(degree))
        return integral(self.model.space, value, degree)

    def maximum(self, quantity: str, stress: str = "admissible") -> Maximum:
        """Return the greatest value of a quantity and its place; collective.

        The displacement is u^, the von Mises stress is computed from the mean of sigma^
        in a cell, and "pressure", "shear", "slip" and "gap" are taken from
        :meth:`profile`.

        Args:
            quantity: A quantity of :func:`erc_contact.model.greatest.find_maximum`.
            stress: Which stress has it, see :func:`erc_contact.results.mean_stress`.

        Raises:
            InputError: If the quantity is another one, or the scene has no contact.
        """
        pair = self.admissible
        u = pair.displacement

        def stresses() -> np.ndarray:
            return von_mises(mean_stress(pair, stress))

        return find_maximum(self.model, quantity, u, stresses, self.profile)

    @property
    def best_stress_error(self) -> float:
        """Return the bound of the error of the best stress [sqrt(force length)].

        That is the mean of sigma^ and C eps(u^), where e bounds the errors of both.

        Raises:
            InputError: If the material has a potential.
        """
        no_norm = "absolute bounds the distance of both energies from their minima."
        refuse_potential(self.model.scene.material, "best_stress_error", no_norm)
        return 0.5 * float(np.hypot(self.absolute, self.contact_error))

    @property
    def displacement_error(self) -> float:
        """Return the bound of ``|u - u^|`` in the elastic norm [sqrt(force length)].

        Of a linear law it is e. Of a potential it is e over the root of the least share
        of the elasticity at rest by which it is convex: ``sqrt(H/(3 G + H))`` of
        :class:`erc_contact.Plastic`. With Coulomb friction it is one as e is.

        Raises:
            InputError: If a potential does not tell its convexity.
        """
        space = self.model.space
        linearised = self.model.linearised
        if linearised is None:
            return self.absolute
        law = linearised.law
        if not law.has_convexity:
            material = type(self.model.scene.material).__name__
            raise InputError(
                f"displacement_error: {material} does not tell its convexity; give it a method"
                " convexity(**parameters). absolute bounds both energies."
            )
        cells = space.owned_cells
        corners = space.cell_corners()[cells]
        x = np.matmul(barycentric(lattice(space.d, DATA_DEGREE)), corners)
        least, _ = space.extremes(law.convexity(x, cells))
        return self.absolute / float(np.sqrt(least))

    @property
    def oscillation(self) -> float:
        """Return the norm of the oscillations [sqrt(force length)]."""
        return self.oscillations.total


def constitutive_error(admissible: Admissible) -> ConstitutiveError:
    """Measure the error in the constitutive relation; collective.

    Args:
        admissible: An admissible pair.

    Returns:
        e, eps, their parts and eps_E. If the solution has no stress but round-off (at
        rest, in a rigid motion, in a free expansion, back at rest in a history), e is
        round-off, and what is relative is zero by convention.

    Raises:
        InputError: If the energy overflows or underflows double precision.

    Example:
        >>> error = ec.constitutive_error(admissible)
        >>> f"{error.relative:.1%}"
        '12.3%'
    """
    began = perf_counter()
    model = admissible.model
    comm = model.space.comm
    measure = body_error if model.linearised is None else fenchel_error
    body = measure(admissible)
    springs = spring_error(admissible)
    unknown = strain_round_off(admissible)
    bulk_cells_2 = (np.sqrt(body.gap) + unknown) ** 2 + springs.gap
    # Springs are outside of the cells, so the estimate of the geometry is without them.
    geometry_cells_2 = geometry_squares(admissible)
    bulk_2 = comm.allreduce(bulk_cells_2.sum(), MPI.SUM)
    floor = UNKNOWN_SHARE * float(bulk_2)
    contacts = contact_law_error(model.space, admissible.displacement, admissible.tractions, floor)
    cells_2 = bulk_cells_2 + contacts.gap
    sums_2 = body.of_sum + springs.of_sum + contacts.of_sum
    # In the order of the attributes of Oscillations.
    of_data_2 = [
        of_loads(model, admissible.cell_geometry, admissible.cell_forces, admissible.relief),
        of_supports(model),
        body.moduli,
        contacts.gaps,
        contacts.friction,
        of_history(model),
    ]
    norms = [sums_2.sum(), geometry_cells_2.sum(), unknown @ unknown, contacts.gap.sum()]
    total = comm.allreduce(np.array([*norms, *of_data_2]), MPI.SUM)
    scale_2, geometry_2, unknown_2, contact_2 = total[:4]
    oscillations_2 = total[4:]
    floor_2, lost = round_off(admissible)
    _raise_if_no_number(lost, np.array([bulk_2, scale_2, contact_2, *oscillations_2]))
    # What is left of a motion or a free expansion without stress is no part of a scale.
    is_noise = scale_2 <= NOISE**2 * floor_2
    if admissible.solution.at_rest or (is_noise and _expands_freely(model)):
        cells_2[:] = 0.0
        geometry_cells_2[:] = 0.0
        scale_2 = geometry_2 = 0.0
    scale = float(np.sqrt(scale_2))
    tell_tiny_edges(model.space, cells_2, float(bulk_2 + contact_2), float(scale_2))
    seconds = comm.allreduce(perf_counter() - began, MPI.MAX)
    return ConstitutiveError(
        admissible=admissible,
        absolute=float(np.sqrt(bulk_2 + contact_2)),
        scale=scale,
        bulk_error=float(np.sqrt(bulk_2)),
        contact_error=float(np.sqrt(contact_2)),
        geometry_error=float(np.sqrt(geometry_2)),
        round_off=float(np.sqrt(unknown_2)),
        oscillations=Oscillations(*np.sqrt(oscillations_2).tolist()),
        indicators=np.sqrt(cells_2) / (scale or 1.0),
        total_indicators=np.sqrt(cells_2 + geometry_cells_2) / (scale or 1.0),
        seconds=seconds,
    )


def _expands_freely(model: Model) -> bool:
    """Tell whether given strains are all that acts on a body beside its supports."""
    return model.strains is not None and model.body_force is None and not model.surface_loads


def _raise_if_no_number(lost: bool, squares: np.ndarray) -> None:
    """Raise an error if an energy overflows or underflows.

    Args:
        lost: Whether the round-off underflows.
        squares: Squares of norms [force length].
    """
    if lost or not np.isfinite(squares).all():
        raise InputError(
            "The energy of this scene is no number of double precision; loads or moduli are too "
            "large or too small. Choose units in which they are nearer to 1."
        )
