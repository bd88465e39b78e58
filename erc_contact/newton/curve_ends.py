"""Find plastic strains beyond the last point of a hardening curve.

There the stress stays, but for the least slope that a law needs. A stress in
equilibrium that is a little greater costs much energy: the error is large, and falls
slowly.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from mpi4py import MPI

from erc_contact.model.law.law_entries import place_of
from erc_contact.newton.solution import Solution
from erc_contact.scene.hardening import HardeningCurve
from erc_contact.scene.potential import remembers

ACCUMULATED = "accumulated"
"""Name of the accumulated plastic strain in the state of a law."""


def beyond_curves(solution: Solution) -> dict[tuple[str, str], str]:
    """Find regions whose curves are too short, in words by region; collective.

    Args:
        solution: The solution, whose plastic strains are the strains at its end.
    """
    ends = _ends_of_curves(solution.model.scene.material)
    if not ends:
        return {}
    domain = solution.domain
    accumulated = _accumulated(solution)
    found = {}
    # Each region has a curve of its own: a strain beyond it elsewhere means nothing.
    for region, end in ends.items():
        cells = domain.region(region) if region else np.arange(len(accumulated))
        owned = cells[cells < len(accumulated)]
        local = float(accumulated[owned].max(initial=0.0))
        reached = domain.comm.allreduce(local, MPI.MAX)
        if reached > end:
            where = f" in {region!r}" if region else ""
            found["curve", region] = (
                f"The accumulated plastic strain reaches {reached:.3g}{where}, beyond the last "
                f"point of the hardening curve, {end:.3g}: there the stress hardly grows, and the "
                "error falls slowly. Give the curve up to greater strains."
            )
    return found


def _ends_of_curves(material: object) -> dict[str, float]:
    """Return the last plastic strain of the curve of each region, "" for the body."""
    hardening = getattr(material, "hardening", None)
    of_regions = hardening if isinstance(hardening, Mapping) else {"": hardening}
    ends = {}
    for region, curve in of_regions.items():
        if isinstance(curve, HardeningCurve):
            ends[region] = float(curve.plastic_strain[-1])
    return ends


def _accumulated(solution: Solution) -> np.ndarray:
    """Return the accumulated plastic strain inside the owned cells, shape (n, q)."""
    model = solution.model
    assert model.linearised is not None
    after = model.linearised.state_at_end(solution.u)
    assert after is not None
    material = model.scene.material
    assert remembers(material)
    place = place_of(material.state, ACCUMULATED)
    return after.in_cells(model.space.owned_cells)[..., place.start]
