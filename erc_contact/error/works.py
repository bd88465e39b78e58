"""Work of stresses and of friction on displacements.

It is known up to what the integrals leave unknown. The integrals are exact where no
data vary inside cells. Elsewhere they are adapted to the data
(:mod:`erc_contact.model.data.quadrature`).
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.admissible.elastic import (
    CellStrains,
    macro_moduli,
    strains,
    strains_at,
    strains_of_body,
)
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.pair import Admissible
from erc_contact.admissible.springs import spring_work
from erc_contact.admissible.traction import ContactTraction
from erc_contact.error.contact_integral import contact_integral
from erc_contact.error.foundations import Sliding, foundation_energies
from erc_contact.error.hidden import hidden_by_data
from erc_contact.error.load_work import assemble_number
from erc_contact.error.numbers import ROUND_OFF, BoundedNumber
from erc_contact.model.contact.contact_values import ContactData
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.trace import split
from erc_contact.model.data.quadrature import Hidden, Integral, Integrand, cell_pieces, integrate
from erc_contact.model.law.constitution import act
from erc_contact.model.law.point_law import PointLaw
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from namedmesh.simplex import mass


def elastic_work(
    pair: Admissible, v: fem.Function, w: fem.Function, floor: float = 0.0
) -> BoundedNumber:
    """Compute ``a(v, w)``, with the springs [force length]; collective.

    Args:
        pair: The pair whose law is meant.
        v: A displacement [length].
        w: A displacement [length].
        floor: What may always stay unknown where moduli vary [force length].
    """
    model = pair.model
    space = model.space
    cells = pair.cell_geometry
    of_springs = _spring_work(model, v, w)
    law = model.constitution
    if not law.stiffness.varies_in_cells:
        owned = model.domain.owned_cells
        stress = act(macro_moduli(model, cells, owned), strains(cells, v)[:owned])
        means = mass(space.d, space.degree - 1, space.degree - 1)
        strain = strains(cells, w)[:owned]
        of_cells = np.einsum("nas,ab,nbs->n", stress, means, strain, optimize=True)
        local = float(cells.volume[:owned] @ of_cells)
        return BoundedNumber(space.comm.allreduce(local, MPI.SUM)) + of_springs
    numbers = space.owned_cells
    strain_v = CellStrains.of(space, cells, v)
    strain_w = CellStrains.of(space, cells, w)

    def stress_at(entity: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        return law.stress_change(strain_v.at(entity, places, x), x, numbers[entity])

    return _over_cells(pair, stress_at, strain_w.at, floor) + of_springs


def spring_energy(model: Model, u: fem.Function) -> BoundedNumber:
    """Compute the energy that springs store [force length]; collective."""
    return 0.5 * _spring_work(model, u, u)


def _spring_work(model: Model, v: fem.Function, w: fem.Function) -> BoundedNumber:
    """Compute the work of springs, pulled by v, on w [force length]; collective."""
    total = BoundedNumber(0.0)
    for spring in model.springs:
        total += BoundedNumber(assemble_number(model.space, spring.work(v, w)))
    return total


def strain_work(pair: Admissible, v: fem.Function, floor: float = 0.0) -> BoundedNumber:
    """Compute ``int C eps_0 : eps(v)`` [force length]; collective.

    It is zero without given strains.

    Args:
        pair: The pair whose given strains are meant.
        v: A displacement [length].
        floor: What may always stay unknown [force length].
    """
    model = pair.model
    given = model.strains
    if given is None:
        return BoundedNumber(0.0)
    if not model.constitution.varies_in_cells:
        return BoundedNumber(assemble_number(model.space, model.strain_loads(v)))
    cells = pair.cell_geometry
    of_cells = model.space.owned_cells

    def stress_at(entity: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        cell = of_cells[entity]
        return model.constitution.stress_change(given(x, cell), x, cell)

    return _over_cells(pair, stress_at, CellStrains.of(model.space, cells, v).at, floor)


def strain_energy(pair: Admissible, u: fem.Function, floor: float = 0.0) -> BoundedNumber:
    """Compute the strain energy of a displacement [force length]; collective.

    It is the energy of the elastic strain, ``|C (eps(u) - eps_0)|^2/2``; of a
    potential it is the integral of psi.

    Args:
        pair: The pair.
        u: The displacement [length].
        floor: What each of its integrals may always leave unknown [force length].
    """
    model = pair.model
    of_cells = model.space.owned_cells
    if model.linearised is not None:
        law = model.linearised.law
        strain = strains_of_body(model, pair.cell_geometry, u)

        def of_law(
            law: PointLaw, entity: np.ndarray, places: np.ndarray, x: np.ndarray
        ) -> np.ndarray:
            eps = strain.at(entity, places, x)
            energy = law.energy(eps, x, of_cells[entity])[..., None]
            return model.space.section.times(energy, x)

        def energy_at(entity: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
            return of_law(law, entity, places, x)

        def once(entity: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
            return np.ones((*x.shape[:2], 1))

        hidden = hidden_by_data(law, of_cells, of_law)
        return _over_cells(pair, energy_at, once, floor, hidden) + 0.5 * _spring_work(model, u, u)
    energy = 0.5 * elastic_work(pair, u, u, floor)
    given = model.strains
    if given is None:
        return energy

    def strain_at(entity: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        return given(x, of_cells[entity])

    def stress_at(entity: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        strain = strain_at(entity, places, x)
        return model.constitution.stress_change(strain, x, of_cells[entity])

    of_given = 0.5 * _over_cells(pair, stress_at, strain_at, floor)
    return energy - strain_work(pair, u, floor) + of_given


def _over_cells(
    pair: Admissible,
    stress_at: Integrand,
    strain_at: Integrand,
    floor: float = 0.0,
    hidden: Hidden | None = None,
) -> BoundedNumber:
    """Integrate the work of a stress on a strain over all cells; collective.

    The integral is adapted to them. Where they do no work on each other, what is left
    is round-off of the products that cancel, which needs no resolution.
    """
    space = pair.model.space
    cells = pair.cell_geometry
    owned = space.domain.owned_cells
    corners = cells.corners[:owned]
    volume = cells.volume[:owned]

    def density(entity: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        product = stress_at(entity, places, x) * strain_at(entity, places, x)
        return product.sum(axis=-1, keepdims=True)

    middles = np.full((owned, 1, space.d + 1), 1 / (space.d + 1))
    at_middles = (np.arange(owned), middles, corners.mean(axis=1, keepdims=True))
    sizes = [np.linalg.norm(field(*at_middles), axis=-1)[:, 0] for field in (stress_at, strain_at)]
    size = space.comm.allreduce(float((volume * sizes[0]) @ sizes[1]), MPI.SUM)
    body = corners, volume, cell_pieces(space.d)
    floor = max(ROUND_OFF * size, floor)
    most = space.points_of_numbers
    integral = integrate(space.comm, density, *body, floor=floor, hidden=hidden, most=most)
    return BoundedNumber.summed(space.comm, integral)


def stress_work(pair: Admissible, v: fem.Function) -> BoundedNumber:
    """Compute ``(sigma^, eps(v))``, which is exact [force length]; collective.

    With the work of the springs it is the work of r^ and of the projected loads.
    """
    model = pair.model
    cells = pair.cell_geometry
    k = cells.degree
    owned = model.domain.owned_cells
    shape, points, weights = macro_points(model.space.d, k)
    sigma = np.matmul(shape, pair.stress).reshape(owned, len(points), pair.stress.shape[3])
    strain = strains_at(model.space, cells, v, points, owned)
    # sigma^ is a polynomial on each sub-simplex, so the rule is exact.
    means = np.einsum("nqs,nqs,q->n", sigma, strain, weights)
    local = float(np.sum(cells.volume[:owned] * means))
    local += spring_work(model, v, pair.spring_tractions)
    return BoundedNumber(float(model.space.comm.allreduce(local, MPI.SUM))) + _hoop_work(pair, v)


def _hoop_work(pair: Admissible, v: fem.Function) -> BoundedNumber:
    """Compute the work of the radial body force of rings, a hoop stress; collective."""
    load = pair.model.hoop_load.hoop
    if load is None:
        return BoundedNumber(0.0)
    of_cells = pair.model.space.owned_cells
    strain_v = CellStrains.of(pair.model.space, pair.cell_geometry, v)

    def hoop_at(entity: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        return load(x, of_cells[entity])[..., None]

    def strain_at(entity: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        return strain_v.at(entity, places, x)[..., -1:]

    return _over_cells(pair, hoop_at, strain_at)


def friction_work(
    space: Space,
    traction: ContactTraction,
    u: fem.Function,
    floor: float,
    end: ContactTraction | None = None,
) -> BoundedNumber:
    """Add up :func:`friction_works`; collective."""
    if traction.contact.friction is None:
        return BoundedNumber(0.0)
    return BoundedNumber.summed(space.comm, friction_works(space, traction, u, floor, end))


def foundation_energy(
    space: Space, traction: ContactTraction, u: fem.Function, floor: float
) -> BoundedNumber:
    """Add up :func:`foundation_energies`, 0 on a rigid foundation; collective."""
    if not traction.contact.is_compliant:
        return BoundedNumber(0.0)
    return BoundedNumber.summed(space.comm, foundation_energies(space, traction, u, floor))


def friction_works(
    space: Space,
    traction: ContactTraction,
    u: fem.Function,
    floor: float,
    end: ContactTraction | None = None,
) -> Integral:
    """Compute ``int b(p^) support(slip)`` on each facet [force length]; collective.

    The slip is ``u_t - s``, s of the last step, less the deflection of a compliant
    foundation. It is 0 for ghosts and never below zero. The integrals may leave their
    share or ``floor`` unknown.

    Args:
        space: The mesh.
        traction: r^ on the contact, with its friction bound.
        u: u^ [length].
        floor: What the integrals may leave unknown.
        end: The traction whose friction bound limits the deflection of a compliant
            foundation; by default the same one.
    """
    sliding = Sliding(space, traction)
    at_end = sliding if end is None else Sliding(space, end)
    allowed = traction.contact.friction_set

    def density(
        facet: np.ndarray, shape: np.ndarray, w: np.ndarray, n: np.ndarray, x: np.ndarray
    ) -> np.ndarray:
        slip = at_end.slip(facet, shape, w, n, x)
        path = allowed.support(slip, n, facet)
        return sliding.bound(facet, shape, n, x) * path

    return contact_integral(space, traction.contact, u, density, floor)


def contact_work(
    space: Space, contact: ContactOnMesh, tau: np.ndarray, u: fem.Function, floor: float
) -> BoundedNumber:
    """Compute ``int tau n.(w - g n)`` on a contact [force length]; collective.

    Args:
        space: The mesh.
        contact: The contact.
        tau: Coefficients of the traction tau n [force/area], shape (f, m, d).
        u: u, whose jump is w.
        floor: What the integrals may leave unknown.
    """
    data = ContactData(contact, space.mesh)

    def density(
        facet: np.ndarray, shape: np.ndarray, w: np.ndarray, n: np.ndarray, x: np.ndarray
    ) -> np.ndarray:
        tau_n, tau_t, _ = split(np.matmul(shape, tau[facet]), n)
        w_n, w_t, _ = split(w, n)
        # A gap that is closed everywhere does no work, whatever the traction.
        opening = 0.0 if contact.bilateral else w_n - data.gap(facet, x)
        return tau_n * opening + (tau_t * w_t).sum(axis=-1)

    integral = contact_integral(space, contact, u, density, floor)
    return BoundedNumber.summed(space.comm, integral)
