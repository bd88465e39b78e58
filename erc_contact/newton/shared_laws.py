"""Give multipliers that contacts share the tractions of their laws.

At a solution the equations ``e_c = a_c (lambda_c - P_c)`` of dependent rows
(:mod:`erc_contact.newton.reactions`) leave no force ``B^T e`` together, but each of
them may differ from zero: the forces were split without the laws. The tractions P_c of
the laws have the same resultant.
"""

from __future__ import annotations

from dolfinx import fem

from erc_contact.model.data.over_ranks import sum_over_ranks
from erc_contact.newton.forms import ContactForms
from erc_contact.newton.reactions import MultiplierMap


def laws_of(forms: ContactForms, multiplier_map: MultiplierMap) -> list[fem.Function]:
    """Return multipliers at the fields of the forms, at dependent rows P; collective.

    Args:
        forms: The equations of the method, with their multipliers.
        multiplier_map: What reactions say of these.

    Returns:
        Bernstein coefficients [force/area], new Functions.
    """
    space = forms.model.space
    multipliers = [multiplier.copy() for multiplier in forms.multipliers]
    is_shared = multiplier_map.is_shared.any(axis=1)
    if not is_shared.any():
        return multipliers
    rows = multiplier_map.rows
    for k, multiplier in enumerate(multipliers):
        equations = space.function()
        fem.assemble_vector(equations.x.array, forms.equations[k])
        sum_over_ranks(equations)
        of_contact = rows.places[k][is_shared[rows.places[k]]]
        nodes = space.local_nodes(rows.here[of_contact])
        visible = nodes >= 0
        area = rows.areas[k][of_contact[visible], None]
        at_nodes = (function.x.array.reshape(-1, space.d) for function in (multiplier, equations))
        of_multiplier, of_equations = at_nodes
        of_multiplier[nodes[visible]] -= of_equations[nodes[visible]] / area
    return multipliers
