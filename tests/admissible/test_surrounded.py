"""Images of cells around the sides of copies: sigma^ knows no sides.

Properties: all facets of the cells of a rank are between two cells, also at corners of
several pairs, and images lie beside the cells; works fold as moments repeat; a matrix of
the material turns as stresses do; e of a cell is e of two cells, also where a cell of
the mesh is as wide as the body; a given mean stress is the mean of sigma^; ranks change
nothing, also where the body yields. Sectors: tests/model/test_periodic.py.
"""

import numpy as np
import pytest
import ufl
from domains import partly_broad
from mpi4py import MPI
from scenes import AUGMENTED, certified

import erc_contact as ec
from erc_contact.admissible.across import FITS
from erc_contact.admissible.cells import cell_geometry
from erc_contact.admissible.images import _mandel_turns
from erc_contact.admissible.imbalance import _of_sides
from erc_contact.admissible.surrounded import surrounded
from erc_contact.scene.material import mandel_basis

COMM = MPI.COMM_WORLD
SIDES = [("left", "right"), ("bottom", "top"), ("front", "back")]


def modulus(x):
    """A modulus that is repeated, and symmetric to nothing."""
    return 1 + 0.5 * ufl.sin(2 * np.pi * (x[0] + x[1]) + 0.3)


VARYING = ec.Elastic(modulus, 0.3)
MEAN = [[0.01, 0.003, 0.002], [0.003, -0.005, 0.001], [0.002, 0.001, 0.004]]


def cell_of(cells, given="mean_strain", material=VARYING, repeats=1, comm=COMM):
    """Some unit cells in a row, repeated along all axes, under a mean strain or stress."""
    d = len(cells)
    mean = np.array(MEAN)[:d, :d].tolist()
    sides = [ec.Periodic(*names, **{given: mean}) for names in SIDES[:d]]
    make = ec.rectangle if d == 2 else ec.box
    times = np.array([repeats, *[1] * (d - 1)])
    size = tuple(times.astype(float))
    domain = make((0.0,) * d, size, cells=tuple((times * cells).tolist()), comm=comm)
    return ec.Scene(material, sides), domain


@pytest.mark.parametrize(
    "cells",
    partly_broad([(1, 1), (2, 1), (3, 3), (1, 1, 1), (2, 2, 1)], [(2, 1), (3, 3), (1, 1, 1)]),
    ids=str,
)
def test_no_cell_is_at_a_side(cells):
    solution = ec.solve(*cell_of(cells, material=ec.Elastic(1.0, 0.3)), AUGMENTED)
    own = cell_geometry(solution.model.space)
    around = surrounded(solution.model, own)
    owned = solution.domain.owned_cells
    assert around.has_second[own.facets[:owned]].all()
    # Both cells of a facet have its corners, and lie on both sides of it.
    first, second = around.side[:, around.has_second]
    d = own.d
    areas = around.area.reshape(-1, d)
    assert np.allclose(areas[first], -areas[second], rtol=0, atol=1e-14)
    inside = np.ones((*around.facets.shape, d + 1), dtype=bool)
    inside[:, np.arange(d + 1), np.arange(d + 1)] = False
    corners = np.broadcast_to(around.corners[:, None], (*around.facets.shape, d + 1, d))
    of_facets = corners[inside].reshape(-1, d, d)
    assert np.allclose(of_facets[first], of_facets[second], rtol=0, atol=1e-14)
    assert np.array_equal(around.volume[: len(own.volume)], own.volume)
    # Conjugate gradients need that works fold as moments repeat.
    rng = np.random.default_rng(1)
    work, moment = rng.normal(size=(2, around.side.shape[1], d, d))
    folded = work.copy()
    around.images.fold(folded)
    repeated = around.images.repeat(moment.copy())
    assert np.isclose((work * repeated).sum(), (folded * moment).sum(), rtol=0, atol=1e-11)


@pytest.mark.serial
@pytest.mark.parametrize("d", [2, 3])
def test_matrices_turn_as_tensors_do(d):
    rng = np.random.default_rng(d)
    turn = np.linalg.qr(rng.normal(size=(d, d)))[0]
    basis = mandel_basis(d)
    mandel_turn = _mandel_turns(turn[None], len(basis) + 1)[0]
    tensor = np.einsum("s,sab->ab", rng.normal(size=len(basis)), basis)
    components = np.einsum("sab,ab->s", basis, tensor)
    turned = np.einsum("sab,ab->s", basis, turn @ tensor @ turn.T)
    assert np.allclose(mandel_turn[:-1, :-1] @ components, turned, rtol=0, atol=1e-14)
    assert np.allclose(mandel_turn @ mandel_turn.T, np.eye(len(mandel_turn)), rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("cells", "degree", "given"),
    [((1, 1), 1, "mean_strain"), pytest.param((3, 2), 2, "mean_stress", marks=pytest.mark.broad)],
)
def test_one_cell_is_as_good_as_two(cells, degree, given):
    """The tractions of sigma^ on the sides are chosen as all others are."""
    one, two = (
        certified(*cell_of(cells, given, VARYING, repeats), AUGMENTED, degree) for repeats in (1, 2)
    )
    assert one.admissible.tightening == two.admissible.tightening
    assert np.isclose(np.sqrt(2) * one.absolute, two.absolute, rtol=5 * FITS)
    if given == "mean_stress":
        # The resultants on the sides are kept while their tractions change.
        forces = np.column_stack([one.force(name).force for name in ("right", "top")])
        assert np.allclose(forces, np.array(MEAN)[:2, :2], rtol=0, atol=1e-14)
        # What the pair proves of them would tell a tenth more.
        found = _of_sides(one.model, 1.1 * one.admissible.facet_moments)
        missing = COMM.allreduce(max(max(amounts, default=0.0) for _, amounts, _ in found), MPI.MAX)
        assert missing == pytest.approx(0.1 * np.abs(MEAN)[:2, :2].max(), rel=1e-9)


@pytest.mark.ranks
@pytest.mark.parametrize("degree", [pytest.param(1, marks=pytest.mark.broad), 2])
def test_ranks_see_the_same_copies(degree):
    """A corner of four copies whose cells are on different ranks.

    The steps of a law that yields end on digits that depend on the sums of ranks. A cell
    that is missing changes e by percents.
    """
    yields = ec.Plastic(modulus, 0.3, yield_stress=0.008, hardening=0.1)
    errors = []
    for comm in (MPI.COMM_SELF, COMM):
        scene, domain = cell_of((4, 3), material=yields, comm=comm)
        errors.append(certified(scene, domain, AUGMENTED, degree).absolute)
    assert np.isclose(*errors, rtol=1e-6, atol=0.0)
