"""Certify the file of results that a command line names."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import dataclass
from math import isclose
from pathlib import Path

from erc_contact.command.decks import deck_of
from erc_contact.decks.deck import Deck
from erc_contact.error.certify import Certificate, certify
from namedmesh.for_solvers import FileField, from_file

SAME_TIME = 1e-5
"""Relative difference of times that is none: files have six digits [-]."""


@dataclass(frozen=True)
class CertifiedFile:
    """Hold the certificate of a file of results.

    Attributes:
        deck: The deck that it is a result of.
        name: Name of the file.
        time: The time of its last result [time].
        field: Its displacement and forces, as the file has them.
        certificate: The error of this result.
    """

    deck: Deck
    name: str
    time: float
    field: FileField
    certificate: Certificate


def certified_file(arguments: Namespace) -> CertifiedFile:
    """Certify the file of results of a command line; collective."""
    deck = deck_of(arguments)
    field = from_file(deck.domain.comm, arguments.result)
    time = _time_of(deck, field)
    certificate = certify(deck.scene_at(time), deck.domain, field)
    return CertifiedFile(deck, Path(arguments.result).name, time, field, certificate)


def _time_of(deck: Deck, field: FileField) -> float:
    """Return the time of a result; the end of the last step if its file tells none."""
    ends = deck.times or [0.0]
    if field.time is None:
        return ends[-1]
    same = [end for end in ends if isclose(end, field.time, rel_tol=SAME_TIME)]
    return (same or [field.time])[0]
