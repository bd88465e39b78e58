"""Solves on meshes that are split, joined, draped and read: constant stresses are exact, and what is tied is one body."""

from functools import cache
from itertools import product

import file_collection as files
import numpy as np
import pytest
from dolfinx import mesh as dmesh
from domains import COMM, partly_broad
from mpi4py import MPI
from scenes import certified
from test_domain import assert_closed, close, plate
from test_draped import SIDES, joined
from test_drawings import block_on_base, middle, write
from test_files import COLLAPSED, EXACT, SPLIT, collapsed, of_dolfinx
from test_joined import WIDER, least_angle
from test_named import area_of
from test_named import close as areas_are
from test_remesh import MESHES, around
from test_split import assert_paired, tagged
from test_two_bodies import LOWER, METHODS, UPPER, distance, patch, vector

import erc_contact as ec
from namedmesh.parts_table import NAMELESS

GRADIENT = 1e-3 * np.array([[-10.0, 1.0, 0.0], [1.0, -12.0, 0.5], [0.0, 0.5, -9.0]])


FORMS = [*SPLIT, *(f"collapsed {kind}" for kind in COLLAPSED), "coincident wedge"]
BROADER = [form for form in FORMS if form.split()[-1] in ("triangle", "tetra")]
BROADER += ["pyramid", "collapsed wedge"]


def brick(d, half, heights, cells, comm=COMM, **names):
    """A rectangle or box about x = 0 whose parts get other names."""
    low = (-half, *(-1.0,) * (d - 2), heights[0])
    high = (half, *(1.0,) * (d - 2), heights[1])
    make = ec.rectangle if d == 2 else ec.box
    kind = {"cells": cells} if isinstance(cells, tuple) else {"size": cells}
    body = make(low, high, comm=comm, **kind)
    parts = {names.get(name, name): tag for name, tag in body.names.items()}
    return ec.Domain(body.mesh, body.facet_tags, parts)


PATCHES = [
    *product(("slip",), (1.0,), (2,), (1, 2)),
    pytest.param("slip", 1.0, 3, 1, marks=pytest.mark.broad),
    *product(("stick",), (1.0,), (2, 3), (1,)),
    *product(("slip",), (WIDER,), (2, 3), (1,)),
]


STRIPS = {
    # what side 2 has beyond the upper body on each side, the edges of both, which one is
    # named first, and the most cells over the cells before
    "around": ((0.01, 0.01, 0.01, 0.01), (3, 4), 1, 10.0),
    "aside": ((-0.004, 0.004, 0.012, -0.012), (3, 2), -1, 22.0),
    "inside": ((-0.002, -0.03, -0.006, -0.012), (2, 4), 1, 14.0),
    "flush and not": ((0.0, 0.004, 0.02, -0.1), (3, 3), -1, 6.5),
    "nearly flush": ((0.0002, -0.0001, 0.0, 0.0002), (3, 4), 1, 3.5),
}


def write_disturbed(folder, form):
    """A file of the body with cells of a form, numbered at random, inner nodes moved."""
    import meshio

    kind = form.split()[-1]
    x, cells = files.arrays(kind, n=3)
    d = 2 if kind in ("triangle", "quad") else 3
    rng = np.random.default_rng(5)
    inside = np.all((x[:, :d] > 1e-9) & (x[:, :d] < np.array([2, 1, 1])[:d] - 1e-9), axis=1)
    inside &= abs(x[:, 0] - 1) > 1e-9
    x[inside, :d] += 0.04 * rng.uniform(-1, 1, (inside.sum(), d))
    order = rng.permutation(len(x))
    new = np.empty_like(x)
    new[order] = x
    blocks = []
    tags = []
    for name, (rows, tag) in cells.items():
        numbers = order[rows]
        shape = name
        if name == kind and form != kind:
            numbers = collapsed(kind, numbers)
            if form.startswith("coincident"):
                # The corners are there twice in the list of points.
                numbers[:, [3, 7]] += len(new)
            shape = "quad" if d == 2 else "hexahedron"
        blocks.append((shape, numbers))
        tags.append(tag)
    points = np.vstack([new, new]) if form.startswith("coincident") else new
    path = folder / "body.vtu"
    meshio.Mesh(points, blocks, cell_data={"tag": tags}).write(path)
    return path


def test_parts_inside_the_body_are_kept_but_carry_no_condition(gmsh_session):
    if gmsh_session:
        plate(gmsh_session)
    domain = ec.from_gmsh(gmsh_session.model if gmsh_session else None)
    with pytest.raises(ec.InputError, match="'interface' has facets inside the body"):
        domain.facets("interface")
    with pytest.raises(ec.InputError, match="inside the body"):
        domain.refined().tag("interface")
    held = ec.Displacement(domain.outer[0], (0.0, 0.0))
    assert ec.solve(ec.Scene(ec.Elastic(1.0, 0.3), held), domain).newton_steps == 0


@pytest.mark.broad
@pytest.mark.parametrize(
    "name", ["half ball in a socket", "quarter of a pin", "quarter of a pin in half a hub"]
)
def test_constant_stress_is_exact(name):
    """It presses everywhere, and its shear is less than the friction."""
    domain = joined(name, sides=SIDES[::-1])
    u = tuple(lambda x, row=row: row @ x for row in GRADIENT)
    supports = [ec.Displacement(part, u) for part in domain.outer if part not in SIDES]
    contact = ec.Contact("one side", against="two side", friction=0.6)
    solution = ec.solve(ec.Scene(ec.Elastic(1000.0, 0.3), supports, contacts=contact), domain)
    x = solution.u.function_space.tabulate_dof_coordinates()
    wanted = x @ GRADIENT.T
    assert abs(solution.u.x.array.reshape(-1, 3) - wanted).max() < 1e-9 * abs(wanted).max()
    error = ec.constitutive_error(ec.equilibrate(solution))
    assert error.relative < 1e-9
    force, opposite = (error.force(side) for side in SIDES)
    assert abs(force.force + opposite.force).max() < 1e-12 * abs(force.force).max()
    assert abs(force.moment + opposite.moment).max() < 1e-12 * abs(force.force).max()


@pytest.mark.broad
def test_contacts_and_ties_take_pairs_as_they_are(shared_tmp_path):
    def three(occ):
        block_on_base(occ)
        occ.addBox(1, 1, 2, 2, 2, 1)

    path = write(shared_tmp_path / "three.step", three, ["base", "block", "cap"])
    bodies = ec.read_mesh(path, size=1.5)
    heights = {name: middle(bodies, name)[2] for name in bodies.names if name.isdigit()}
    low, high = (pick(heights, key=heights.get) for pick in (min, max))
    bodies = ec.read_mesh(path, size=1.5, names={int(low): "below", int(high): "above"})
    tied = bodies.touching("cap")
    assert [tuple(pair) for pair in tied] == [("block on cap", "cap on block")]
    assert bodies.touching("c*", "block") == tied
    loose = [pair for pair in bodies.touching() if pair not in tied]
    scene = ec.Scene(
        ec.Elastic(1.0, 0.3),
        ec.Displacement("below", (0.0, 0.0, 0.0)),
        ec.Traction("above", (0.0, 0.0, -0.01)),
        contacts=[ec.Contact(*pair, friction=0.15) for pair in loose],
        ties=[ec.Tied(*pair) for pair in tied],
    )
    error = certified(scene, bodies)
    force = error.force("block on base").force
    assert np.allclose(force, (0.0, 0.0, 0.04), atol=1e-9)


@pytest.mark.on_ranks("quad", "hexahedron", "wedge", "collapsed pyramid", "coincident wedge")
@pytest.mark.parametrize("form", partly_broad(FORMS, BROADER))
def test_splitting_keeps_volumes_and_constant_stresses(form, shared_tmp_path, measures):
    path = COMM.bcast(write_disturbed(shared_tmp_path, form) if COMM.rank == 0 else None)
    names = {1: "foot", 2: "roof", 7: "left", 8: "right"}
    domain = ec.read_mesh(path, names=names)
    d = domain.dim
    for region in ("left", "right"):
        assert measures.region(domain, region) == pytest.approx(1.0, rel=EXACT)
    for part in ("foot", "roof"):
        assert measures.part(domain, part) == pytest.approx(2.0, rel=EXACT)
    # Pressed between a wall and the floor without lateral strain: a constant stress.
    press = ec.Displacement("roof", (0.0,) * (d - 1) + (-0.01,))
    scene = ec.Scene(ec.Elastic(1.0, 0.0), press, contacts=ec.Contact("foot", friction=0.3))
    error = certified(scene, domain)
    assert error.relative < 1e-9
    assert error.force("foot").force[d - 1] == pytest.approx(0.02, rel=1e-9)


@pytest.mark.ranks
@pytest.mark.parametrize("kind", ["quadrilateral", "hexahedron"])
def test_the_split_does_not_depend_on_the_ranks(kind):
    errors = []
    for comm in (COMM, MPI.COMM_SELF):
        domain = of_dolfinx(kind, comm)
        d = domain.dim
        press = ec.Displacement("roof", (0.0,) * (d - 1) + (-0.1,))
        scene = ec.Scene(ec.Elastic(1.0, 0.3), press, contacts=ec.Contact("foot"))
        errors.append(certified(scene, domain).relative)
    assert errors[0] == pytest.approx(errors[1], rel=1e-8)


def test_a_mesh_of_dolfinx_without_tags():
    mesh = dmesh.create_unit_cube(COMM, 3, 2, 2)
    plain = ec.Domain(mesh)
    assert plain.names == {}
    domain = plain.named({"foot": lambda x: np.isclose(x[2], 0.0)})
    areas_are(area_of(domain.refined()), foot=1.0, **{NAMELESS: 5.0})
    scene = ec.Scene(ec.Elastic(1.0, 0.3), [ec.Displacement("foot", (0.0, 0.0, 0.0))])
    assert ec.solve(scene, domain).u.x.array.max() == 0.0
    with pytest.raises(ec.InputError, match="'foot'; this domain has none"):
        ec.solve(scene, plain)


@pytest.mark.serial
def test_gap_acts_on_every_mesh_alike():
    """A half disc on a plane: its gap is the height of its own arc.

    The force stays but for the meshes' errors.
    """
    scene = ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.0, -0.05))],
        contacts=[ec.Contact("arc", gap=lambda x: x[1], normal=(0.0, -1.0))],
    )
    domain, forces, start = ec.read_mesh(MESHES / "half_disc.geo", scripts=True), [], None
    for step in range(0, 10, 2):
        domain = domain.remeshed(around(domain, (0.0, 0.0), 0.015, 0.05 + 0.02 * step))
        start = ec.solve(scene, domain, start=start)
        traction = ec.equilibrate(start).tractions[0]
        owned = traction.contact.facets[:, 0] < domain.owned_cells
        forces.append(
            COMM.allreduce(
                float((traction.area @ (owned[:, None] * traction.normal_component)).sum())
            )
        )
    assert np.ptp(forces) < 0.05 * abs(np.mean(forces)), forces


def layers(d, comm=COMM, half=1.0, tied=False):
    """Two bricks whose facets at height zero have the ratio 1 : 1.37, not nested."""
    cells = {2: ((8, 2), (11, 3)), 3: ((3, 2, 1), (4, 3, 1))}[d]
    upper = brick(d, 1.0, (0.0, 1.0), cells[0], comm, bottom="contact", top="outer")
    lower = brick(d, half, (-1.0, 0.0), cells[1], comm, top="contact", bottom="outer")
    return ec.assembly({"upper": upper, "lower": lower}).joined(UPPER, LOWER, tied=tied)


@cache
def small_layers(d, half=1.0):
    return layers(d, half=half)


@pytest.mark.pairs
@pytest.mark.on_ranks("slip-1.3-2-1", "stick-1.0-3-1")
@pytest.mark.parametrize(("name", "half", "d", "degree"), PATCHES)
def test_patch(name, half, d, degree):
    """Constant stresses are exact, also where the lower body is loaded beside the contact."""
    scene, exact = patch(name, d)
    domain = small_layers(d, half)
    loads = [*scene.loads]
    if half > 1:
        loads.append(ec.Traction(f"{LOWER} outside", vector(d, 3.0, -10.0)))
    scene = ec.Scene(scene.material, scene.supports, loads, scene.contacts)
    for method, solver in product(METHODS[::3], ("direct", "iterative")):
        solution = ec.solve(scene, domain, method, degree=degree, solver=solver)
        case = f"{method}, {solver}"
        assert distance(solution, exact) < 1e-9, case
        if solver == "direct":
            error = ec.constitutive_error(ec.equilibrate(solution))
            assert error.relative < 1e-9, case


def test_tied_is_one_body():
    """Tied sides that match are the mesh in one piece; those that do not are close to it."""
    material = ec.Elastic({"upper": 1000.0, "lower": 300.0}, 0.3)
    supports = [
        ec.Displacement("upper top", (0.02, -0.05)),
        ec.Displacement("lower bottom", (0.0, 0.0)),
    ]
    scene = ec.Scene(material, supports)
    whole = tagged(
        ec.rectangle((0, 0), (2, 2), cells=(8, 8)),
        lambda x: np.where(x[:, 1] > 1, 1, 2),
        {"upper": 1, "lower": 2},
    )
    names = {"upper top": whole.names["top"], "lower bottom": whole.names["bottom"]}
    whole = ec.Domain(whole.mesh, whole.facet_tags, names, whole.cell_tags, whole.regions)
    wanted = certified(scene, whole)
    lower = ec.rectangle((0, 0), (2, 1), cells=(8, 4))
    for cells, difference in (((8, 4), 1e-9), ((11, 5), 0.15)):
        upper = ec.rectangle((0, 1), (2, 2), cells=cells)
        both = ec.assembly({"upper": upper, "lower": lower})
        tied = both.joined("upper bottom", "lower top", tied=True)
        assert tied.pairs == ()
        assert "upper bottom/lower top" not in tied.outer
        error = certified(scene, tied)
        assert error.relative == pytest.approx(wanted.relative, rel=difference)
        force = error.force("lower bottom").force
        assert force == pytest.approx(wanted.force("lower bottom").force, rel=difference)


@pytest.mark.broad
@pytest.mark.on_ranks("aside")
@pytest.mark.parametrize("name", STRIPS)
def test_outlines_beside_each_other(name, measures):
    """A strip between them gets short edges: few cells, no splinters, bodies as they were."""
    (left, right, front, back), (fine, coarse), order, most_cells = STRIPS[name]
    cubes = ((0.0, 0.0, 0.0), (1.0, 1.0, 0.5)), ((-left, -front, -0.5), (1 + right, 1 + back, 0.0))
    cells = ((fine, fine, 2), (coarse, coarse, 2))
    upper, lower = (ec.box(*ends, cells=n) for ends, n in zip(cubes, cells, strict=True))
    both = ec.assembly({"upper": upper, "lower": lower})
    sides = ("upper bottom", "lower top")[::order]
    domain = both.joined(*sides)
    assert domain.cells < most_cells * both.cells
    assert least_angle(domain) > 2.5
    assert assert_paired(domain, *sides) > 0
    assert_closed(domain)
    is_flush = name == "nearly flush"
    if not is_flush:
        for region in both.regions:
            assert close(measures.region(domain, region), measures.region(both, region))
    area = np.prod([1 + min(right, 0) + min(left, 0), 1 + min(back, 0) + min(front, 0)])
    assert measures.part(domain, "upper bottom") == pytest.approx(
        area, rel=1e-3 if is_flush else 1e-9
    )
    supports = [
        ec.Displacement("upper top", (0.0, 0.0, -0.05)),
        ec.Displacement("lower bottom", (0.0, 0.0, 0.05)),
    ]
    outside = {"upper bottom outside": 0.1, "lower top outside": -0.1}
    loads = [
        ec.Traction(part, (0.0, 0.0, p)) for part, p in outside.items() if part in domain.names
    ]
    scene = ec.Scene(
        ec.Elastic(1.0, 0.0), supports, loads, [ec.Contact(sides[0], against=sides[1])]
    )
    error = certified(scene, domain, METHODS[3])
    assert error.relative < (1e-3 if is_flush else 1e-9)
