"""Displacements of files in cells of any shape, carried to meshes that do not match.

- shape functions are 1 at their node and 0 at the others, sum to 1, and have the
  gradients that differences have; local coordinates invert the map of a cell;
- a displacement in the span of the cells comes back exactly at any points, with its
  gradient: linear on all shapes, quadratic where cells are of second order;
- bodies that touch or overlap keep their displacements apart; nodes outside get the
  nearest point, and are refused far outside; ranks change nothing.
"""

import numpy as np
import pytest
from mpi4py import MPI

import namedmesh as nm
from namedmesh.base.releases import cell_nodes
from namedmesh.field_on_mesh import FieldOnMesh
from namedmesh.files.displacements import displacement_of
from namedmesh.files.file_mesh import Block, FileMesh
from namedmesh.files.shape_functions import (
    CORNERS,
    WHOLE,
    ShapeFunctions,
    corner_functions,
    local_coordinates,
    middle_groups,
)

CASES = [(shape, 1) for shape in CORNERS] + [(shape, 2) for shape in CORNERS]
CASES += [(shape, 3) for shape in WHOLE]
"""Shapes of first order, of second order, and with nodes in their middles."""


def functions_of(shape, kind):
    corners = np.array(CORNERS[shape], dtype=float)
    if kind == 1:
        return corner_functions(shape)
    groups = middle_groups(shape, whole=kind == 3)
    middles = [corners[list(group)].mean(axis=0) for group in groups]
    return ShapeFunctions(shape, np.vstack([corners, middles]), 2)


@pytest.mark.serial
@pytest.mark.parametrize(("shape", "kind"), CASES)
def test_shape_functions(shape, kind):
    rng = np.random.default_rng(0)
    functions = functions_of(shape, kind)
    corners = np.array(CORNERS[shape], dtype=float)
    local = rng.dirichlet(np.ones(len(corners)), 20) @ corners
    assert abs(functions.at(functions.nodes) - np.eye(len(functions.nodes))).max() < 1e-13
    assert abs(functions.at(local).sum(axis=1) - 1).max() < 1e-13
    assert abs(functions.at(local) @ functions.nodes - local).max() < 1e-13
    gradients = functions.gradients(local)
    for axis in range(corners.shape[1]):
        step = 1e-6 * np.eye(corners.shape[1])[axis]
        slope = (functions.at(local + step) - functions.at(local - step)) / 2e-6
        assert abs(slope - gradients[..., axis]).max() < 1e-8


@pytest.mark.serial
@pytest.mark.parametrize("shape", CORNERS)
def test_local_coordinates_invert_the_map_of_a_cell(shape):
    rng = np.random.default_rng(1)
    reference = np.array(CORNERS[shape], dtype=float)
    corners = reference + 0.1 * rng.uniform(-1, 1, (20, *reference.shape))
    local = rng.dirichlet(np.ones(len(reference)), 20) @ reference
    x = np.einsum("nk,nki->ni", corner_functions(shape).at(local), corners)
    assert abs(local_coordinates(shape, corners, x) - local).max() < 1e-10


PIECES = {
    "triangle": [(0, 1, 2), (0, 2, 3)],
    "quadrilateral": [(0, 1, 2, 3)],
    "tetrahedron": [
        (0, 1, 3, 7),
        (0, 4, 1, 7),
        (1, 2, 3, 7),
        (1, 6, 2, 7),
        (1, 4, 5, 7),
        (1, 5, 6, 7),
    ],
    "hexahedron": [(0, 1, 2, 3, 4, 5, 6, 7)],
    "prism": [(0, 1, 3, 4, 5, 7), (1, 2, 3, 5, 6, 7)],
    "pyramid": [
        *((0, 1, 2, 3, 8), (4, 7, 6, 5, 8), (0, 4, 5, 1, 8)),
        *((1, 5, 6, 2, 8), (2, 6, 7, 3, 8), (3, 7, 4, 0, 8)),
    ],
}
"""Cells into which a square or a cube is divided; its middle is corner 8."""


def grid(shape, kind, u, low, high, n):
    """The mesh of a file: a box of n cells along each axis, with a displacement."""
    d = len(CORNERS[shape][0])
    lines = [np.linspace(low[i], high[i], n + 1) for i in range(d)]
    points = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, d)
    number = np.arange(len(points)).reshape((n + 1,) * d)
    box = np.array(CORNERS["quadrilateral" if d == 2 else "hexahedron"], dtype=int)
    first = np.stack(np.meshgrid(*[np.arange(n)] * d, indexing="ij"), axis=-1).reshape(-1, 1, d)
    corners = number[tuple(np.moveaxis(first + box, -1, 0))]
    middles = points[corners].mean(axis=1)
    corners = np.column_stack([corners, len(points) + np.arange(len(middles))])
    points = np.vstack([points, middles])
    cells = np.concatenate([corners[:, piece] for piece in PIECES[shape]])
    if kind > 1:
        groups = middle_groups(shape, whole=kind == 3)
        added = np.concatenate([points[cells[:, list(group)]].mean(axis=1) for group in groups])
        points = np.vstack([points, added])
        numbers = len(points) - len(added) + np.arange(len(added)).reshape(len(groups), -1)
        cells = np.hstack([cells, numbers.T])
    x = np.pad(points, ((0, 0), (0, 3 - d)))
    values = np.pad(u(points.T).T, ((0, 0), (0, 3 - d)))
    return FileMesh(x, (Block(shape, cells),), values={"U": values})


def together(*meshes):
    """Several bodies in one file."""
    begins = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
    blocks = []
    for mesh, begin in zip(meshes, begins, strict=False):
        blocks += [Block(block.shape, block.nodes + begin) for block in mesh.blocks]
    points = np.concatenate([mesh.points for mesh in meshes])
    values = np.concatenate([mesh.values["U"] for mesh in meshes])
    return FileMesh(points, tuple(blocks), values={"U": values})


def box_of(d, comm=MPI.COMM_WORLD):
    if d == 2:
        return nm.rectangle((0.0, 0.0), (1.0, 1.0), cells=(3, 5), comm=comm)
    return nm.box((0.0,) * 3, (1.0,) * 3, cells=(3, 2, 3), comm=comm)


@pytest.mark.on_ranks("hexahedron-2")
@pytest.mark.parametrize(("shape", "kind"), CASES)
def test_what_cells_span_comes_back_on_any_mesh(shape, kind):
    d = len(CORNERS[shape][0])
    rng = np.random.default_rng(2)
    linear = rng.standard_normal((d, d))
    quadratic = rng.standard_normal((d, d, d)) * (kind > 1)
    quadratic += quadratic.transpose(0, 2, 1)

    def u(x):
        return linear @ x + np.einsum("ijk,jn,kn->in", quadratic, x, x)

    field = displacement_of(grid(shape, kind, u, (0.0,) * d, (1.0,) * d, 2))
    assert field.degree == (1 if kind == 1 and shape in ("triangle", "tetrahedron") else 2)
    domain = box_of(d)
    on_mesh = FieldOnMesh(domain, field)
    corners = domain.mesh.geometry.x[cell_nodes(domain.mesh.geometry), :d]
    shares = rng.dirichlet(np.ones(d + 1), 6)
    x = np.matmul(shares, corners)
    cells = np.arange(len(corners))
    values, gradients = on_mesh.in_cells(cells, x)
    exact = u(x.reshape(-1, d).T).T.reshape(x.shape)
    slopes = linear + 2 * np.einsum("ijk,nqk->nqij", quadratic, x)
    # Points are moved into their cells by a millionth.
    assert abs(values - exact).max() < 1e-5 * abs(exact).max()
    assert abs(gradients - slopes).max() < 1e-5 * abs(slopes).max()
    nodes = domain.mesh.geometry.x[:, :d]
    at_nodes = on_mesh.at_nodes(cell_nodes(domain.mesh.geometry), nodes)
    assert abs(at_nodes - u(nodes.T).T).max() < 1e-12


def test_bodies_that_overlap_keep_their_displacements():
    """The upper box reaches into the lower one in the file, as a press fit does."""
    lower = grid("quadrilateral", 2, lambda x: 0 * x + 1.0, (0.0, 0.0), (1.0, 0.51), 3)
    upper = grid("triangle", 1, lambda x: 0 * x - 1.0, (0.0, 0.5), (1.0, 1.0), 2)
    field = displacement_of(together(lower, upper))
    below = nm.rectangle((0.0, 0.0), (1.0, 0.5), cells=(4, 2))
    above = nm.rectangle((0.0, 0.5), (1.0, 1.0), cells=(5, 2))
    domain = nm.assembly({"below": below, "above": above})
    geometry = domain.mesh.geometry
    u = FieldOnMesh(domain, field).at_nodes(cell_nodes(geometry), geometry.x[:, :2])
    of_cells = u[cell_nodes(geometry)]
    is_below = domain.region_tags == domain.regions["below"]
    assert abs(of_cells[is_below] - 1.0).max(initial=0.0) < 1e-12
    assert abs(of_cells[~is_below] + 1.0).max(initial=0.0) < 1e-12


def test_nodes_outside_have_the_nearest_point():
    field = displacement_of(grid("hexahedron", 1, lambda x: x, (0.0,) * 3, (1.0, 1.0, 0.99), 2))
    domain = box_of(3)
    geometry = domain.mesh.geometry
    u = FieldOnMesh(domain, field).at_nodes(cell_nodes(geometry), geometry.x)
    assert abs(u - np.minimum(geometry.x, [1.0, 1.0, 0.99])).max() < 1e-12
    with pytest.raises(nm.InputError, match="in 3D, and the mesh is in 2D"):
        FieldOnMesh(box_of(2), field)
    small = displacement_of(grid("hexahedron", 1, lambda x: x, (0.0,) * 3, (1.0, 1.0, 0.5), 2))
    with pytest.raises(nm.InputError, match="outside of the bodies of the file, the first"):
        FieldOnMesh(domain, small).at_nodes(cell_nodes(geometry), geometry.x)
