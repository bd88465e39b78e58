"""Number the boundary parts of a form 1, 2, ..., whatever their tags.

The tags are in the code of a form. So the same load on another side would be another
form, and would be compiled again.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl


class PartsOfForm:
    """Stand for the tags of a mesh in a form that has other numbers for some of them.

    DOLFINx asks it for the entities of a number, as it asks tags.

    Args:
        tags: The tags of a mesh.
        values: The tag that each number 1, 2, ... stands for.
    """

    def __init__(self, tags: Any, values: list[int]) -> None:
        self._tags = tags
        self._values = values

    def __getattr__(self, name: str) -> Any:
        """Return what else DOLFINx asks of the tags."""
        return getattr(self._tags, name)

    def find(self, number: int) -> np.ndarray:
        """Return the entities of a number."""
        return self._tags.find(self._values[number - 1])


def renumber(form: ufl.Form) -> ufl.Form:
    """Return a form whose parts have the numbers 1, 2, ... in the order of their tags.

    Forms that have no tags, or besides them an integral over everything, stay as they
    are, and so do derivatives of forms that have these numbers already.
    """
    # UFL keeps this dictionary with a form for such things.
    if "renumbered" not in form._cache:
        form._cache["renumbered"] = _renumber(form)
    return form._cache["renumbered"]


def _renumber(form: ufl.Form) -> ufl.Form:
    """Do what :func:`renumber` does, each time."""
    values: dict[str, set[Any]] = {}
    for integral in form.integrals():
        values.setdefault(integral.integral_type(), set()).update(_values(integral))
    parts: dict[str, PartsOfForm] = {}
    numbers: dict[str, dict[int, int]] = {}
    integrals = []
    for integral in form.integrals():
        kind = integral.integral_type()
        tags = integral.subdomain_data()
        plain = hasattr(tags, "find") and not isinstance(tags, PartsOfForm)
        if "everywhere" in values[kind] or not plain:
            integrals.append(integral)
            continue
        if kind not in parts:
            in_order = sorted(values[kind])
            parts[kind] = PartsOfForm(tags, in_order)
            numbers[kind] = {value: number for number, value in enumerate(in_order, start=1)}
        new_tags = tuple(numbers[kind][value] for value in _values(integral))
        new = integral.reconstruct(
            subdomain_id=new_tags if len(new_tags) > 1 else new_tags[0], subdomain_data=parts[kind]
        )
        integrals.append(new)
    return ufl.Form(integrals) if parts else form


def _values(integral: ufl.Integral) -> tuple[Any, ...]:
    """Return the tags of an integral, or the word that stands for all of the mesh."""
    value = integral.subdomain_id()
    return value if isinstance(value, tuple) else (value,)
