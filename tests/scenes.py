"""Scenes that several tests share, and what is measured of their results."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pytest
import ufl
from domains import two_materials
from mpi4py import MPI

import erc_contact as ec
from erc_contact.admissible.traction import ContactTraction

AUGMENTED = ec.AugmentedLagrangian()


def mostly_serial(cases: Iterable, on_ranks: Sequence, broad: Sequence = ()) -> list:
    """Parameters of a test: all of them in serial, some also on several ranks.

    Some are left to the broad suite.
    """

    def marked(case: object) -> object:
        marks = [] if case in on_ranks else [pytest.mark.serial]
        if case in broad:
            marks.append(pytest.mark.broad)
        return pytest.param(case, marks=marks)

    return [marked(case) for case in cases]


def certified(
    scene: ec.Scene,
    domain: ec.Domain,
    method: object = None,
    degree: int = 1,
    **options: object,
) -> ec.ConstitutiveError:
    """Solve a scene, and measure the error of an admissible pair."""
    solution = ec.solve(scene, domain, method, degree=degree, **options)
    return ec.constitutive_error(ec.equilibrate(solution))


def measured(
    scene: ec.Scene,
    domain: ec.Domain,
    method: object = AUGMENTED,
    degree: int = 1,
    **options: object,
) -> ec.ConstitutiveError:
    """The same by the augmented Lagrangian, whose forms know no modulus and no strain: few compile."""
    return certified(scene, domain, method, degree, **options)


def prototype_block() -> ec.Scene:
    """Pressed and sheared block, (0, 2) x (0, 7)."""
    return ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.02, -0.05))],
        contacts=[ec.Contact("bottom", friction=0.3)],
    )


def common_block() -> ec.Scene:
    """The block that several contact codes agree on, (0, 2) x (0, 7)."""
    return ec.Scene(
        material=ec.Elastic(E=1.0, nu=0.3),
        supports=[ec.Displacement("top", (0.1, -0.05))],
        loads=[ec.Traction("right", (-0.0002, 0.0))],
        contacts=[ec.Contact("bottom", friction=0.3)],
    )


def block(n: int, comm: MPI.Comm = MPI.COMM_WORLD) -> ec.Domain:
    """The 2 x 7 block with n squares across."""
    return ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(n, 7 * n // 2), comm=comm)


def flat_block(d: int, cells: int, comm: MPI.Comm = MPI.COMM_WORLD) -> ec.Domain:
    """The block (0, 2) x (0, 1), in 3D of depth 1, with so many cells in each unit of length."""
    make = ec.rectangle if d == 2 else ec.box
    numbers = (2 * cells, cells, cells)
    return make((0.0,) * d, (2.0, 1.0, 1.0)[:d], cells=numbers[:d], comm=comm)


def pressed(material: object, push: Sequence, **contact: object) -> ec.Scene:
    """A body whose top is moved by ``push``, on its foundation."""
    top = ec.Displacement("top", push)
    return ec.Scene(material, top, contacts=ec.Contact("bottom", **contact))


def greco(friction: float = 1.0) -> ec.Scene:
    """Compressed and pushed block (GRECO): N, mm; half model, (0, 40) x (0, 40)."""
    return ec.Scene(
        material=ec.Elastic(E=130e3, nu=0.2),
        supports=[ec.Displacement("right", (0.0, None))],
        loads=[ec.Traction("top", pressure=50.0), ec.Traction("left", pressure=150.0)],
        contacts=[ec.Contact("bottom", friction=friction)],
    )


def patch_test(friction: float, nu: float, E: float = 1.7) -> tuple[ec.Scene, np.ndarray]:
    """Friction patch test: u = (c + b y, e y) slips everywhere on y = 0.

    Returns the scene and (b, c, e).
    """
    lam, G = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    c, e = 0.03, -0.01
    b = -friction * (lam + 2 * G) * e / G
    sigma = np.array([[lam * e, G * b], [G * b, (lam + 2 * G) * e]])
    u = (lambda x: c + b * x[1], lambda x: e * x[1])
    scene = ec.Scene(
        material=ec.Elastic(E, nu),
        supports=[ec.Displacement("top", u)],
        loads=[ec.Traction("left", tuple(-sigma[:, 0])), ec.Traction("right", tuple(sigma[:, 0]))],
        contacts=[ec.Contact("bottom", friction=friction)],
    )
    return scene, np.array([b, c, e])


def quadratic_contact() -> ec.Scene:
    """Quadratic u on the unit square, closed and without shear at y = 0.

    Its tractions are linear.
    """
    material = ec.Elastic(E=1.0, nu=0.3)

    def stress(x):
        u = ufl.as_vector(
            [0.02 * x[0] + 0.03 * x[0] ** 2, (-0.1 - 0.02 * x[0] + 0.03 * x[1]) * x[1]]
        )
        return material.stress(ufl.sym(ufl.grad(u)), E=material.E, nu=material.nu)

    return ec.Scene(
        material=material,
        supports=[ec.Displacement("left", (0.0, None))],
        loads=[
            ec.Traction("left", (0.0, lambda x: -stress(x)[0, 1])),
            ec.Traction("right", lambda x: stress(x)[:, 0]),
            ec.Traction("top", lambda x: stress(x)[:, 1]),
            ec.BodyForce(lambda x: -ufl.div(stress(x))),
        ],
        contacts=[ec.Contact("bottom")],
    )


def opening(friction: object) -> ec.Scene:
    """The block tilted and pushed: it opens on the left, slips and sticks elsewhere."""
    return ec.Scene(
        material=ec.Elastic(1.0, 0.3),
        supports=[ec.Displacement("top", (0.1, lambda x: 0.02 - 0.04 * x[0]))],
        contacts=[ec.Contact("bottom", friction=friction)],
    )


def resultant(traction: ContactTraction) -> np.ndarray:
    """Integral of r^ over the contact, all ranks [force]."""
    domain_cells = traction.contact.facets[:, 0]
    mesh = traction.contact.ds.ufl_domain().ufl_cargo()
    owned = domain_cells < mesh.topology.index_map(mesh.topology.dim).size_local
    local = (traction.area[owned, None] * traction.values[owned].mean(axis=1)).sum(axis=0)
    return mesh.comm.allreduce(local, MPI.SUM)


def random_scene(seed: int, comm: MPI.Comm = MPI.COMM_WORLD) -> tuple[ec.Scene, ec.Domain]:
    """A random scene in 2D (even seeds) or 3D.

    Rollers, two materials, body force, pressure, friction, gap.
    """
    rng = np.random.default_rng(seed)
    d = 2 + seed % 2
    extent = rng.uniform(0.8, 1.5, d)
    domain = two_materials(extent, float(rng.uniform(0.25, 0.35)), comm)
    bottom, top, side = "bottom", "top", "right"
    last = d - 1
    slope = rng.uniform(-0.02, 0.02, d)
    push = [float(v) for v in rng.uniform(-0.03, 0.03, d)]
    push[last] = -float(rng.uniform(0.02, 0.06))
    friction = [0.0, 0.3, 1.0, lambda x: 0.2 + 0.5 * x[0]][seed // 2 % 4]
    gap = [0.0, lambda x: 0.02 * (x[0] - 0.5) ** 2, 0.004, lambda x: 0.01 * x[0] ** 2][
        (seed + seed // 4) % 4
    ]
    roller = tuple(0.0 if i == 0 else None for i in range(d))
    supports = [ec.Displacement("left", roller)] if seed % 3 == 0 else []
    if supports:
        push[0] = 0.0
    loads = [
        ec.Traction(side, pressure=lambda x: 0.01 * (1 + x[last])),
        ec.BodyForce(
            tuple(lambda x, k=k: float(slope[k]) * (1 + x[0] * x[last]) for k in range(d))
        ),
    ]
    scene = ec.Scene(
        material=ec.Elastic(
            E={"lower": 1.0, "upper": float(rng.uniform(2, 20))}, nu={"lower": 0.3, "upper": 0.1}
        ),
        supports=[*supports, ec.Displacement(top, tuple(push))],
        loads=loads,
        contacts=[ec.Contact(bottom, friction=friction, gap=gap)],
    )
    return scene, domain


def two_squares(
    comm: MPI.Comm = MPI.COMM_WORLD, *, cells: int = 4, apart: float = 3.0
) -> ec.Domain:
    """Two unit squares that do not touch, in one mesh.

    The parts are left1 ... top1 and left2 ... top2.
    """
    import basix.ufl
    from dolfinx import mesh as dmesh

    from namedmesh.partition import partitioner

    n = np.arange(cells + 1)
    x = np.stack(np.meshgrid(n / cells, n / cells, indexing="ij"), axis=2).reshape(-1, 2)
    corner = (n[:-1, None] * (cells + 1) + n[:-1]).ravel()
    square = np.column_stack([corner, corner + cells + 1, corner + 1, corner + cells + 2])
    triangles = np.concatenate([square[:, [0, 1, 3]], square[:, [0, 3, 2]]])
    x, triangles = (
        np.concatenate([x, x + np.array([apart, 0.0])]),
        np.concatenate([triangles, triangles + len(x)]),
    )
    if comm.rank > 0:
        x, triangles = x[:0], triangles[:0]
    element = ufl.Mesh(basix.ufl.element("Lagrange", "triangle", 1, shape=(2,)))
    mesh = dmesh.create_mesh(comm, triangles.astype(np.int64), element, x, partitioner(comm))
    names: dict[str, int] = {}
    facets, values = [], []
    for body, start in enumerate((0.0, apart), start=1):
        for name, axis, at in (
            ("left", 0, start),
            ("right", 0, start + 1),
            ("bottom", 1, 0.0),
            ("top", 1, 1.0),
        ):
            names[f"{name}{body}"] = len(names) + 1

            def there(x, axis=axis, at=at, start=start):
                return (
                    (abs(x[axis] - at) < 1e-9) & (x[0] > start - 1e-9) & (x[0] < start + 1 + 1e-9)
                )

            found = dmesh.locate_entities_boundary(mesh, 1, there)
            facets.append(found)
            values.append(np.full(len(found), len(names), dtype=np.int32))
    order = np.argsort(np.concatenate(facets))
    return ec.Domain(
        mesh,
        dmesh.meshtags(mesh, 1, np.concatenate(facets)[order], np.concatenate(values)[order]),
        names,
    )


def sliding_block(
    slide: float,
    d: int = 2,
    friction: object = 0.3,
    E: float = 210e9,
    size: float = 1.0,
    n: int = 2,
) -> tuple[ec.Scene, ec.Domain]:
    """A block under its own weight that only contact holds vertically, its top moved by ``slide`` times its height."""
    if d == 2:
        domain = ec.rectangle((0.0, 0.0), (3 * size, size), cells=(3 * n, n))
    else:
        domain = ec.box((0.0,) * 3, (2 * size, 2 * size, size), cells=(2 * n, 2 * n, n))
    along = (slide * size,) if d == 2 else (slide * size, 0.3 * slide * size)
    scene = ec.Scene(
        material=ec.Elastic(E, 0.3),
        supports=[ec.Displacement("top", (*along, None))],
        loads=[ec.BodyForce((*(0.0,) * (d - 1), -3.7e-7 * E / size))],
        contacts=[ec.Contact("bottom", friction=friction)],
    )
    return scene, domain


def moved_box(
    d: int, push: float, press: float, friction: object = 0.3, E: float = 1.0, size: float = 1.0
) -> tuple[ec.Scene, ec.Domain]:
    """A box on a foundation, its top moved along it by ``push`` and towards it by ``press``, over its size."""
    if d == 2:
        domain = ec.rectangle((0.0, 0.0), (size, 0.7 * size), cells=(4, 4))
    else:
        domain = ec.box((0.0,) * 3, (size, 0.8 * size, 0.7 * size), cells=(2, 2, 2))
    along = (push * size,) if d == 2 else (push * size, 0.4 * push * size)
    support = ec.Displacement("top", (*along, -press * size))
    return ec.Scene(
        ec.Elastic(E, 0.3), [support], [], [ec.Contact("bottom", friction=friction)]
    ), domain
