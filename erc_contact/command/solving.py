"""Solve a deck to a prescribed accuracy."""

from __future__ import annotations

from argparse import Namespace

from erc_contact.base.logs import log_to_console
from erc_contact.command.decks import deck_of, folder_of, say, write_words
from erc_contact.command.forces import narrowly_bounded
from erc_contact.decks.deck import Deck
from erc_contact.output.bounded_forces import forces_in_columns
from erc_contact.run.adapt import adapt
from erc_contact.run.evolution import Evolution
from erc_contact.run.evolve import evolve
from erc_contact.run.history import History


def solve_deck(arguments: Namespace) -> int:
    """Solve a deck, print its forces with their intervals, and save a report."""
    deck = deck_of(arguments)
    folder = folder_of(arguments, "solved")
    log_to_console()
    say(deck, "")
    run = _run(deck, arguments)
    run.save(folder, pictures=arguments.pictures or None)
    forces = forces_in_columns(narrowly_bounded(run.error))
    write_words(folder / "forces.txt", forces)
    say("", "Forces on the parts at the end:", forces, "")
    say(f"Report: {folder / 'report.html'}")
    return int(not run.reached)


def _run(deck: Deck, arguments: Namespace) -> History | Evolution:
    """Solve one step as a problem, and several as a history; collective."""
    limits = {"degree": arguments.degree, "max_cells": arguments.max_cells}
    if len(deck.times) > 1:
        return evolve(deck.scene_at, deck.domain, deck.times, arguments.accuracy, **limits)
    return adapt(deck.scene, deck.domain, arguments.accuracy, **limits)
