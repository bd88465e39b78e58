"""The compiled kernels of axisymmetric bodies do what dense matrices do.

- energies: the quadratic form of facet forces is the energy of the stresses by a rule;
- inner amounts: no other ones that are in balance have less energy;
- patches: tightening ends at the least energy that forces in axial equilibrium have.
"""

from dataclasses import replace

import numpy as np
import pytest
from domains import two_halves

import erc_contact as ec
from erc_contact.admissible.axisymmetric.bulk import _off_axis
from erc_contact.admissible.axisymmetric.elements import Elements, law_of_cells
from erc_contact.admissible.axisymmetric.tighten import _Energy, tighten_forces
from erc_contact.admissible.cells import cell_geometry, moments_of_cells
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.tighten.iteration import Ending
from erc_contact.model.model import Model
from namedmesh.simplex import barycentric, bernstein, rule

pytestmark = pytest.mark.serial
with_and_without_axis = pytest.mark.parametrize("inner_radius", [0.0, 0.4])
degrees = pytest.mark.parametrize("degree", [1, 2])


def rings(inner_radius: float, degree: int) -> tuple[Model, Elements]:
    """Some distorted cells of two materials, with a random axial body force."""
    rng = np.random.default_rng(3)
    domain = two_halves(ec.rectangle((inner_radius, 0.0), (inner_radius + 1, 1.0), cells=(3, 2)))
    x = domain.mesh.geometry.x
    inside = (x[:, 0] > inner_radius) & (x[:, 0] < inner_radius + 1)
    x[inside, :2] += rng.uniform(-0.07, 0.07, (inside.sum(), 2))
    material = ec.Elastic(
        {"lower": 1.0, "upper": 4.0}, {"lower": 0.3, "upper": 0.45}, hypothesis="axisymmetric"
    )
    model = Model(ec.Scene(material, [ec.Displacement("bottom", (0, 0))]), domain, degree)
    cells = cell_geometry(model.space)
    force = rng.standard_normal((len(cells.nodes), degree * (degree + 1) // 2, 2))
    return model, Elements(model.space, cells, force)


def compliances(model: Model, elements: Elements) -> np.ndarray:
    points = macro_points(2, model.space.degree).points
    return law_of_cells(model.constitution.metric, elements.corners, points)


def energy_of(model: Model, elements: Elements, stress: np.ndarray, elastic: np.ndarray) -> float:
    """``int (S - S_0) : M : (S - S_0) / c`` by the rule of the pieces, c circumference."""
    k = model.space.degree
    _, points, weights = macro_points(2, k)
    table = bernstein(2, k, rule(2, 2 * k)[0])
    values = np.matmul(table, stress).reshape(len(stress), -1, 4) - elastic
    metric = compliances(model, elements)
    radius = np.matmul(barycentric(points), elements.corners)[..., 0]
    density = np.einsum(
        "npa,npab,npb->np", values, np.broadcast_to(metric, (*values.shape, 4)), values
    )
    volume = elements.cells.volume[:, None]
    return float((weights * volume * density / (2 * np.pi * radius)).sum())


@with_and_without_axis
@degrees
def test_energies_of_stresses(inner_radius: float, degree: int) -> None:
    model, elements = rings(inner_radius, degree)
    cells = elements.cells
    rng = np.random.default_rng(5)
    elastic = rng.standard_normal((len(cells.nodes), len(macro_points(2, degree).points), 4))
    energies = elements.energies(elastic, compliances(model, elements))
    off = _off_axis(model.space, cells)
    forces = rng.standard_normal((*off.shape, 2)) * off[..., None]
    value, half = _Energy(cells, energies).start(forces)
    of_cells = moments_of_cells(cells, forces)

    def energy(energies):
        return energy_of(model, elements, elements.stresses(of_cells, energies), elastic)

    assert value == pytest.approx(energy(energies), rel=1e-11)
    # The derivative is the derivative.
    direction = rng.standard_normal(forces.shape) * off[..., None]
    both = [_Energy(cells, energies).start(forces + t * direction)[0] for t in (1, -1)]
    assert 4 * (half * direction).sum() == pytest.approx(both[0] - both[1], rel=1e-9)
    # Other amounts in balance: the energy is least, so it grows the same on both sides.
    change = np.zeros_like(energies.upper)
    change[..., -1] = rng.standard_normal(change.shape[:2])
    one, two = (energy(replace(energies, upper=energies.upper + t * change)) for t in (1.0, -1.0))
    assert one > value * (1 + 1e-6)
    assert one - value == pytest.approx(two - value, rel=1e-7)


@with_and_without_axis
@degrees
def test_tightening_ends_at_the_least_energy(inner_radius: float, degree: int) -> None:
    model, elements = rings(inner_radius, degree)
    cells = elements.cells
    rng = np.random.default_rng(7)
    elastic = rng.standard_normal((len(cells.nodes), len(macro_points(2, degree).points), 4))
    energies = elements.energies(elastic, compliances(model, elements))
    off = _off_axis(model.space, cells)
    # Forces of the boundary are free on its upper side, which is connected: patches of
    # vertices do not move a resultant from a part of the boundary to another one.
    heights = model.space.V.tabulate_dof_coordinates()[cells.vertices_of_facets, 1]
    on_top = heights.min(axis=1) > 1 - 1e-9
    free = np.repeat(off[..., None] & (cells.has_second | on_top)[:, None, None], 2, axis=-1)
    start = rng.standard_normal(free.shape) * off[..., None]
    forces, done, square = tighten_forces(
        model.space, elements, energies, energies.matrix, start, free, Ending(300, 1e-13)
    )
    assert done < 300
    # The same by dense matrices: free forces without axial resultant on any cell.
    energy = _Energy(cells, energies)
    units = np.eye(free.size)[free.ravel()].reshape(-1, *free.shape)
    H = np.array([energy(unit)[1][free] for unit in units])
    resultants = moments_of_cells(cells, np.moveaxis(units, 0, -1).reshape(*free.shape[:2], -1))
    axial = resultants.reshape(*resultants.shape[:-1], 2, -1)[..., 1, :].sum(axis=(1, 2))
    _, size, V = np.linalg.svd(axial)
    rank = int((size > 1e-10 * size[0]).sum())
    kernel = V[rank:].T
    slope = energy.start(start)[1][free]
    step = kernel @ np.linalg.lstsq(kernel.T @ H @ kernel, -kernel.T @ slope, rcond=1e-12)[0]
    least = start.copy()
    least[free] += step
    assert square == pytest.approx(energy.start(least)[0], rel=1e-9)
    assert square < energy.start(start)[0] * (1 - 1e-3)
    np.testing.assert_allclose(forces, least, atol=1e-5 * abs(least).max())
