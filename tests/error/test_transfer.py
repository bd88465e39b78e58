"""Results of other cells than those of the mesh: their own error, and its causes.

- ``e_v + e_T`` bounds the distance of the displacement in the file to the solution,
  for any displacement that keeps supports and gaps at its nodes, in any cells;
- without contacts there is no cost of the transfer; what is linear or lives on the
  mesh costs nothing; the cost is below a tenth of the error, by a finer mesh at contacts;
- the squares of the causes sum to e^2; ranks change nothing.
"""

import numpy as np
import pytest
from mpi4py import MPI
from scenes import block, prototype_block
from test_fields_in_cells import grid

import erc_contact as ec
from erc_contact.error.transfer import transfer_squares
from namedmesh.field_on_mesh import FieldOnMesh
from namedmesh.files.displacements import displacement_of

SCENE = prototype_block()
TIED = ec.Scene(
    ec.Elastic(1.0, 0.3),
    [ec.Displacement("top", (0.02, -0.05)), ec.Displacement("bottom", (0.0, 0.0))],
)
SCENES = {"contact": SCENE, "supports": TIED}


def field_of(shape, kind, n, reference, scale=0.0):
    """A displacement in n x n cells: the reference at their nodes, and a disturbance.

    The disturbance is zero on the supports, and lifts the block off its foundation.
    """

    def u(x):
        at = reference.at(x.T).displacement.T
        waves = np.sin(np.outer([5.0, 3.0], x[0]) + np.array([[1.0], [2.0]])) + 1.5
        return at + scale * waves * np.array([[0.0], [1.0]]) * (7.0 - x[1]) * x[1]

    return displacement_of(grid(shape, kind, u, (0.0, 0.0), (2.0, 7.0), n))


@pytest.fixture(scope="module", params=SCENES)
def reference(request):
    """The scene, and its solution on a fine mesh with the error of it."""
    scene = SCENES[request.param]
    fine = ec.constitutive_error(ec.equilibrate(ec.solve(scene, block(12), degree=2)))
    return scene, fine


CELLS = [("quadrilateral", 1), ("quadrilateral", 2), ("quadrilateral", 3), ("triangle", 2)]


@pytest.mark.serial
@pytest.mark.parametrize("scale", [0.0, 1e-3])
@pytest.mark.parametrize(("shape", "kind"), CELLS)
def test_the_bound_holds_in_the_cells_of_the_file(shape, kind, scale, reference):
    scene, fine = reference
    field = field_of(shape, kind, 3, fine, scale)
    certificate = ec.certify(scene, block(2), field)
    assert certificate.interpolated
    assert certificate.transfer <= 0.1 * certificate.absolute
    if scene is TIED:
        assert certificate.transfer == 0.0
    causes = np.array(list(certificate.causes.values()))
    assert np.linalg.norm(causes) == pytest.approx(certificate.absolute, rel=1e-9)
    # The distance of both displacements, where the fine one stands for the solution.
    on_fine = FieldOnMesh(fine.domain, field)
    _, squares = transfer_squares(fine.model, fine.solution.u, on_fine)
    true = np.sqrt(squares.sum())
    assert true <= certificate.absolute + certificate.transfer + fine.absolute
    assert certificate.absolute < 4 * true


@pytest.mark.parametrize("shape", ["quadrilateral", "triangle"])
def test_what_is_linear_costs_nothing(shape):
    stretched = ec.Scene(
        ec.Elastic(1.0, 0.0),
        [ec.Displacement("top", (0.0, -0.07)), ec.Displacement("bottom", (0.0, 0.0))],
    )

    def u(x):
        return np.array([0.0 * x[0], -0.01 * x[1]])

    field = displacement_of(grid(shape, 1, u, (0.0, 0.0), (2.0, 7.0), 3))
    certificate = ec.certify(stretched, block(2), field)
    assert certificate.transfer == 0.0
    assert certificate.relative < 1e-9


def test_ranks_change_nothing():
    def u(x):
        return np.array([0.02 * (x[1] / 7) ** 2, -0.05 * x[1] / 7 - 0.001 * x[0] * (7 - x[1])])

    field = displacement_of(grid("quadrilateral", 2, u, (0.0, 0.0), (2.0, 7.0), 3))
    certificates = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        domain = ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(2, 7), comm=comm)
        certificates.append(ec.certify(SCENE, domain, field))
    alone, together = certificates
    assert together.error.domain.cells == alone.error.domain.cells
    assert together.absolute == pytest.approx(alone.absolute, rel=1e-7)
    assert together.transfer == pytest.approx(alone.transfer, rel=1e-6)
    assert together.lift == pytest.approx(alone.lift, rel=1e-6)
