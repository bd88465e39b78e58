"""Write the page `docs/inside/features.md`: which features work together.

    python benchmarks/features.py > docs/inside/features.md

A feature is a change of a small block that is pressed on a foundation. Of each pair of
features the block with both changes is solved and certified once, and the page has what
came of it, or the words with which it was refused. Two features that change the same
entry to different values are alternatives.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import combinations_with_replacement, pairwise
from typing import Any, NamedTuple

import erc_contact as ec

PROVED, ESTIMATE, ALTERNATIVES = "●", "○", "–"
"""What a cell of the table says; a number stands for the words of a refusal."""
HEAD = f"""# Which features work together

Each cell is a small block that has both features, solved and certified by a script; on
the diagonal it has one feature alone.

```console
python benchmarks/features.py > docs/inside/features.md
```

- {PROVED}: it works, and the error, or the interval of a goal, is proved.
- {ESTIMATE}: it works, and the error or interval is an estimate, or proved up to a term, as with
  Coulomb friction. A certificate rests on an estimate of q.
- {ALTERNATIVES}: two alternatives for the same thing.
- A number: it is refused, with [these words](#refusals).

What three features do together is not in the table. A test computes some of the cells
again.
"""


@dataclass(frozen=True)
class Block:
    """Say what a block has beside its Displacement and its foundation.

    Attributes:
        d: Dimension.
        hypothesis: Hypothesis of the material.
        degree: Degree of the displacement.
        solver: Solver of the elastic equations.
        friction: Friction of the contact.
        contact: Further arguments of the contact.
        foundation: Arguments of a compliant foundation.
        on_body: Whether the contact is with another body.
        cut: Whether a preload draws the block together at a cut.
        tied: Whether the top of the block is a part of its own that is tied.
        face: What the top is, a rigid face or a plane section; None if it is neither.
        held: Whether a support holds the block along the normal of the contact.
        springs: Whether a side is on springs.
        periodic: Whether copies of the block follow each other along x.
        heated: Whether it has a given strain.
        plastic: Whether the material is plastic.
        varies: Whether the moduli vary.
        history: Whether it is the second step of a history.
        goal: Whether the force on the contact is asked for.
        certificate: Whether the certificate of Coulomb friction is asked for.
    """

    d: int = 2
    hypothesis: str = "plane strain"
    degree: int = 1
    solver: str = "direct"
    friction: Any = 0.0
    contact: tuple[tuple[str, Any], ...] = ()
    foundation: tuple[tuple[str, float], ...] = ()
    on_body: bool = False
    cut: bool = False
    tied: bool = False
    face: type[ec.Rigid] | None = None
    held: bool = True
    springs: bool = False
    periodic: bool = False
    heated: bool = False
    plastic: bool = False
    varies: bool = False
    history: bool = False
    goal: bool = False
    certificate: bool = False


class Feature(NamedTuple):
    """Hold the changes of a block that make a feature.

    Attributes:
        changes: Entries of the block, with their values.
        needs: The same, where the other feature of a pair does not say otherwise.
    """

    changes: Mapping[str, Any]
    needs: Mapping[str, Any] = {}


def hill(x: Any) -> Any:
    """Return a gap that is zero in the middle."""
    return 0.02 * (x[0] - 0.5) ** 2


TRESCA = ec.Tresca(0.002)
BRUSHED = ec.Orthotropic((0.1, 0.4), axes=(1.0, 0.0, 0.0))
FEATURES = {
    "3D": Feature({"d": 3}),
    "body of revolution": Feature({"hypothesis": "axisymmetric"}),
    "two bodies": Feature({"on_body": True}),
    "degree 2": Feature({"degree": 2}),
    "multigrid": Feature({"solver": "iterative"}),
    "Tresca friction": Feature({"friction": TRESCA}),
    "Coulomb friction": Feature({"friction": 0.3}),
    "orthotropic friction": Feature({"friction": BRUSHED}, {"d": 3}),
    "bilateral contact": Feature({"contact": (("bilateral", True),)}),
    "gap that varies": Feature({"contact": (("gap", hill),)}),
    "moving foundation": Feature({"contact": (("motion", True),)}, {"friction": TRESCA}),
    "compliant foundation": Feature({"foundation": (("normal", 1.0),)}),
    "tangential compliance": Feature({"foundation": (("tangential", 1.0),)}, {"friction": TRESCA}),
    "rigid face": Feature({"face": ec.Rigid}),
    "plane section": Feature({"face": ec.PlaneSection}),
    "springs": Feature({"springs": True}),
    "periodic sides": Feature({"periodic": True}),
    "held by contact alone": Feature({"held": False}),
    "preload": Feature({"cut": True}),
    "tied bodies": Feature({"tied": True}),
    "given strain": Feature({"heated": True}),
    "plasticity": Feature({"plastic": True}),
    "moduli that vary": Feature({"varies": True}),
    "loading history": Feature({"history": True}),
    "goal": Feature({"goal": True}),
    "Coulomb certificate": Feature({"certificate": True}, {"friction": 0.3}),
}
TUPLES = ("contact", "foundation")
"""Entries of a block that have what both features give."""


def block_of(one: Feature, other: Feature) -> Block | None:
    """Return the block with two features; None if they are alternatives."""
    changes = dict(one.changes)
    for name, value in other.changes.items():
        if name in TUPLES and name in changes and value != changes[name]:
            changes[name] = (*changes[name], *value)
        elif changes.setdefault(name, value) != value:
            return None
    return Block(**{**one.needs, **other.needs, **changes})


@cache
def meshed(d: int, *, on_body: bool, cut: bool, tied: bool) -> ec.Domain:
    """Return the block "body" of unit size, with what is below and above it."""
    make = ec.rectangle if d == 2 else ec.box
    names = ["body", *["head"] * cut, *["cap"] * tied]
    heights = {name: float(number) for number, name in enumerate(names)}
    if on_body:
        heights["base"] = -1.0
    bodies = {}
    for name, foot in heights.items():
        low, high = (0.0,) * (d - 1), (1.0,) * (d - 1)
        bodies[name] = make((*low, foot), (*high, foot + 1.0), cells=(2,) * d)
    domain = ec.assembly(bodies)
    if on_body:
        domain = domain.joined("body bottom", "base top")
    for below, above in pairwise(names):
        domain = domain.joined(f"{below} top", f"{above} bottom")
    return domain


def scene_of(block: Block, share: float = 1.0) -> ec.Scene:
    """Return the scene of a block under a share of its press."""
    names = ["body", *["head"] * block.cut, *["cap"] * block.tied]
    top = f"{names[-1]} top"
    zeros = (0.0,) * (block.d - 1)
    rings = block.hypothesis == "axisymmetric"
    along = 0.0 if rings else 0.004

    E = (lambda x: 1.0 + x[0]) if block.varies else 1.0
    material: Any = ec.Elastic(E, 0.3, hypothesis=block.hypothesis)
    if block.plastic:
        material = ec.Plastic(
            E, 0.3, yield_stress=0.005, hardening=0.2, hypothesis=block.hypothesis
        )

    supports: list[Any] = []
    loads = []
    push = (along * share, *zeros[1:], -0.01 * share)
    weight = (*zeros, -0.01 * share)
    force = (*(None,) * (block.d - 1), -0.01 * share)
    if block.face is not None and rings:
        supports.append(block.face(top, force=force))
    elif block.face is ec.Rigid:
        rotation = 0.0 if block.d == 2 else (0.0, 0.0, 0.0)
        supports.append(ec.Rigid(top, (*push[:-1], None), rotation, force=force))
    elif block.face is ec.PlaneSection:
        moment = 0.0 if block.d == 2 else (0.0, 0.0, None)
        supports.append(ec.PlaneSection(top, force=force, moment=moment))
    elif block.held:
        supports.append(ec.Displacement(top, push))
    else:
        loads.append(ec.Traction(top, weight))
    if block.on_body:
        supports.append(ec.Displacement("base bottom", (*zeros, 0.0)))

    options = dict(block.contact)
    if "motion" in options:
        options["motion"] = (-along * share - 0.001 * share, *zeros)
    if block.on_body:
        options["against"] = "base top"
    if block.foundation:
        options["foundation"] = ec.Foundation(**dict(block.foundation))
    contacts = [ec.Contact("body bottom", friction=block.friction, **options)]
    if block.periodic:
        contacts.append(ec.Periodic("body left", "body right"))

    joints: list[ec.Tied] = []
    parts = [f"{name} {end}" for name in names for end in ("bottom", "top")][1:-1]
    pairs = list(zip(parts[::2], parts[1::2], strict=True))
    if block.cut:
        below, above = pairs.pop(0)
        joints.append(ec.Preload(above, against=below, shortening=0.001 * share))
    joints += [ec.Tied(above, against=below) for below, above in pairs]
    return ec.Scene(
        material,
        supports,
        loads,
        contacts,
        springs=[ec.Spring("body right", 0.1, 0.1)] if block.springs else (),
        ties=joints,
        strains=[ec.ThermalStrain(0.001, share)] if block.heated else (),
    )


def outcome(block: Block) -> str:
    """Solve and certify a block, and return what came of it."""
    domain = meshed(block.d, on_body=block.on_body, cut=block.cut, tied=block.tied)
    options: dict[str, Any] = {"degree": block.degree, "solver": block.solver}
    try:
        before = ec.solve(scene_of(block, 0.5), domain, **options) if block.history else None
        solution = ec.solve(scene_of(block), domain, after=before, **options)
        error = ec.constitutive_error(ec.equilibrate(solution))
        proved = error.guaranteed
        if block.goal:
            force = ec.Resultant("body bottom", (*(0.0,) * (block.d - 1), 1.0))
            proved = ec.interval(error, force).guaranteed
        if block.certificate:
            ec.coulomb_certificate(error)
            proved = False
    except ec.ErcContactError as reason:
        return str(reason).split("\n")[0].split(". ")[0].split("; ")[0].rstrip(".") + "."
    return PROVED if proved else ESTIMATE


def cell(one: str, other: str) -> str:
    """Return what the page says of two features."""
    block = block_of(FEATURES[one], FEATURES[other])
    return ALTERNATIVES if block is None else outcome(block)


def page(cells: Mapping[tuple[str, str], str]) -> Iterator[str]:
    """Yield the lines of the page."""
    yield HEAD
    counts = Counter(cells.values())
    told = f"{counts[PROVED]} cells are proved, {counts[ESTIMATE]} are estimates"
    refused = sum(counts.values()) - sum(counts[sign] for sign in (PROVED, ESTIMATE, ALTERNATIVES))
    yield f"{told}, {refused} are refused.\n"
    names = list(FEATURES)
    numbers: dict[str, int] = {}
    yield "| | | " + " | ".join(str(k) for k in range(1, len(names) + 1)) + " |"
    yield "|---|---|" + "---|" * len(names)
    for row, name in enumerate(names):
        entries = [""] * row
        for other in names[row:]:
            said = cells[name, other]
            if said not in (PROVED, ESTIMATE, ALTERNATIVES):
                said = str(numbers.setdefault(said, len(numbers) + 1))
            entries.append(said)
        yield f"| {row + 1} | {name} | " + " | ".join(entries) + " |"
    yield "\n## Refusals\n"
    for words, number in numbers.items():
        yield f"{number}. {words}"


if __name__ == "__main__":
    found = {pair: cell(*pair) for pair in combinations_with_replacement(FEATURES, 2)}
    print("\n".join(page(found)))
