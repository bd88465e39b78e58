"""Certify the result that another code has computed for a deck."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from erc_contact.command.decks import folder_of, say, write_words
from erc_contact.command.forces import bolt_forces, narrowly_bounded, with_forces_of
from erc_contact.command.results import certified_file
from erc_contact.decks.deck import Deck
from erc_contact.error.certify import ADVICE, Certificate
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.sizes import PREDICTIVE_ERROR, size_map
from erc_contact.model.preload import shifts_of
from erc_contact.output.bounded_forces import BoundedForce, forces_in_columns, forces_in_html
from erc_contact.output.gallery import Gallery
from erc_contact.output.report import write_report
from erc_contact.output.verdict import parted, verdict
from erc_contact.run.history import add_error
from namedmesh.base.percent import percent, place_words
from namedmesh.base.ranks import gather_rows
from namedmesh.base.releases import cell_nodes

IN_WORDS = {
    "the mesh": "the mesh",
    "the contact": "the contact enforcement (penetration, tension, friction)",
    "the displacement": "forces out of balance (solver, digits, contact stiffness)",
}
"""The causes of an error as an engineer calls them."""
MOST = 0.5
"""Share of the squared error in the cells that are told as the place of it [-]."""


@dataclass(frozen=True)
class Certified:
    """Hold what a report shows of a certificate: error, and verdict in words."""

    error: ConstitutiveError
    outcome: str


def certify_file(arguments: Namespace) -> int:
    """Certify a file of results, and write the verdict, pictures and a report."""
    folder = folder_of(arguments, "certified")
    certified = certified_file(arguments)
    deck, name, time = certified.deck, certified.name, certified.time
    certificate = certified.certificate
    error = certificate.error
    forces = narrowly_bounded(error)
    if certificate.interpolated:  # the simplices have other nodal forces than the cells
        forces = with_forces_of(forces, error, certified.field, deck.plan.thickness)
    bolts = bolt_forces(error, deck.scene_at(time))
    sentences = [
        _how_wrong(certificate, name, time),
        *_of_the_time(deck, time, name),
        *_from_what(certificate),
        _where(error),
        _how_many_cells(certificate, arguments.accuracy),
        _of_forces(forces, name),
        *_of_bolts(bolts, error),
    ]
    forces += bolts
    words = "\n".join(sentences)
    columns = forces_in_columns(forces)
    write_words(folder / "verdict.txt", f"{words}\n\n{columns}")
    say(words, "", columns, "")
    gallery = Gallery(error.domain, folder, 0.0, every=True)
    add_error(gallery, error, "certificate.error")
    path = folder / "report.html"
    claims, unknown = parted([*_assumed(deck), *_in_its_cells(certificate), *verdict(error)])
    write_report(
        Certified(error, words),
        path,
        f"relative error {percent(certificate.total)} of {name}",
        {},
        gallery,
        results=forces_in_html(forces),
        claims=claims,
        unknown=unknown,
    )
    say(f"Report: {path}")
    return int(certificate.total > arguments.accuracy)


def _assumed(deck: Deck) -> list[tuple[str, str]]:
    """Return what is taken in another way than the deck says, as claims."""
    return [("assumed", str(note)) for note in deck.assumed]


def _in_its_cells(certificate: Certificate) -> list[tuple[str, str]]:
    """Say of what the numbers of a report are if the result has other cells."""
    if not certificate.interpolated:
        return []
    words = (
        f"The result has the error {percent(certificate.total)} in its own cells. What "
        "follows is of its displacement on simplices, between whose nodes it is interpolated."
    )
    return [("bound", words)]


def _how_wrong(certificate: Certificate, name: str, time: float) -> str:
    """Say how large the error is, and whether that is proved."""
    eps = certificate.total
    words = (
        f"{name} at t = {time:g} has the error eps = {percent(eps)} against the exact solution of "
        "the deck: in the mean over the bodies (energy norm) its stress is wrong by at most about "
        f"{percent(2.0 * eps, 2)}, and by {percent(eps)} halfway to the stress in equilibrium. "
    )
    if not certificate.error.guaranteed:
        return f"{words}The report names what is not proved of it."
    if certificate.interpolated:
        return f"{words}This is proved, up to the quadrature in its cells."
    return f"{words}This is proved."


def _of_the_time(deck: Deck, time: float, name: str) -> list[str]:
    """Say what of the history of the deck the error does not know."""
    sentences = []
    if deck.times and time < deck.times[-1]:
        sentences.append(
            f"The last result of {name} is at t = {time:g}, before the end of the deck at t = "
            f"{deck.times[-1]:g}: the other code has not written, or not reached, the end."
        )
    has_friction = any(contact.friction != 0.0 for contact in deck.scene.contacts)
    if has_friction and len([end for end in deck.times if end <= time]) > 1:
        sentences.append(
            "The deck has several steps with friction, and the error is the error of an answer to "
            "the loads at this time in one step, so that a slip to and fro before counts as an "
            "error; `erc-contact solve` takes all steps."
        )
    return sentences


def _from_what(certificate: Certificate) -> list[str]:
    """Say what causes the error."""
    words = []
    for cause, part in certificate.causes.items():
        words.append(f"{IN_WORDS[cause]} {percent(certificate.share(part))}")
    sentences = [f"From: {', '.join(words)}; the squares add up."]
    if certificate.interpolated:
        sentences[0] = (
            f"{sentences[0][:-1]}. The transfer from its cells to simplices, which matters at "
            f"contacts and ties alone, costs {percent(certificate.share(certificate.transfer))}, "
            "and is added."
        )
    sentences.append(f"Most of it is {certificate.cause}: {ADVICE[certificate.cause]}.")
    if certificate.penetration > 0:
        sentences.append(f"Bodies penetrate by up to {certificate.penetration:.3g}.")
    if certificate.off_supports > 0:
        sentences.append(
            f"The result differs from the supports by up to {certificate.off_supports:.3g}."
        )
    return sentences


def _where(error: ConstitutiveError) -> str:
    """Say in which cells most of the squared error is; collective."""
    domain = error.domain
    comm = domain.comm
    cells = cell_nodes(domain.mesh.geometry)[: domain.owned_cells]
    middles = domain.mesh.geometry.x[cells].mean(axis=1)[:, : domain.dim]
    rows = gather_rows(comm, square=error.indicators**2, middle=middles)
    return str(comm.bcast(_place_of(rows["square"], rows["middle"]) if rows else None))


def _place_of(square: np.ndarray, middle: np.ndarray) -> str:
    """Say where most of the squared error is, of all cells."""
    total = square.sum()
    if total == 0.0:
        return "Where: nowhere."
    order = np.argsort(-square)
    number = int(np.searchsorted(np.cumsum(square[order]), MOST * total)) + 1
    worst = place_words(middle[order[0]])
    return (
        f"Where: {percent(MOST)} of its square is in {number} of {len(square)} cells, the worst "
        f"around {worst}."
    )


def _how_many_cells(certificate: Certificate, accuracy: float) -> str:
    """Say how many cells would do for an accuracy; collective."""
    error = certificate.error
    wanted = percent(accuracy)
    if certificate.total <= accuracy:
        return f"The mesh of {error.domain.cells} simplices does for {wanted}."
    if certificate.cause != "the mesh":
        return f"A finer mesh alone does not lead to {wanted}: see what most of the error is."
    cells = size_map(error, accuracy).predicted_cells
    doubt = "; a mesh as coarse as this one foresees it badly" * (error.total > PREDICTIVE_ERROR)
    return (
        f"For {wanted} about {cells:.0f} simplices would do, where the picture of the error says; "
        f"this mesh has {error.domain.cells}{doubt}."
    )


def _of_forces(forces: Sequence[BoundedForce], name: str) -> str:
    """Say which forces of the result are outside their intervals."""
    told = [row for row in forces if row.computed is not None and row.bounds is not None]
    if not told:
        return (
            f"Forces: {name} does not tell its forces on these parts; compare what the other code "
            "has printed with the intervals."
        )
    outside = [f"{row.part} along {row.axis}" for row in told if row.is_outside]
    if not outside:
        return (
            f"Forces: {len(told)} of {len(forces)} are known of {name} and have an interval, and "
            "it is in all of these."
        )
    return f"Forces: the forces of {name} on {', '.join(outside)} are outside their intervals."


def _of_bolts(bolts: Sequence[BoundedForce], error: ConstitutiveError) -> list[str]:
    """Say with which shifts bolts are certified, and which forces they cause."""
    shifts = shifts_of(error.solution.scene.ties)
    sentences = []
    for bolt in bolts:
        shift = f"{shifts[bolt.part]:.5g}"
        sentences.append(
            f"The bolt at {bolt.part} is shortened by {shift} as in the result; the error is that "
            "of the bodies with this bolt."
        )
        if bolt.bounds is not None:
            where = "outside of" if bolt.is_outside else "in"
            force = f"The force {bolt.computed:.5g} that the deck asks for"
            sentences.append(f"{force} is {where} the interval of its force.")
    return sentences
