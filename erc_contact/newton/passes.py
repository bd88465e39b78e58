"""Assemblies of the contact equations in the numbering of the condensed problem.

The assembled forces of a contact stand at the nodes of its cells. A first assembly
takes each to the unknown there. Where unknowns are jumps, further ones take forces to
the other unknowns that move the node (:mod:`erc_contact.newton.moved_forces` does the
same by matrices).
"""

from __future__ import annotations

import numpy as np

from erc_contact.model.model import Model
from erc_contact.newton.forms import ContactForms, Pass
from erc_contact.newton.jump_sums import Sums


def passes(forms: ContactForms, rows: np.ndarray) -> list[Pass]:
    """Return the assemblies whose sum the contact equations are.

    Args:
        forms: The equations of the method.
        rows: Place in u_A of each degree of freedom of this rank, -1 without.
    """
    model = forms.model
    result = [Pass(forms.all_jumps, rows, np.ones(len(rows)))]
    if forms.test_alike:
        result.append(_without_jump(forms, rows))
    if not forms.jump_sums.any:
        return result
    of_colours = []
    for colour in range(forms.jump_sums.count):
        sums = forms.jump_sums.of_colour(colour)
        for row_of, factor_of in _moved(model, sums, rows):
            of_colours.append(Pass(forms.jumps_of(colour), row_of, factor_of))
            if forms.test_alike:
                # The forces with tested jumps contain those without.
                result.append(Pass(forms.no_jumps, row_of, -factor_of))
    return result + of_colours


def _without_jump(forms: ContactForms, rows: np.ndarray) -> Pass:
    """Return the assembly for unknowns that move both sides of a contact alike.

    A displacement that is a sum of two unknowns has a force on each of them. The work
    on the jump belongs to the jump alone.

    Args:
        forms: The equations of the method.
        rows: Place in u_A of each degree of freedom of this rank, -1 without.
    """
    coordinates = forms.model.coordinates
    entries = coordinates.entries
    columns = coordinates.columns_here
    # A swapped component has no force on its own unknown beside that on the jump.
    is_swapped = entries.own == 0
    places = np.where(is_swapped, rows[entries.rows], rows[columns])
    factors = np.where(is_swapped, -1.0, entries.other)
    row_of = np.full(len(rows), -1)
    row_of[entries.rows] = np.where((factors != 0) & (columns >= 0), places, -1)
    factor_of = np.zeros(len(rows))
    factor_of[entries.rows] = factors
    return Pass(forms.no_jumps, row_of, factor_of)


def _moved(model: Model, sums: Sums, rows: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return where D^T takes the forces at nodes, as rows and factors of passes.

    A pass has one row for each degree of freedom, and there are as many passes as sums
    have summands at most. All ranks have the same number.

    Args:
        model: The scene on a mesh.
        sums: The entries of D.
        rows: Place in u_A of each degree of freedom of this rank, -1 without.
    """
    d = model.d
    nodes = model.V.dofmap.index_map.global_to_local(sums.columns // d).astype(np.int64)
    columns = np.where(nodes >= 0, nodes * d + sums.columns % d, -1)
    order = np.argsort(sums.rows, kind="stable")
    ascending = sums.rows[order]
    number = np.arange(len(ascending)) - np.searchsorted(ascending, ascending)
    most = max(model.comm.allgather(int(number.max(initial=-1))))
    result = []
    for k in range(most + 1):
        entry = order[number == k]
        visible = entry[columns[entry] >= 0]
        row_of = np.full(len(rows), -1)
        row_of[sums.rows[visible]] = rows[columns[visible]]
        factor_of = np.zeros(len(rows))
        factor_of[sums.rows[visible]] = sums.values[visible]
        result.append((row_of, factor_of))
    return result
