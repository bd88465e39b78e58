"""The error against the truth, element by element, on references that integrate everything exactly.

- frictionless contact: e over both errors is 1 or more, to round-off, on a uniform mesh and those adapted from it;
- the bulk part of the tightened e is at most 1.3 times the true error of u^;
- eps_E ranks the elements of the block as the true errors do.
"""

import numpy as np
import pytest
from effectivity import CASES, Row, measured
from true_errors import nested, rank_correlation

import erc_contact as ec

pytestmark = pytest.mark.serial


def rows_of(name: str, start: ec.Domain, meshes: int) -> list[Row]:
    """Loose and tight rows on an adaptive sequence."""
    rows, domain = [], start
    for _ in range(meshes):
        new, error = measured(name, 1, "adaptive", domain)
        rows += new
        domain = domain.refined(ec.mark(error))
    print("", *rows, sep="\n")
    return rows


@pytest.mark.parametrize(
    ("name", "meshes"), [("block, frictionless", 3), ("opening block, frictionless", 2), ("manufactured", 4)]
)
def test_both_errors_are_e(name, meshes):
    for row in rows_of(name, CASES[name].meshes[0](), meshes):
        assert 1 - 1e-9 <= row.both <= 1.05
        assert row.fine_cells >= 3 * row.cells
        if row.tighten:
            assert 1.0 <= row.bulk_index <= 1.30


def test_rank_correlation_on_the_block():
    for row in rows_of("block, friction 0.3", CASES["block, friction 0.3"].meshes[1](), 2):
        assert row.rank_both > 0.9
        if row.tighten:
            assert row.rank_u > 0.9
            assert 1.0 <= row.bulk_index <= 1.30
        assert abs(row.third) < 0.02
        assert 0.99 <= row.both <= 1.15


@pytest.mark.parametrize("levels", [0, 2])
@pytest.mark.parametrize("make", [CASES["block, frictionless"].meshes[0], CASES["cube, frictionless"].meshes[0]])
def test_nested_meshes(make, levels, measures):
    """Cells lie in the cell they name, in one of its parts, and boundary parts keep their names."""
    domain = make()
    fine, d = nested(domain, levels), domain.dim
    parent = fine.cell_tags.values
    assert fine.cells == domain.cells * (d + 1) * 2 ** (d * levels)
    assert np.array_equal(fine.cell_tags.indices, np.arange(fine.cells))
    corners = measures.vertices(domain)[parent]
    volumes = np.bincount(parent, measures.simplices(measures.vertices(fine)))
    assert np.allclose(volumes, measures.simplices(measures.vertices(domain)), rtol=1e-12)
    inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    local = np.einsum("nij,nqj->nqi", inverse, measures.vertices(fine) - corners[:, :1])
    local = np.concatenate([1 - local.sum(axis=2, keepdims=True), local], axis=2)
    assert local.min() > -1e-12
    k = local.mean(axis=1).argmin(axis=1)
    own = np.take_along_axis(local, k[:, None, None], axis=2)
    assert np.all(own <= local + 1e-12)  # no cell is cut by the edge of a part
    for name in domain.names:
        assert measures.part(fine, name) == pytest.approx(measures.part(domain, name), rel=1e-12)


def test_rank_correlation_of_ranks():
    a = np.array([0.3, 1.0, 2.5, 7.0])
    assert rank_correlation(a, a**3) == pytest.approx(1.0)
    assert rank_correlation(a, -a) == pytest.approx(-1.0)
