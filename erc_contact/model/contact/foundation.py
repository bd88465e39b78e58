"""Hold a contact on a mesh: its measure, and the normal, gap and friction law."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import ufl
from dolfinx import fem

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.friction import Friction
from erc_contact.model.contact.friction_set import DISC, WHOLE, Disc
from erc_contact.model.contact.trace import Trace
from erc_contact.model.data.symbolic import has_arguments, varies_in_cells
from erc_contact.scene.law import project
from erc_contact.scene.words import contact_in_words, names_of_sides


def pressures(r: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Return the pressures ``max(-r_n, 0)`` of tractions [force/area], shape (...).

    Args:
        r: Tractions [force/area], shape (..., d).
        n: Unit normals of the foundations, shape (..., d).
    """
    return np.maximum(-np.vecdot(r, n), 0.0)


@dataclass(frozen=True, eq=False)
class ContactOnMesh:
    """Hold a contact on a mesh: its measure, and the data of the scene as UFL.

    Attributes:
        name: Name of the boundary part.
        against: Name of the facing part of another body; None on a foundation.
        is_exchanged: Whether the facing part is this side, because its body is the
            softer one.
        trace: The displacement of the contact, with the facets of the body.
        ds: Measure of the part.
        normal: Unit normal of the foundation, or of this side into the other, UFL.
        given_normal: The normal as the scene gives it, of any length, UFL; None where
            it does not vary.
        friction: Friction law, or None without friction.
        gap: Gap [length], UFL; None where it is zero. On facets of two bodies along
            which normals turn it is ``g |M|``, see
            ``erc_contact.model.contact.normals``.
        given_gap: The part of the gap that the scene gives, the motion of a foundation,
            and what true surfaces add, UFL; None without. What is left is the distance
            of the facets of two bodies.
        gap_beside_facets: What true surfaces add to the distance of facets, UFL; None
            where they are not known.
        gap_varies: Whether the gap is a callable.
        bilateral: Whether the contact cannot open.
        stiffness: Stiffness k_n of a compliant foundation along the normal
            [force/length^3], UFL; None where it is rigid.
        tangential_stiffness: Stiffness k_t tangentially, likewise; with friction alone.
        lost: What this mesh does not represent of it, ``int_F |s - I s|^2`` of its
            tangential part s on each facet [length^(d+1)], shape (f,); None where it
            represents all.
        variable: The displacement whose jump a solver varies, and this jump, Functions;
            None outside a solver, and on a foundation.
        tests_jump: Whether the jump of test functions counts: a solver asks for
            equations without it, too.
        gap_share: Factor of the gap in the equations of a solver [-], UFL; None outside
            a solver.
        gap_vectors: M at the vertices of the facets [-], shape (f, d, d); None where
            the gap is what the scene gives.
        moved: Displacement of the foundation at the nodes of the contact, zero off it
            [length]; None without a motion. Of periodic sides it is the jump that a
            mean strain gives. ``gap`` and the trace contain it.
        between: Vectors from the vertices of the facets to their partners of the other
            body [length], shape (f, d, d), of which ``gap`` has the normal part; None
            where both sides are in one place.
        projection: Stands in for the projection of a trial traction in the equations of
            a solver, UFL in, UFL out; None for the projection of the law.
    """

    name: str
    against: str | None
    trace: Trace
    ds: Ufl
    normal: Ufl
    bilateral: bool
    is_exchanged: bool = False
    given_normal: Ufl | None = None
    friction: Friction | None = None
    gap: Ufl | None = None
    given_gap: Ufl | None = None
    gap_beside_facets: Ufl | None = None
    gap_varies: bool = False
    stiffness: Ufl | None = None
    tangential_stiffness: Ufl | None = None
    lost: np.ndarray | None = None
    variable: tuple[fem.Function, fem.Function] | None = None
    tests_jump: bool = True
    gap_share: Ufl | None = None
    gap_vectors: np.ndarray | None = None
    moved: fem.Function | None = None
    between: np.ndarray | None = None
    projection: Callable[[Ufl], Ufl] | None = None

    @property
    def title(self) -> str:
        """Return its name, with the name of the part that it is against."""
        return contact_in_words(names_of_sides(self.name, self.against))

    @property
    def side_names(self) -> tuple[str, ...]:
        """Return the names of the parts on this side and, of a body, the other side."""
        names = names_of_sides(self.name, self.against)
        return names[::-1] if self.is_exchanged else names

    @property
    def sign(self) -> float:
        """Return -1 where this side is the facing part, else 1.

        Normal, jump and traction times the sign belong to the part that the scene names
        first.
        """
        return -1.0 if self.is_exchanged else 1.0

    @property
    def facets(self) -> np.ndarray:
        """Return the pairs (cell, local facet) with ghosts, shape (f, 2)."""
        return self.trace.here.facets

    @property
    def direction(self) -> np.ndarray:
        """Return the unit normal on each facet, out of the body [-], shape (f, d)."""
        return self.trace.direction

    @property
    def data(self) -> list[Ufl]:
        """Return what may vary: gap, normal, foundation, parameters of the law, UFL."""
        data = [self.gap, self.given_normal, self.stiffness, self.tangential_stiffness]
        if self.friction is not None:
            data += self.friction.parameters.values()
        return [value for value in data if value is not None]

    @property
    def is_compliant(self) -> bool:
        """Tell whether the foundation is compliant, normally or tangentially."""
        return self.stiffness is not None or self.tangential_stiffness is not None

    @property
    def varies(self) -> bool:
        """Tell whether gap, normal or friction vary along facets."""
        return any(varies_in_cells(value) for value in self.data)

    @property
    def gap_lengths(self) -> np.ndarray:
        """Return the factor ``|M|`` of the gap at nodes of facets, (f, m or 1) [-]."""
        if self.gap_vectors is None:
            return np.ones((len(self.facets), 1))
        return np.linalg.norm(np.matmul(self.trace.here.shares_of_nodes, self.gap_vectors), axis=-1)

    @property
    def to_partners(self) -> np.ndarray:
        """Return the vectors from nodes of facets to their partners [length].

        Their shape is (f, m, d). Their normal part is the part of ``gap`` with which
        the bodies are drawn.
        """
        if self.between is None:
            return np.zeros((*self.trace.here.nodes.shape, self.trace.here.d))
        return np.matmul(self.trace.here.shares_of_nodes, self.between)

    @property
    def named_corners(self) -> np.ndarray:
        """Return the vertices of the facets on the side that the scene names first.

        They are in the order of the vertices of this side [length], shape (f, d, d).
        """
        corners = self.trace.here.corners
        if self.is_exchanged and self.between is not None:
            corners = corners + self.between
        return corners

    @property
    def is_of_mesh(self) -> bool:
        """Tell whether another mesh has another problem.

        It has where normals turn and are found by the mesh, and where axes of friction
        vary from facet to facet.
        """
        of_normals = self.trace.corner_normals is not None and self.given_normal is None
        return of_normals or self.friction_set.is_of_mesh

    @property
    def sampled(self) -> bool:
        """Tell whether the friction bound must be sampled on facets.

        A traction may then exceed it between the nodes alone. So may a traction that
        turns with normals that turn: its part across the turn becomes shorter, which
        leads out of an ellipse, but not out of a disc.
        """
        turns = self.trace.corner_normals is not None and not self.friction_set.is_disc
        return self.friction is not None and (turns or not self.friction.convex)

    @property
    def friction_set(self) -> Disc:
        """Return the set of tangential tractions that its law allows."""
        return DISC if self.friction is None else self.friction.allowed

    @property
    def is_periodic(self) -> bool:
        """Tell whether its sides are sides of copies of a body."""
        return self.friction_set is WHOLE

    @property
    def given_jump(self) -> np.ndarray:
        """Return the jump that its motion gives at the nodes [length], (f, m, d)."""
        if self.moved is None:
            return np.zeros(self.trace.here.places.shape)
        return self.trace.of(self.moved.x.array)

    def with_shares(self, friction: Ufl, gap: Ufl) -> ContactOnMesh:
        """Return the contact with factors, by which a solver goes in steps.

        Args:
            friction: Factor of its friction bound [-], UFL.
            gap: Factor of its gap [-], UFL.
        """
        law = self.friction
        if law is not None:
            law = replace(law, share=friction)
        return replace(self, friction=law, gap_share=gap)

    @property
    def first_touch(self) -> Ufl | None:
        """Return the gap as a solver sees it [length], UFL, or None without."""
        if self.gap is None or self.gap_share is None:
            return self.gap
        return self.gap_share * self.gap

    def jump(self, u: Ufl) -> Ufl:
        """Return the displacement that the law of the contact is about [length], UFL.

        On a foundation it is u, between two bodies the difference of u on this side and
        on the other one. In a history its tangential part is counted from the end of
        the last step, of which friction remembers the tangential part s: ``w - s``. On
        a tangentially compliant foundation s is the slip at the end of that step,
        without the deflection of the foundation.

        Its variation has no s. So the work of a traction r is ``inner(r, jump(v))``
        with a test function v.

        Args:
            u: A displacement [length], a Function or, on a foundation, UFL; or a test
                or trial function, or UFL that is linear in one.

        Raises:
            InputError: If u is UFL, and the contact is between two bodies.
        """
        if has_arguments(u):
            return u if self.tests_jump else 0.0 * u
        w = u if self.against is None else self._difference(u)
        before = self.trace.before
        if before is None:
            return w
        return w - (before - ufl.dot(before, self.normal) * self.normal)

    def _difference(self, u: Ufl) -> fem.Function:
        """Return the difference of u on the two sides [length], a Function."""
        if self.variable is not None and u is self.variable[0]:
            return self.variable[1]
        if not isinstance(u, fem.Function):
            raise InputError(
                f"Contact({self.name!r}) is between two bodies: its jump(u) needs a Function, "
                "whose values on the other side are known, and not UFL. Take the jump of the "
                "displacement itself, and what is linear of the jump."
            )
        difference = fem.Function(u.function_space)
        self.trace.assign(difference.x.array, self.trace.of(u.x.array))
        return difference

    def since(self, u: Ufl) -> Ufl:
        """Call :meth:`jump` by its name in version 0.1.

        Methods of users may have it. It is to go with version 0.4.
        """
        return self.jump(u)

    def allowed_traction(self, r: Ufl, u: Ufl, gamma: Ufl) -> Ufl:
        """Return the traction that the law allows for a traction and a displacement.

        It is :meth:`project` of ``r - gamma w``, where w is the displacement beyond
        first touch, :meth:`jump` of u less ``g n``. Where friction is orthotropic, the
        slip is weighted as the set of allowed tractions asks, so that slip and traction
        fulfil the law.

        Args:
            r: Traction of the body, or a multiplier [force/area], UFL.
            u: Displacement [length], as :meth:`jump` takes it.
            gamma: Factor of the displacement [force/volume], UFL.
        """
        w = self.jump(u)
        gap = self.first_touch
        if gap is not None:
            w = w - gap * self.normal
        return self._project(r - gamma * self.friction_set.opposing_in_ufl(w, self.normal), gamma)

    def project(self, z: Ufl, gamma: Ufl | None = None) -> Ufl:
        """Return the traction that the law allows [force/area], UFL.

        On a compliant foundation springs k and gamma carry the trial traction ``r -
        gamma (w - g n)`` together: the traction ``-k (w - g n)`` of the spring k is the
        share ``k/(k + gamma)`` of it, along the normal and tangentially. The law allows
        what is nearest to this share. It tends to 1 on a stiff foundation and to 0 on a
        soft one.

        Args:
            z: Trial traction [force/area], UFL.
            gamma: Factor of the displacement in it [force/volume], UFL; a compliant
                foundation needs it.

        Raises:
            InputError: If the foundation is compliant and gamma is missing, or if
                friction is orthotropic: a trial traction does not tell its slip.
        """
        if not self.friction_set.is_disc:
            raise InputError(
                f"Contact({self.name!r}) has orthotropic friction: a method calls"
                " contact.allowed_traction(r, u, gamma) there, and not"
                " contact.project(r - gamma * (contact.jump(u) - gap * normal), gamma)."
            )
        return self._project(z, gamma)

    def _project(self, z: Ufl, gamma: Ufl | None) -> Ufl:
        """Return the traction that the law allows for a trial traction, UFL."""
        bound = None if self.friction is None else self.friction.bound
        if self.is_compliant:
            if gamma is None:
                raise InputError(
                    f"Contact({self.name!r}) has a compliant foundation: a method calls"
                    " contact.project(z, gamma) there, with the factor gamma of -jump(u) in z."
                )
            z = self._of_springs(z, gamma)
        if self.projection is not None:
            return self.projection(z)
        gauge = self.friction_set.gauge_in_ufl
        return project(z, self.normal, bound, gauge, bilateral=self.bilateral)

    def _of_springs(self, z: Ufl, gamma: Ufl) -> Ufl:
        """Return the share of a trial traction that springs of the foundation carry."""
        z_n = ufl.dot(z, self.normal) * self.normal
        z_t = z - z_n
        if self.stiffness is not None:
            z_n = self.stiffness / (self.stiffness + gamma) * z_n
        if self.tangential_stiffness is not None:
            z_t = self.tangential_stiffness / (self.tangential_stiffness + gamma) * z_t
        return z_n + z_t

    def status(self, r: Ufl) -> Ufl:
        """Return the status open (0), slip (1) or stick (2) of a traction, UFL.

        Args:
            r: A traction from :meth:`project` [force/area], UFL.
        """
        r_n = ufl.dot(r, self.normal)
        r_t = r - r_n * self.normal
        limit = self.friction.bound(-r_n) if self.friction else 0
        # Where it slips the gauge is the bound up to round-off.
        size = self.friction_set.gauge_in_ufl(r_t, self.normal)
        slips = ufl.ge(size**2, (1 - 1e-9) * limit**2)
        closed = ufl.conditional(slips, 1, 2)
        return closed if self.bilateral else ufl.conditional(ufl.lt(r_n, 0), closed, 0)

    def friction_bound(self, pressure: np.ndarray, values: Mapping[str, np.ndarray]) -> np.ndarray:
        """Evaluate the friction bound b(p) at points of the facets [force/area].

        Args:
            pressure: p >= 0 at the points [force/area], shape (f, q).
            values: The law's parameters there, from ``friction_parameters``.

        Returns:
            The bound, shape (f, q); zero without friction.
        """
        if self.friction is None:
            return np.zeros(pressure.shape)
        return self.friction.numbers(pressure, values)
