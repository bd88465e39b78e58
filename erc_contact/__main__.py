"""Run the command ``erc-contact``, or ``python -m erc_contact``.

Without arguments it is the check of the package. It returns 0 if the accuracy is
reached or the check passes, 1 if not, and 2 if the input is refused. Under ``mpirun``
rank 0 prints.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Callable, Sequence
from typing import Any

from mpi4py import MPI

from erc_contact.base.exceptions import ErcContactError, InputError
from erc_contact.command.certifying import certify_file
from erc_contact.command.check import run_check
from erc_contact.command.decks import show_deck, show_parts
from erc_contact.command.refining import refine_deck
from erc_contact.command.solving import solve_deck
from erc_contact.decks.deck import PENALTIES

NOT_REACHED = 1
"""Value of a command whose accuracy is not reached."""
REFUSED = 2
"""Value of a command whose input is refused, as of a wrong command line."""


class Parser(ArgumentParser):
    """Read a command line, and write on rank 0 alone."""

    def _print_message(self, message: str, file: Any = None) -> None:
        """Write help or an error."""
        if MPI.COMM_WORLD.rank == 0:
            super()._print_message(message, file)


def main(words: Sequence[str] | None = None) -> int:
    """Run a subcommand; collective.

    Args:
        words: The command line; None takes the one of the process.

    Returns:
        0 if the accuracy is reached, 1 if it is not, 2 if the input is refused.
    """
    arguments = _parser().parse_args(words)
    try:
        return int(arguments.run(arguments))
    except ErcContactError as reason:  # raised on all ranks
        if MPI.COMM_WORLD.rank == 0:
            print(f"erc-contact: {reason}", file=sys.stderr, flush=True)
        return REFUSED if isinstance(reason, InputError) else NOT_REACHED


def _parser() -> Parser:
    """Return the parser of the command line."""
    parser = Parser(
        prog="erc-contact",
        description="Certified accuracy for contact of elastic bodies. Without a subcommand it "
        "checks the package.",
        epilog="It returns 0 if the accuracy is reached, 1 if not, 2 if the input is refused.",
    )
    parser.set_defaults(run=run_check)
    commands = parser.add_subparsers(title="subcommands", metavar="COMMAND")

    def command(name: str, run: Callable[[Namespace], int], words: str, example: str) -> Parser:
        added: Parser = commands.add_parser(
            name,
            help=words,
            description=f"{words[0].upper()}{words[1:]}.",
            epilog=f"example:\n  erc-contact {name} {example}",
            formatter_class=RawDescriptionHelpFormatter,
        )
        added.set_defaults(run=run)
        return added

    parts = command("parts", show_parts, "list the parts of a mesh or a drawing", "bracket.step")
    parts.add_argument("file", help="a mesh, a drawing or a deck")
    parts.add_argument("--size", type=float, help="greatest edge of the cells of a drawing")
    parts.add_argument("-o", "--output", help="folder of the picture (default: this folder)")

    deck = command("deck", show_deck, "tell what a deck is, and what is left out", "job.inp")
    _add_deck(deck, "deck")

    words = "certify the result that another code has computed for a deck"
    certify = command("certify", certify_file, words, "job.inp job.frd")
    _add_deck(certify, "certified")
    _add_result(certify)
    _add_accuracy(certify)

    words = "write the deck of a result with a mesh for an accuracy"
    example = "job.inp job.frd --accuracy 0.05 -o next.inp"
    refine = command("refine", refine_deck, words, example)
    _add_deck(refine)
    _add_result(refine)
    _add_accuracy(refine)
    words = "greatest mesh (default: 100000)"
    refine.add_argument("--max-cells", type=int, default=100_000, help=words)
    refine.add_argument("-o", "--output", help="the new deck (default: DECK_next.inp)")

    words = "solve a deck to an accuracy, with forces and their intervals"
    solve = command("solve", solve_deck, words, "job.inp --accuracy 0.05")
    _add_deck(solve, "solved")
    _add_accuracy(solve)
    solve.add_argument("--degree", type=int, default=1, help="degree of the elements, 1 or 2")
    solve.add_argument("--max-cells", type=int, default=1_000_000, help="greatest mesh")
    words = "draw all pictures; by default those for which there is time"
    solve.add_argument("--pictures", action="store_true", help=words)

    command("check", run_check, "check the package: versions, solvers, a small scene", "")
    return parser


def _add_result(parser: Parser) -> None:
    """Add the file of results of another code."""
    parser.add_argument("result", help="its result: .frd, .vtu, .vtk, .med, .e or .xdmf")


def _add_deck(parser: Parser, ending: str = "") -> None:
    """Add a deck, how it is read, and the folder of the report if it has an ending."""
    parser.add_argument("deck", help="the deck of CalculiX or Abaqus")
    parser.add_argument(
        "--without",
        action="append",
        default=[],
        metavar="CARD",
        help='leave out a card that is refused: --without "*EQUATION"; can be repeated',
    )
    words = "what a pressure over an overclosure is: a penalty for hard contact, or a layer"
    parser.add_argument("--penalty", choices=PENALTIES, default="hard", help=words)
    if ending:
        words = f"folder of the report (default: DECK_{ending})"
        parser.add_argument("-o", "--output", help=words)


def _add_accuracy(parser: Parser) -> None:
    """Add the accuracy."""
    words = "relative error that is asked for (default: 0.05)"
    parser.add_argument("--accuracy", type=float, default=0.05, help=words)


if __name__ == "__main__":
    sys.exit(main())
