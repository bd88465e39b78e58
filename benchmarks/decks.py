"""Read all decks of a folder, count what is taken, solve it, and compare with CalculiX.

    python benchmarks/decks.py FOLDER [--solve] [--ccx] [PATTERN]

The test suite of CalculiX is such a folder (Debian: calculix-ccx-test). ``--solve`` has
the error of each deck that is taken; ``--ccx`` runs ``ccx`` on it, too, and has the
greatest difference of the displacements at vertices, and of the forces on supports.
At the end stand the decks of statics of solids: how many are taken, and which
are not.
"""

import logging
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

import erc_contact as ec
from erc_contact.decks.interfaces import COUPLING_ELEMENT
from erc_contact.decks.keywords import BY_NAME, REFUSED, squeezed
from namedmesh.files.abaqus_cards import Card, cards_of
from namedmesh.files.abaqus_tables import shape_of
from namedmesh.files.displacements import FileField, displacement_of
from namedmesh.files.reading import read

MOST_CELLS = 5000
"""Greatest number of cells of a deck that is solved."""
INWARD = 1e-4
"""Share of the way to the middle of a cell at which a vertex is evaluated [-]."""
UP_TO_A_MOTION = "displacements are up to such a motion"
"""What a deck tells whose displacements have rigid motions that nothing holds."""
ZERO = 1e-9
"""Sum of forces over the sum of their sizes that is none [-]."""
LONGEST = 300
"""Longest run of CalculiX [s]."""
OF_SUBROUTINES = re.compile(r"[A-Z]+\d?N[UP]")
"""Loads whose values a subroutine computes."""


def is_of_solids(path: Path) -> bool:
    """Tell whether a deck is statics of solids, without a subroutine.

    All its keywords are taken in some way then; refused is how they are used.
    """
    cards = list(cards_of(path))
    words = {squeezed(card.keyword) for card in cards}
    has_other_words = any(w not in BY_NAME or BY_NAME[w].fate == REFUSED for w in words)
    if has_other_words or not {"STATIC", "SOLIDSECTION"} <= words:
        return False
    types = {card.get("TYPE").upper() for card in cards if card.keyword == "ELEMENT"}
    kinds = [shape_of(kind) for kind in types - {COUPLING_ELEMENT}]
    has_solids_alone = any(solid for *_, solid in kinds) and all(shape for shape, *_ in kinds)
    return has_solids_alone and not any(map(_is_of_others, cards))


def _is_of_others(card: Card) -> bool:
    """Tell whether a card has values of a subroutine, or moduli without axes."""
    if squeezed(card.keyword) == "ELASTIC":
        return squeezed(card.get("TYPE")) in ("ANISO", "ANISOTROPIC")
    if card.keyword == "DLOAD" and any(OF_SUBROUTINES.fullmatch(row[1]) for row in card.rows):
        return True
    return card.has("USER") or card.get("DEFINITION").upper() == "USER"


def fate(path: Path, *, solve: bool, with_ccx: bool) -> tuple[str, ec.Deck | None, list[str], str]:
    """Return what becomes of a deck: a word, itself, refused cards, and a sentence."""
    try:
        deck = ec.read_deck(path, penalty="kept")
        scene = deck.scene
    except ec.InputError as reason:
        lines = [line.strip() for line in str(reason).splitlines() if line.startswith("  *")]
        return "refused", None, [line.split(" (")[0] for line in lines], str(reason)
    if not deck.times:
        return "no step", deck, [], ""
    if not solve or deck.domain.cells > MOST_CELLS:
        return "taken", deck, [], ""
    try:
        if isinstance(scene.material, ec.Plastic):
            result: Any = ec.evolve(deck.scene_at, deck.domain, deck.times, accuracy=0.9, degree=2)
            eps = result.steps[-1].eps
        else:
            result = ec.solve(scene, deck.domain, degree=2)
            eps = ec.constitutive_error(ec.equilibrate(result)).relative
        words = f"eps {eps:.3g}, {deck.domain.cells} cells"
        if with_ccx:
            words += f", {differences(path, deck, result)}"
    except ec.ErcContactError as reason:
        return "not solved", deck, [], str(reason)
    return "solved", deck, [], words


def differences(path: Path, deck: ec.Deck, result: Any) -> str:
    """Return the greatest differences from CalculiX, in words."""
    sets = [support.facets for support in deck.scene.supports if " " not in support.facets]
    prints = "".join(f"*NODE PRINT, NSET={name}\nRF\n" for name in sets)
    text = path.read_text("latin-1")
    text = re.sub(r"(?im)^\*end ?step", f"*NODE FILE\nU\n{prints}*END STEP", text)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "job.inp").write_text(text)
        subprocess.run(
            ["ccx", "job"], cwd=folder, capture_output=True, timeout=LONGEST, check=False
        )
        frd = Path(folder) / "job.frd"
        if not frd.is_file():
            return "ccx has no result"
        field = displacement_of(read(frd, "frd", numbered=False))
        table = (Path(folder) / "job.dat").read_text("latin-1")
    d = deck.plan.d
    corners, inward = corners_of(field)
    x = field.x[corners]
    places = (x + INWARD * inward)[:, :d]
    theirs = field.values[corners, :d]
    if field.x.shape[1] > d:  # CalculiX makes a layer of a plane body
        is_top = x[:, 2] == x[:, 2].max()
        places, theirs = places[is_top], theirs[is_top]
    ours = np.full(theirs.shape, np.nan)
    for i, place in enumerate(places):
        try:
            ours[i] = np.asarray(result.at(place).displacement).reshape(-1, d)[-1]
        except ec.InputError:  # beside a curved side
            continue
    is_inside = ~np.isnan(ours[:, 0])
    places, theirs, ours = places[is_inside], theirs[is_inside], ours[is_inside]
    if any(UP_TO_A_MOTION in note.words for note in deck.assumed):
        ring = getattr(deck.scene.material, "hypothesis", "") == "axisymmetric"
        theirs = without_motions(places, theirs, ring=ring)
        ours = without_motions(places, ours, ring=ring)
    scale = abs(theirs).max()
    words = f"u {abs(ours - theirs).max() / scale:.1%}" if scale else "u is 0"
    is_pushed = bool(deck.scene.loads) or any(s.is_moved for s in deck.scene.supports)
    if isinstance(result, ec.Evolution) or not is_pushed:
        return words  # forces on a single support of a body that is warm alone are zero
    forces = forces_of(table)
    greatest = 0.0
    apart = 0.0
    for support in deck.scene.supports:
        name = support.facets
        if name.upper() in forces:
            # Nodes of the set may be held by other sets in other components.
            is_held = np.array([value is not None for value in support.value])
            of_ccx, of_nodes = (values[:d] for values in forces[name.upper()])
            if abs(of_ccx).max() < ZERO * of_nodes.max():
                continue  # the forces of a moment add up to round-off
            of_us = np.array(result.force(name).force) * deck.plan.thickness
            greatest = max(greatest, float(abs(of_ccx).max()))
            apart = max(apart, float(abs((of_us - of_ccx) * is_held).max()))
    words += f", F {apart / greatest:.1%}" if greatest else ""
    return words


def corners_of(field: FileField) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of cells of a file, and the ways into them [length]."""
    every = field.simplices.ravel()
    middles = field.x[field.simplices].mean(axis=1)
    sums = np.zeros(field.x.shape)
    np.add.at(sums, every, np.repeat(middles, field.simplices.shape[1], axis=0))
    corners = np.unique(np.concatenate([block.corners.ravel() for block in field.blocks]))
    inward = sums[corners] / np.bincount(every)[corners, None] - field.x[corners]
    return corners, inward


def without_motions(x: np.ndarray, u: np.ndarray, *, ring: bool) -> np.ndarray:
    """Return displacements (n, d) less the rigid motion that is nearest to them."""
    n, d = x.shape
    motions = [np.tile(row, (n, 1)) for row in np.eye(d)]
    for i, j in combinations(range(d), 2):
        turn = np.zeros((n, d))
        turn[:, i] = x[:, j]
        turn[:, j] = -x[:, i]
        motions.append(turn)
    if ring:
        motions = motions[1:2]
    columns = np.array([motion.ravel() for motion in motions]).T
    amounts = np.linalg.lstsq(columns, u.ravel(), rcond=None)[0]
    return u - (columns @ amounts).reshape(n, d)


def forces_of(table: str) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return the last force on each set of nodes of a table of CalculiX, and its size.

    Nodes that a set lists twice count once; in CalculiX' own totals they count twice.
    """
    of_nodes: dict[str, dict[str, list[float]]] = {}
    name = ""
    for line in table.splitlines():
        words = line.split()
        if "for set" in line:
            name = line.split("for set")[1].split()[0] if line.startswith(" forces") else ""
            of_nodes[name] = {}
        elif name and len(words) == 4:
            of_nodes[name][words[0]] = [float(word) for word in words[1:]]
    result = {}
    for name, nodes in of_nodes.items():
        if nodes:
            values = np.array(list(nodes.values()))
            result[name] = (values.sum(axis=0), abs(values).sum(axis=0))
    return result


def main() -> None:
    """Print a line for each deck, and counts."""
    arguments = [word for word in sys.argv[1:] if not word.startswith("--")]
    folder = Path(arguments[0])
    pattern = arguments[1] if len(arguments) > 1 else "*.inp"
    logging.disable(logging.WARNING)
    with_ccx = "--ccx" in sys.argv
    counts: Counter[str] = Counter()
    of_solids: Counter[str] = Counter()
    not_taken = []
    cards: Counter[str] = Counter()
    alone: Counter[str] = Counter()
    taken: Counter[str] = Counter()
    assumed: Counter[str] = Counter()
    for path in sorted(folder.glob(pattern)):
        begin = time.process_time()
        deck = None
        refused: list[str] = []
        try:
            solve = with_ccx or "--solve" in sys.argv
            word, deck, refused, sentence = fate(path, solve=solve, with_ccx=with_ccx)
        except Exception as reason:  # a fault of the package is counted
            word, sentence = "FAULT", repr(reason)
        counts[word] += 1
        if is_of_solids(path):
            of_solids[word if word in ("refused", "not solved") else "taken"] += 1
            not_taken += [path.stem] if word == "refused" else []
        cards.update(set(refused))
        if len(set(refused)) == 1:
            alone[refused[0]] += 1
        if deck is not None:
            taken.update(list(deck.taken))
            assumed.update({note.card for note in deck.assumed})
        seconds = time.process_time() - begin
        shown = ", ".join(sorted(set(refused))) or sentence.replace("\n", " ")[:300]
        print(f"{path.name:28s} {word:10s} {seconds:6.1f}  {shown}", flush=True)
    print(dict(counts))
    print("statics of solids:", dict(of_solids), "not taken:", ", ".join(not_taken))
    for name, of_cards in (
        ("taken cards, in decks:", taken),
        ("assumed cards, in decks:", assumed),
        ("refused cards, in decks:", cards),
        ("refused alone:", alone),
    ):
        print(name, of_cards.most_common(40))


if __name__ == "__main__":
    main()
