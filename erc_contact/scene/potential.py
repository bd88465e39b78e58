"""Describe materials with a convex potential: plasticity and nonlinear elasticity.

Such a law is a convex energy density psi of the strain [force/area], with the conjugate

    psi*(sigma) = sup_eps  sigma : eps - psi(eps).

The stress is ``sigma = psi'(eps)``, and Fenchel's inequality

    psi(eps) + psi*(sigma) - sigma : eps  >=  0

is an equality only there. e^2 (16) is twice the integral of its left side, with the
contact part as it is: no term of it needs a linear law. For an admissible pair
``J(u^) + J*(sigma^) = e^2/2``, with the potential and the complementary energy, without
friction or with a given friction. So e bounds how far both energies are from their
minima. For ``psi = eps : C eps / 2`` all this is linear elasticity.

Strains and stresses are tensors of space, of shape (3, 3). A mesh in the plane is in
plane strain. Its stress out of plane takes no part in the equilibrium, so the conjugate
of the plane is the minimum of psi* over it.

Symbols: eps strain [-], sigma stress [force/area].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol, TypeGuard

import ufl

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl
from erc_contact.scene.material import in_tensor, mandel_basis


class Potential(Protocol):
    """Describe a material by a convex energy density and its conjugate.

    All methods get the parameters by their names, as UFL: a class with the parameters
    ("K", "G") has ``potential(self, strain, K, G)``; ``*values`` is here for type
    checkers only. The package differentiates the potential twice.

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
        """Return psi* of a stress (3, 3) [force/area], UFL."""

    def modulus(self, *values: Ufl, **parameters: Ufl) -> Ufl:
        """Return a modulus > 0 that scales contact parameters [force/area], UFL."""


POTENTIAL_MEMBERS = ("parameters", "check", "potential", "conjugate", "modulus")
"""Names of the members of a material with a potential."""


BY_FORCE = "force() has the value of sigma^, without an interval; potential_energy() has one."
"""What there is of a potential where a number has no interval."""
FROM_REST = "Potentials are solved in plane strain, as bodies of revolution and in space."
"""What there is of a potential where a hypothesis or a given strain is refused."""
type Shapes = Mapping[str, tuple[int, ...]]
"""Names of the entries of a state with their shapes: () or (3, 3)."""


class Remembering(Potential, Protocol):
    """Describe a law whose body remembers a state from load step to load step.

    ``potential`` and ``conjugate`` get the entries of the state before the step by
    their names, too, as UFL of their shapes; at first they are zero. They are the
    energy of a step of implicit Euler, with the new state at its best.

    Attributes:
        state: Names of the entries with their shapes, () or (3, 3), which is symmetric.
            An entry ``plastic_strain`` takes plastic work.
    """

    @property
    def state(self) -> Shapes: ...  # noqa: D102

    def new_state(self, strain: Ufl, *values: Ufl, **parameters: Ufl) -> Mapping[str, Ufl]:
        """Return the entries after a load step that ends at a strain (3, 3), UFL."""


def remembers(material: Any) -> TypeGuard[Remembering]:
    """Tell whether a law has a state."""
    return bool(getattr(material, "state", None))


def size_of(shapes: Shapes) -> int:
    """Return the number of components of a state."""
    return sum(6 if shape else 1 for shape in shapes.values())


def place_of(shapes: Shapes, name: str) -> slice:
    """Return the place of an entry among the components of a state."""
    names = list(shapes)
    before = {one: shapes[one] for one in names[: names.index(name)]}
    begin = size_of(before)
    return slice(begin, begin + size_of({name: shapes[name]}))


def state_after(potential: Remembering, strain: Ufl, values: Mapping[str, Ufl]) -> Ufl:
    """Return the components of the state after a load step, UFL (size,).

    Args:
        potential: The law.
        strain: The strain at its end, UFL (3, 3).
        values: Parameters, and the state before it.
    """
    new = potential.new_state(strain, **values)
    basis = [ufl.as_tensor(tensor.tolist()) for tensor in mandel_basis(3)]
    components: list[Ufl] = []
    for name, shape in potential.state.items():
        components += [ufl.inner(tensor, new[name]) for tensor in basis] if shape else [new[name]]
    return ufl.as_vector(components)


def entries(shapes: Shapes, components: Sequence[Ufl]) -> dict[str, Ufl]:
    """Return the entries of a state by their names from its components, UFL."""
    values = {}
    place = 0
    for name, shape in shapes.items():
        if shape:
            values[name] = in_tensor(components[place : place + 6])
            place += 6
        else:
            values[name] = components[place]
            place += 1
    return values


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
