"""Show what a file is: parts and pairs of any mesh, and the scene of a deck."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from mpi4py import MPI

from erc_contact.decks.deck import Deck, read_deck
from erc_contact.output.files import make_folder
from namedmesh import Domain, draw_parts, read_mesh
from namedmesh.base.exceptions import InputError
from namedmesh.pictures import on_root

PICTURE = "parts.png"
"""Name of the picture of the parts."""
NEAR = 1e-6
"""Distance of parts that touch, over the extent of the bodies [-]."""


def say(*paragraphs: object) -> None:
    """Print paragraphs on rank 0; they are the same on all ranks."""
    if MPI.COMM_WORLD.rank == 0:
        print(*paragraphs, sep="\n", flush=True)


def deck_of(arguments: Namespace) -> Deck:
    """Read the deck of a command line; collective."""
    return read_deck(arguments.deck, without=arguments.without, penalty=arguments.penalty)


def folder_of(arguments: Namespace, ending: str) -> Path:
    """Make the folder that a command line names, or else one named as the deck.

    Collective.
    """
    name = arguments.output or f"{Path(arguments.deck).stem}_{ending}"
    return make_folder(MPI.COMM_WORLD, name)


def write_words(path: Path, words: str) -> None:
    """Write a text on rank 0; collective."""

    def write() -> None:
        path.write_text(f"{words}\n")

    on_root(MPI.COMM_WORLD, path, write)


def show_parts(arguments: Namespace) -> int:
    """Print names, areas and pairs of a mesh, a drawing or a deck; draw its parts."""
    domain = read_mesh(arguments.file, size=arguments.size)
    words = [str(domain.parts())]
    pairs = domain.touching(within=NEAR * domain.extent)
    if len(pairs):
        words += ["", str(pairs)]
    say(repr(domain), "", *words, "")
    folder = make_folder(MPI.COMM_WORLD, arguments.output or ".")
    _draw(domain, folder)
    return 0


def show_deck(arguments: Namespace) -> int:
    """Print what a deck is, and draw its parts."""
    deck = deck_of(arguments)
    folder = folder_of(arguments, "deck")
    write_words(folder / "deck.txt", str(deck))
    say(deck, "")
    _draw(deck.domain, folder)
    say(f"Report: {folder / 'deck.txt'}")
    return 0


def _draw(domain: Domain, folder: Path) -> None:
    """Draw the parts of a domain, and say where; collective."""
    path = folder / PICTURE
    try:
        draw_parts(domain, path)
    except InputError as reason:  # the libraries of this machine cannot draw
        say(f"No picture: {reason}")
        return
    say(f"Picture: {path}")
