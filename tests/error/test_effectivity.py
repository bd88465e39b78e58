"""The error against the truth, element by element, on references that integrate everything exactly.

The reference lives on a mesh that cuts each cell as sigma^ does, and refines that: on
its cells u^ and sigma^ are polynomials. The augmented Lagrangian keeps the contact
conditions at its nodes exactly. For frictionless scenes whose data the mesh
represents exactly then

    e^2 = |u_ref - u^|^2 + |sigma_ref - sigma^|^2 + 2 int r^_n (u_ref,n - g) + 2 sum_i
    R_i (u^_n - g)_i,  R_i <= 0,

with no term below zero: not even the error of the reference can take the index of both
errors below 1.

- frictionless contact: e over both errors is 1 or more, to round-off, on a uniform mesh
  and those adapted from it;
- the bulk part of the tightened e is at most 1.3 times the true error of u^;
- eps_E ranks the elements of the block as the true errors do.
"""

from collections.abc import Iterator

import numpy as np
import pytest
from reference import TrueErrors, nested, true_errors
from scenes import block, opening, prototype_block, quadratic_contact

import erc_contact as ec

pytestmark = pytest.mark.serial
LEVELS = 2


def frictionless(scene: ec.Scene) -> ec.Scene:
    return ec.Scene(scene.material, scene.supports, scene.loads, [ec.Contact("bottom")])


def measured(
    scene: ec.Scene, domain: ec.Domain, meshes: int, *, levels: int = LEVELS, degree: int = 1
) -> Iterator[tuple[ec.ConstitutiveError, TrueErrors]]:
    """Errors, loose and tight, and true errors on an adaptive sequence.

    The reference may be of another degree.
    """
    for _ in range(meshes):
        solution = ec.solve(scene, domain)
        fine = ec.solve(scene, nested(domain, levels), ec.AugmentedLagrangian(), degree=degree)
        for tighten in (0, 10):
            error = ec.constitutive_error(ec.equilibrate(solution, tighten=tighten))
            true = true_errors(error.admissible, fine)
            print(
                domain.cells,
                tighten,
                error.bulk_error / true.displacement,
                error.absolute / true.both,
            )
            yield error, true
        domain = domain.refined(ec.mark(error))


CASES = {
    "block": (frictionless(prototype_block()), block(4), 2, {}),
    "opening block": (opening(0.0), block(4), 2, {}),
    "known": (
        quadratic_contact(),
        ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4)),
        2,
        {"levels": 0, "degree": 2},
    ),
}


@pytest.mark.broad
@pytest.mark.parametrize("name", CASES)
def test_both_errors_are_e(name):
    scene, domain, meshes, options = CASES[name]
    for error, true in measured(scene, domain, meshes, **options):
        assert 1 - 1e-9 <= error.absolute / true.both <= 1.05
        if error.admissible.tightening:
            assert 1.0 <= error.bulk_error / true.displacement <= 1.30


def rank_correlation(a: np.ndarray, b: np.ndarray) -> float:
    """Spearman's: the correlation of the ranks of two arrays."""
    return float(np.corrcoef(a.argsort().argsort(), b.argsort().argsort())[0, 1])


@pytest.mark.broad
def test_rank_correlation_on_the_block():
    for error, true in measured(prototype_block(), block(8), 2):
        assert rank_correlation(error.indicators, np.hypot(*true.of_cells)) > 0.9
        if error.admissible.tightening:
            assert rank_correlation(error.indicators, true.of_cells[0]) > 0.9
            assert 1.0 <= error.bulk_error / true.displacement <= 1.30
        assert abs(true.friction) < 0.02 * error.absolute**2
        assert 0.99 <= error.absolute / true.both <= 1.15


@pytest.mark.parametrize(
    "domain", [block(2), ec.box((0.0,) * 3, (1.0, 2.0, 1.0), cells=(2, 2, 2))], ids=["2D", "3D"]
)
def test_nested_meshes(domain, measures):
    """No cell is cut by the edge of a part of sigma^, volumes and boundary parts stay."""
    fine, d = nested(domain, 1), domain.dim
    assert fine.cells == domain.cells * (d + 1) * 2**d
    corners, points = measures.vertices(domain), measures.vertices(fine)
    inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    local = np.einsum("nij,mnqj->mnqi", inverse, points[:, None] - corners[:, :1])
    local = np.concatenate([1 - local.sum(axis=3, keepdims=True), local], axis=3)
    parent = local.mean(axis=2).min(axis=2).argmax(axis=1)
    local = local[np.arange(len(points)), parent]
    assert local.min() > -1e-12
    part = local.mean(axis=1).argmin(axis=1)
    assert np.all(local[np.arange(len(local)), :, part][..., None] <= local + 1e-12)
    volumes = np.bincount(parent, measures.simplices(points))
    assert np.allclose(volumes, measures.simplices(corners), rtol=1e-12)
    for name in domain.names:
        assert measures.part(fine, name) == pytest.approx(measures.part(domain, name), rel=1e-12)
