"""Tell how much of loads contacts can carry, and what friction that takes.

It is for scenes without a solution by statics (:mod:`erc_contact.newton.statics`). The
cones of that programme are about the true ones, so what it excludes is excluded: no
tractions carry more of a load than the greatest share, or with less friction than the
least. Supports, springs and given motions may take any forces.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
import ufl
from dolfinx import fem

from erc_contact.base.runtime import compiled
from erc_contact.model.model import Model
from erc_contact.newton.statics import (
    find_unbalanced,
    greatest_share,
    on_first,
    programme,
    work_of_loads,
)

MUCH = 1e4
"""Factor of friction beyond which more of it does not help [-]."""
CLOSE = 1e-4
"""Relative accuracy of the least friction [-]."""
LEAST_SHARE = 1e-3
"""Share of a load below which contacts carry none of it [-]."""


def what_can_be_carried(model: Model, loads: fem.Function) -> str:
    """Say what share of each load can be carried, and with what friction; collective.

    Each load is taken by itself, with the others as they are: the loads on each part of
    the boundary, the loads in the body, and where there is one of them, all loads.

    Args:
        model: The scene on a mesh, whose loads no contact forces balance.
        loads: Nodal forces of its loads [force], not yet summed over ranks.

    Returns:
        Sentences that end in a space, or "" if nothing of it is known.
    """
    motions, work, forces = programme(model, loads)
    shares = []
    for name, part in _parts(model, motions, work):
        share = on_first(model.space, forces, partial(greatest_share, part=part), work)
        if share is not None and LEAST_SHARE < share < 1.0:
            shares.append(f"at most {100 * share:.3g}% of {name}")
    told = ""
    if shares:
        told = f"Contacts can carry {', or '.join(shares)}. "
    coefficients = [model.greatest_coefficient(contact) for contact in model.contacts]
    if any(contact.friction is not None for contact in model.contacts):
        factor = _least_friction(model, loads)
        if factor is None:
            told += "No friction is enough. "
        else:
            told += f"It takes at least {factor:.4g} times the friction"
            if any(coefficients):
                told += f", a coefficient of {factor * max(coefficients):.3g}"
            told += ". "
    return told


def _parts(model: Model, motions: np.ndarray, work: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Generate the names of loads and their work on the motions; collective."""
    names: list[str | None] = list(dict.fromkeys(load.facets for load in model.surface_loads))
    if model.body_force is not None:
        names.append(None)
    if len(names) == 1:
        yield "the loads", work
        return
    for name in names:
        form = model.loads(ufl.TestFunction(model.space.V), on=[name])
        of_part = model.space.function()
        fem.assemble_vector(of_part.x.array, compiled.form(form))
        told = "the body force" if name is None else f"the load on {name!r}"
        yield told, work_of_loads(model.space, of_part, motions)


def _least_friction(model: Model, loads: fem.Function) -> float | None:
    """Return the least factor of friction that balances loads, from below; collective.

    None if none does.
    """

    def is_enough(factor: float) -> bool:
        _, work, forces = programme(model, loads, factor)
        return on_first(model.space, forces, find_unbalanced, work) is None

    low, high = 1.0, MUCH
    if not is_enough(high):
        return None
    while high > (1 + CLOSE) * low:
        middle = float(np.sqrt(low * high))
        if is_enough(middle):
            high = middle
        else:
            low = middle
    return low
