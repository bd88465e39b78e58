"""Declare supports: displacements, springs, rigid faces, sections that stay plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from numbers import Real
from typing import Any, ClassVar

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Value
from erc_contact.scene.checks import check_name, check_vector
from namedmesh.base.checks import is_number
from namedmesh.base.names import listed

STIFFNESS = "a number >= 0 [force/length^3]"
"""What is allowed, in words."""
AXES = "xyz"
"""Names of the axes, for messages."""


@dataclass(frozen=True)
class Displacement:
    """Declare a prescribed displacement ``u = U`` on a boundary part, per component.

    Args:
        facets: Name of the boundary part.
        value: One number or callable of x for each dimension [length]; None leaves a
            component free (a roller).

    Raises:
        InputError: If the value is no such sequence, or fixes nothing.

    Example:
        >>> ec.Displacement("left", (0.0, None))  # symmetry: free along y
        Displacement(facets='left', value=(0.0, None))
    """

    facets: str
    value: Sequence[Value | None]

    def __post_init__(self) -> None:
        """Check the arguments."""
        check_name("Displacement", self.facets)
        what = f"Displacement({self.facets!r})"
        if callable(self.value):
            raise InputError(
                f"{what}: give one value or callable for each component, (ux, uy),"
                " not one callable."
            )
        check_vector(what, self.value, free=True)
        object.__setattr__(self, "value", tuple(self.value))
        if all(component is None for component in self.value):
            raise InputError(f"{what} fixes no component; leave it out.")

    @property
    def is_moved(self) -> bool:
        """Tell whether a displacement is prescribed that is not zero."""
        return any(callable(component) or component for component in self.value)


@dataclass(frozen=True)
class Spring:
    """Declare springs all over a boundary part, which pull it back to its place.

    The traction on the body is ``-k_n u_n n - k_t u_t``. No support is rigid: springs
    are a bed, a seal, a machine that is compliant. The other end of the springs is
    moved by U if a Traction ``k U`` acts on the same part.

    Args:
        facets: Name of the boundary part.
        normal: k_n, force per area over displacement along the normal [force/length^3].
        tangential: k_t, that along the facet [force/length^3].

    Raises:
        InputError: If a stiffness is no finite number >= 0, or both are zero.

    Example:
        >>> ec.Spring("left", normal=100.0)
        Spring(facets='left', normal=100.0, tangential=0.0)
    """

    facets: str
    normal: float = 0.0
    tangential: float = 0.0

    def __post_init__(self) -> None:
        """Check the arguments."""
        check_name("Spring", self.facets)
        what = f"Spring({self.facets!r})"
        for name in ("normal", "tangential"):
            value: Any = getattr(self, name)
            if not is_number(value) or value < 0:
                raise InputError(
                    f"{what}: {name} is {value!r}; give {STIFFNESS}. Where it varies, use several"
                    " boundary parts."
                )
            object.__setattr__(self, name, float(value))
        if self.normal == self.tangential == 0.0:
            raise InputError(f"{what} has no stiffness; leave it out.")


@dataclass(frozen=True)
class Rigid:
    """Declare a rigid body constraint on a face: it moves as in a stiff holder.

    Such a boundary part is called a rigid face. Of each of its freedoms, a translation
    along each axis and a rotation (in 3D one about each axis), either the motion or its
    resultant is given: a number in one of the two, None in the other. A face of an
    axisymmetric body moves along the axis alone, and ``force=(None, F)`` says all of
    it: along r it slides freely, or it is held by ``displacement=(0.0, None)``.

    Args:
        facets: Name of the boundary part, which lies on one body.
        displacement: Displacement of the point ``about`` [length], d numbers or None.
        rotation: Angle of the small rotation [rad], counterclockwise; in 3D three,
            about the axes.
        force: Resultant of all that acts on the part from outside [force], d numbers
            or None.
        moment: Its moment about ``about`` [force length]; in 3D three.
        about: The point [length], d numbers. By default it is the centroid of the part.

    Raises:
        InputError: If both or none of motion and resultant of a freedom are given, or a
            value is no finite number.

    Source: the face is a support whose motion is unknown in some freedoms. The traction
    on it does work only through its resultants, so e (16) keeps its meaning: u^ is
    rigid on the face, and sigma^ has the given resultants.

    Example:
        >>> ec.Rigid("top", (0.0, None), rotation=0.0, force=(None, -3.0)).resultants
        (None, -3.0, None)
    """

    facets: str
    displacement: Sequence[float | None] | None = None
    rotation: float | Sequence[float | None] | None = None
    force: Sequence[float | None] | None = None
    moment: float | Sequence[float | None] | None = None
    about: Sequence[float] | None = None

    _example: ClassVar[str] = (
        "Rigid('top', displacement=(0.0, None), rotation=0.0, force=(None, -3.0))"
    )

    def __post_init__(self) -> None:
        """Check the arguments, and make tuples of them."""
        check_name(type(self).__name__, self.facets)
        for name in ("displacement", "rotation", "force", "moment", "about"):
            value: Any = getattr(self, name)
            if value is not None and not isinstance(value, Real):
                # The class is frozen: only here an attribute may change.
                object.__setattr__(self, name, self._vector(name, value))
        if self.displacement is None and self.force is None:
            raise InputError(
                f"{self._what} has neither displacement nor force; give a number for each"
                f" component in one of them, e.g. {self._example}."
            )
        for number, lacks in enumerate(zip(self._ring_lacks, self._slides, strict=True)):
            self._check_freedom(number, may_lack=any(lacks))

    def check_hypothesis(self, *, axisymmetric: bool) -> None:
        """Check what depends on the material: which freedoms must be given.

        Args:
            axisymmetric: Whether the body is a ring, which moves along the axis alone.

        Raises:
            InputError: If a freedom is not given, or a ring has no such freedom.
        """
        if not axisymmetric:
            for number, slides in enumerate(self._slides):
                self._check_freedom(number, may_lack=slides)
            return
        freedoms = zip(self._ring_lacks, self.motions, self.resultants, strict=True)
        for number, (ring_lacks, motion, resultant) in enumerate(freedoms):
            self._check_freedom(number, may_lack=ring_lacks)
            if ring_lacks and (motion not in (None, 0.0) or resultant is not None):
                raise InputError(
                    f"{self._what}: a rigid face of an axisymmetric body moves along the axis only;"
                    " give its force, force=(None, F), or its displacement, displacement=(None, U),"
                    " no moment, and displacement=(0.0, ...) to hold it along r."
                )

    def _check_freedom(self, number: int, *, may_lack: bool) -> None:
        """Check that either motion or resultant of a freedom is given.

        Args:
            number: Number of the freedom.
            may_lack: Whether both may be left out.
        """
        motion = self.motions[number]
        resultant = self.resultants[number]
        if (motion is None) != (resultant is None) or (may_lack and motion is None):
            return
        given = "neither" if motion is None else "both"
        motion_name, resultant_name = self._names[number]
        raise InputError(
            f"{self._what} has {given} of {motion_name} and {resultant_name}; give one of"
            " them, and None in place of the other (a free motion has the resultant 0)."
        )

    @property
    def motions(self) -> tuple[float | None, ...]:
        """Return the given motions: displacements, then rotations; None where free."""
        return self._freedoms("displacement", "rotation")

    @property
    def resultants(self) -> tuple[float | None, ...]:
        """Return the given resultants: forces, then moments; None where not given."""
        return self._freedoms("force", "moment")

    @property
    def value(self) -> tuple[float | None, ...]:
        """Return the given displacement, as a support has it; 0 where the face moves.

        It is None in a component in which nothing is given.
        """
        value: list[float | None] = []
        freedoms = zip(self.motions, self.resultants, strict=True)
        for motion, resultant in list(freedoms)[: self.d]:
            is_given = motion is not None or resultant is not None
            value.append((motion or 0.0) if is_given else None)
        return tuple(value)

    @property
    def is_moved(self) -> bool:
        """Tell whether a motion is given that is not zero."""
        return any(self.motions)

    @property
    def d(self) -> int:
        """Return the dimension."""
        return len(self.displacement or self.force or ())

    @property
    def _what(self) -> str:
        """Return the face in words for messages."""
        return f"{type(self).__name__}({self.facets!r})"

    @property
    def _slides(self) -> tuple[bool, ...]:
        """Tell in which freedoms the face slides, so that nothing is given: in none."""
        return (False,) * len(self._names)

    @property
    def _ring_lacks(self) -> tuple[bool, ...]:
        """Tell which freedoms a ring lacks: all but the motion along the axis."""
        return (True, False, True) if self.d == 2 else (False,) * len(self._names)

    @property
    def _names(self) -> list[tuple[str, str]]:
        """Return the names of motion and resultant of each freedom, for messages."""
        names = [(f"displacement in {axis}", f"force in {axis}") for axis in AXES[: self.d]]
        if self.d == 2:
            return [*names, ("rotation", "moment")]
        return names + [(f"rotation about {axis}", f"moment about {axis}") for axis in AXES]

    def _freedoms(self, translations: str, rotations: str) -> tuple[float | None, ...]:
        """Return the numbers of two arguments in a tuple, None where there is none."""
        d = self.d
        linear = getattr(self, translations)
        angular = getattr(self, rotations)
        count = 1 if d == 2 else 3
        if linear is None:
            linear = (None,) * d
        if angular is None:
            angular = (None,) * count
        if isinstance(angular, Real):
            angular = (angular,)
        for name, numbers, size in ((translations, linear, d), (rotations, angular, count)):
            if len(numbers) != size:
                raise InputError(
                    f"{self._what}: {name} has {len(numbers)} numbers; in {d}D give {size}."
                )
            for number in numbers:
                self._check_number(name, number)
        return (*linear, *angular)

    def _vector(self, name: str, value: Any) -> tuple[Any, ...]:
        """Return an argument as a tuple of numbers."""
        is_sequence = hasattr(value, "__len__") and not isinstance(value, str)
        if not is_sequence or len(value) not in (1, 2, 3):
            raise InputError(
                f"{self._what}: {name} is {value!r}; give one number for each dimension, or None."
            )
        if name == "about":
            for number in value:
                self._check_number(name, number)
        return tuple(value)

    def _check_number(self, name: str, number: Any) -> None:
        """Check that a component of an argument is a finite number, or None."""
        if number is None and name != "about":
            return
        if not isinstance(number, Real) or not isfinite(number):
            raise InputError(
                f"{self._what}: a component of {name} is {number!r}; give finite numbers. In a"
                " history the scene is a function of time, and so are they."
            )


@dataclass(frozen=True)
class PlaneSection(Rigid):
    """Declare a flat part that stays plane, and slides and widens in its plane.

    Such a part is a section through a longer body, or a symmetric joint: it moves along
    its normal n, turns about the axes in its plane, and has no shear,

        u . n = q_0 + (theta x (x - about)) . n,    sigma n = (n . sigma n) n.

    n is an axis, and is known by the component that is given: ``force=(None, F)`` is a
    force along y. Of each freedom of the section, as of :class:`Rigid`, either the
    motion or its resultant is given; None stands for the freedoms that it lacks. In 3D
    it turns about two axes, ``moment=(0.0, 0.0, None)`` where n is z. A section of an
    axisymmetric body moves along the axis alone, as a face that slides along r.

    Args:
        facets: Name of the boundary part, which is flat and lies on one body.
        displacement: Displacement of the point ``about`` [length], d entries: a number
            along n, or None.
        rotation: Angle of the small rotation [rad], counterclockwise; in 3D three,
            about the axes, None about n.
        force: Resultant of all that acts on the part from outside [force], d entries: a
            number along n, or None.
        moment: Its moment about ``about`` [force length]; in 3D three, None about n.
        about: The point [length], d numbers. By default it is the centroid of the part.

    Raises:
        InputError: If numbers are given along several axes or in the plane, both or
            none of motion and resultant of a freedom are given, or a value is no finite
            number.

    Source: as a rigid face in the components that it has. Its other components are a
    free boundary, so that e (16) keeps its meaning: u^ . n is linear on the part, and
    sigma^ has no shear there and the given resultants.

    Example:
        >>> ec.PlaneSection("right", force=(3.0, None), moment=0.0).resultants
        (3.0, None, 0.0)
    """

    _example: ClassVar[str] = "PlaneSection('top', rotation=0.0, force=(None, -3.0))"

    def __post_init__(self) -> None:
        """Check the arguments: they are along one axis, and about the other axes."""
        super().__post_init__()
        axes = [axis for axis, value in zip(AXES, self.value, strict=False) if value is not None]
        if len(axes) != 1:
            raise InputError(
                f"{self._what} has displacements or forces along {listed(axes)}; it moves along its"
                " normal alone: give one component, and None in place of the others, e.g."
                f" {self._example}."
            )
        for number, slides in enumerate(self._slides):
            if slides and (self.motions[number], self.resultants[number]) != (None, None):
                motion_name, resultant_name = self._names[number]
                raise InputError(
                    f"{self._what} has a {motion_name} or a {resultant_name}, its normal; it turns"
                    " freely in its plane: give None there."
                )

    @property
    def axis(self) -> int:
        """Return the number of the axis along its normal."""
        return next(i for i, value in enumerate(self.value) if value is not None)

    @property
    def _slides(self) -> tuple[bool, ...]:
        """Tell in which freedoms the section slides: all that are in its plane."""
        translations = tuple(value is None for value in self.value)
        if self.d == 2:
            return (*translations, False)
        about_normal = tuple(not slides for slides in translations)
        return (*translations, *about_normal)
