"""Read supports, loads, temperatures, amplitudes and steps.

What they prescribe is kept as the deck says it, in nodes, elements and faces of
elements; see :mod:`erc_contact.decks.supports` and :mod:`erc_contact.decks.loads`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.decks.histories import Amplitude, Entry, Key
from erc_contact.decks.orthotropic import rectangular
from erc_contact.decks.reading import PLASTIC_STRAIN, Axes, DeckReading
from erc_contact.decks.told import number_of, numbers_in
from namedmesh.for_solvers import Card, DeckSpace

NAMED_SUPPORTS = {
    "ENCASTRE": (1, 6),
    "PINNED": (1, 3),
    "XSYMM": (1, 1),
    "YSYMM": (2, 2),
    "ZSYMM": (3, 3),
    "XASYMM": (2, 3),
    "YASYMM": (1, 3),
    "ZASYMM": (1, 2),
}
"""Supports of Abaqus by their names: first and last component."""
EQUAL = 1e-6
"""Relative difference of numbers of a deck that is none [-]."""


@dataclass(frozen=True, eq=False)
class Held:
    """Hold a prescribed component of the displacement of nodes.

    Attributes:
        name: Name of the set, or "" of single nodes.
        nodes: The points.
        component: Degree of freedom of the deck, from 1.
        values: Values at the nodes [length].
        card: The card.
        is_fixed: Whether the value is what the step before has reached.
    """

    name: str
    nodes: np.ndarray
    component: int
    values: np.ndarray
    card: Card
    is_fixed: bool = False


@dataclass(frozen=True, eq=False)
class NodalForces:
    """Hold forces on nodes, shape (n, d) of components of the deck."""

    name: str
    nodes: np.ndarray
    forces: np.ndarray
    card: Card


@dataclass(frozen=True, eq=False)
class Pressure:
    """Hold pressures on faces [force/area]."""

    name: str
    faces: np.ndarray
    values: np.ndarray
    card: Card


@dataclass(frozen=True, eq=False)
class FaceTraction:
    """Hold a force per area on faces, d numbers [force/area]."""

    name: str
    faces: np.ndarray
    value: tuple[float, ...]
    card: Card


@dataclass(frozen=True, eq=False)
class Gravity:
    """Hold an acceleration of cells, d numbers [length/time^2]."""

    cells: np.ndarray
    acceleration: tuple[float, ...]
    card: Card


@dataclass(frozen=True, eq=False)
class Spin:
    """Hold a rotation of cells about an axis: square of its speed, point, direction."""

    cells: np.ndarray
    square: float
    point: tuple[float, ...]
    direction: tuple[float, ...]
    card: Card


@dataclass(frozen=True, eq=False)
class Warmth:
    """Hold temperatures of nodes."""

    nodes: np.ndarray
    values: np.ndarray
    card: Card


# --- steps


def read_step(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Begin a step."""
    reading.current = None
    reading.steps.open(jumps=card.get("AMPLITUDE").upper() == "STEP")
    if card.has("NLGEOM") and card.get("NLGEOM").upper() != "NO":
        reading.told.assume(
            card,
            "NLGEOM: displacements are taken as small; the solution tells where rotations, strains "
            "or the statics of displaced bodies say that they are not",
        )
    if card.has("PERTURBATION"):
        reading.told.assume(card, "PERTURBATION: the step begins without the loads before")


def read_static(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Take the period of a static step."""
    numbers = numbers_in(card)
    if len(numbers) > 1 and numbers[1] > 0:
        reading.steps.last(numbers[1])


def read_end_step(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """End a step."""
    reading.steps.close()


def read_amplitude(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read a table of factors by time."""
    if card.get("DEFINITION").upper() not in ("", "TABULAR"):
        reading.told.refuse(card, f"DEFINITION={card.get('DEFINITION')}: tables are read.")
        return
    if card.has("USER"):
        reading.told.refuse(card, "USER: a subroutine cannot be read; give a table.")
        return
    numbers = [number for line in range(len(card.lines)) for number in numbers_in(card, line)]
    times = tuple(numbers[0::2])
    factors = tuple(numbers[1::2])
    if len(times) != len(factors) or not times or np.any(np.diff(times) <= 0):
        reading.told.refuse(card, "give pairs of times that increase and factors.")
        return
    total = card.get("TIME").upper().startswith("TOTAL")
    reading.amplitudes[card.get("NAME").upper()] = Amplitude(times, factors, total)


# --- supports


def read_transform(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read local axes of nodes."""
    numbers = [*numbers_in(card), *([0.0] * 6)][:6]
    nodes = reading.mesh.nodes(card.get("NSET"), space)
    kind = card.get("TYPE").upper() or "R"
    if kind == "R":
        reading.transforms.append(Axes(nodes, np.zeros(3), rectangular(numbers), False, card))
    elif kind == "C":
        a, b = np.array(numbers).reshape(2, 3)
        z = (b - a) / np.linalg.norm(b - a)
        axes = np.array([np.zeros(3), np.zeros(3), z])
        reading.transforms.append(Axes(nodes, a, axes, True, card))
    else:
        reading.told.refuse(card, f"TYPE={kind}: R and C are read.")


def read_boundary(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read prescribed displacements."""
    if card.has("FIXED"):
        _read_fixed(reading, card, space)
        return
    if any(card.has(name) for name in ("SUBMODEL", "MASSFLOW", "USER", "LOADCASE")):
        reading.told.refuse(card, f"{', '.join(card.parameters)}: values in lines alone are read.")
        return
    amplitude = reading.amplitude(card)
    if card.get("OP").upper() == "NEW":
        reading.steps.renew("held")
    references = reading.references()
    singles: dict[int, dict[int, float]] = {}
    for row in card.rows:
        word = row[0]
        first, last, value = _components(card, row)
        nodes = reading.mesh.nodes(word, space)
        if not len(nodes):
            reading.told.refuse(card, f"there is no node or set {word!r}; mend the name.")
            continue
        for component in range(first, last + 1):
            if references.issuperset(nodes.tolist()):
                for node in nodes.tolist():
                    reading.steps.add("grip", (node, component), value, amplitude)
            elif word.isdigit():
                singles.setdefault(component, {})[int(nodes[0])] = value
            else:
                held = Held(word, nodes, component, np.full(len(nodes), value), card)
                reading.steps.add("held", (word.upper(), component), held, amplitude)
    for component, values in singles.items():
        points = np.array(list(values))
        held = Held("", points, component, np.array(list(values.values())), card)
        reading.steps.add("held", (tuple(sorted(values)), component), held, amplitude)


def _read_fixed(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read that nodes stay where an earlier step has left them, and bolts as short."""
    steps = reading.steps
    if steps.number < 2:
        reading.told.refuse(card, "FIXED: no step before has reached anything.")
        return
    bolts = {pretension.node for pretension in reading.pretensions}
    for row in card.rows:
        nodes = reading.mesh.nodes(row[0], space)
        if not len(nodes):
            reading.told.refuse(card, f"there is no node or set {row[0]!r}; mend the name.")
        elif bolts.issuperset(nodes.tolist()):
            for node in nodes.tolist():
                steps.add("locked", (node,), True, None)
        else:
            reading.told.assume(
                card,
                f"FIXED: {row[0]} stays where the solution of degree 2 on the mesh of the deck is "
                f"at t = {steps.begin:g}, and carries the loads on itself",
            )
            first, last, _ = _components(card, row)
            for component in range(first, last + 1):
                held = Held(row[0], nodes, component, np.zeros(len(nodes)), card, is_fixed=True)
                steps.stay("held", (row[0].upper(), component), held)


def _components(card: Card, row: list[str]) -> tuple[int, int, float]:
    """Return first and last component and the value of a line of *BOUNDARY."""
    if len(row) > 1 and row[1].upper() in NAMED_SUPPORTS:
        return (*NAMED_SUPPORTS[row[1].upper()], 0.0)
    numbers = [number_of(card, word) for word in row[1:]]
    first = int(numbers[0]) if numbers else 1
    last = int(numbers[1]) if len(numbers) > 1 and numbers[1] else first
    return first, last, numbers[2] if len(numbers) > 2 else 0.0


# --- loads


def read_cload(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read forces on nodes."""
    if any(card.has(name) for name in ("USER", "SUBMODEL", "SECTOR")):
        reading.told.refuse(card, f"{', '.join(card.parameters)}: values in lines alone are read.")
        return
    amplitude = reading.amplitude(card)
    if card.get("OP").upper() == "NEW":
        reading.steps.renew("forces")
        reading.steps.renew("grip force")
    references = reading.references()
    forces: dict[int, np.ndarray] = {}
    for row in card.rows:
        component = int(row[1])
        value = number_of(card, row[2])
        nodes = reading.mesh.nodes(row[0], space)
        if not len(nodes):
            reading.told.refuse(card, f"there is no node or set {row[0]!r}; mend the name.")
            return
        if references.issuperset(nodes.tolist()):
            for node in nodes.tolist():
                reading.steps.add("grip force", (node, component), value, amplitude)
            continue
        if component > 3:
            reading.told.refuse(
                card, f"component {component}: a moment acts on no point of a body."
            )
            return
        for node in nodes:
            forces.setdefault(int(node), np.zeros(3))[component - 1] += value
    if forces:
        nodes = np.array(sorted(forces))
        table = np.array([forces[node] for node in nodes])
        name = card.rows[0][0]
        load = NodalForces("" if name.isdigit() else name, nodes, table, card)
        key = tuple(nodes.tolist())
        for earlier in reading.steps.acting("forces", key):
            _replace(reading, card, earlier, earlier.what.nodes, nodes)
        reading.steps.add("forces", key, load, amplitude)


def _replace(
    reading: DeckReading, card: Card, earlier: Entry, members: np.ndarray, new: np.ndarray
) -> None:
    """End an earlier load whose nodes or faces are loaded anew; refuse a share."""
    shared = np.intersect1d(members, new)
    if len(shared) == len(members):
        reading.steps.fade(earlier)
    elif len(shared):
        reading.told.refuse(
            card,
            f"it loads a part of what {earlier.what.card.place} has loaded in an earlier step: say "
            "all of it anew, with OP=NEW.",
        )


def read_dload(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read loads on elements: pressures on faces, gravity and rotation."""
    amplitude = reading.amplitude(card)
    if card.get("OP").upper() == "NEW":
        for kind in ("pressure", "body"):
            reading.steps.renew(kind)
    by_face: dict[int, float] = {}
    for row in card.rows:
        word, label = row[0], row[1].upper()
        numbers = [number_of(card, entry) for entry in row[2:]]
        if label in ("GRAV", "CENTRIF"):
            _read_body_load(reading, card, space, word, label, numbers, amplitude)
        elif len(label) == 2 and label[0] == "P" and label[1].isdigit():
            faces = reading.mesh.face_of_element(word, label, space)
            if not len(faces):
                reading.told.refuse(card, f"{word}, {label} is no face of a solid; mend the line.")
                return
            if word.isdigit():
                for face in faces:
                    by_face[int(face)] = by_face.get(int(face), 0.0) + numbers[0]
                continue
            load = Pressure(word, faces, np.full(len(faces), numbers[0]), card)
            _add_on_faces(reading, (word.upper(), label), load, amplitude)
        else:
            reading.told.refuse(card, f"the load {label}: P1 to P6, GRAV and CENTRIF are read.")
    if by_face:
        faces = np.array(sorted(by_face))
        values = np.array([by_face[face] for face in faces])
        load = Pressure("", faces, values, card)
        _add_on_faces(reading, tuple(faces.tolist()), load, amplitude)


def _add_on_faces(
    reading: DeckReading,
    key: Key,
    load: Pressure | FaceTraction,
    amplitude: Amplitude | None,
) -> None:
    """Add a load on faces, and end earlier loads there."""
    for earlier in reading.steps.acting("pressure", key):
        if type(earlier.what) is type(load):
            _replace(reading, load.card, earlier, earlier.what.faces, load.faces)
    reading.steps.add("pressure", key, load, amplitude)


def _read_body_load(
    reading: DeckReading,
    card: Card,
    space: DeckSpace,
    word: str,
    label: str,
    numbers: list[float],
    amplitude: Amplitude | None,
) -> None:
    """Read gravity or a rotation of elements; without a set it is of all."""
    d = reading.mesh.d
    mesh = reading.mesh
    cells = mesh.cells(word, space) if word else np.concatenate(mesh.body.numbers)
    if not len(cells):
        reading.told.refuse(card, f"no solid element is called {word!r}; mend the name.")
        return
    numbers = [*numbers, *([0.0] * 7)]
    what: Gravity | Spin
    if label == "GRAV":
        direction = np.array(numbers[1:4])
        length = np.linalg.norm(direction) or 1.0
        acceleration = numbers[0] * direction / length
        what = Gravity(cells, tuple(float(value) for value in acceleration[:d]), card)
        # Gravity along several directions adds up.
        label = f"{label} {numbers[1:4]}"
    else:
        what = Spin(cells, numbers[0], tuple(numbers[1:4]), tuple(numbers[4:7]), card)
    reading.steps.add("body", (word.upper(), label), what, amplitude)


def read_dsload(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read loads on surfaces: pressures, and tractions along a vector."""
    amplitude = reading.amplitude(card)
    if card.get("OP").upper() == "NEW":
        reading.steps.renew("pressure")
    for row in card.rows:
        faces = reading.mesh.surface(row[0])
        label = row[1].upper()
        if faces is None or not len(faces):
            reading.told.refuse(card, f"no surface is called {row[0]!r}; mend the name.")
        elif label == "P":
            values = np.full(len(faces), number_of(card, row[2]))
            load = Pressure(row[0], faces, values, card)
            _add_on_faces(reading, (row[0].upper(), label), load, amplitude)
        elif label == "TRVEC":
            numbers = [number_of(card, word) for word in row[2:6]]
            direction = np.array(numbers[1:])
            vector = numbers[0] * direction / np.linalg.norm(direction)
            value = tuple(float(entry) for entry in vector[: reading.mesh.d])
            traction = FaceTraction(row[0], faces, value, card)
            _add_on_faces(reading, (row[0].upper(), label), traction, amplitude)
        else:
            reading.told.refuse(card, f"the load {label}: P and TRVEC are read.")


# --- temperatures


def read_temperature(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read temperatures of nodes in a step."""
    if card.has("FILE") or card.has("USER"):
        reading.told.refuse(card, "temperatures in lines alone are read; write them there.")
        return
    if card.get("OP").upper() == "NEW":
        reading.steps.renew("warmth")
    amplitude = reading.amplitude(card)
    for nodes, values in _nodal_values(reading, card, space):
        key = (nodes.tobytes(),)
        for earlier in reading.steps.acting("warmth", key):
            _warm_anew(reading, earlier, nodes)
        reading.steps.add("warmth", key, Warmth(nodes, values, card), amplitude)


def _warm_anew(reading: DeckReading, earlier: Entry, nodes: np.ndarray) -> None:
    """End the share of an earlier temperature that is of nodes which are given anew."""
    warmth: Warmth = earlier.what
    is_anew = np.isin(warmth.nodes, nodes)
    if not is_anew.any():
        return
    stays = Warmth(warmth.nodes[~is_anew], warmth.values[~is_anew], warmth.card)
    fades = replace(
        earlier, what=Warmth(warmth.nodes[is_anew], warmth.values[is_anew], warmth.card)
    )
    earlier.what = stays
    reading.steps.entries["warmth"].append(fades)
    reading.steps.fade(fades)


def read_initial(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read temperatures of nodes, or tensors of elements, at the beginning."""
    kind = card.get("TYPE").upper()
    if card.has("USER") or kind not in ("TEMPERATURE", "STRESS", PLASTIC_STRAIN):
        said = ", ".join(filter(None, [kind, "USER" if card.has("USER") else ""]))
        reading.told.refuse(
            card, f"TYPE={said}: TEMPERATURE, STRESS and PLASTIC STRAIN in lines are read."
        )
    elif kind != "TEMPERATURE":
        _read_tensors(reading, card, space)
    else:
        for nodes, values in _nodal_values(reading, card, space):
            reading.initial.update(zip(nodes.tolist(), values.tolist(), strict=True))


def _read_tensors(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Read tensors of elements: six components, in CalculiX behind a point of each."""
    if reading.mesh.d != 3:
        reading.told.refuse(card, "stresses and strains of bodies in space alone are read.")
        return
    for row in card.rows:
        numbers = [number_of(card, word) for word in row[1:]][-6:]
        if len(row) not in (7, 8):
            reading.told.refuse(card, f"a line has {len(row)} words; give the six components.")
            return
        xx, yy, zz, xy, xz, yz = numbers
        tensor = ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))
        for cell in reading.mesh.cells(row[0], space):
            known, first = reading.tensors.setdefault(int(cell), (tensor, card))
            if first.get("TYPE").upper() != card.get("TYPE").upper():
                reading.told.refuse(card, f"{first.place} has a tensor of element {row[0]}, too.")
                return
            if not np.allclose(known, tensor, rtol=EQUAL):
                reading.told.refuse(card, f"it varies inside element {row[0]}; give one value.")
                return


def _nodal_values(
    reading: DeckReading, card: Card, space: DeckSpace
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return nodes and values of the lines of a card; single nodes are together."""
    singles: dict[int, float] = {}
    result = []
    for row in card.rows:
        nodes = reading.mesh.nodes(row[0], space)
        if not len(nodes):
            raise InputError(
                f"*{card.keyword} ({card.place}): there is no node or set {row[0]!r}; mend it."
            )
        value = number_of(card, row[1] if len(row) > 1 else "")
        if row[0].isdigit():
            singles[int(nodes[0])] = value
        else:
            result.append((nodes, np.full(len(nodes), value)))
    if singles:
        nodes = np.array(sorted(singles))
        result.append((nodes, np.array([singles[node] for node in nodes])))
    return result
