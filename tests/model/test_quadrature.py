"""Adaptive integrals: exact where the integrand is smooth, and honest where it is not.

- smooth integrands are integrated to the share asked for, and what is left unknown is
  above the true error;
- on segments jumps and kinks are resolved too, wherever they are; in triangles and
  tetrahedra jumps are told;
- data that jump from cell to cell are smooth; a rank without pieces takes part; the
  pieces fill their simplex.
"""

from itertools import pairwise

import numpy as np
import pytest
from mpi4py import MPI

from erc_contact.model.data.quadrature import (
    Cuts,
    bisect,
    cell_pieces,
    facet_pieces,
    first_pieces,
    integrate,
)

COMM = MPI.COMM_WORLD


def segments(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Segments of [0, 1]."""
    ends = np.linspace(0.0, 1.0, n + 1)[:, None]
    return np.stack([ends[:-1], ends[1:]], axis=1), np.full(n, 1 / n)


def simplex(d: int) -> tuple[np.ndarray, np.ndarray]:
    """The reference simplex of rank 0; nothing on other ranks."""
    vertices = np.vstack([np.zeros(d), np.eye(d)])[None]
    return (
        (vertices, np.array([1 / (1, 1, 2, 6)[d]]))
        if COMM.rank == 0
        else (vertices[:0], np.zeros(0))
    )


def total(values: np.ndarray) -> np.ndarray:
    return COMM.allreduce(values.sum(axis=0), MPI.SUM)


@pytest.mark.serial
@pytest.mark.parametrize("place", np.random.default_rng(1).uniform(0, 1, 20))
def test_on_segments_all_is_resolved(place):
    def f(of, at, x):
        return np.concatenate(
            [x < place, abs(x - place), np.exp(5 * x), np.exp(-(((x - place) / 0.01) ** 2))], axis=2
        )

    true = [place, (place**2 + (1 - place) ** 2) / 2, (np.exp(5) - 1) / 5]
    found = integrate(MPI.COMM_SELF, f, *segments(4), facet_pieces(1))
    assert found.resolved.all()
    error = abs(found.value.sum(axis=0)[:3] - true)
    assert (error <= found.bound.sum(axis=0)[:3] + 1e-15).all()
    assert (error <= 1e-8 * np.array(true)).all()


@pytest.mark.parametrize("d", [2, 3])
def test_smooth_in_cells(d):
    def f(of, at, x):
        return 1 / (1 + x[..., :1])

    found = integrate(COMM, f, *simplex(d), cell_pieces(d))
    # the simplex in slices of constant x
    t = (np.arange(1000000) + 0.5) / 1000000
    true = np.mean((1 - t) ** (d - 1) / (1 + t)) / (1, 1, 1, 2)[d]
    assert found.resolved.all()
    assert abs(total(found.value) - true) <= total(found.bound) + 1e-12
    assert total(found.bound) <= 1e-8 * true


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("place", [0.213, 0.4])
def test_jumps_in_cells_are_told(d, place):
    found = integrate(
        COMM, lambda of, at, x: 1.0 * (x[..., :1] > place), *simplex(d), cell_pieces(d)
    )
    true = (1 - place) ** d / (1, 1, 2, 6)[d]
    assert not found.resolved.any()
    assert abs(total(found.value) - true) <= total(found.bound)
    assert total(found.bound) <= 0.25 * true


@pytest.mark.serial
@pytest.mark.parametrize("d", [1, 2, 3])
def test_squares_of_quadratic_fields_need_no_bisection(d):
    """Degree 4: the points determine it, so that nothing is unknown of it."""
    rng = np.random.default_rng(d)
    calls = []

    def square(of, at, x):
        calls.append(len(of))
        monomials = np.concatenate([np.ones_like(x[..., :1]), x, x**2], axis=-1)
        return (monomials @ weights)[..., None] ** 2

    weights = rng.normal(size=2 * d + 1)
    vertices = np.vstack([np.zeros(d), np.eye(d)])[None]
    pieces = facet_pieces(1) if d == 1 else cell_pieces(d)
    found = integrate(MPI.COMM_SELF, square, vertices, np.ones(1), pieces)
    assert found.resolved.all()
    assert len(calls) == 1
    assert found.bound.sum() < 1e-13 * found.value.sum()


@pytest.mark.serial
def test_jumps_between_cells_are_smooth():
    vertices = np.array(
        [[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]]
    )
    found = integrate(
        MPI.COMM_SELF,
        lambda of, at, x: np.where(x.sum(axis=2, keepdims=True) < 1, 1.0, 100.0),
        vertices,
        np.array([0.5, 0.5]),
        cell_pieces(2),
    )
    assert found.resolved.all()
    assert found.value.ravel() == pytest.approx([0.5, 50.0], rel=1e-12)


@pytest.mark.serial
def test_few_pieces_are_bisected_at_a_peak():
    """What is unknown lies in a few pieces; what is left adds up to what is allowed."""
    places = np.linspace(0.0, 1.0, 5)
    triangles = []
    for left, right in pairwise(places):
        for low, high in pairwise(places):
            triangles += [[(left, low), (right, low), (right, high)]]
            triangles += [[(left, low), (right, high), (left, high)]]
    sizes = []

    def peak(of, at, x):
        sizes.append(len(of))
        return 1 / (0.01 + (x**2).sum(axis=2, keepdims=True))

    vertices, area = np.array(triangles), np.full(len(triangles), 1 / 32)
    arguments = peak, vertices, area, cell_pieces(2)
    found = integrate(MPI.COMM_SELF, *arguments, share=1e-6)
    assert found.resolved.all()
    # 1338 pieces where each piece may leave as much as any piece.
    assert sum(sizes) < 900
    exact = integrate(MPI.COMM_SELF, *arguments, share=1e-10).value.sum()
    assert abs(found.value.sum() - exact) <= found.bound.sum() <= 1e-6 * exact


@pytest.mark.serial
@pytest.mark.parametrize("d", [2, 3])
def test_points_end_a_search(d):
    """A jump takes as many points as it may, and its worst pieces first."""
    evaluated = []

    def jump(of, at, x):
        evaluated.append(x.shape[0] * x.shape[1])
        return 1.0 * (x[..., :1] > 0.213)

    true = (1 - 0.213) ** d / (1, 1, 2, 6)[d]
    vertices = np.vstack([np.zeros(d), np.eye(d)])[None]
    unknown = []
    for most in (0, 10_000, 100_000):
        evaluated.clear()
        arguments = jump, vertices, np.array([1 / (1, 1, 2, 6)[d]]), cell_pieces(d)
        found = integrate(MPI.COMM_SELF, *arguments, most=most)
        first = evaluated[0]
        assert sum(evaluated) <= max(most, first)
        assert sum(evaluated) >= 0.5 * most
        assert abs(found.value.sum() - true) <= found.bound.sum()
        unknown.append(found.bound.sum())
    assert unknown[1] < 0.7 * unknown[0]
    assert unknown[2] < 0.7 * unknown[1]


@pytest.mark.serial
def test_copies_of_simplices_change_no_piece():
    """What another rank owns is cut as it is there, and takes no points."""
    vertices, size = segments(6)

    def f(of, at, x):
        return np.stack([abs(np.sin(40 * x[..., 0])), np.cos(x[..., 0]), x[..., 0]], axis=-1)

    alone = integrate(MPI.COMM_SELF, f, vertices, size, facet_pieces(1), most=1500)
    rows = np.array([0, 1, 2, 3, 4, 5, 2, 4])
    copied = integrate(
        MPI.COMM_SELF,
        f,
        vertices[rows],
        size[rows],
        facet_pieces(1),
        owned=np.arange(8) < 6,
        most=1500,
    )
    assert not alone.resolved.all()
    assert np.array_equal(copied.value, alone.value[rows])
    assert np.array_equal(copied.bound, alone.bound[rows])


@pytest.mark.serial
def test_the_order_of_functions_changes_no_piece():
    """Moments of a vector are in the order of vertices, which ranks number."""
    vertices, size = segments(3)

    def moments(order):
        def f(of, at, x):
            load = np.concatenate([abs(np.sin(40 * x)), 1e-3 * abs(x - 0.4)], axis=-1)
            return (at[..., order, None] * load[:, :, None]).reshape(*x.shape[:2], 4)

        return integrate(MPI.COMM_SELF, f, vertices, size, facet_pieces(1), components=2, most=1000)

    one, other = moments([0, 1]), moments([1, 0])
    assert not one.resolved.all()
    assert other.value.reshape(3, 2, 2)[:, ::-1].ravel() == pytest.approx(one.value.ravel())
    assert other.bound == pytest.approx(one.bound)
    assert one.bound.shape == (3, 2)


def test_zero_and_noise_end():
    """What is zero is known, and a floor ends the bisection of noise."""
    rng = np.random.default_rng(0)
    found = integrate(COMM, lambda of, at, x: 0.0 * x[..., :1], *simplex(2), cell_pieces(2))
    assert found.resolved.all()
    assert not found.bound.any()
    calls = []

    def noise(of, at, x):
        calls.append(len(of))
        return 1e-20 * rng.standard_normal((*x.shape[:2], 1))

    found = integrate(MPI.COMM_SELF, noise, *segments(2), facet_pieces(1), floor=1e-15)
    assert found.resolved.all()
    assert len(calls) == 1


@pytest.mark.serial
def test_a_component_that_is_round_off_beside_others_needs_no_resolution():
    """A linear load along a side has 1e-16 of itself across, at random."""
    vertices, size = segments(8)
    evaluated = []

    def f(of, at, x):
        evaluated.append(len(of))
        noise = np.random.default_rng(0).normal(size=x.shape[:2])
        return np.stack([1.0 + x[..., 0], 1e-16 * noise], axis=-1)

    as_vector = integrate(COMM, f, vertices, size, facet_pieces(1), components=2)
    pieces = sum(evaluated)
    evaluated.clear()
    as_two = integrate(COMM, f, vertices, size, facet_pieces(1))
    assert as_vector.resolved.all()
    assert not as_two.resolved.all()
    assert sum(evaluated) > 100 * pieces
    assert abs(total(as_vector.value) - (1.5, 0.0)).max() < 1e-14


@pytest.mark.serial
@pytest.mark.parametrize("d", [2, 3])
def test_the_order_of_vertices_changes_nothing(d):
    """Simplices of squares and cubes have several longest edges.

    Which of them is cut must not depend on numbers.
    """
    rng = np.random.default_rng(4)
    vertices = np.vstack([np.zeros(d), np.tril(np.ones((d, d)))]) @ rng.permutation(np.eye(d))
    pieces, measure = cell_pieces(d), np.array([1 / (1, 1, 2, 6)[d]])
    found = []
    for _ in range(5):
        integral = integrate(
            MPI.COMM_SELF,
            lambda of, at, x: 1 / (0.1 + (x**2).sum(axis=-1, keepdims=True)),
            rng.permutation(vertices)[None],
            measure,
            pieces,
            share=1e-3,
        )
        assert integral.resolved.all()
        found.append(integral.value[0, 0])
    assert np.ptp(found) <= 1e-14 * found[0], found


@pytest.mark.serial
@pytest.mark.parametrize(
    "pieces", [facet_pieces(1), facet_pieces(2), cell_pieces(2), cell_pieces(3)]
)
def test_pieces_fill_the_simplex(pieces):
    count, P, _ = pieces.shape
    vertices = np.broadcast_to(np.vstack([np.zeros(P - 1), np.eye(P - 1)]), (count, P, P - 1))
    for corners in (pieces, bisect(pieces, vertices)):
        sizes = abs(np.linalg.det(corners))
        assert sizes.sum() == pytest.approx(1.0, rel=1e-12)
        assert sizes == pytest.approx(sizes[0], rel=1e-12)


@pytest.mark.serial
def test_kinks_at_vertices_cut_nothing():
    """Neither at the first vertex of a segment nor at its second one, up to round-off."""
    cuts = Cuts(np.zeros(5, dtype=int), np.array([0.0, 1e-12, 0.3, 1.0 - 1e-12, 1.0]))
    found = first_pieces(np.array([0]), np.eye(2)[None], cuts)
    assert found.share == pytest.approx([0.3, 0.7])
