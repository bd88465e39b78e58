"""Goals: single numbers of the solution that a certified interval is asked of.

Each class has the dimension of its number for prints, "" where it has none, or the data
of the goal decide on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from erc_contact.base.code import code_of
from erc_contact.base.exceptions import InputError
from erc_contact.scene.checks import check_name, check_vector
from erc_contact.scene.load import LOAD_MEMBERS, Load
from namedmesh.base.checks import positive

__all__ = [
    "BoltForce",
    "Energy",
    "Functional",
    "MeanDisplacement",
    "Moment",
    "Opening",
    "Resultant",
    "Rotation",
    "Shortening",
    "Slip",
    "StressIntensity",
]


def _numbers(what: str, direction: Sequence[float]) -> tuple[float, ...]:
    """Return a direction as numbers.

    Raises:
        InputError: If it is no sequence of two or three numbers.
    """
    check_vector(what, direction)
    if callable(direction) or any(callable(component) for component in direction):
        raise InputError(f"{what}: the direction must be numbers, and the same everywhere.")
    return tuple(direction)


@dataclass(frozen=True)
class _OfPart:
    """Hold and check the name of a boundary part."""

    part: str

    def __post_init__(self) -> None:
        """Check the name."""
        check_name(type(self).__name__, self.part)


@dataclass(frozen=True)
class _PartInDirection(_OfPart):
    """Hold and check a boundary part and a direction."""

    direction: Sequence[float]

    def __post_init__(self) -> None:
        """Check the arguments."""
        super().__post_init__()
        direction = _numbers(f"{type(self).__name__}({self.part!r})", self.direction)
        object.__setattr__(self, "direction", direction)


@dataclass(frozen=True)
class Resultant(_PartInDirection):
    """Ask for the force on a support or on a contact in one direction.

    All that acts on the part from outside counts, as in
    :func:`erc_contact.results.force`.

    Args:
        part: Name of the boundary part, with a support or in contact; of a contact
            between two bodies either side.
        direction: d numbers, of any length: the force is taken along it, times its
            length.

    Raises:
        InputError: If the direction is no such sequence.

    Example:
        >>> ec.Resultant("top", (0.0, 1.0))
        Resultant(part='top', direction=(0.0, 1.0))
    """

    dimension: ClassVar[str] = "force"


@dataclass(frozen=True)
class MeanDisplacement(_PartInDirection):
    """Ask for the mean displacement of a boundary part in one direction.

    Args:
        part: Name of the boundary part, with or without loads.
        direction: d numbers, of any length.

    Raises:
        InputError: If the direction is no such sequence.

    Example:
        >>> ec.MeanDisplacement("right", (0.0, 1.0))
        MeanDisplacement(part='right', direction=(0.0, 1.0))
    """

    dimension: ClassVar[str] = "length"


@dataclass(frozen=True)
class _PartAboutAxis(_OfPart):
    """Hold and check a boundary part and an axis in 3D."""

    axis: Sequence[float] | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        """Check the arguments."""
        super().__post_init__()
        for name in ("axis", "about"):
            value = getattr(self, name, None)
            if value is not None:
                check_vector(f"{type(self).__name__}({self.part!r}): {name}", value)
                # The class is frozen: only here an attribute may change.
                object.__setattr__(self, name, tuple(value))


@dataclass(frozen=True)
class Moment(_PartAboutAxis):
    """Ask for the moment on a support or on a contact.

    It is ``int (x - c) x (sigma n)`` over the part, along the axis: the moment of all
    that acts on the part from outside, as :func:`erc_contact.results.force` has it.

    Args:
        part: Name of the boundary part, as of :class:`Resultant`.
        about: The point c [length], d numbers. By default it is the centroid of the
            part.
        axis: In 3D, three numbers, of any length: the moment is taken about it,
            times its length. In the plane it is counterclockwise, and none is given.

    Raises:
        InputError: If the point or the axis is no such sequence.

    Source: the derivative of the energy by a small rotation of the supports.

    Example:
        >>> ec.Moment("top", about=(0.0, 0.0))
        Moment(part='top', axis=None, about=(0.0, 0.0))
    """

    dimension: ClassVar[str] = "force length"

    about: Sequence[float] | None = None


@dataclass(frozen=True)
class Rotation(_PartAboutAxis):
    """Ask for the small rotation of a rigid face whose moment is given [rad].

    Args:
        part: Name of the boundary part, see :class:`erc_contact.Rigid`.
        axis: In 3D, three numbers, of any length: the rotation is taken about it,
            times its length. In the plane it is counterclockwise, and none is given.

    Raises:
        InputError: If the axis is no such sequence.

    Source: the derivative of the energy by the moment of the face.

    Example:
        >>> ec.Rotation("top")
        Rotation(part='top', axis=None)
    """

    dimension: ClassVar[str] = ""


@dataclass(frozen=True)
class Slip(_OfPart):
    """Ask for the mean slip of a contact: of its part against what it touches.

    It is the mean over the contact, or over its ring, where it is open, too.

    Args:
        part: Name of the boundary part; of a contact between two bodies either side.
        direction: d numbers, of any length: the slip is taken along it, times its
            length. In the plane it may be left out: the slip is then along the tangent,
            which is the outward normal of the part turned counterclockwise.

    Raises:
        InputError: If the direction is no such sequence.

    Source: the derivative of the energy by a shear that drives the slip. The greatest
    slip is ``history.maximum("slip")``, an estimate.

    Example:
        >>> ec.Slip("bottom")
        Slip(part='bottom', direction=None)
    """

    dimension: ClassVar[str] = "length"

    direction: Sequence[float] | None = None

    def __post_init__(self) -> None:
        """Check the arguments."""
        super().__post_init__()
        if self.direction is not None:
            direction = _numbers(f"Slip({self.part!r})", self.direction)
            object.__setattr__(self, "direction", direction)


@dataclass(frozen=True)
class Opening(_OfPart):
    """Ask for the mean distance of a contact from what it touches [length].

    It is the gap that is left along the normals of the contact; between curved sides
    along the normals of their flat facets.

    Args:
        part: Name of the boundary part; of a contact between two bodies either side.

    Source: the derivative of the energy by a pressure that drives the sides apart. The
    greatest distance is ``history.maximum("gap")``, an estimate.

    Example:
        >>> ec.Opening("bottom")
        Opening(part='bottom')
    """

    dimension: ClassVar[str] = "length"


@dataclass(frozen=True)
class BoltForce(_OfPart):
    """Ask for the force of a bolt whose shortening is given [force].

    It is along the axis of its :class:`Preload`, in tension > 0.

    Args:
        part: Name of a side of its cut.

    Source: the derivative of the energy by the shift.

    Example:
        >>> ec.BoltForce("upper end")
        BoltForce(part='upper end')
    """

    dimension: ClassVar[str] = "force"


@dataclass(frozen=True)
class Shortening(_OfPart):
    """Ask for the shift of a bolt whose force is given [length].

    It is > 0 where the sides of the cut of its :class:`Preload` are drawn together.

    Args:
        part: Name of a side of its cut.

    Source: the derivative of the energy by the force.

    Example:
        >>> ec.Shortening("upper end")
        Shortening(part='upper end')
    """

    dimension: ClassVar[str] = "length"


@dataclass(frozen=True, repr=False)
class Functional:
    """Ask for a number that is linear in the displacement.

    ``int psi . u`` is the work of a load psi that the scene need not have: a mean with
    a weight, the opening between two parts, a coefficient of a mode.

    Args:
        load: psi, as a :class:`erc_contact.Traction` on a boundary part, a
            :class:`erc_contact.BodyForce`, or a load of the user's own. A traction is
            on a part where the scene may have one: in components that supports leave
            free, and not in contact.

    Raises:
        InputError: If it is no load.

    Source: the derivative of the energy by the load. The interval is proved if psi is
    represented exactly by the mesh: on facets polynomials of the degree k of u, in
    cells of degree k - 1.

    Example:
        >>> ec.Functional(ec.Traction("right", (0.0, 1.0)))
        Functional(load=ec.Traction(facets='right', value=(0.0, 1.0)))
    """

    dimension: ClassVar[str] = ""

    load: Load

    def __post_init__(self) -> None:
        """Check the load."""
        missing = [name for name in LOAD_MEMBERS if not hasattr(self.load, name)]
        if missing or isinstance(self.load, type):
            raise InputError(
                f"Functional: load is {self.load!r}; give a Traction, a BodyForce, or an object"
                f" with {', '.join(LOAD_MEMBERS)}."
            )

    def __repr__(self) -> str:
        """Return it as code: a lambda by its source, not by its address."""
        return f"Functional(load={code_of(self.load)})"


@dataclass(frozen=True)
class StressIntensity:
    """Ask for a stress intensity factor at a crack tip, in the plane or of a ring.

    Within the radius around the tip there must be nothing but the crack: two faces
    behind the tip, in one isotropic material, without body forces and given strains. In
    the plane they may bend within the radius, away from the tip. Loads on the faces are
    allowed. Faces may be in contact; where they touch within the radius, the number is
    an estimate if their tractions have a part in it.

    Of axisymmetric bodies the tip is a ring in any direction: the rim of a penny crack,
    a crack round a bar, a cylinder or a cone. Within the radius it is straight, and the
    axis counts as a boundary. The unit is force/length^1.5, K_I of a
    penny crack ``2 p sqrt(a/pi)``.

    Args:
        tip: Position of the tip [length], two numbers; of rings (r, z).
        direction: Direction in which the crack points at its tip, away from its faces:
            two numbers, of any length. Along a curve each mesh has its own; the last
            facet counts where it is less than 11 degrees from the given direction.
        radius: Radius around the tip in which the stress is asked [length].
        mode: "I" for opening, "II" for sliding: K_II > 0 where the face on the left of
            the direction moves in it.

    Raises:
        InputError: If an argument is none of these.

    Source: the derivative of the energy by a given strain around the tip, in the place
    of the interaction integral, see ``erc_contact.error.goals.singular_strain``, of
    cracks that bend ``erc_contact.error.goals.bent_strain``, and of rings
    ``erc_contact.error.goals.ring_strain``.

    Example:
        >>> ec.StressIntensity((0.5, 0.0), (1.0, 0.0), radius=0.3)
        StressIntensity(tip=(0.5, 0.0), direction=(1.0, 0.0), radius=0.3, mode='I')
    """

    dimension: ClassVar[str] = "force/length^1.5"

    tip: Sequence[float]
    direction: Sequence[float]
    radius: float
    mode: str = "I"

    def __post_init__(self) -> None:
        """Check the arguments."""
        for name in ("tip", "direction"):
            value = getattr(self, name)
            check_vector(f"StressIntensity: {name}", value)
            object.__setattr__(self, name, tuple(float(entry) for entry in value))
            if len(value) != 2:
                raise InputError(f"StressIntensity: {name} is {value!r}; give two numbers.")
        if not any(self.direction):
            raise InputError("StressIntensity: direction is zero; give a vector along the crack.")
        positive("StressIntensity: radius", self.radius, "a radius > 0 [length]")
        if self.mode not in ("I", "II"):
            raise InputError(f'StressIntensity: mode is {self.mode!r}; give "I" or "II".')


@dataclass(frozen=True)
class Energy:
    """Ask for the potential energy [force length].

    See :func:`erc_contact.potential_energy`. Where the work of the loads has bounds, it
    is known as well as the energy, see :func:`erc_contact.work_of_loads`.

    Source: the energy of u^ is above the least one by at most ``e^2/2``.

    Example:
        >>> ec.adapt(scene, block, accuracy=0.1, goal=ec.Energy()).reached
        True
    """

    dimension: ClassVar[str] = "force length"


GOALS = (
    Resultant,
    Moment,
    MeanDisplacement,
    Rotation,
    Slip,
    Opening,
    BoltForce,
    Shortening,
    Functional,
    StressIntensity,
    Energy,
)
"""The kinds of goals."""

type GoalOfPart = Resultant | Moment | MeanDisplacement | Rotation
"""A number of a boundary part."""

type GoalOfContact = Slip | Opening
"""A displacement of a contact."""

type GoalOfBolt = BoltForce | Shortening
"""A number of a preload."""

type Goal = GoalOfPart | GoalOfContact | GoalOfBolt | Functional | StressIntensity | Energy
"""A number of the solution."""
