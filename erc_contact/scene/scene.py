"""What the user declares: a body's material, supports, loads and contacts. Frozen data, no mesh.

A scene names the parts of the boundary; it is put on a mesh by
:class:`erc_contact.model.model.Model`. Values that vary in space are callables of x
(UFL in, UFL out), so a scene survives every new mesh.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from erc_contact.base.exceptions import InputError
from erc_contact.base.html import table
from erc_contact.scene.contact import Contact
from erc_contact.scene.load import Load
from erc_contact.scene.material import Material
from erc_contact.scene.support import Displacement
from erc_contact.scene.words import in_words

MATERIAL = ("parameters", "check", "stress", "compliance", "modulus")
"""What a material has."""
LOAD = ("facets", "parameters", "density")
"""What a load has."""
CAUSES = TRACTIONS, BODY_FORCE, BALANCE = "tractions", "body force", "balance"
"""Names of forces in the result ``reactions()``, beside those of supports and contacts."""


@dataclass(frozen=True)
class Scene:
    """An elastic body, what holds it, what loads it and what it may touch.

    Args:
        material: :class:`Elastic`, or a class of the user's with the same methods.
        supports: Prescribed displacements.
        loads: Tractions and body forces; several on one part add up.
        contacts: Contacts with rigid foundations.

    A single support, load or contact needs no list around it.

    Raises:
        InputError: If a boundary part is in two conditions that conflict, or an entry
            is of another type, or a part with a support or a contact has the name of
            another force (:data:`CAUSES`).

    Example:
        >>> scene
        Scene(material=Elastic(E=1000.0, ...), supports=(Displacement(facets='top', ...),), ...)
        >>> [contact.facets for contact in scene.contacts]
        ['bottom']
    """

    material: Material
    supports: Sequence[Displacement] = ()
    loads: Sequence[Load] = ()
    contacts: Sequence[Contact] = ()

    def __post_init__(self) -> None:
        missing = [member for member in MATERIAL if not hasattr(self.material, member)]
        if missing or isinstance(self.material, type):
            raise InputError(
                f"Scene: material is {self.material!r}; give an Elastic(E, nu), or an object of a class of your own "
                f"with {', '.join(MATERIAL)}."
            )
        for name, what, fits in (
            ("supports", "Displacement", lambda entry: isinstance(entry, Displacement)),
            ("loads", "Traction and BodyForce", _is_load),
            ("contacts", "Contact", lambda entry: isinstance(entry, Contact)),
        ):
            given: Any = getattr(self, name)
            if not isinstance(given, list | tuple) and not fits(given):
                raise InputError(f"Scene: {name} is {given!r}; give a list of {what}.")
            entries = tuple(given) if isinstance(given, list | tuple) else (given,)
            for entry in entries:
                if not fits(entry):
                    own = f", and objects with {', '.join(LOAD)}" if name == "loads" else ""
                    raise InputError(f"Scene: {name} holds {entry!r}; allowed are {what}{own}.")
            object.__setattr__(self, name, entries)
        for facets in (*(s.facets for s in self.supports), *(c.facets for c in self.contacts)):
            if facets in CAUSES:
                raise InputError(
                    f"Scene: the boundary part {facets!r} has a name that reactions() has for another force; rename "
                    f"it, and avoid {', '.join(map(repr, CAUSES))}."
                )
        self._check_conflicts()

    def _repr_html_(self) -> str:
        """The scene in a notebook."""
        return table(in_words(self), caption="Scene")

    def _check_conflicts(self) -> None:
        fixed = [
            (s.facets, i)
            for s in self.supports
            for i, value in enumerate(s.value)
            if value is not None
        ]
        for (facets, component), times in Counter(fixed).items():
            if times > 1:
                raise InputError(
                    f"Component {component} of {facets!r} is fixed by {times} supports; keep one of them."
                )
        touching = Counter(c.facets for c in self.contacts)
        for facets, times in touching.items():
            if times > 1:
                raise InputError(f"{facets!r} is in {times} contacts; keep one of them.")
            others = [
                type(o).__name__
                for o in (*self.supports, *self.loads)
                if getattr(o, "facets", None) == facets
            ]
            if others:
                raise InputError(
                    f"{facets!r} is in a Contact and in a {others[0]}; a boundary part can be in one of them."
                )
        for load in self.loads:
            if load.facets is None:
                continue
            free = {
                i for s in self.supports if s.facets == load.facets for i in range(len(s.value))
            }
            free -= {i for facets, i in fixed if facets == load.facets}
            held = any(s.facets == load.facets for s in self.supports)
            if held and not free:
                raise InputError(
                    f"{load.facets!r} has a {type(load).__name__} and a Displacement of all components; free a "
                    "component (None) or remove one of the two."
                )
            given = value if isinstance(value := getattr(load, "value", None), tuple) else ()
            for i, value in enumerate(given):
                if (load.facets, i) in fixed and (callable(value) or value != 0):
                    raise InputError(
                        f"{load.facets!r} has a {type(load).__name__} and a Displacement in component {i}; "
                        "make the load 0 there, or free the Displacement (None)."
                    )
        owners: list[tuple[Any, Any]] = [(one, one.value) for one in self.supports]
        owners += [(one, one.normal) for one in self.contacts if isinstance(one.normal, tuple)]
        for (first, one), (second, other) in pairwise(owners):
            if len(one) != len(other):
                raise InputError(
                    f"The scene mixes vectors of {len(one)} components, {type(first).__name__}({first.facets!r}), and "
                    f"of {len(other)}, {type(second).__name__}({second.facets!r}); give one for each dimension."
                )


def _is_load(entry: Any) -> bool:
    """Whether it has the members of a load, and is no class."""
    return not isinstance(entry, type) and all(hasattr(entry, member) for member in LOAD)
