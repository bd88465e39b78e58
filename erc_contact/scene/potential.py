"""Describe materials with a convex potential: plasticity and nonlinear elasticity.

Such a law is a convex energy density psi of the strain [force/area], with the conjugate

    psi*(sigma) = sup_eps  sigma : eps - psi(eps).

The stress is ``sigma = psi'(eps)``, and Fenchel's inequality

    psi(eps) + psi*(sigma) - sigma : eps  >=  0

is an equality only there. e^2 (16) is twice the integral of its left side, with the
contact part as it is: no term of it needs a linear law. For an admissible pair
``J(u^) + J*(sigma^) = e^2/2``, with the potential and the complementary energy, without
friction or with Tresca friction. So e bounds how far both energies are from their
minima. For ``psi = eps : C eps / 2`` all this is linear elasticity.

Strains and stresses are tensors of space, of shape (3, 3). A mesh in the plane is in
plane strain. Its stress out of plane takes no part in the equilibrium, so the conjugate
of the plane is the minimum of psi* over it.

Symbols: eps strain [-], sigma stress [force/area].
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, TypeGuard

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl


class Potential(Protocol):
    """Describe a material by a convex energy density and its conjugate.

    All methods get the parameters by their names, as UFL: a class with the parameters
    ("K", "G") has ``potential(self, strain, K, G)``; ``*values`` is here for type
    checkers only. The package differentiates the potential twice.

    A further method ``convexity``, like ``modulus``, may return a share a [-] for which
    ``psi(eps) - a/2 eps : C eps`` is convex, with ``C = psi''(0)`` for the state that
    the body has. Then e bounds the error of the displacement, too
    (:attr:`erc_contact.ConstitutiveError.displacement_error`), and ``conjugate`` can be
    left out: Newton's method looks for the supremum at each point, and the convexity
    bounds what it leaves, ``rho : (a C)^-1 rho / 2`` for the stress rho that it misses.

    A law with an attribute ``expands = True`` takes given strains that are the same in
    all directions: where a scene has them, all methods get their sum as
    ``free_strain``, by which ``psi(eps) = psi_0(eps - free_strain I)`` is moved.

    Attributes:
        parameters: Names of the attributes that are values in space: numbers, callables
            of x, or mappings from the names of regions to either.

    Example:
        >>> law: ec.Potential = ec.Plastic(1e3, 0.3, yield_stress=3.0, hardening=20.0)
        >>> yielding = ec.Scene(law, scene.supports, contacts=scene.contacts)
        >>> ec.solve(yielding, block)
        <Solution of degree 1 on 16 cells by Nitsche(theta=0, gamma=10.0),
         ... Newton steps>
    """

    @property
    def parameters(self) -> tuple[str, ...]: ...  # noqa: D102

    def check(self, name: str, low: float, high: float) -> None:
        """Raise an error if a parameter must not take a range of values."""

    def potential(self, strain: Ufl, *values: Ufl, **parameters: Ufl) -> Ufl:
        """Return psi of a strain (3, 3) [force/area], UFL.

        It is convex and has a derivative; it and its derivative are zero without
        strain.
        """

    def conjugate(self, stress: Ufl, *values: Ufl, **parameters: Ufl) -> Ufl:
        """Return psi* of a stress (3, 3) [force/area], UFL.

        It can be left out where there is a ``convexity`` > 0.
        """

    def modulus(self, *values: Ufl, **parameters: Ufl) -> Ufl:
        """Return a modulus > 0 that scales contact parameters [force/area], UFL."""


FREE_STRAIN = "free_strain"
"""Name of the parameter of a law that expands: a given strain in all directions [-]."""
POTENTIAL_MEMBERS = ("parameters", "check", "potential", "modulus")
"""Names of the members of each material with a potential."""
DUAL_MEMBERS = ("conjugate", "convexity")
"""Names of members of which a material with a potential has one or both."""
type Shapes = Mapping[str, tuple[int, ...]]
"""Names of the entries of a state with their shapes: () or (3, 3)."""


BY_FORCE = "force() has the value of sigma^, without an interval; potential_energy() has one."
"""What there is of a potential where a number has no interval."""
FROM_REST = (
    "Potentials are solved in plane strain, as bodies of revolution and in 3D; Plastic also with "
    "strains of heat."
)
"""What there is of a potential where a hypothesis or a given strain is refused."""


class Remembering(Potential, Protocol):
    """Describe a law whose body remembers a state from load step to load step.

    ``potential`` and ``conjugate`` get the entries of the state before the step by
    their names, too, as UFL of their shapes; at first they are zero. They are the
    energy of a step of implicit Euler, with the new state at its best.

    Attributes:
        state: Names of the entries with their shapes, () or (3, 3), which is symmetric.
            An entry ``plastic_strain`` takes plastic work.

    Example:
        >>> law: ec.Remembering = ec.Plastic(1e3, 0.3, yield_stress=3.0, hardening=20.0)
        >>> law.state
        {'plastic_strain': (3, 3), 'accumulated': ()}
    """

    @property
    def state(self) -> Shapes: ...  # noqa: D102

    def new_state(self, strain: Ufl, *values: Ufl, **parameters: Ufl) -> Mapping[str, Ufl]:
        """Return the entries after a load step that ends at a strain (3, 3), UFL."""


class Convex(Potential, Protocol):
    """Describe a law that tells how convex it is."""

    def convexity(self, *values: Ufl, **parameters: Ufl) -> Ufl:
        """Return a share a [-] with ``psi - a/2 eps : psi''(0) eps`` convex, UFL."""


def gives_conjugate(material: Any) -> bool:
    """Tell whether a law has a conjugate of its own beside the protocol."""
    method = getattr(type(material), "conjugate", None)
    return method is not None and method is not Potential.conjugate


def tells_convexity(material: Any) -> TypeGuard[Convex]:
    """Tell whether a law tells how convex it is."""
    return hasattr(material, "convexity")


def expands(material: Any) -> bool:
    """Tell whether a law takes a given strain in all directions, as heat is."""
    return bool(getattr(material, "expands", False))


def remembers(material: Any) -> TypeGuard[Remembering]:
    """Tell whether a law has a state."""
    return bool(getattr(material, "state", None))


def has_potential(material: Any) -> TypeGuard[Potential]:
    """Tell whether a material is given by a potential, not by a linear law."""
    return hasattr(material, "potential")


def refuse_potential(material: Any, what: str, instead: str) -> None:
    """Refuse what holds for linear laws only; the same on all ranks.

    Args:
        material: The material of a scene.
        what: What was asked for.
        instead: What the user can do.

    Raises:
        InputError: If the material is given by a potential.
    """
    if has_potential(material):
        raise InputError(
            f"{what} needs a linear law between strain and stress, and {type(material).__name__} "
            f"has none. {instead}"
        )
