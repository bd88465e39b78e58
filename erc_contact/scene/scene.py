"""Declare a scene: a body's material, supports, loads and contacts.

It is frozen data without a mesh. A scene names the parts of the boundary; it is put on
a mesh by :class:`erc_contact.model.model.Model`. Values that vary in space are
callables of x (UFL in, UFL out), so a scene survives every new mesh.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from erc_contact.base.exceptions import InputError
from erc_contact.scene.checks import has_callable, round_off
from erc_contact.scene.contact import Contact
from erc_contact.scene.load import LOAD_MEMBERS, Drive, Load
from erc_contact.scene.material import (
    PLANE_STRAIN,
    PLANE_STRESS,
    Material,
    is_axisymmetric,
    of_regions,
)
from erc_contact.scene.potential import (
    DUAL_MEMBERS,
    FROM_REST,
    POTENTIAL_MEMBERS,
    Potential,
    expands,
    gives_conjugate,
    has_potential,
    refuse_potential,
    tells_convexity,
)
from erc_contact.scene.strain import GivenStrain
from erc_contact.scene.support import Displacement, Rigid, Spring
from erc_contact.scene.tied import Tied
from erc_contact.scene.units import check_units, in_units, unit_of
from erc_contact.scene.words import in_words
from namedmesh.base.html import in_columns, table

MATERIAL_MEMBERS = ("parameters", "check", "stress", "compliance", "modulus")
"""Names of the members of a material."""
STRAIN_MEMBERS = ("region", "parameters", "strain")
"""Names of the members of a given strain."""
LISTS: dict[str, tuple[str, tuple[type, ...], tuple[str, ...]]] = {
    "supports": ("Displacement, Rigid and PlaneSection", (Displacement, Rigid), ()),
    "loads": ("Traction and BodyForce", (), LOAD_MEMBERS),
    "contacts": ("Contact", (Contact,), ()),
    "strains": ("ThermalStrain and Eigenstrain", (), STRAIN_MEMBERS),
    "springs": ("Spring", (Spring,), ()),
    "ties": ("Tied and Preload", (Tied,), ()),
}
"""Lists of a scene: their entries in words, their types, or else their members."""
CAUSES = TRACTIONS, BODY_FORCE, BALANCE = "tractions", "body force", "balance"
"""Names of forces in ``reactions()``, beside the names of supports and contacts."""


@dataclass(frozen=True)
class Scene:
    """Declare elastic bodies with all that acts on them.

    Args:
        material: :class:`Elastic`, or a class of the user's with the same methods; or a
            mapping of regions to such materials, which differ in numbers only.
        supports: Prescribed displacements, planes of symmetry, and periodic and cyclic
            sides.
        loads: Tractions and body forces; several on one part add up.
        contacts: Contacts with rigid foundations, or between bodies.
        strains: Strains of heat and others that no stress causes; they add up.
        springs: Springs on boundary parts.
        ties: Joints of bodies that are glued to each other, and preloads of bolts.
        units: Units of length, force and stress, as in "mm, N, MPa", which pictures,
            tables, reports and prints write; nothing is computed with them. In the
            plane forces act on a unit of thickness: "mm, N/mm, MPa".

    A single support, load, contact, strain, spring or tie needs no list around it.

    Raises:
        InputError: If a boundary part is in two conditions that conflict, or an entry
            is of another type, or a part with a support or a contact has the name of
            another force (:data:`CAUSES`).

    Example:
        >>> scene
        Scene(material=Elastic(E=1000.0, ...),
              supports=(Displacement(facets='top', ...),), ...)
        >>> [contact.facets for contact in scene.contacts]
        ['bottom']
    """

    material: Material | Potential
    supports: Sequence[Displacement | Rigid] = ()
    loads: Sequence[Load] = ()
    contacts: Sequence[Contact] = ()
    strains: Sequence[GivenStrain] = ()
    springs: Sequence[Spring] = ()
    ties: Sequence[Tied] = ()
    units: str = field(default="", compare=False, repr=False)

    def __post_init__(self) -> None:
        """Check the entries and their names, and make tuples of them."""
        if isinstance(self.material, Mapping):
            object.__setattr__(self, "material", of_regions(self.material))
        needed = POTENTIAL_MEMBERS if has_potential(self.material) else MATERIAL_MEMBERS
        missing = [name for name in needed if not hasattr(self.material, name)]
        is_bounded = gives_conjugate(self.material) or tells_convexity(self.material)
        if has_potential(self.material) and not is_bounded:
            needed = (*needed, " or ".join(DUAL_MEMBERS))
            missing.append(needed[-1])
        if missing or isinstance(self.material, type):
            raise InputError(
                f"Scene: material is {self.material!r}; give an Elastic(E, nu), a Plastic(E, nu,"
                f" ...), or an object of a class of your own with {', '.join(needed)}."
            )
        check_units(self.units)
        self._move_symmetries()
        for name in LISTS:
            self._check_entries(name)
        self._check_potential()
        parts = [support.facets for support in self.supports]
        parts += [spring.facets for spring in self.springs]
        for contact in self.contacts:
            parts += contact.sides
        for tie in self.ties:
            parts += tie.sides
        for part in parts:
            if part in CAUSES:
                raise InputError(
                    f"Scene: the boundary part {part!r} has a name that reactions() has"
                    f" for another force; rename it, and avoid {', '.join(map(repr, CAUSES))}."
                )
        self._check_conflicts()

    def label(self, text: str) -> str:
        """Return a label with the units of the scene in place of dimensions."""
        return in_units(text, self.units)

    def unit(self, dimension: str) -> str:
        """Return the unit of a dimension as it stands behind a number, or ""."""
        return unit_of(dimension, self.units)

    def __str__(self) -> str:
        """List what the scene says of each part, a line each."""
        return in_columns(in_words(self))

    def _repr_html_(self) -> str:
        """Return the scene as a table in a notebook."""
        return table(in_words(self), caption="Scene")

    def _check_potential(self) -> None:
        """Check that the scene has nothing that needs a linear law.

        Raises:
            InputError: If the material has a potential, and the scene has given
                strains that it does not take, or is in plane stress.
        """
        hypothesis = getattr(self.material, "hypothesis", PLANE_STRAIN)
        needs_linear = {
            "A given strain": bool(self.strains) and not expands(self.material),
            f"The hypothesis {hypothesis!r}": hypothesis == PLANE_STRESS,
        }
        for what, is_there in needs_linear.items():
            if is_there:
                refuse_potential(self.material, what, FROM_REST)

    def _move_symmetries(self) -> None:
        """Move planes of symmetry and sides of copies to the contacts."""
        lists: dict[str, tuple[Any, ...]] = {}
        for name in ("supports", "contacts"):
            value: Any = getattr(self, name)
            lists[name] = tuple(value) if isinstance(value, list | tuple) else (value,)
        supports: list[Any] = []
        symmetries: list[Any] = []
        for entry in lists["supports"]:
            is_symmetry = getattr(entry, "is_symmetry", False)
            (symmetries if is_symmetry else supports).append(entry)
        if symmetries:
            object.__setattr__(self, "supports", tuple(supports))
            object.__setattr__(self, "contacts", (*lists["contacts"], *symmetries))

    def _check_entries(self, name: str) -> None:
        """Check the entries of a list by its name, and make a tuple of them.

        A single entry needs no list.
        """
        kinds, _, members = LISTS[name]
        value: Any = getattr(self, name)
        if isinstance(value, list | tuple):
            entries = tuple(value)
        elif _fits(value, name):
            entries = (value,)
        else:
            told = _its_list(value)
            raise InputError(f"Scene: {name} is {value!r}; give a list of {kinds}.{told}")
        for entry in entries:
            if not _fits(entry, name):
                or_objects = f", and objects with {', '.join(members)}" if members else ""
                told = _its_list(entry)
                raise InputError(
                    f"Scene: {name} holds {entry!r}; allowed are {kinds}{or_objects}.{told}"
                )
        # The class is frozen: only here an attribute may change.
        object.__setattr__(self, name, entries)

    def _check_conflicts(self) -> None:
        """Check that no two entries prescribe different things at one place."""
        fixed = _fixed_components(self.supports)
        for (facets, component), times in Counter(fixed).items():
            if times > 1:
                raise InputError(
                    f"Component {component} of {facets!r} is fixed by {times} supports; keep one"
                    " of them."
                )
        for facets in _sides(self.contacts, "contacts"):
            loads = [load for load in self.loads if not isinstance(load, Drive)]
            others: list[Any] = [*self.supports, *loads, *self.springs]
            for entry in others:
                if entry.facets == facets:
                    raise InputError(
                        f"{facets!r} is in a Contact and in a {type(entry).__name__}; a boundary"
                        " part can be in one of them."
                    )
        self._check_ties()
        self._check_springs()
        for load in self.loads:
            if load.facets is not None:
                self._check_load_on_support(load, fixed)
        self._check_dimensions()
        axisymmetric = is_axisymmetric(self.material)
        for support in self.supports:
            if isinstance(support, Rigid):
                support.check_hypothesis(axisymmetric=axisymmetric)

    def _check_ties(self) -> None:
        """Check that both parts of each tied joint are in no other condition."""
        ties = _sides(self.ties, "tied joints")
        others: list[Any] = [*self.supports, *self.loads, *self.springs, *self.contacts]
        for entry in others:
            for part in getattr(entry, "sides", (entry.facets,)):
                if part in ties:
                    raise InputError(
                        f"{part!r} is in a Tied and in a {type(entry).__name__}; the parts of a"
                        " tied joint can be in nothing else."
                    )

    def _check_springs(self) -> None:
        """Check that each spring is alone on its boundary part, but for loads."""
        springs = Counter(spring.facets for spring in self.springs)
        supported = {support.facets: type(support).__name__ for support in self.supports}
        for facets, times in springs.items():
            if times > 1:
                raise InputError(f"{facets!r} has {times} springs; give one with their sum.")
            if facets in supported:
                raise InputError(
                    f"{facets!r} has a Spring and a {supported[facets]}; keep one of them. A stiff"
                    " spring holds a component nearly as a support does."
                )

    def _check_load_on_support(self, load: Load, fixed: list[tuple[str, int]]) -> None:
        """Check that a load acts on free components of its boundary part.

        Args:
            load: The load.
            fixed: Boundary part and number of each prescribed component.
        """
        supports = [support for support in self.supports if support.facets == load.facets]
        # Supports of one part may each prescribe some of its components.
        components = {i for support in supports for i in range(len(support.value))}
        free = components - {i for facets, i in fixed if facets == load.facets}
        if supports and not free:
            support, remedy = "Displacement of all components", "free a component (None)"
            if isinstance(supports[0], Rigid):
                support, remedy = "Rigid", "give the Rigid its resultant (force, moment)"
            raise InputError(
                f"{load.facets!r} has a {type(load).__name__} and a {support}; {remedy} or remove"
                " one of the two."
            )
        if supports and hasattr(load, "on_part"):
            raise InputError(
                f"{load.facets!r} has a {type(load).__name__} and a {type(supports[0]).__name__}; a"
                " linear traction acts in all components. Give the support a part of its own, or"
                " Rigid(..., force=, moment=) in place of both."
            )
        value = getattr(load, "value", None)
        if not isinstance(value, tuple):
            self._check_not_on_section(load, supports)
            return
        for i, component in enumerate(value):
            acts = callable(component) or abs(component) > round_off(value)
            if acts and (load.facets, i) in fixed:
                kind = type(supports[0]).__name__
                raise InputError(
                    f"{load.facets!r} has a {type(load).__name__} and a {kind} in component {i};"
                    f" make the load 0 there, or free the {kind} (None)."
                )

    @staticmethod
    def _check_not_on_section(load: Load, supports: list[Displacement | Rigid]) -> None:
        """Check that a load without components is on no face whose motion may be free.

        Args:
            load: The load.
            supports: The supports of its part, which leave a component free.
        """
        for support in supports:
            if isinstance(support, Rigid):
                kind = type(support).__name__
                raise InputError(
                    f"{load.facets!r} has a {type(load).__name__} and a {kind}, whose force is the"
                    f" resultant of all that acts there. Add the load to the force of the {kind},"
                    " and give what acts along the part as Traction(part, (tx, ty)), with 0 along"
                    " the given force."
                )

    def _check_dimensions(self) -> None:
        """Check that all vectors of supports and contacts have as many components."""
        vectors: list[tuple[Any, Any]] = [(support, support.value) for support in self.supports]
        for contact in self.contacts:
            if isinstance(contact.normal, tuple):
                vectors.append((contact, contact.normal))
        for (first, one_value), (second, other_value) in pairwise(vectors):
            if len(one_value) != len(other_value):
                raise InputError(
                    f"The scene mixes vectors of {len(one_value)} components,"
                    f" {type(first).__name__}({first.facets!r}), and of {len(other_value)},"
                    f" {type(second).__name__}({second.facets!r}); give one for each dimension."
                )


def count_varying(scene: Scene) -> int:
    """Count the entries of a scene, with the material, whose values vary in space."""
    entries: list[Any] = [scene.material]
    for name in LISTS:
        entries += getattr(scene, name)
    return sum(has_callable(entry) for entry in entries)


def _sides(entries: Sequence[Any], kind: str) -> Counter[str]:
    """Count the sides of contacts or tied joints; none may be in two of them."""
    sides: Counter[str] = Counter()
    for entry in entries:
        sides.update(entry.sides)
    for facets, times in sides.items():
        if times > 1:
            raise InputError(f"{facets!r} is in {times} {kind}; keep one of them.")
    return sides


def _fixed_components(supports: Sequence[Displacement | Rigid]) -> list[tuple[str, int]]:
    """List boundary part and number of each component that supports prescribe."""
    fixed = []
    for support in supports:
        for i, value in enumerate(support.value):
            if value is not None:
                fixed.append((support.facets, i))
    return fixed


def _fits(entry: Any, name: str) -> bool:
    """Tell whether an entry has the type or the members of the entries of a list."""
    _, types, members = LISTS[name]
    if types or isinstance(entry, type):
        return isinstance(entry, types)
    return all(hasattr(entry, member) for member in members)


def _its_list(entry: Any) -> str:
    """Say to which list of a scene an entry belongs; empty if to none."""
    for name in LISTS:
        if _fits(entry, name):
            return f" It belongs to another list: give {name}=."
    return ""
