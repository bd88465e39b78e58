"""Read all decks of a folder, count what is taken, and solve what is taken.

    python benchmarks/decks.py FOLDER [--solve] [PATTERN]

The test suite of CalculiX is such a folder (Debian: calculix-ccx-test).
"""

import logging
import sys
import time
from collections import Counter
from pathlib import Path

import erc_contact as ec

MOST_CELLS = 5000
"""Greatest number of cells of a deck that is solved."""


def fate(path: Path, *, solve: bool) -> tuple[str, list[str], str]:
    """Return what becomes of a deck: a word, refused cards, and a sentence."""
    try:
        deck = ec.read_deck(path)
        scene = deck.scene
    except ec.InputError as reason:
        lines = [line.strip() for line in str(reason).splitlines() if line.startswith("  *")]
        return "refused", [line.split(" (")[0] for line in lines], str(reason)
    if not deck.times:
        return "no step", [], ""
    if not solve or deck.domain.cells > MOST_CELLS:
        return "taken", [], ""
    try:
        error = ec.constitutive_error(ec.equilibrate(ec.solve(scene, deck.domain, degree=2)))
    except ec.ErcContactError as reason:
        return "not solved", [], str(reason)
    return "solved", [], f"eps {error.relative:.3g}, {deck.domain.cells} cells"


def main() -> None:
    """Print a line for each deck, and counts."""
    arguments = [word for word in sys.argv[1:] if not word.startswith("--")]
    folder = Path(arguments[0])
    pattern = arguments[1] if len(arguments) > 1 else "*.inp"
    logging.disable(logging.WARNING)
    counts: Counter[str] = Counter()
    cards: Counter[str] = Counter()
    alone: Counter[str] = Counter()
    for path in sorted(folder.glob(pattern)):
        begin = time.perf_counter()
        try:
            word, refused, sentence = fate(path, solve="--solve" in sys.argv)
        except Exception as reason:  # a fault of the package is counted
            word, refused, sentence = "FAULT", [], repr(reason)
        counts[word] += 1
        cards.update(set(refused))
        if len(set(refused)) == 1:
            alone[refused[0]] += 1
        seconds = time.perf_counter() - begin
        shown = ", ".join(sorted(set(refused))) or sentence.replace("\n", " ")[:300]
        print(f"{path.name:28s} {word:10s} {seconds:6.1f}  {shown}", flush=True)
    print(dict(counts))
    print("refused cards, in decks:", cards.most_common(40))
    print("refused alone:", alone.most_common(40))


main()
