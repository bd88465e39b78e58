"""Ask for the view of a result, whose kinds the package of pictures knows.

Results have a method ``show()``, but are made before any picture. So the modules of
pictures tell here how each kind of result is shown.
"""

from __future__ import annotations

from functools import singledispatch
from typing import Any

from erc_contact.base.exceptions import InputError


@singledispatch
def view_of(result: Any) -> Any:
    """Make the view of a result in 3D, an :class:`erc_contact.output.View`; collective.

    Raises:
        InputError: If results of this kind have no view, or its mesh is too large.
    """
    raise InputError(
        f"{type(result).__name__} cannot be shown; show a solution, an error or a run."
    )
