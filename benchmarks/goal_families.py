"""Random scenes of single numbers: moments and rotations, forces of several contacts.

Each scene comes with its goals, and with what reads each number off the fields of a
mesh: its stress or displacement, not an interval.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
import ufl  # isort: skip
from dolfinx import fem  # isort: skip
from attack_families import Sample  # isort: skip

Reading = Callable[[ec.ConstitutiveError], float]
"""Type of what reads a number off the fields of a mesh."""


@dataclass(frozen=True)
class Wanted:
    """Hold a goal with a name, and with what reads its number off fields."""

    name: str
    goal: Any
    read: Reading


def resultant(part: str, direction: np.ndarray, name: str) -> Wanted:
    """Return a force, from the stress."""

    def read(error: ec.ConstitutiveError) -> float:
        return float(error.force(part).force @ direction)

    return Wanted(f"force {name}", ec.Resultant(part, tuple(direction)), read)


def moment(part: str, about: np.ndarray, axis: np.ndarray | None, name: str) -> Wanted:
    """Return a moment, from the stress."""

    def read(error: ec.ConstitutiveError) -> float:
        force = error.force(part)
        if axis is None:
            x, y = about
            return float(force.moment[0] - x * force.force[1] + y * force.force[0])
        return float((force.moment - np.cross(about, force.force)) @ axis)

    goal = ec.Moment(part, tuple(about), axis=None if axis is None else tuple(axis))
    return Wanted(f"moment {name}", goal, read)


def rotation(part: str, axis: np.ndarray | None) -> Wanted:
    """Return the rotation of a rigid face, from the displacement."""

    def read(error: ec.ConstitutiveError) -> float:
        angle = error.solution.motion(part).rotation
        return float(angle[0] if axis is None else angle @ axis)

    goal = ec.Rotation(part, axis=None if axis is None else tuple(axis))
    return Wanted(f"rotation of {part}", goal, read)


def weighted(part: str, weights: np.ndarray) -> Wanted:
    """Return an integral over a part, whose weight is linear, from the displacement.

    Args:
        part: Name of the part.
        weights: Factors of the components and of them times the last coordinate.
    """
    d = weights.shape[1]

    def weight(x: Any) -> Any:
        return ufl.as_vector([weights[0, i] + weights[1, i] * x[d - 1] for i in range(d)])

    def read(error: ec.ConstitutiveError) -> float:
        model = error.model
        ds = model.space.ds(model.domain.tag(part))
        density = ufl.inner(error.solution.u, weight(model.space.x)) * ds
        return float(fem.assemble_scalar(fem.form(density)))

    return Wanted("weighted mean", ec.Functional(ec.Traction(part, weight)), read)


def mean(part: str, direction: np.ndarray) -> Wanted:
    """Return a mean displacement, from the displacement."""

    def read(error: ec.ConstitutiveError) -> float:
        model = error.model
        ds = model.space.ds(model.domain.tag(part))
        along = ufl.inner(error.solution.u, ufl.as_vector(direction.tolist()))
        one = fem.Constant(model.domain.mesh, 1.0)
        area = fem.assemble_scalar(fem.form(one * ds))
        return float(fem.assemble_scalar(fem.form(along * ds)) / area)

    return Wanted("mean displacement", ec.MeanDisplacement(part, tuple(direction)), read)


def energy(error: ec.ConstitutiveError) -> float:
    """Return about the potential energy."""
    bounds = ec.potential_energy(error)
    return (bounds.low + bounds.high) / 2


def mean_of_body(force: np.ndarray) -> Wanted:
    """Return an integral over the body, from the displacement."""

    def read(error: ec.ConstitutiveError) -> float:
        return error.integrate(lambda u, sigma: ufl.inner(u, ufl.as_vector(force.tolist())))

    return Wanted("integral over body", ec.Functional(ec.BodyForce(tuple(force))), read)


def random_axis(rng: np.random.Generator, d: int) -> np.ndarray | None:
    """Return a random axis in 3D, None in the plane."""
    return None if d == 2 else rng.standard_normal(3)


def random_law(rng: np.random.Generator, depth: float) -> tuple[str, Any]:
    """Return a kind of friction by its name, and the friction."""
    kind = str(rng.choice(["none", "given", "Coulomb"]))
    if kind == "none":
        return kind, 0.0
    if kind == "given":
        return kind, ec.Tresca(float(rng.uniform(0.05, 0.5)) * depth)
    return kind, float(rng.uniform(0.05, 0.6))


def block(low: tuple[float, ...], high: tuple[float, ...], cells: tuple[int, ...]) -> ec.Domain:
    """Return a rectangle or a box."""
    if len(low) == 2:
        return ec.rectangle(low, high, cells=cells)
    return ec.box(low, high, cells=cells)


def random_block(rng: np.random.Generator, d: int) -> tuple[str, Sample]:
    """Make a block on a foundation, pressed from above and pulled at the right side.

    Returns its kind of friction, and the scene.
    """
    columns, rows = (int(number) for number in rng.integers(2, 7 if d == 2 else 4, 2))
    width = float(np.exp(rng.uniform(-0.5, 1.0)))
    nu = float(rng.uniform(-0.3, 0.45))
    depth = float(rng.uniform(0.005, 0.02))
    law = str(rng.choice(["none", "given", "Coulomb"]))
    friction: Any = {
        "none": 0.0,
        "given": ec.Tresca(float(rng.uniform(0.05, 0.5)) * depth),
        "Coulomb": float(rng.uniform(0.05, 0.6)),
    }[law]
    along = depth * float(rng.uniform(-1.0, 1.0))
    pull = depth * float(rng.uniform(-1.0, 1.5))
    degree = int(rng.integers(1, 3))
    if d == 2:
        block = ec.rectangle((0.0, 0.0), (width, 1.0), cells=(columns, rows))
    else:
        block = ec.box((0.0, 0.0, 0.0), (width, 1.0, 1.0), cells=(columns, columns, rows))
    middle = (0.0,) * (d - 2)
    supports = [ec.Displacement("top", (along, *middle, -depth))]
    loads = [ec.Traction("right", (0.0, *middle, pull))]
    gap: Any = 0.0
    if rng.random() < 0.5:
        curvature = depth * float(rng.uniform(0.2, 1.0))
        gap = lambda x: curvature * (x[0] - width / 2) ** 2  # noqa: E731
    contact = ec.Contact("bottom", friction=friction, gap=gap)
    scene = ec.Scene(ec.Elastic(1.0, nu), supports, loads, [contact])
    name = f"{columns} x {rows}, width {width:.2f}, nu {nu:.2f}, {law}, degree {degree}"
    return law, Sample(name, scene, block, degree)


def pressed(rng: np.random.Generator, d: int) -> tuple[str, Sample, list[Wanted]]:
    """Make a block of :func:`random_block`.

    Returns its kind of friction, the scene, and its goals.
    """
    law, sample = random_block(rng, d)
    up = np.eye(d)[-1]
    wanted = [resultant("top", up, "on support"), resultant("bottom", up, "on contact")]
    wanted.append(mean("right", up))
    if law != "Coulomb":
        # There the energy belongs to the friction bound of each mesh, another number.
        wanted.append(Wanted("energy", ec.Energy(), energy))
    return law, sample, wanted


def turned(rng: np.random.Generator, d: int) -> tuple[str, Sample, list[Wanted]]:
    """Make a block under a press that turns: as a support, or as a rigid face.

    Returns its kind of friction, the scene, and its goals.
    """
    depth = float(rng.uniform(0.005, 0.02))
    law, friction = random_law(rng, depth)
    width = float(np.exp(rng.uniform(-0.5, 1.0)))
    cells = tuple(int(number) for number in rng.integers(2, 6 if d == 2 else 3, d))
    high = (width, *(1.0,) * (d - 1))
    domain = block((0.0,) * d, high, cells)
    still = (0.0,) * (d - 2)
    along = depth * float(rng.uniform(-1.0, 1.0))
    tilt = depth * float(rng.uniform(-1.0, 1.0)) / width
    axis = random_axis(rng, d)
    about = rng.uniform(-1.0, 2.0, d)
    wanted = [moment("top", about, axis, "of press")]
    wanted.append(moment("bottom", about, axis, "of contact"))
    kind = str(rng.choice(["support", "roller", "rigid", "rigid, moment given"]))
    loads: list[ec.Load] = [
        ec.Traction("right", (0.0, *still, depth * float(rng.uniform(-1.0, 1.5))))
    ]
    if kind in ("support", "roller"):
        sink = lambda x: -depth + tilt * (x[0] - width / 2)  # noqa: E731
        press: Any = ec.Displacement("top", (along, *still, sink))
        if kind == "roller":
            press = ec.Displacement("top", (None, *still, sink))
            loads.append(ec.Traction("top", (0.05 * depth, *still, 0.0)))
            friction = ec.Tresca(depth) if law == "none" else friction
    else:
        free = (None,) * (d - 1)
        moves = (along, *still, None)
        push = -depth * float(rng.uniform(0.5, 1.0)) * width
        force = (*free, push)
        turns: Any = tilt if d == 2 else (0.0, -tilt, 0.0)
        press = ec.Rigid("top", moves, rotation=turns, force=force)
        if kind != "rigid":
            torque: Any = push * width * float(rng.uniform(-0.1, 0.1))
            turns = None if d == 2 else (0.0, None, 0.0)
            torque = torque if d == 2 else (None, torque, None)
            press = ec.Rigid("top", moves, rotation=turns, force=force, moment=torque)
            y_axis = None if d == 2 else np.array([0.0, 2.0, 0.0])
            wanted = [rotation("top", y_axis), *wanted[1:]]
    material = ec.Elastic(1.0, float(rng.uniform(-0.3, 0.45)))
    scene = ec.Scene(material, [press], loads, [ec.Contact("bottom", friction=friction)])
    degree = int(rng.integers(1, 3))
    return law, Sample(f"{kind}, {law}, {cells}, degree {degree}", scene, domain, degree), wanted


def rotating(rng: np.random.Generator, d: int) -> tuple[str, Sample, list[Wanted]]:
    """Make a block under a rigid face that turns, see :func:`turned`."""
    while True:
        law, sample, wanted = turned(rng, d)
        if wanted[0].name.startswith("rotation"):
            return law, sample, wanted[:1]


def weighed(rng: np.random.Generator, d: int) -> tuple[str, Sample, list[Wanted]]:
    """Make a block under a press, see :func:`turned`, with numbers linear in u."""
    law, sample, _ = turned(rng, d)
    wanted = [weighted("right", rng.standard_normal((2, d))), mean_of_body(rng.standard_normal(d))]
    return law, sample, wanted


def stacked(rng: np.random.Generator, d: int) -> tuple[str, Sample, list[Wanted]]:
    """Make a block that is pressed on another one: held, on a foundation, in a corner.

    Returns the kind of friction between them, the scene, and its goals.
    """
    depth = float(rng.uniform(0.005, 0.02))
    law, friction = random_law(rng, depth)
    still = (0.0,) * (d - 2)
    number = int(rng.integers(2, 4 if d == 2 else 3))
    left = float(rng.uniform(0.1, 0.8)) if d == 2 else 0.0
    right = left + float(rng.uniform(0.6, 1.0)) if d == 2 else 2.0
    middle = (1.0,) * (d - 2)
    low_cells = (2 * number, *(1,) * (d - 2), number)
    up_cells = low_cells if d == 3 else (number, number)
    lower = block((0.0, *still, 0.0), (2.0, *middle, 1.0), low_cells)
    upper = block((left, *still, 1.0), (right, *middle, 2.0), up_cells)
    bodies = ec.assembly({"upper": upper, "lower": lower})
    bodies = bodies.joined("upper bottom", "lower top")
    along = depth * float(rng.uniform(-0.5, 0.5))
    supports: list[Any] = [ec.Displacement("upper top", (along, *still, -depth))]
    contacts = [ec.Contact("upper bottom", against="lower top", friction=friction)]
    kind = str(rng.choice(["held", "foundation", "corner"]))
    if kind == "held":
        supports.append(ec.Displacement("lower bottom", (0.0,) * d))
    else:
        contacts.append(ec.Contact("lower bottom", friction=ec.Tresca(depth)))
        if kind == "corner":
            supports.append(ec.Symmetry("lower left"))
    weight = depth * rng.uniform(-0.1, 0.1, d)
    loads: list[ec.Load] = [ec.BodyForce(tuple(weight))]
    loads.append(ec.Traction("lower right", (0.0, *still, 0.2 * depth)))
    modulus = {"upper": 1.0, "lower": float(np.exp(rng.uniform(-1.0, 1.5)))}
    scene = ec.Scene(ec.Elastic(modulus, 0.3), supports, loads, contacts)
    about = rng.uniform(-1.0, 2.0, d)
    axis = random_axis(rng, d)
    side = str(rng.choice(["upper bottom", "lower top"]))
    wanted = [resultant(side, rng.standard_normal(d), "between bodies")]
    wanted.append(moment(side, about, axis, "between bodies"))
    if kind != "held":
        wanted.append(resultant("lower bottom", np.eye(d)[-1], "of second contact"))
    degree = int(rng.integers(1, 3))
    return law, Sample(f"{kind}, {law}, {number}, degree {degree}", scene, bodies, degree), wanted
