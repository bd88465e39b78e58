"""Tell the cells on both sides of a joint whose nodes are common."""

from __future__ import annotations

import numpy as np
from dolfinx import fem

from erc_contact.model.space import Space


def indicators(space: Space, names: tuple[str, str]) -> list[fem.Function]:
    """Return the indicators of the regions on both sides of a joint; collective.

    Args:
        space: The mesh, on which the joint is glued.
        names: Names of its parts.
    """
    domain = space.domain
    assert domain.interface_map is not None
    assert domain.cell_tags is not None
    result = []
    for name in names:
        indicator = domain.function("DG", 0)
        for interface in domain.interface_map.interfaces:
            if name in interface.names:
                regions = interface.regions[interface.names.index(name)]
                of_side = np.isin(domain.cell_tags.values, regions)
                indicator.x.array[domain.cell_tags.indices[of_side]] = 1.0
        result.append(indicator)
    return result
