"""Contact methods: their equations and their contact tractions, in UFL.

A method is two things, its equations and its traction; every later stage reads only the
traction. The equations are what one contact adds to elasticity ``a(u, v) - f(v) -
F(v)``, which is the same for all methods.

Symbols: u displacement, v test function, lambda multiplier [force/area], n normal of
the foundation, g gap, s tangential displacement at the end of the last step of a
history, which is zero without history, r contact traction on the body, P the projection
of the law, gamma = gamma_0 E k^2/h [force/volume] with h = d |cell|/|facet| the height
of the cell over its facet and k the degree.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import ufl

from erc_contact.base.exceptions import InputError
from erc_contact.base.runtime import compiled
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.model import Model
from namedmesh.base import checks

GAMMA = "> 0 (dimensionless; 1 to 100 is usual)"
"""Words for the range of gamma in messages."""


class Method(Protocol):
    """Define the equations and the traction of a contact method.

    An object of it must be hashable, as one of a frozen dataclass is: the solver keeps
    the compiled forms of each method. Messages show its ``repr``. Without a multiplier
    Newton starts from the solution of the :class:`AugmentedLagrangian`.

    Of a model it may use ``stress(u)`` [force/area], ``modulus`` [force/area],
    ``stiffness_per_area(gamma)`` [force/volume], ``at_nodes(contact)``, the contact
    with its data at the nodes, for a multiplier, and its ``space``; of the space the
    ``mesh``, the outward normal ``n`` of the body, the quadrature degree
    ``contact_degree``, and the quadrature at nodes ``nodal_rule``; of a contact ``ds``,
    ``normal`` (of the foundation), ``gap`` [length], None where it is zero,
    ``jump(u)``, the displacement that the law is about, in a history since the last
    step, ``jump(v)``, its variation for a test function v, and ``project(z, gamma)``,
    the traction that the law allows for a trial traction z with ``-gamma jump(u)`` in
    it; a compliant foundation alone needs gamma. ``allowed_traction(r, u, gamma)`` does
    both, and is what orthotropic friction needs. Write a parameter as
    ``fem.Constant(model.space.mesh, value)``: a plain number is compiled into the
    forms. A script that imports ``dolfinx`` begins with ``from mpi4py import MPI``.

    Example: ``demos/extend/method.py``.

    Attributes:
        multiplier: Whether it has a multiplier, a traction at the nodes of the contact.
            Its equations then replace the equilibrium of these nodes, which gives the
            multiplier.
        in_layer: Whether its equations test the stress, hence all nodes of the cells at
            the contact. Without it what the equations have at nodes off the contact is
            left out, and nothing warns of it.

    Example:
        >>> method: ec.Method = ec.Nitsche(theta=1)
        >>> ec.solve(scene, block, method).method
        Nitsche(theta=1, gamma=10.0)
    """

    @property
    def multiplier(self) -> bool: ...  # noqa: D102

    @property
    def in_layer(self) -> bool: ...  # noqa: D102

    def equations(
        self, model: Model, contact: ContactOnMesh, u: Ufl, v: Ufl, multiplier: Ufl = None
    ) -> Ufl:
        """Return what the contact adds to the residual [force], a form linear in v.

        The residual is ``a(u, v) - f(v) - F(v)``. Without a multiplier that is minus
        the work of its traction, ``- int r . jump(v)``, and what the method adds to it.
        With one it is the equation of the multiplier at each node.

        Args:
            model: The scene on a mesh.
            contact: One of its contacts.
            u: Displacement [length]; with a multiplier its nodal values are the
                Bernstein coefficients.
            v: Test function of the displacement, or of the multiplier.
            multiplier: The multiplier [force/area], or None without.
        """

    def traction(self, model: Model, contact: ContactOnMesh, u: Ufl, multiplier: Ufl = None) -> Ufl:
        """Return the contact traction on the body [force/area], UFL, shape (d,).

        It is all that later stages read.
        """

    def projected(
        self, model: Model, contact: ContactOnMesh, u: Ufl, multiplier: Ufl = None
    ) -> Ufl:
        """Return the projection of the equations [force/area], UFL, shape (d,).

        It shows open, slip and stick. It is a result of ``contact.allowed_traction`` or
        of ``contact.project``; without a multiplier it is mostly the traction.
        """


@dataclass(frozen=True)
class Nitsche:
    """Define Nitsche's method for contact with friction.

    It has no unknowns beside the displacement.

    Args:
        theta: 0 (simplest, default), 1 (symmetric without friction) or -1 (skew;
            converges for any gamma).
        gamma: Dimensionless parameter gamma_0 > 0.

    Raises:
        InputError: If theta is not in {0, 1, -1} or gamma is not positive.

    Source: Chouly, Hild, Renard, "Symmetric and non-symmetric variants of Nitsche's
    method for contact problems in elasticity", Math. Comp. 84 (2015); with Coulomb
    friction: Chouly et al., "An overview of recent results on Nitsche's method for
    contact problems" (2017).

    Example:
        >>> ec.solve(scene, block, method=ec.Nitsche(theta=-1))
        <Solution of degree 1 on 16 cells by Nitsche(theta=-1, gamma=10.0),
         ... Newton steps>
    """

    theta: int = 0
    gamma: float = 10.0
    multiplier: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if self.theta not in (0, 1, -1):
            raise InputError(f"Nitsche: theta is {self.theta!r}; allowed are 0, 1 and -1.")
        checks.positive("Nitsche: gamma", self.gamma, GAMMA)

    @property
    def in_layer(self) -> bool:
        """Tell whether the stress is tested, too."""
        return self.theta != 0

    def equations(
        self, model: Model, contact: ContactOnMesh, u: Ufl, v: Ufl, multiplier: Ufl = None
    ) -> Ufl:
        """Return the equations of a contact [force], a UFL form linear in v.

        They are ``- int_C r(u).v - theta int_C (sigma(u)n - r(u))/gamma . sigma(v)n``.

        Args:
            model: The scene on a mesh.
            contact: One of its contacts.
            u: Displacement [length].
            v: Test function.
            multiplier: Not used.
        """
        r = self.traction(model, contact, u)
        return self.equations_with(r, model, contact, u, v, multiplier)

    def equations_with(
        self, r: Ufl, model: Model, contact: ContactOnMesh, u: Ufl, v: Ufl, multiplier: Ufl = None
    ) -> Ufl:
        """Return :meth:`equations` with a traction r(u) [force/area] made before."""
        space = model.space
        ds = contact.ds(metadata={"quadrature_degree": space.contact_degree})
        residual = -ufl.inner(r, contact.jump(v)) * ds
        if self.theta:
            theta = compiled.constant(space.mesh, float(self.theta))
            difference = ufl.dot(model.stress(u), space.n) - r
            tested = ufl.dot(model.stress(v), space.n)
            residual -= theta / self._gamma(model) * ufl.inner(difference, tested) * ds
        return residual

    def traction(self, model: Model, contact: ContactOnMesh, u: Ufl, multiplier: Ufl = None) -> Ufl:
        """Return the contact traction [force/area], UFL, shape (d,).

        It is ``r(u) = P(sigma(u)n - gamma (u - s - g n))``.
        """
        stress = ufl.dot(model.stress(u), model.space.n)
        gamma = self._gamma(model)
        return contact.allowed_traction(stress, u, gamma)

    projected = traction

    def _gamma(self, model: Model) -> Ufl:
        """Return gamma [force/volume]."""
        return model.stiffness_per_area(compiled.constant(model.space.mesh, float(self.gamma)))


@dataclass(frozen=True)
class AugmentedLagrangian:
    """Define the augmented Lagrangian, with a multiplier at the nodes of the contact.

    It has the projection of Alart and Curnier. The multiplier lives in the trace of the
    displacement's space on the contact facets: the space that elements on a submesh of
    these facets give, without a second mesh. Its equations hold at each node, between
    the Bernstein coefficients of u, s, g and lambda (for degree 1 their nodal values);
    lambda there is the force on the coefficient of u over its share of the area. So at
    the solution u does not penetrate at any point, friction holds for the force on
    every Bernstein polynomial, and no weight of a node is zero or negative, as nodal
    quadrature of degree 2 has it on triangles. (This smooths its traction of degree 2:
    on a smooth contact e is 1.05 to 1.2 times the true error of u^, where Nitsche's
    method has 1.01 to 1.07. The traction that does the work of the forces was better
    there, and twice as bad where friction begins: it overshoots.) A component that a
    support fixes at a contact node, and a node that an earlier contact has already,
    take the multiplier from their neighbours: their own would be redundant. Where three
    bodies meet, or two of them on a foundation, the contacts share the forces of the
    node.

    Args:
        gamma: Dimensionless augmentation parameter gamma_0 > 0; it changes the way of
            Newton, not the solution, but for nodes where contacts share forces.

    Raises:
        InputError: If gamma is not positive.

    Source: Alart, Curnier, "A mixed formulation for frictional contact problems prone
    to Newton like solution methods", Comput. Methods Appl. Mech. Engrg. 92 (1991).

    Example:
        >>> ec.solve(scene, block, method=ec.AugmentedLagrangian())
        <Solution of degree 1 on 16 cells by AugmentedLagrangian(gamma=1.0),
         ... Newton steps>
    """

    gamma: float = 1.0
    multiplier: ClassVar[bool] = True
    in_layer: ClassVar[bool] = False

    def __post_init__(self) -> None:
        checks.positive("AugmentedLagrangian: gamma", self.gamma, GAMMA)

    def equations(
        self, model: Model, contact: ContactOnMesh, u: Ufl, v: Ufl, multiplier: Ufl = None
    ) -> Ufl:
        """Return the equations of the multiplier, a UFL form linear in v.

        They are ``int_C (lambda - P(lambda - gamma (u - s - g n))).v`` by quadrature at
        the nodes.

        Args:
            model: The scene on a mesh.
            contact: One of its contacts.
            u: Function whose nodal values are the Bernstein coefficients of the
                displacement [length].
            v: Test function of the multiplier.
            multiplier: The same for lambda [force/area].
        """
        projected = self.projected(model, contact, u, multiplier)
        return self.equations_with(projected, model, contact, u, v, multiplier)

    def equations_with(
        self, projected: Ufl, model: Model, contact: ContactOnMesh, u: Ufl, v: Ufl, multiplier: Ufl
    ) -> Ufl:
        """Return :meth:`equations` with a projection [force/area] made before."""
        return ufl.inner(multiplier - projected, v) * contact.ds(metadata=model.space.nodal_rule)

    def traction(self, model: Model, contact: ContactOnMesh, u: Ufl, multiplier: Ufl = None) -> Ufl:
        """Return the contact traction, the multiplier [force/area], UFL, shape (d,)."""
        return multiplier

    def projected(
        self, model: Model, contact: ContactOnMesh, u: Ufl, multiplier: Ufl = None
    ) -> Ufl:
        """Return the projection at the nodes [force/area], UFL, shape (d,).

        It is ``P(lambda - gamma (u - s - g n))``.
        """
        gamma_0 = compiled.constant(model.space.mesh, float(self.gamma))
        gamma = model.stiffness_per_area(gamma_0, model.cell_modulus)
        nodal = model.at_nodes(contact)
        return nodal.allowed_traction(multiplier, u, gamma)


OURS = Nitsche, AugmentedLagrangian
"""Methods whose equations are known to be linear in the test function."""


DEFAULT = Nitsche()
"""The method where the user names none."""
