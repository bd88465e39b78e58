"""Give multipliers that contacts share the tractions of their laws.

At a solution the equations ``e_c = a_c (lambda_c - P_c)`` of a shared node leave no
force on its unknowns together, but each of them may differ from zero: the forces were
split without the laws. The tractions P_c of the laws have the same resultant.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem, la

from erc_contact.newton.forms import ContactForms
from erc_contact.newton.shared_multipliers import SharedMultipliers


def set_to_laws(
    forms: ContactForms, shared: SharedMultipliers, multipliers: list[fem.Function]
) -> None:
    """Set multipliers at shared nodes to P at the fields of the forms; collective.

    Args:
        forms: The equations of the method.
        shared: What contacts share at these nodes.
        multipliers: Bernstein coefficients of those of the forms [force/area], changed
            in place.
    """
    model = forms.model
    equations = model.function()
    of_nodes = equations.x.array.reshape(-1, model.d)
    for colour in range(forms.jump_sums.count):
        forms.test(forms.jumps_of(colour))
        equations.x.array[:] = 0.0
        forms.assemble(equations.x.array)
        equations.x.scatter_reverse(la.InsertMode.add)
        equations.x.scatter_forward()
        for k, contact in enumerate(model.contacts):
            if forms.jump_sums.colours[k] != colour:
                continue
            here = np.unique(contact.trace.here.nodes)
            numbers = model.global_numbers(here)
            is_shared = np.isin(numbers, shared.at.numbers)
            nodes = here[is_shared]
            place = np.searchsorted(shared.at.numbers, numbers[is_shared])
            area = shared.areas[k][place, None]
            multipliers[k].x.array.reshape(-1, model.d)[nodes] -= of_nodes[nodes] / area
    forms.test(forms.all_jumps)
