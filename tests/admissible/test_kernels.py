"""The compiled kernels do what numpy does with dense matrices.

- patches: the sum of small inverses, in any units;
- energy: the energy of the macro-element stresses with the bubbles of least energy,
  with moduli that vary inside cells, too;
- blocks: the inverses of the energies of the quadratic moments of each facet;
- stresses of macro-elements: the matrix of the reference simplex between Piola's
  transforms;
- graph Laplacians: the solutions of least norm of the patches of all nodes;
- squares: the integrals of the energies of two stresses.
"""

from dataclasses import replace
from itertools import combinations, product
from math import factorial

import numpy as np
import pytest
from domains import two_halves
from scenes import random_scene

import erc_contact as ec
from erc_contact.admissible.cells import (
    CellGeometry,
    cell_geometry,
    force_coefficients,
    moments_of_cells,
)
from erc_contact.admissible.elastic import act, elastic_stress, macro_moduli
from erc_contact.admissible.facets import _patch_jumps
from erc_contact.admissible.macro import _elevation, macro_points, macro_stress
from erc_contact.admissible.reference import mandel, reference_map
from erc_contact.admissible.tighten import complementary
from erc_contact.admissible.tighten.blocks import Blocks
from erc_contact.admissible.tighten.complementary import ComplementaryEnergy, relax
from erc_contact.admissible.tighten.patches import Patches
from erc_contact.admissible.tighten.tables import hierarchical
from erc_contact.error.bulk import body_error
from erc_contact.model.model import Model
from erc_contact.scene.material import mandel_basis
from namedmesh.simplex import local_facet_nodes, nodes

pytestmark = pytest.mark.serial
dimensions, degrees = (
    pytest.mark.parametrize("d", [2, 3]),
    pytest.mark.parametrize("degree", [1, 2]),
)


def piola(cells: CellGeometry, chunk: slice) -> np.ndarray:
    """Return the images ``J b J^T / |det J|`` of the basis tensors b in some cells.

    Returns:
        One image a row, in Mandel components, shape (n, s, s).
    """
    d = cells.d
    basis = mandel_basis(d)
    J = cells.J[chunk]
    determinant = cells.volume[chunk] * factorial(d)
    products = (J[:, :, :, None, None] * J[:, None, None]) / determinant[:, None, None, None, None]
    symmetric = np.einsum("aij,bkl->ikjlba", basis, basis).reshape(d**4, -1)
    return (products.reshape(-1, d**4) @ symmetric).reshape(-1, len(basis), len(basis))


def small(d: int, degree: int) -> tuple[Model, np.ndarray]:
    """Some distorted cells of two materials, and components of facets that are free, some of them on the boundary."""
    rng = np.random.default_rng(d)
    domain = two_halves(
        ec.rectangle((0, 0), (1, 1), cells=(3, 2))
        if d == 2
        else ec.box((0,) * 3, (1,) * 3, cells=(2, 1, 1))
    )
    domain.mesh.geometry.x[:, :d] += rng.uniform(-0.07, 0.07, (len(domain.mesh.geometry.x), d))
    stiff = {"lower": 1.0, "upper": 4.0}
    held = [ec.Displacement("bottom", (0.0,) * d)]
    model = Model(ec.Scene(ec.Elastic(stiff, {"lower": 0.3, "upper": 0.45}), held), domain, degree)
    cells = cell_geometry(model.space)
    return model, cells.has_second[:, None] | (rng.random((len(cells.side[0]), d)) < 0.5)


def unit_tractions(cells: CellGeometry, x: np.ndarray, ring: np.ndarray) -> np.ndarray:
    """Moments of the unit forces, couple and bars of a ring, shape (facets, d, d, unknowns)."""
    d, columns = cells.d, []
    facet, apex, sense = ring // 2 // d, ring // 2 % d, np.where(ring % 2, 1.0, -1.0)
    corners = x[cells.vertices_of_facets[facet]]
    normal = cells.area.reshape(-1, d)[cells.side[0, facet]]
    normal = normal / np.linalg.norm(normal, axis=1)[:, None]
    empty = np.zeros((len(cells.side[0]), d, d))
    for node, i in product(range(d - 1), range(d)):
        force = empty.copy()
        force[facet, np.array([np.delete(range(d), j)[node] for j in apex]), i] = sense
        columns.append(force)
    couple = empty.copy()
    slopes = np.linalg.pinv(
        np.diff(corners, axis=1)
    )  # of the last barycentric coordinates, up to a triangular matrix
    slopes = np.concatenate(
        [-slopes[..., :1], slopes[..., :-1] - slopes[..., 1:], slopes[..., -1:]], axis=2
    )
    for f, j, n, g in zip(facet, apex, normal, slopes, strict=True):
        couple[f] = np.outer(g.T @ g[:, j] / np.linalg.norm(g[:, j]), n)
    columns.append(couple)
    for f, c in zip(facet, corners, strict=True):
        for a, b in combinations(range(d), 2):
            bar = empty.copy()
            bar[f, a], bar[f, b] = c[a] - c[b], c[b] - c[a]
            columns.append(bar)
    return np.stack(columns, axis=-1)


@dimensions
@pytest.mark.parametrize(("size", "modulus"), [(1.0, 1.0), (1e-12, 1e12), (1e12, 1e-12)])
def test_patches_against_numpy(d, size, modulus):
    """``sum_p T_p (T_p^T K T_p)^+ T_p^T``, to the digits of the factors."""
    model, free = small(d, 1)
    cells = cell_geometry(model.space)
    x = size * model.space.V.tabulate_dof_coordinates()[:, :d]
    cells = replace(
        cells, J=size * cells.J, volume=size**d * cells.volume, area=size ** (d - 1) * cells.area
    )
    compliance = macro_moduli(model, cells, len(cells.nodes), inverse=True) / modulus
    energy, patches = (
        ComplementaryEnergy(cells, len(cells.nodes), compliance),
        Patches(model.space, cells, compliance, free),
    )
    unit = np.eye(free.size * d).reshape(-1, len(free), d, d)
    K = np.stack([energy(e)[1].ravel() for e in unit])
    assert abs(K - K.T).max() < 1e-14 * abs(K).max()
    assert np.isclose(energy(unit.sum(axis=0))[0], K.sum(), rtol=1e-12)
    expected = np.zeros_like(K)
    for ring in np.split(patches.ring, np.cumsum(patches.size)[:-1]):
        T = unit_tractions(cells, x, ring)
        T = T.reshape(-1, T.shape[-1])
        T /= np.linalg.norm(T, axis=0)
        T = T[:, ~np.any(abs(T[~np.repeat(free, d, axis=0).ravel()]) > 1e-12, axis=0)]
        expected += T @ np.linalg.pinv(T.T @ K @ T, rcond=1e-11, hermitian=True) @ T.T
    found = np.stack([patches(e).ravel() for e in unit])
    assert np.linalg.norm(found - expected) < 1e-8 * np.linalg.norm(expected)


@dimensions
@degrees
@pytest.mark.parametrize("at_points", [False, True])
def test_energy_against_numpy(d, degree, at_points, monkeypatch):
    """Balanced tractions have the energy of the stresses of :mod:`macro` with the bubbles of least energy."""
    model, free = small(d, degree)
    cells, m, rng = (
        cell_geometry(model.space),
        len(model.space.facet_points),
        np.random.default_rng(degree),
    )
    compliance = macro_moduli(model, cells, len(cells.nodes), inverse=True)
    x = rng.standard_normal((len(free), m, d))
    x[:, :d] = Patches(model.space, cells, compliance, free)(x)[:, :d]
    if at_points:
        stiffer = 1 + rng.random((len(cells.nodes), len(macro_points(d, degree).points), 1, 1))
        compliance = compliance * stiffer
    near, _, weights = macro_points(d, degree)
    forces = force_coefficients(
        moments_of_cells(cells, np.matmul(np.linalg.inv(hierarchical(d, degree)), x)), degree
    )
    nothing = np.zeros((len(cells.nodes), len(nodes(d, degree - 1)), d, d))
    stress = macro_stress(cells, len(cells.nodes), nothing, forces, None)
    values = np.matmul(
        near, relax(cells, stress, np.zeros((len(stress), 1, stress.shape[-1])), compliance)
    )
    values = values.reshape(len(values), len(weights), -1)
    square = np.sum(
        cells.volume[:, None] * weights * (values * act(compliance, values)).sum(axis=2)
    )
    # By passes over the cells, by the matrices of all cells, and by those of eight.
    slopes = []
    for most_kept, digits in ((0, 1e-11), (1 << 40, 1e-8), (8 * 12_000, 1e-8)):
        monkeypatch.setattr(complementary, "MOST_KEPT", most_kept)
        found, half = ComplementaryEnergy(cells, len(cells.nodes), compliance)(x)
        assert found == pytest.approx(square, rel=digits)
        assert np.vdot(x, half) == pytest.approx(square, rel=digits)
        slopes.append(half)
    for slope in slopes[1:]:
        assert abs(slope - slopes[0]).max() < 1e-8 * abs(slopes[0]).max()


@dimensions
def test_blocks_against_numpy(d):
    model, free = small(d, 2)
    cells = cell_geometry(model.space)
    compliance = macro_moduli(model, cells, len(cells.nodes), inverse=True)
    m, count, mine = len(model.space.facet_points), len(cells.nodes), np.full(len(free), True)
    mine[3] = False
    near, _, weights = macro_points(d, 2)
    nothing = np.zeros((count, d + 1, d, d))
    stresses = []
    for a, i in product(range(d, m), range(d)):
        x = np.zeros((len(free), m, d))
        x[:, a, i] = 1.0
        x = moments_of_cells(cells, np.matmul(np.linalg.inv(hierarchical(d, 2)), x))
        for f in range(d + 1):
            forces = np.zeros_like(x)
            forces[:, f] = force_coefficients(x[:, f], 2)
            stresses.append(np.matmul(near, macro_stress(cells, count, nothing, forces, None)))
    values = np.reshape(stresses, (-1, d + 1, count, len(weights), d * (d + 1) // 2))
    size = len(values)
    strains = np.einsum("xfcqs,cst->xfcqt", values, compliance[:, 0])
    energy = np.einsum("xfcqs,yfcqs,q,c->cfxy", values, strains, weights, cells.volume)
    matrices = np.zeros((len(free), size, size))
    np.add.at(matrices, cells.facets, energy)
    keep = np.tile(free, size // d) & mine[:, None]
    expected = np.zeros_like(matrices)
    for f, (matrix, kept) in enumerate(zip(matrices, keep, strict=True)):
        places = np.ix_([f], kept, kept)
        expected[places] = d * np.linalg.inv(matrix[np.ix_(kept, kept)])
    found = Blocks(cells, compliance, free, mine).inverse
    assert abs(found - expected).max() < 1e-11 * abs(expected).max()


@dimensions
@degrees
def test_graph_laplacians_against_numpy(d, degree):
    """Jumps of the solutions of least norm, component by component.

    Components of Gamma_D are grounded.
    """
    model, free = small(d, degree)
    cells, rng = cell_geometry(model.space), np.random.default_rng(7)
    inner, weight, N = cells.has_second, rng.random(len(free)) + 0.5, cells.nodes.shape[1]
    of_facets, count = local_facet_nodes(d, degree), cells.nodes.size
    ends = [
        np.array([(s // (d + 1)) * N + of_facets[s % (d + 1)] for s in side]) for side in cells.side
    ]
    matrix = np.zeros((d, count, count))
    for f, a, b in zip(range(len(free)), *ends, strict=True):
        for c in range(d):
            if inner[f]:
                for i, j, sign in ((a, a, 1), (b, b, 1), (a, b, -1), (b, a, -1)):
                    matrix[c, i, j] += sign * weight[f]
            elif free[f, c]:
                matrix[c, a, a] += weight[f]
    right = np.einsum("cij,jc->ic", matrix, rng.standard_normal((count, d)))
    expected = np.stack(
        [np.linalg.lstsq(matrix[c], right[:, c], rcond=1e-12)[0] for c in range(d)], axis=1
    )
    jumps = expected[ends[0]] - np.where(inner[:, None, None], expected[ends[1]], 0.0)
    jumps *= weight[:, None, None] * free[:, None]
    found = _patch_jumps(
        cells,
        right.reshape(*cells.nodes.shape, d).copy(),
        weight,
        inner,
        free & ~inner[:, None],
        np.full(len(model.fixed), True),
    )
    assert abs(found - jumps).max() < 1e-12 * abs(jumps).max()


@dimensions
@degrees
def test_squares_against_numpy(d, degree):
    pair = ec.equilibrate(ec.solve(*random_scene(d), degree=degree))
    model, cells = pair.solution.model, pair.cell_geometry
    near, _, weights = macro_points(d, degree)
    sigma = np.matmul(near, pair.stress).reshape(len(pair.stress), len(weights), -1)
    elastic = elastic_stress(model, cells, pair.displacement, len(sigma))
    compliance = macro_moduli(model, cells, len(sigma), inverse=True)
    for found, tau in zip(body_error(pair)[:2], (sigma - elastic, sigma + elastic), strict=True):
        square = cells.volume * ((act(compliance, tau) * tau).sum(axis=2) @ weights)
        assert np.allclose(found, square, rtol=1e-12, atol=0)


@dimensions
@degrees
def test_macro_stress_against_numpy(d, degree):
    """``sigma_h + map(F^ - sigma_h n, f + div sigma_h)``."""
    model, _ = small(d, degree)
    cells, rng = cell_geometry(model.space), np.random.default_rng(3)
    n, b, m = len(cells.nodes), len(nodes(d, degree - 1)), len(model.space.facet_points)
    stress = rng.standard_normal((n, b, d, d))
    stress = stress + stress.transpose(0, 1, 3, 2)
    forces, force = rng.standard_normal((n, d + 1, m, d)), rng.standard_normal((n, b, d))
    of_subs, of_facets = _elevation(d, degree)
    push = np.einsum("nfj,nbij->nfbi", cells.area, stress)
    inside = force - (np.einsum("nffi->ni", push)[:, None] / d if degree > 1 else 0.0)
    inputs = np.concatenate([(forces - of_facets @ push).reshape(n, -1, d), inside], axis=1)
    reference = np.einsum("vmsci,nij,ncj->nvms", reference_map(d, degree), cells.inverse, inputs)
    expected = np.einsum("nvms,nst->nvmt", reference, piola(cells, slice(n)))
    expected += np.einsum("vmb,nbs->nvms", of_subs, mandel(stress))
    found = macro_stress(cells, n, stress, forces, force)
    assert abs(found - expected).max() < 1e-13 * abs(expected).max()
