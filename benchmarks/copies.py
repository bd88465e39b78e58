"""Bound the energies of random periodic and cyclic bodies, and evaluate them anew.

A case is one of

- cell: a cell whose modulus varies, or a cell with a hole, under a random mean strain,
  mean stress, or both of them, component by component;
- wave: a wavy surface pressed on a plane without friction or with Tresca's, its crest
  anywhere, whose sides are kept apart, strained or without a force;
- sector: a sector of a bladed disc under rotation;
- fit: a sector of a frictionless press fit near opening;
- wedge: a sector of a full disc or cylinder, of 2 to 6 sectors, whose sides meet on the
  axis: under rotation and pressure, or pressed into a ring with Tresca's friction, with
  a torque.

The intervals of the energy on a coarse mesh, of degree 1 and 2, must contain the energy
of degree 2 on a mesh that is refined twice, in 3D once, up to its own error; and u^
must fit across the sides. The energy of u^ is evaluated anew, by forms of DOLFINx from
the fields alone, and the index is e over the error of u^. Each sector is compared with
the whole disc, on a mesh of its own, and each wedge with the body whose mesh is its
copies.

    OMP_NUM_THREADS=1 python benchmarks/copies.py [cases] [seed]
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
import ufl  # isort: skip
from dolfinx import fem  # isort: skip
from full_sectors import all_sectors, full_sector  # isort: skip
from reference_copies import bladed, perforated_cell, sector_of_fit  # isort: skip

E, NU = 1.0, 0.3
SIDES = (("left", "right"), ("bottom", "top"))
FLAT = np.pi * 0.01 * E / (1 - NU**2)
"""Pressure that flattens a wave of the height 0.01 and the length 1 [force/area]."""
EXACT = 1e-6
"""Relative error below which a solution is exact, and has no index [-]."""
SAME = 1e-9
"""Difference of energies that counts as none, over the energy [-]."""


@dataclass(frozen=True)
class Case:
    """Hold a random scene.

    Attributes:
        kind: Its name in the table.
        scene: The scene.
        domain: Its coarse mesh.
        tresca: A part with Tresca friction, and its bound [force/area]; None without.
        whole: The whole body, whose energy is ``sectors`` times the energy; None where
            it is not compared.
        sectors: Number of sectors.
        is_of_copies: Whether the mesh of the whole body is the copies of the mesh.
    """

    kind: str
    scene: ec.Scene
    domain: ec.Domain
    tresca: tuple[str, float] | None = None
    whole: ec.Domain | None = None
    sectors: int = 1
    is_of_copies: bool = False


def cell(rng: np.random.Generator) -> Case:
    """Return a cell under a random mean strain and mean stress."""
    mean = rng.normal(size=(2, 2)) * 0.01
    mean += mean.T
    stressed = rng.random((2, 2)) < rng.choice([0.0, 0.5, 1.0])
    stressed = np.triu(stressed) | np.triu(stressed).T
    strain = np.where(stressed, 0.0, mean).tolist()
    stress = [[s if s else None for s in row] for row in np.where(stressed, mean, 0.0).tolist()]
    given = {"mean_strain": strain, "mean_stress": stress if stressed.any() else None}
    sides: list[Any] = [ec.Periodic(*names, **given) for names in SIDES]
    domain = ec.rectangle((0.0, 0.0), (1.0, 1.0), cells=(4, 4))
    modulus: Any = E
    if rng.random() < 0.5:
        domain = perforated_cell(rng.uniform(0.1, 0.4), 0.25)
    else:
        wave, turns = rng.uniform(0.2, 0.9), rng.integers(-1, 2, size=2)

        def modulus(x: Any) -> Any:
            return 1 + wave * ufl.sin(2 * np.pi * (turns[0] * x[0] + turns[1] * x[1]))

    return Case("cell", ec.Scene(ec.Elastic(modulus, NU), sides), domain)


def wave(rng: np.random.Generator) -> Case:
    """Return a wavy surface on a plane."""
    share, crest = rng.uniform(0.1, 1.2), rng.random()
    friction = float(rng.integers(2)) * rng.uniform(0.0, 0.2) * share * FLAT

    def gap(x: Any) -> Any:
        return 0.01 * (1 - ufl.cos(2 * np.pi * (x[0] - crest)))

    given: dict[str, Any] = {}
    kind = rng.integers(3)
    if kind == 1 and friction == 0.0:
        given["mean_strain"] = ((rng.normal() * 0.005, 0.0), (0.0, 0.0))
    if kind == 2 and friction == 0.0:
        given["mean_stress"] = ((rng.normal() * 0.005, None), (None, None))
    sides: list[Any] = [ec.Periodic("left", "right", **given)]
    law = ec.Tresca(friction) if friction else 0.0
    scene = ec.Scene(
        ec.Elastic(E, NU),
        sides,
        [ec.Traction("top", pressure=share * FLAT)],
        [ec.Contact("bottom", gap=gap, friction=law)],
    )
    height = rng.uniform(0.7, 1.5)
    domain = ec.rectangle((0.0, 0.0), (1.0, height), cells=(6, 8))
    return Case("wave", scene, domain, ("bottom", friction) if friction else None)


def sector(rng: np.random.Generator) -> Case:
    """Return a sector of a bladed disc under rotation."""
    sectors = int(rng.integers(4, 9))
    pull = rng.uniform(0.5, 1.0) * 1e-6
    force = ec.BodyForce((lambda x: pull * x[0], lambda x: pull * x[1]))
    sides: list[Any] = [ec.Cyclic("low", "cut", axis=(0.0, 0.0), sectors=sectors)]
    scene = ec.Scene(ec.Elastic(E, NU), sides, [force])
    domain, whole = bladed(1, sectors), bladed(sectors, sectors)
    return Case("sector", scene, domain, whole=whole, sectors=sectors)


def fit(rng: np.random.Generator) -> Case:
    """Return a sector of a frictionless press fit under rotation."""
    radii = np.cumsum([20.0, rng.uniform(15.0, 30.0), rng.uniform(20.0, 60.0)])
    pull = rng.uniform(0.0, 3.0) * 1e-7
    force = ec.BodyForce((lambda x: pull * x[0], lambda x: pull * x[1]))
    sides: list[Any] = [ec.Cyclic("low", "cut", axis=(0.0, 0.0), sectors=12)]
    contact = ec.Contact("rim", against="bore", gap=-0.02)
    scene = ec.Scene(ec.Elastic(E, NU), sides, [force], [contact])
    return Case("fit", scene, sector_of_fit(*radii.tolist()))


def from_axis(x: Any) -> Any:
    """Return the direction from the axis, in the plane or in 3D, UFL."""
    flat = ufl.as_vector([x[0], x[1], *(0.0 * x[i] for i in range(2, len(x)))])
    return flat / ufl.sqrt(ufl.dot(flat, flat))


def wedge(rng: np.random.Generator) -> Case:
    """Return a sector of a full disc or cylinder, whose sides meet on the axis."""
    d, sectors = int(rng.integers(2, 4)), int(rng.integers(2, 7))
    axis = (0.0, 0.0) if d == 2 else ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    sides: list[Any] = [ec.Cyclic("low", "cut", axis=axis, sectors=sectors)]
    pull, twist = rng.uniform(0.5, 1.0) * 1e-3, 0.0
    loads: list[Any] = []
    contacts: list[Any] = []
    tresca = None
    if rng.random() < 0.5:
        loads.append(ec.Traction("rim", pressure=rng.uniform(0.001, 0.003)))
    else:
        twist = rng.normal() * 1e-3
        tresca = "rim", rng.uniform(0.001, 0.003)
        law = ec.Tresca(tresca[1])
        contacts.append(ec.Contact("rim", gap=-0.003, friction=law, normal=from_axis))
    force = [lambda x: pull * x[0] - twist * x[1], lambda x: pull * x[1] + twist * x[0]]
    loads.append(ec.BodyForce((*force, lambda x: 0.0 * x[0])[:d]))
    domain = full_sector(d, sectors, rng.uniform(0.35, 0.5))
    scene = ec.Scene(ec.Elastic(E, NU), sides, loads, contacts)
    return Case("wedge", scene, domain, tresca, all_sectors(domain, sectors), sectors, True)


KINDS: tuple[Callable[[np.random.Generator], Case], ...] = (cell, wave, sector, fit, wedge)


def certified(
    case: Case, domain: ec.Domain, degree: int, method: ec.Method | None = None
) -> ec.ConstitutiveError:
    """Return the error of a case on a mesh."""
    solution = ec.solve(case.scene, domain, method, degree=degree)
    return ec.constitutive_error(ec.equilibrate(solution))


def energy_anew(case: Case, error: ec.ConstitutiveError) -> float:
    """Evaluate the potential energy of u^ from the fields alone [force length]."""
    u = error.admissible.displacement
    mesh = error.domain.mesh
    exact = {"quadrature_degree": 16}
    dx = ufl.Measure("dx", domain=mesh, metadata=exact)
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=error.domain.facet_tags, metadata=exact)
    x = ufl.SpatialCoordinate(mesh)
    given: Any = error.solution.scene.material
    modulus = given.E(x) if callable(given.E) else given.E
    strain = ufl.sym(ufl.grad(u))
    stress = NU / (1 - 2 * NU) * ufl.tr(strain) * ufl.Identity(mesh.geometry.dim) + strain
    terms = [0.5 * modulus / (1 + NU) * ufl.inner(stress, strain) * dx]
    for load in case.scene.loads:
        if isinstance(load, ec.BodyForce):
            components: Any = load.value
            force = ufl.as_vector([component(x) for component in components])
            terms.append(-ufl.inner(force, u) * dx)
        else:
            pressed: Any = load
            normal_part = ufl.dot(u, ufl.FacetNormal(mesh))
            terms.append(pressed.pressure * normal_part * ds(error.domain.names[pressed.facets]))
    if case.tresca is not None:
        part, bound = case.tresca
        n = from_axis(x) if case.is_of_copies else ufl.FacetNormal(mesh)
        slip = u - ufl.dot(u, n) * n
        terms.append(bound * ufl.sqrt(ufl.dot(slip, slip)) * ds(error.domain.names[part]))
    total = float(sum(fem.assemble_scalar(fem.form(term)) for term in terms))
    # A mean stress does work on the jump of u^, on sides without holes.
    corners = mesh.geometry.x
    volume = np.prod(np.ptp(corners[:, :2], axis=0))
    axes = {here: axis for axis, (here, _) in enumerate(SIDES)}
    for entry in error.solution.scene.contacts:
        mean_stress = getattr(entry, "mean_stress", None)
        if mean_stress is not None:
            row = np.nan_to_num(np.array(mean_stress, dtype=float)[axes[entry.facets]])
            total -= float(volume * row @ error.solution.mean_strain(entry.facets))
    return total


def misfit(error: ec.ConstitutiveError) -> float:
    """Return how far u^ is from fitting across the sides, over its size [-]."""
    u = error.admissible.displacement.x.array
    worst = 0.0
    for contact in error.model.contacts:
        if contact.is_periodic:
            given = 0.0 if contact.moved is None else contact.trace.of(contact.moved.x.array)
            worst = max(worst, float(abs(contact.trace.of(u) - given).max()))
    return worst / float(abs(u).max())


def measured(case: Case, degree: int) -> dict[str, float]:
    """Return what a case shows: violations, index, differences, widths."""
    coarse = certified(case, case.domain, degree)
    # The domain of the error knows its sides, which are refined alike.
    finer = coarse.domain.refined()
    fine = certified(case, finer.refined() if finer.dim == 2 else finer, 2)
    bounds, within = ec.potential_energy(coarse), ec.potential_energy(fine)
    size = SAME * abs(within.value)
    violated = bounds.low > within.high + size or bounds.high < within.low - size
    anew = energy_anew(case, coarse)
    result = {
        "eps": coarse.relative,
        "violations": float(violated),
        "energy of u^ anew": abs(anew - bounds.value) / abs(bounds.value),
        "misfit of u^": misfit(coarse),
        "imbalance": coarse.admissible.imbalance,
    }
    if coarse.geometry_error == 0.0 and coarse.relative > EXACT:
        # Twice the excess of energy is the square of the error of u^.
        excess = bounds.value - 0.5 * (within.low + within.value)
        result["e over the error of u^"] = coarse.absolute / np.sqrt(2 * excess)
    if case.is_of_copies:
        result |= beside_copies(case, degree)
    elif case.whole is not None:
        # A whole disc has no sides, and lies on the axis that its sectors turn about.
        whole = replace(case.scene, supports=[], contacts=[])
        every = ec.potential_energy(certified(replace(case, scene=whole), case.whole, 2))
        middle = case.sectors * within.value
        beyond = max(every.low - middle, case.sectors * within.low - every.high)
        result["whole beside sectors"] = abs(every.value / middle - 1)
        result["violations"] += float(beyond > SAME * abs(middle))
    return result


def beside_copies(case: Case, degree: int) -> dict[str, float]:
    """Compare a sector with the body whose mesh is its copies.

    sigma^ knows no sides. So e is the same, if tightening ends after as many iterations
    and the tractions of contacts are the same: at nodes of a contact and of both sides
    the method has other multipliers. There, where r^ chooses what is closed, u^ differs
    a little.
    """
    assert case.whole is not None
    method = ec.AugmentedLagrangian()
    whole = replace(case.scene, contacts=case.scene.contacts[:-1])
    one = certified(case, case.domain, degree, method)
    every = certified(replace(case, scene=whole), case.whole, degree, method)
    u = one.solution.u
    # Points on the rim may be beside the body by round-off.
    x = (1 - 1e-13) * u.function_space.tabulate_dof_coordinates()
    values = u.x.array.reshape(len(x), -1)
    apart = every.solution.at(x[:, : values.shape[1]]).displacement - values
    # Both are known up to a motion along the axis, and without contact to a turn.
    motions = np.zeros((*values.shape, 2))
    motions[:, :2, 0] = np.column_stack([-x[:, 1], x[:, 0]])
    motions[:, 2:, 1] = 1.0
    flat = motions.reshape(-1, 2)
    left = apart.ravel() - flat @ np.linalg.lstsq(flat, apart.ravel(), rcond=None)[0]
    energies = [ec.potential_energy(error).value for error in (one, every)]
    return {
        "u beside copies": float(abs(left).max() / abs(values).max()),
        "energy beside copies": abs(case.sectors * energies[0] / energies[1] - 1),
        "e beside copies": np.sqrt(case.sectors) * one.absolute / every.absolute,
    }


def quantiles(values: Sequence[float]) -> str:
    """Return the least value, quantiles and the greatest value of a list in words."""
    return "  ".join(f"{q:9.3g}" for q in np.quantile(values, [0.0, 0.1, 0.5, 0.9, 1.0]))


def main(cases: int, seed: int) -> None:
    """Run random cases, and print the table."""
    logging.getLogger("erc_contact").setLevel(logging.ERROR)
    rng = np.random.default_rng(seed)
    rows: list[tuple[str, dict[str, float]]] = []
    for number in range(cases):
        case = KINDS[number % len(KINDS)](rng)
        degree = int(rng.integers(1, 3))
        row = measured(case, degree)
        rows.append((f"{case.kind} {degree}", row))
        if row["violations"]:
            print(f"case {number}: {case.kind} of degree {degree}: {row}", flush=True)
    print(f"{cases} cases of seed {seed}; least, 10%, median, 90%, greatest")
    for kind in sorted({kind for kind, _ in rows}):
        chosen = [row for of_kind, row in rows if of_kind == kind]
        total = int(sum(row["violations"] for row in chosen))
        print(f"{kind}: {len(chosen)} cases, {total} violations")
        for name in dict.fromkeys(name for row in chosen for name in row):
            if name != "violations":
                values = [row[name] for row in chosen if name in row]
                print(f"  {name:24s} {quantiles(values)}")


if __name__ == "__main__":
    numbers = [int(argument) for argument in sys.argv[1:]]
    main(*(numbers + [80, 1][len(numbers) :]))
