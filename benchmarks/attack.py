"""Measure the claims of the pages on random scenes.

None of the scenes was chosen, and the seed is an argument.

``coarse``: every mesh of 1 x 1 to 4 x 4 squares, degrees 1 and 2, every set of sides in
contact, no support; the number of scenes that are solved. It may be run on several
ranks.

``kinks``: the contact part of e^2 of pushed blocks against a composite rule of 4000
points a facet. The length of the slip has a kink where the slip changes its direction.

``pushed``: blocks pushed along their foundation with Coulomb friction. "both" is e over
``sqrt(|u - u^|^2 + |sigma - sigma^|^2)``, "third" the third term, a product of two
errors, over e^2, "left" the sum of both squares and the third term over e^2, which the
theorem says is at most 1 (more is the error of the reference, which halves with each of
its refinements); "index" is e over ``|u - u^|``; "covered" is the bound of the Coulomb
certificate, where it makes one, over the true error. The reference is of degree 2 on a
mesh that cuts the cells as sigma^ does and refines them three times.

``steps``: the same of steps of histories that turn the push back, given their history.

``heated``: the same of blocks with random given strains, where the contact has no
friction or Tresca's.

``sprung``: the same with springs on the sides. ``turned``: see ``attack_springs.py``.

``rigid``: the same under a rigid face; ``sections``: under a plane section.

``foundations``: the same on compliant foundations; ``tangential``: on foundations that
are tangentially compliant, half of them along the normal, too, with Tresca friction;
``layers``: with such a layer between two bodies.

``tightening``: see ``attack_tightening.py``; ``plane``, ``space``: the certificates of
``attack_certificates.py``; ``plates``: see ``attack_plates.py``, ``pairs``: see
``attack_pairs.py``, both on several ranks, too.

    OMP_NUM_THREADS=1 python benchmarks/attack.py [name|all] [seed] [number of scenes]

Without a number each family has as many scenes as fit into a minute or two; all take
about ten minutes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import combinations, product

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from attack_certificates import certificates  # isort: skip
from attack_certificates import summary as summary_of_certificates  # isort: skip
from attack_families import random_foundation, random_sliding_block  # isort: skip
from attack_families import random_sliding_box, random_springs, random_strains  # isort: skip
from attack_pairs import pairs  # isort: skip
from attack_plates import plates  # isort: skip
from attack_springs import summary as summary_of_turned  # isort: skip
from attack_tables import quantile_table  # isort: skip
from attack_tightening import summary as summary_of_tightening, tightening as tightened  # isort: skip
from tasks import run, tell  # isort: skip
from true_errors import reference, true_errors  # isort: skip

from erc_contact.admissible.traction import ContactTraction
from erc_contact.error.contact import contact_squares
from erc_contact.error.contact_term import AtPoints, contact_density
from erc_contact.model.contact.contact_values import friction_parameters
from erc_contact.model.contact.foundation import pressures
from erc_contact.model.data.quadrature import polynomials
from namedmesh.simplex import coefficients

QUANTILES = (0.0, 0.05, 0.5, 0.95, 1.0)
SIDES = {"left": (-1.0, 0.0), "right": (1.0, 0.0), "bottom": (0.0, -1.0), "top": (0.0, 1.0)}
"""Outward normals of the sides of a rectangle."""
LEVELS = 3
"""Refinements of the reference beyond the cut at the barycentres."""
PANELS = 1000
"""Parts of a facet in the composite rule, of four points each."""
Case = tuple[ec.Scene, ec.Domain, int, ec.Solution | None]
"""A scene, its mesh, the degree, and the last step of a history or None."""


def coarse(_seed: int = 0, _count: int = 0) -> None:
    """Print how many of the coarse scenes are solved; collective."""
    solved = scenes = 0
    for columns, rows in product(range(1, 5), repeat=2):
        domain = ec.rectangle((0.0, 0.0), (columns, rows), cells=(columns, rows))
        for sides in sides_in_contact():
            for degree in (1, 2):
                scenes += 1
                try:
                    eps = certified(closed_by(sides), domain, degree).relative
                except ec.ErcContactError as reason:
                    tell(f"{columns} x {rows}, degree {degree}, {sides}: {reason}")
                    continue
                solved += 0.0 <= eps < 1.0
    tell(f"{solved} of {scenes} coarse scenes are solved and certified below 100%")


def sides_in_contact() -> Iterator[tuple[str, ...]]:
    """Give every set of sides of a rectangle that is not empty."""
    for count in range(1, 5):
        yield from combinations(SIDES, count)


def closed_by(sides: tuple[str, ...]) -> ec.Scene:
    """Make a scene without supports that contacts on these sides hold.

    The sides are too near, or the body is pressed on them by a weight.
    """
    push = 0.01 * np.sum([SIDES[side] for side in sides], axis=0)
    loads = [ec.BodyForce(tuple(float(part) for part in push))] if push.any() else []
    contacts = [ec.Contact(side, friction=0.5, gap=-0.01) for side in sides]
    return ec.Scene(ec.Elastic(1.0, 0.3), [], loads, contacts)


def certified(scene: ec.Scene, domain: ec.Domain, degree: int) -> ec.ConstitutiveError:
    """Solve a scene and measure its error."""
    return ec.constitutive_error(ec.equilibrate(ec.solve(scene, domain, degree=degree)))


def pushed_block(rng: np.random.Generator) -> tuple[Callable[[float], ec.Scene], ec.Domain, int]:
    """Make a block whose top is moved.

    Returns its scene as a function of the share of the push, its mesh and its degree.
    """
    columns, rows = (int(count) for count in rng.integers(1, 9, 2))
    height = float(rng.uniform(0.3, 2.0))
    friction = float(rng.uniform(0.2, 0.8))
    nu = float(rng.uniform(-0.7, 0.49))
    push = float(rng.uniform(-0.05, 0.05)) * height
    press = float(rng.uniform(0.01, 0.05)) * height
    degree = int(rng.integers(1, 3))

    def scene(share: float) -> ec.Scene:
        support = ec.Displacement("top", (share * push, -press))
        return ec.Scene(
            ec.Elastic(1.0, nu), [support], [], [ec.Contact("bottom", friction=friction)]
        )

    return scene, ec.rectangle((0.0, 0.0), (1.0, height), cells=(columns, rows)), degree


def kinks(seed: int = 0, count: int = 200) -> None:
    """Print quantiles of the contact part over a composite rule's, minus 1."""
    deviations = []
    for number in range(count):
        scene, domain, degree = pushed_block(np.random.default_rng([seed, number]))
        pair = ec.equilibrate(ec.solve(scene(1.0), domain, degree=degree))
        traction = pair.tractions[0]
        part = contact_squares(
            pair.solution.model.space, pair.displacement, traction, 0.0
        ).parts.sum()
        composite = composite_contact_part(pair, traction)
        if composite > 0:
            deviations.append(part / composite - 1)
    show({"contact part over the part by a composite rule - 1": deviations}, "{:.1e}")


def composite_contact_part(pair: ec.Admissible, traction: ContactTraction) -> float:
    """Integrate the contact part of e^2 with many Gauss points [force length].

    The contact is one without gap, in the plane.
    """
    contact = traction.contact
    space = pair.solution.model.space
    points, weights = np.polynomial.legendre.leggauss(4)
    starts = np.arange(PANELS)[:, None]
    places = ((starts + 0.5 * (points + 1)) / PANELS).ravel()
    shape = polynomials(space.degree, np.stack([1 - places, places], axis=-1)[None])
    nodal = pair.displacement.x.array.reshape(-1, 2)[traction.nodes]
    w = shape @ (coefficients(1, space.degree) @ nodal)
    r = shape @ traction.values
    normal = contact.direction[:, None, :]
    parameters = friction_parameters(space, contact, np.array([[0.5]]))
    bound = contact.friction_bound(pressures(r, normal), parameters)
    at = AtPoints(normal, r, w, np.zeros_like(w), 0.0, bound)
    density = contact_density(contact, at, 0.0)
    means = density @ np.tile(0.5 * weights / PANELS, PANELS)
    return float(traction.area @ means)


def pushed(seed: int = 0, count: int = 80) -> None:
    """Print the quantiles of the third term and of the indices of pushed blocks."""
    cases: list[Case] = []
    for number in range(count):
        scene, domain, degree = pushed_block(np.random.default_rng([seed, number]))
        cases.append((scene(1.0), domain, degree, None))
    compared(cases)


def steps(seed: int = 0, count: int = 30) -> None:
    """Print the same of steps that turn the push back by a random share.

    The errors are those given the history of the step.
    """
    cases: list[Case] = []
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        scene, domain, degree = pushed_block(rng)
        share = float(rng.uniform(-0.5, 0.9))
        pressed = ec.solve(scene(0.0), domain, degree=degree)
        sheared = ec.solve(scene(1.0), domain, degree=degree, after=pressed)
        cases.append((scene(share), domain, degree, sheared))
    compared(cases)


def compared(cases: list[Case]) -> None:
    """Print the quantiles of e against true errors."""
    names = (
        "both",
        "third",
        "left",
        "index, degree 1",
        "index, degree 2",
        "index, eps < 20%",
        "covered",
    )
    columns: dict[str, list[float]] = {name: [] for name in names}
    for scene, domain, degree, last in cases:
        solution = ec.solve(scene, domain, degree=degree, after=last)
        error = ec.constitutive_error(ec.equilibrate(solution))
        true = true_errors(error.admissible, reference(solution, LEVELS, degree=2, after=last))
        e = error.absolute
        index = e / true.of_u
        columns["both"].append(e / true.of_both)
        columns["third"].append(true.friction / e**2)
        columns["left"].append((true.of_both**2 + true.friction) / e**2)
        columns[f"index, degree {degree}"].append(index)
        if error.relative < 0.2:
            columns["index, eps < 20%"].append(index)
        bound = ec.coulomb_certificate(error).bound
        if np.isfinite(bound):
            columns["covered"].append(bound / true.of_both)
    show(columns, "{:.3f}")


def given_friction(rng: np.random.Generator) -> tuple[ec.Scene, ec.Domain, int]:
    """Make a random block whose contact has no friction or Tresca's, and its degree.

    On such scenes e is proved to bound the errors of displacement and stress.
    """
    scene, domain, degree = pushed_block(rng)
    law = None if rng.random() < 0.5 else ec.Tresca(float(rng.uniform(0.0, 0.02)))
    contact = ec.Contact("bottom", friction=law or 0.0)
    pushed_scene = scene(float(rng.uniform(0.0, 1.0)))
    return replace(pushed_scene, contacts=[contact]), domain, degree


type Change = Callable[[np.random.Generator, ec.Scene], ec.Scene]
"""Makes another scene of a block with Tresca friction."""


def compared_blocks(seed: int, count: int, change: Change) -> None:
    """Print the quantiles of e over the true errors of changed blocks."""
    cases: list[Case] = []
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        scene, domain, degree = given_friction(rng)
        cases.append((change(rng, scene), domain, degree, None))
    compared(cases)


def heated(seed: int = 0, count: int = 100) -> None:
    """Print the quantiles of e over the true errors of heated and swollen blocks."""
    compared_blocks(seed, count, lambda rng, scene: replace(scene, strains=random_strains(rng)))


def sprung(seed: int = 0, count: int = 50) -> None:
    """Print the same of blocks with springs on one or both sides.

    They are from 0.01 to 100 times as stiff as a block of size one. The true errors
    are without the energy in the springs, so e over them is somewhat greater.
    """
    compared_blocks(seed, count, lambda rng, scene: replace(scene, springs=random_springs(rng)))


def turned(seed: int = 0, count: int = 300) -> None:
    """Print the quantiles of eps of turned blocks on springs over eps unturned."""
    ratios, worst = summary_of_turned(seed, count)
    show(ratios, "{:.2f}")
    tell(worst)


def rigid(seed: int = 0, count: int = 50) -> None:
    """Print the same of blocks that a rigid face presses and turns.

    Without friction the face turns freely: Tresca friction might overturn the block.
    The resultant is inside the middle third of the base, so that even a base of one
    facet has a traction that balances it.
    """

    def under_a_face(rng: np.random.Generator, scene: ec.Scene) -> ec.Scene:
        # The block's support prescribes two numbers.
        push, sink = (float(value) for value in scene.supports[0].value)  # type: ignore[arg-type]
        force = -float(rng.uniform(0.2, 2.0)) * abs(sink)
        arm = float(rng.uniform(-0.15, 0.15))
        turn = float(rng.uniform(-0.3, 0.3)) * abs(sink)
        face = ec.Rigid("top", (push, None), rotation=turn, force=(None, force))
        if scene.contacts[0].law is None:
            face = replace(face, rotation=None, moment=arm * force)
        return replace(scene, supports=[face])

    compared_blocks(seed, count, under_a_face)


def sections(seed: int = 0, count: int = 50) -> None:
    """Print the same of halves of blocks under a plane section.

    A roller at the left holds the half, which widens under a force, or is pressed by a
    given way, or bent.
    """

    def under_a_section(rng: np.random.Generator, scene: ec.Scene) -> ec.Scene:
        sink = float(scene.supports[0].value[1])  # type: ignore[arg-type]
        force = float(rng.uniform(0.2, 2.0)) * sink
        arm = float(rng.uniform(-0.15, 0.15))
        turn = float(rng.uniform(-0.3, 0.3)) * sink
        if rng.random() < 0.5:
            section = ec.PlaneSection("top", force=(None, force), moment=arm * force)
        else:
            section = ec.PlaneSection("top", (None, sink), rotation=turn)
        roller = ec.Displacement("left", (0.0, None))
        return replace(scene, supports=[roller, section])

    compared_blocks(seed, count, under_a_section)


def foundations(seed: int = 0, count: int = 50) -> None:
    """Print the same of blocks on compliant foundations, without energies in these."""

    def bedded(rng: np.random.Generator, scene: ec.Scene) -> ec.Scene:
        contact = replace(scene.contacts[0], **random_foundation(rng))
        return replace(scene, contacts=[contact])

    compared_blocks(seed, count, bedded)


def tangential(seed: int = 0, count: int = 50) -> None:
    """Print the same of blocks on tangentially compliant foundations."""
    compared_blocks(seed, count, tangentially_bedded)


def tangentially_bedded(rng: np.random.Generator, scene: ec.Scene) -> ec.Scene:
    """Put a block on a tangentially compliant foundation, with Tresca friction."""
    sheared = random_foundation(rng)["foundation"].normal
    bed = random_foundation(rng)
    normal = bed["foundation"].normal if rng.random() < 0.5 else None
    bed["foundation"] = ec.Foundation(normal, tangential=sheared)
    friction = ec.Tresca(float(rng.uniform(0.001, 0.02)))
    contact = replace(scene.contacts[0], friction=friction, **bed)
    return replace(scene, contacts=[contact])


def layers(seed: int = 0, count: int = 50) -> None:
    """Print the same of two blocks of height 1/2 with such a layer between them."""
    cases: list[Case] = []
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        scene, _, degree = given_friction(rng)
        scene = tangentially_bedded(rng, scene)
        columns, rows = (int(cells) for cells in rng.integers(1, 5, 2))
        halves = {}
        for name, y in (("lower", 0.0), ("upper", 0.5)):
            halves[name] = ec.rectangle((0.0, y), (1.0, y + 0.5), cells=(columns, rows))
        domain = ec.assembly(halves).joined("lower top", "upper bottom")
        between = replace(scene.contacts[0], facets="upper bottom", against="lower top")
        top = replace(scene.supports[0], facets="upper top")
        held = ec.Displacement("lower bottom", (0.0, 0.0))
        scene = replace(scene, supports=[top, held], contacts=[between])
        cases.append((scene, domain, degree, None))
    compared(cases)


def tightening(seed: int = 0, count: int = 60) -> None:
    """Print how near the default tightening comes to the least error."""
    print(summary_of_tightening(tightened(seed, count)), flush=True)


def plane(seed: int = 0, count: int = 40) -> None:
    """Print what holds of Coulomb certificates on the refined mesh, in the plane."""
    print(summary_of_certificates(certificates(seed, count, random_sliding_block)), flush=True)


def space(seed: int = 0, count: int = 4) -> None:
    """Print the same in 3D."""
    print(summary_of_certificates(certificates(seed, count, random_sliding_box)), flush=True)


def show(columns: dict[str, list[float]], form: str) -> None:
    """Print the quantiles of columns of numbers as a table, without empty columns."""
    filled = {name: numbers for name, numbers in columns.items() if numbers}
    print(quantile_table(filled, QUANTILES, form), flush=True)


TASKS: dict[str, Callable[..., None]] = {
    task.__name__: task
    for task in (
        coarse,
        kinks,
        pushed,
        steps,
        heated,
        sprung,
        turned,
        rigid,
        sections,
        foundations,
        tangential,
        layers,
        tightening,
        plane,
        space,
        plates,
        pairs,
    )
}


if __name__ == "__main__":
    run(TASKS)
