"""Declare a force and a moment that a part shares, as a traction linear on the part.

A force F at a point a away from the part, with a moment M, becomes the traction

    t = F/A + w x (x - c),    J w = M + (a - c) x F,

with the area A of the part, its centre c and its second moments J about c. The traction
is a rigid motion of the part, and its work on all rigid motions is the work of F and M:
the Gram matrix of the translations and of the rotations about c is A and J. The part
itself stays as soft as it is; a part that a stiff body moves is a
:class:`.support.Rigid`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from numbers import Real
from typing import Any, ClassVar

import numpy as np
import ufl

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl
from erc_contact.scene.checks import check_name


@dataclass(frozen=True)
class AreaMoments:
    """Hold the moments of the area of a part, of a ring with its circumference.

    Attributes:
        area: A [length^(d-1)], of a ring and in 3D [length^2].
        centre: c [length], shape (d,).
        second: ``int (x - c) (x - c)^T`` [length^2 area], shape (d, d).
        is_ring: Whether the part is of an axisymmetric body.
    """

    area: float
    centre: np.ndarray
    second: np.ndarray
    is_ring: bool = False


def slopes_of(second: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Return the matrices of ``w x`` with ``J w = M``, the slopes of linear tractions.

    Args:
        second: Second moments of areas or volumes about their centres, shape (..., d,
            d).
        moment: Moments M about the centres [force length], shape (..., 1) in the plane,
            else (..., 3).

    Returns:
        Shape (..., d, d).
    """
    polar = np.trace(second, axis1=-2, axis2=-1)[..., None]
    if moment.shape[-1] == 3:
        inertia = polar[..., None] * np.eye(3) - second
        w = np.linalg.solve(inertia, moment[..., None])[..., 0]
        return np.cross(np.eye(3), w[..., None, :])
    return (moment / polar)[..., None] * np.array([[0.0, -1.0], [1.0, 0.0]])


def moments_of(arms: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Return the moments of forces at arms (..., d), shape (..., 1) or (..., 3)."""
    if arms.shape[-1] == 3:
        return np.cross(arms, forces)
    return arms[..., :1] * forces[..., 1:] - arms[..., 1:] * forces[..., :1]


@dataclass(frozen=True)
class RemoteForce:
    """Declare a force at a point that a part shares, with a moment.

    The part gets the traction that is linear on it and has this resultant and this
    moment, to round-off on each mesh: the distributing coupling of other codes. It does
    not make the part stiff, as :class:`Rigid` does.

    Args:
        facets: Name of the boundary part.
        force: Resultant [force], d numbers; of a ring (0, F), the force along the axis
            on the full ring.
        moment: Moment about the point [force length]: a number in the plane,
            counterclockwise, and three numbers in 3D.
        at: The point [length], d numbers; None for the centre of the part.

    Raises:
        InputError: If an argument is no finite number, or has another number of
            components than the mesh.

    Source: the principle of virtual work on the rigid motions of the part; Abaqus
    Analysis User's Guide, "Coupling constraints", distributing coupling.

    Example:
        >>> crank = ec.RemoteForce("right", (0.0, -0.002), at=(3.0, 0.5))
        >>> bent = ec.Scene(scene.material, ec.Displacement("left", (0.0, 0.0)), crank)
        >>> ec.solve(bent, block).force("right").force
        array([ 0.   , -0.002])
    """

    facets: str
    force: Sequence[float]
    moment: float | Sequence[float] | None = None
    at: Sequence[float] | None = None
    parameters: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        """Check the arguments, and make tuples of them."""
        check_name("RemoteForce", self.facets)
        for name, counts in (("force", (2, 3)), ("at", (2, 3)), ("moment", (1, 3))):
            value = getattr(self, name)
            if value is None and name != "force":
                continue
            numbers = (value,) if isinstance(value, Real) and name == "moment" else value
            is_sequence = isinstance(numbers, Sequence | np.ndarray)
            if not is_sequence or len(numbers) not in counts or not all(map(_is_finite, numbers)):
                raise InputError(
                    f"RemoteForce({self.facets!r}): {name} is {value!r}; give {counts[0]} or "
                    f"{counts[1]} finite numbers. In a history the scene is a function of time."
                )
            object.__setattr__(self, name, tuple(map(float, numbers)))

    def on_part(self, moments: AreaMoments) -> dict[str, np.ndarray]:
        """Return what the density needs of a part: mean, slopes and centre.

        Args:
            moments: The moments of the part on a mesh.

        Raises:
            InputError: If the dimension is another one, or a ring cannot have the load.
        """
        d = len(moments.centre)
        zero = (0.0,) if d == 2 else (0.0, 0.0, 0.0)
        force = np.array(self.force)
        moment = np.array(zero if self.moment is None else self.moment)
        at = moments.centre if self.at is None else np.array(self.at)
        if (len(force), len(at), len(moment)) != (d, d, len(zero)):
            raise InputError(
                f"RemoteForce({self.facets!r}): the mesh is {d}D; give {d} numbers for force and "
                f"at, and {len(zero)} for moment."
            )
        if moments.is_ring:
            self._check_ring(force, moment)
            at = moments.centre  # the same all around
        about_centre = moment + moments_of(at - moments.centre, force)
        slopes = slopes_of(moments.second, about_centre)
        return {"mean": force / moments.area, "slopes": slopes, "centre": moments.centre}

    def density(self, x: Ufl, n: Ufl, mean: Ufl, slopes: Ufl, centre: Ufl) -> Ufl:
        """Return ``F/A + w x (x - c)`` [force/area], UFL, shape (d,)."""
        return mean + ufl.dot(slopes, x - centre)

    def _check_ring(self, force: np.ndarray, moment: np.ndarray) -> None:
        """Check that a load is the same all around an axis."""
        is_off_axis = self.at is not None and self.at[0] != 0.0
        if force[0] != 0.0 or moment.any() or is_off_axis:
            raise InputError(
                f"RemoteForce({self.facets!r}): the body is axisymmetric, and a force across its "
                "axis, a moment or a point beside the axis would bend it; give force=(0.0, F) "
                "alone, or a body in 3D."
            )


def _is_finite(value: Any) -> bool:
    """Tell whether a value is a finite number."""
    return isinstance(value, Real) and isfinite(value)
