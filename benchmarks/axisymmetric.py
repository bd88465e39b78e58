"""Attack axisymmetric pairs with random bodies of revolution.

One to three bodies in a stack, with the axis or with a hole, whose outer radius is a
random line: cylinders, cones with their tip on the axis, balls as polygons. Moduli
differ by up to 1e4, Poisson's ratio is from -0.7 to 0.4999. They rest on a foundation
or hang on a support, are pressed, heated, spun and pulled, with and without gap,
interference, springs and friction; degrees 1 and 2, both methods and solvers.

Each pair is compared with the solution of degree 2 on a nested mesh, three refinements
finer:

- index: e over the energy norm of the error of u^;
- both: e over the norm of the errors of u^ and sigma^, without friction or with Tresca
  friction; it may be below 1 by what the reference lacks;
- own: what is missing in equilibrium at random points, by differences with numpy alone:
  axial forces, the definition of the hoop stress, jumps, cone, stresses on the axis;
- apart: proved intervals of the energy of both meshes that do not meet; none may.

    OMP_NUM_THREADS=1 python benchmarks/axisymmetric.py [seed] [count]
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from mpi4py import MPI

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from axisymmetric_evaluation import UNBALANCED, own_imbalance
from scipy.spatial import cKDTree  # type: ignore[import-untyped]

from erc_contact.admissible.elastic import CellStrains
from erc_contact.admissible.macro import macro_values
from erc_contact.admissible.pair import Admissible
from erc_contact.model.law.constitution import act
from namedmesh.gmsh_session import session
from namedmesh.simplex import barycentric, rule

LEVELS = 3
"""Refinements of the mesh of the reference."""
LEAST = 0.97
"""e over both errors below which a scene is told [-]; references are not exact."""
POINT_DEGREE = 6
"""Degree of the rule on the cells of the reference."""


@dataclass(frozen=True)
class Case:
    """Hold a random scene of bodies of revolution.

    Attributes:
        name: The scene in words.
        scene: The scene.
        domain: Its half plane.
        degree: Degree of the displacement.
        options: Arguments of the solver.
    """

    name: str
    scene: ec.Scene
    domain: ec.Domain
    degree: int
    options: dict[str, Any]


@dataclass(frozen=True)
class Found:
    """Hold what a pair gave against its reference.

    Attributes:
        eps: Relative error.
        index: e over the error of u^.
        both: e over both errors; nan with friction that depends on the pressure.
        own: What is missing in equilibrium over the greatest stress [-].
        apart: Whether proved intervals of the energy do not meet.
    """

    eps: float
    index: float
    both: float
    own: float
    apart: bool


def random_case(rng: np.random.Generator, comm: MPI.Comm = MPI.COMM_WORLD) -> Case:
    """Return a random scene; collective."""
    bodies = int(rng.integers(1, 4))
    has_axis = bool(rng.random() < 0.6)
    inner = 0.0 if has_axis else float(rng.uniform(0.05, 2.0))
    wide = float(rng.uniform(0.5, 1.5))
    levels = np.cumsum([0.0, *rng.uniform(0.3, 1.0, bodies)])
    outer = inner + wide * rng.uniform(0.5, 1.0, bodies + 1)
    has_tip = bool(has_axis and rng.random() < 0.2)
    size = 0.5 * wide * float(rng.uniform(0.5, 1.0))
    domain = stack(comm, inner, outer, levels, size, has_tip=has_tip)
    names = [f"body {i}" for i in range(bodies)]
    E = {name: 1000.0 * 10.0 ** float(rng.uniform(-2, 2)) for name in names}
    nu = float(rng.choice([-0.7, 0.0, 0.3, 0.3, 0.45, 0.4999]))
    friction = rng.choice(["none", "Tresca", "Coulomb"], p=[0.4, 0.4, 0.2])
    softest = min(E.values())
    push = softest * 1e-3
    laws: dict[str, Any] = {"none": 0.0, "Coulomb": 0.3, "Tresca": ec.Tresca(0.3 * push)}
    law = laws[str(friction)]
    gaps: list[Any] = [0.0, lambda x: 2e-4 * x[0] ** 2, -1e-4]
    gap = gaps[int(rng.integers(3))]
    contacts = [ec.Contact("foot", friction=law, gap=gap if not has_tip else 0.0)]
    for lower in range(bodies - 1):
        contacts.append(ec.Contact(f"top {lower}", against=f"foot {lower + 1}", friction=law))
    springs = []
    supports = []
    loads: list[Any] = [ec.BodyForce((0.0, -0.2 * push))]
    if has_tip:
        # The tip presses on nothing: the side is loaded.
        loads.append(ec.Traction("side", pressure=push))
    elif rng.random() < 0.5:
        supports.append(ec.Displacement("head", (None, -1e-3 * float(rng.uniform(0.5, 1.0)))))
    else:
        loads.append(ec.Traction("head", (0.0, -push)))
        if rng.random() < 0.5:
            springs.append(ec.Spring("head", normal=softest * float(rng.uniform(0.1, 10.0))))
    if rng.random() < 0.3:
        loads.append(ec.BodyForce((lambda x: push * x[0], 0.0)))
    strains = []
    if rng.random() < 0.3:
        strains.append(ec.ThermalStrain(1e-4, lambda x: 1.0 + x[0]))
    scene = ec.Scene(
        ec.Elastic(E, nu, hypothesis="axisymmetric"),
        supports=supports,
        loads=loads,
        contacts=contacts,
        strains=strains,
        springs=springs,
    )
    degree = int(rng.integers(1, 3))
    method = [ec.Nitsche(), ec.AugmentedLagrangian()][int(rng.integers(2))]
    solver = str(rng.choice(["direct", "iterative"]))
    what = "with a tip" if has_tip else "with the axis" if has_axis else "with a hole"
    name = (
        f"{bodies} bodies {what}, degree {degree}, nu {nu:g}, {friction}, "
        f"{type(method).__name__}, {solver}, {len(springs)} springs, {len(strains)} strains"
    )
    return Case(name, scene, domain, degree, {"method": method, "solver": solver})


def stack(
    comm: MPI.Comm,
    inner: float,
    outer: np.ndarray,
    levels: np.ndarray,
    size: float,
    *,
    has_tip: bool = False,
) -> ec.Domain:
    """Mesh a stack of bodies of revolution with given radii at levels of z; collective.

    Its parts are "foot", "head", "side", "bore" without an axis, and "top i" and
    "foot i+1" between bodies.
    """
    count = len(levels) - 1

    def build(gmsh: Any) -> None:
        occ = gmsh.model.occ
        rows = []
        for z, r in zip(levels, outer, strict=True):
            is_tip = has_tip and z == levels[-1]
            ends = [occ.addPoint(inner, z, 0.0)]
            if not is_tip:
                ends.append(occ.addPoint(r, z, 0.0))
            rows.append(ends)
        lines = [occ.addLine(*ends) if len(ends) == 2 else None for ends in rows]
        named = {"foot": [lines[0]], "side": [], "bore": []}
        if lines[-1] is not None:
            named["head"] = [lines[-1]]
        named |= {f"z{i}": [lines[i]] for i in range(1, count)}
        faces = []
        for below, above, (bottom, top) in zip(rows[:-1], rows[1:], pairwise(lines), strict=True):
            named["side"].append(occ.addLine(below[1], above[-1]))
            named["bore"].append(occ.addLine(below[0], above[0]))
            around = (bottom, named["side"][-1], top, named["bore"][-1])
            loop = [line for line in around if line is not None]
            faces.append(occ.addPlaneSurface([occ.addCurveLoop(loop)]))
        occ.synchronize()
        for i, face in enumerate(faces):
            gmsh.model.addPhysicalGroup(2, [face], name=f"body {i}")
        if inner == 0.0:
            del named["bore"]
        for name, curves in named.items():
            gmsh.model.addPhysicalGroup(1, curves, name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.option.setNumber("Mesh.MeshSizeMin", size)

    with session(comm, build, "The stack") as model:
        domain = ec.from_gmsh(model, comm)
    for i in range(1, count):
        sides = {f"top {i - 1}": f"body {i - 1}", f"foot {i}": f"body {i}"}
        domain = domain.split(sides, on=f"z{i}")
    return domain


def errors(pair: Admissible, fine: ec.Solution) -> tuple[float, float]:
    """Return the energy norms of the errors of u^ and of sigma^, on one rank.

    The mesh of the fine solution refines the mesh of the pair.
    """
    model = fine.model
    fine_pair = ec.equilibrate(fine, tighten=0)
    cells, coarse = fine_pair.cell_geometry, pair.cell_geometry
    points, weights = rule(2, POINT_DEGREE)
    corners = model.space.V.tabulate_dof_coordinates()[:, :2][cells.vertices]
    n = len(corners)
    places = np.broadcast_to(barycentric(points), (n, len(points), 3))
    x = np.matmul(places, corners)
    parent = parents(pair, corners.mean(axis=1))
    origin = pair.model.space.V.tabulate_dof_coordinates()[coarse.vertices[parent, 0], :2]
    local = np.matmul(x - origin[:, None], coarse.inverse[parent].swapaxes(1, 2))
    there = np.concatenate([1 - local.sum(axis=-1, keepdims=True), local], axis=-1)
    numbers = np.arange(n)
    exact = CellStrains.of(model.space, cells, fine.u).at(numbers, places, x)
    strain = CellStrains.of(pair.model.space, coarse, pair.displacement).at(parent, there, x)
    stress = sigma_at(pair, parent, there, x)
    law = model.constitution
    volume = cells.volume[:, None] * weights
    squares = []
    of_u = exact - strain
    squares.append((act(law.stiffness(x, numbers), of_u) * of_u).sum(axis=-1))
    of_stress = law.stress(exact, x, numbers) - stress
    squares.append((act(law.metric(x, numbers), of_stress) * of_stress).sum(axis=-1))
    of_u_2, of_stress_2 = (float((volume * square).sum()) for square in squares)
    return float(np.sqrt(of_u_2)), float(np.sqrt(of_stress_2))


def sigma_at(pair: Admissible, cell: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Evaluate sigma^ with its hoop component at points of cells, (n, q, 4)."""
    k = pair.model.space.degree
    sigma = np.empty((*x.shape[:2], 4))
    # Each point may be in another piece of its cell.
    for q in range(x.shape[1]):
        sigma[:, q] = macro_values(pair.stress, k, cell, places[:, q : q + 1])[:, 0]
    return pair.model.hoop_load.plus(sigma, x, cell)


def parents(pair: Admissible, middles: np.ndarray) -> np.ndarray:
    """Return the cell of the pair that holds each point, (n,)."""
    model, coarse = pair.model, pair.cell_geometry
    corners = model.space.V.tabulate_dof_coordinates()[:, :2][coarse.vertices]
    centres = cKDTree(corners.mean(axis=1))
    _, near = centres.query(middles, k=min(12, len(corners)))
    near = near.reshape(len(middles), -1)
    local = np.einsum("nkij,nkj->nki", coarse.inverse[near], middles[:, None] - corners[near, 0])
    least = np.minimum(local.min(axis=2), 1 - local.sum(axis=2))
    best = least.argmax(axis=1)
    assert least.max(axis=1).min() > -1e-9
    return near[np.arange(len(middles)), best]


def compared(case: Case) -> Found:
    """Compare a pair with its reference, on one rank."""
    solution = ec.solve(case.scene, case.domain, degree=case.degree, **case.options)
    error = ec.constitutive_error(ec.equilibrate(solution))
    pair = error.admissible
    domain = case.domain
    for _ in range(LEVELS):
        domain = domain.refined()
    fine = ec.solve(case.scene, domain, degree=2)
    of_u, of_stress = errors(pair, fine)
    both = np.hypot(of_u, of_stress)
    is_given = all(
        contact.law is None or isinstance(contact.law, ec.Tresca) for contact in case.scene.contacts
    )
    bounds = ec.potential_energy(error)
    exact = ec.potential_energy(ec.constitutive_error(ec.equilibrate(fine)))
    is_proved = bounds.guaranteed and exact.guaranteed
    apart = is_proved and (bounds.low > exact.high or exact.low > bounds.high)
    own = own_imbalance(pair, np.random.default_rng(0))
    index = error.absolute / of_u
    return Found(error.relative, index, error.absolute / both if is_given else np.nan, own, apart)


def main(seed: int = 0, count: int = 50) -> None:
    """Print what random scenes gave."""
    found: list[Found] = []
    endings: Counter[str] = Counter()
    for number in range(count):
        case = random_case(np.random.default_rng([seed, number]))
        try:
            result = compared(case)
        except ec.ErcContactError as reason:
            endings[type(reason).__name__] += 1
            print(f"{number}: {case.name}: {type(reason).__name__}: {str(reason)[:150]}")
            continue
        endings["pair"] += 1
        found.append(result)
        if result.apart or result.own > UNBALANCED or result.both < LEAST:
            print(f"{number}: {case.name}: {result}")
    print(f"seed {seed}: {dict(endings)}, apart {sum(r.apart for r in found)}")
    print(f"own evaluation: at most {max(r.own for r in found):.1e}")
    for name in ("eps", "index", "both"):
        values = np.array([getattr(r, name) for r in found])
        values = values[~np.isnan(values)]
        quantiles = np.quantile(values, [0.0, 0.05, 0.5, 0.95, 1.0])
        print(f"{name} ({len(values)}): least, 5%, median, 95%, most", quantiles.round(3))


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:]))
