"""Write the deck of a result with a mesh on which the next result is more accurate."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import cast

from erc_contact.command.decks import say
from erc_contact.command.results import certified_file
from erc_contact.decks.rewriting import written_anew
from erc_contact.error.certify import ADVICE
from erc_contact.error.sizes import PREDICTIVE_ERROR, Sizes, size_map
from namedmesh.base.exceptions import on_rank
from namedmesh.base.percent import percent
from namedmesh.base.ranks import from_first, gather_rows
from namedmesh.for_solvers import read_deck_mesh, refined_deck_mesh

COARSER = 1.3
"""Factor on the sizes of a mesh that has too many cells."""


def refine_deck(arguments: Namespace) -> int:
    """Certify a result, and write its deck with a finer mesh."""
    certified = certified_file(arguments)
    certificate = certified.certificate
    sizes = size_map(certificate.error, arguments.accuracy)
    output = Path(arguments.output or f"{Path(arguments.deck).stem}_next.inp")
    cells, is_whole = _write(arguments, sizes, output)
    wanted = percent(arguments.accuracy)
    words = [f"{certified.name} has the error eps = {percent(certificate.total)}."]
    if is_whole:
        words.append(f"Its next mesh has {cells} simplices, for about {wanted}.")
    else:
        words.append(
            f"{wanted} needs more than {arguments.max_cells} simplices; the next mesh has {cells}. "
            "Refine again from its result, or allow more by --max-cells."
        )
    if certificate.total > PREDICTIVE_ERROR:
        words.append("A mesh as coarse as the mesh of the result foresees it badly: refine again.")
    by_mesh = certificate.cause == "the mesh"
    if not by_mesh:
        words.append(
            f"Most of the error is not the mesh but {certificate.cause}, and no finer mesh lowers "
            f"that: {ADVICE[certificate.cause]}."
        )
    say(*words, f"Deck: {output}")
    return int(not (is_whole and by_mesh))


def _write(arguments: Namespace, sizes: Sizes, output: Path) -> tuple[int, bool]:
    """Write the deck with sizes on rank 0; collective.

    Returns:
        The number of cells, and whether they have the sizes: they are coarser if there
        would be too many.
    """
    error = sizes.error
    comm = error.domain.comm
    geometry = error.domain.mesh.geometry
    owned = geometry.index_map().size_local
    rows = gather_rows(comm, x=geometry.x[:owned, : error.domain.dim], h=sizes.values[:owned])

    def write() -> tuple[int, bool]:
        deck = read_deck_mesh(Path(arguments.deck))
        most = max(arguments.max_cells, len(deck.simplicial.cells))
        scale = 1.0
        finer = None
        while finer is None:
            wanted = scale * rows["h"]
            finer = refined_deck_mesh(deck, rows["x"], wanted, degree=error.degree, most=most)
            scale *= COARSER
        output.parent.mkdir(parents=True, exist_ok=True)
        output.write_text(written_anew(finer))
        return len(finer.cells), scale == COARSER

    return cast("tuple[int, bool]", from_first(comm, on_rank(comm, 0, write)))
