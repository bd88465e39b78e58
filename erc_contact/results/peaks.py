"""Find the greatest stress and contact traction of an admissible pair.

Each comes with the size of the element where it is. An adaptive run keeps them for each
mesh: they tell whether a maximum grows with refinement.

Symbols: sigma^ and r^ admissible stress and contact traction, d dimension.
"""

from __future__ import annotations

import numpy as np

from erc_contact.admissible.pair import Admissible
from erc_contact.model.maximum import EQUAL_MAXIMA
from erc_contact.model.profile import profile_points
from erc_contact.model.von_mises import von_mises
from erc_contact.results.stresses import mean_stress

PEAKS = {"von Mises": "peak_stress", "pressure": "peak_pressure", "shear": "peak_shear"}
"""Quantities with a peak, and the beginning of its names in the row of a mesh."""


def peaks(pair: Admissible) -> dict[str, float]:
    """Find the greatest stress and contact traction, and where they are; collective.

    Returns:
        ``peak_stress``, the greatest von Mises stress of the mean of sigma^ in a cell
        [force/area], ``peak_pressure`` and ``peak_shear``, the greatest ones of r^ at
        the points of profiles, nan without a contact; and of each the size of the cell
        or facet [length], with the name ``peak_stress_size`` and so on.
    """
    space = pair.model.space
    volume = pair.cell_geometry.volume[: space.domain.owned_cells]
    points = profile_points(space)
    # A rank without facets of a contact has empty lists of them.
    pressure = [np.empty(0)]
    shear = [np.empty(0)]
    size = [np.empty(0)]
    for traction in pair.tractions_per_area:
        owned = traction.contact.trace.here.owned
        pressures, tangential = traction.at_points(points)
        pressure.append(pressures[owned].max(axis=1))
        shear.append(np.linalg.norm(tangential[owned], axis=2).max(axis=1))
        size.append(traction.area[owned] ** (1 / (space.d - 1)))
    facet_size = np.concatenate(size)
    local = [
        _greatest(von_mises(mean_stress(pair)), volume ** (1 / space.d)),
        _greatest(np.concatenate(pressure), facet_size),
        _greatest(np.concatenate(shear), facet_size),
    ]
    ranks = np.array(space.comm.allgather(local))
    result = {}
    for number, name in enumerate(PEAKS.values()):
        values, sizes = ranks[:, number].T
        top, least_size = _greatest(values, sizes)
        is_there = np.isfinite(top)
        result[name] = top if is_there else np.nan
        result[f"{name}_size"] = least_size if is_there else np.nan
    return result


def _greatest(values: np.ndarray, sizes: np.ndarray) -> tuple[float, float]:
    """Return the greatest of some values, and the least size where it is.

    Values that differ from it by round-off count, too.
    """
    top = float(values.max(initial=-np.inf))
    round_off = EQUAL_MAXIMA * abs(top) if np.isfinite(top) else 0.0
    return top, float(sizes[values >= top - round_off].min(initial=np.inf))
