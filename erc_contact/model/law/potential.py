"""Linearise a law with a convex potential about a strain.

The contact solver, the reconstruction of stresses and the tightening know linear laws
``sigma = C (eps - eps_0)``. A potential gives them its linearisation about the strain
E of a displacement,

    C = psi''(E),    eps_0 = E - C^-1 psi'(E),

where E has the strain of the jumps of preloads, too, and eps_0 is less by it,
so that Newton's method for the body is a sequence of contact problems of linear bodies
(:mod:`erc_contact.newton.law`). The admissible pair is made from the last of them. Only
the gap of the law knows psi and psi* themselves.

Of axisymmetric bodies C and stresses are times the circumference, as everywhere
(:mod:`erc_contact.model.meridian`); :class:`.point_law.PointLaw` knows no
circumference.

Symbols: s number of components that the body has, n cells, q points of a cell.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property, partial

import numpy as np
import ufl
from dolfinx import fem

from erc_contact.base.runtime import compiled
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.data.expressions import definite_inverses
from erc_contact.model.law.constitution import Constitution, ElasticMatrix, StrainField
from erc_contact.model.law.law_code import Derivatives
from erc_contact.model.law.law_state import LawState
from erc_contact.model.law.point_law import PointLaw, Search
from erc_contact.model.meridian import in_space
from erc_contact.model.space import Space
from erc_contact.scene.material import mandel_basis, strain
from erc_contact.scene.potential import Potential, remembers

BESIDE = 1e-9
"""Share of E by which C is taken beside it [-].

What has yielded begins a load step on the yield surface, where psi'' jumps. There
round-off would make C another one in forms than at points, and no correction of nodal
forces would have the stress that belongs to it.
"""


class StrainOf:
    """Evaluate the strain of a displacement at points of cells; collective to make.

    Args:
        space: The mesh.
        u: The displacement [length].
        jumps: Strain of the jumps of preloads in cells, which is added, in Mandel
            components [-]; None without any.
    """

    def __init__(self, space: Space, u: fem.Function, jumps: fem.Function | None = None) -> None:
        self._space = space
        self._u = u
        self._jumps = jumps
        size = space.d * (space.d + 1) // 2
        self._in_plane = space.domain.function("DG", space.degree - 1, (size,))
        self._of_in_plane = space.everywhere(self._in_plane)
        self._of_displacement = space.everywhere(u)
        self.update()

    def update(self) -> None:
        """Take the values that the displacement has now; collective."""
        components = []
        for i, tensor in enumerate(mandel_basis(self._space.d)):
            component = ufl.inner(ufl.as_matrix(tensor.tolist()), strain(self._u))
            components.append(component if self._jumps is None else component + self._jumps[i])
        points = self._in_plane.function_space.element.interpolation_points
        at_nodes = compiled.expression(ufl.as_vector(components), points, self._space.comm)
        self._in_plane.interpolate(at_nodes)

    def __call__(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return the strain in Mandel components, shape (n, q, s)."""
        in_plane = self._of_in_plane(x, cells)
        displacement = partial(self._of_displacement, x, cells)
        return self._space.section.strain_at(in_plane, displacement, x)


class Linearised:
    """Linearise a potential about the strain of a displacement; it acts as a material.

    Construction is collective. At first the displacement is zero. :meth:`move` changes
    it in place: forms with this law stay, so that they are made and compiled once.

    Args:
        space: The mesh.
        potential: The potential.
        law: Its values at points.
        parameters: Its parameters, scalar UFL.

    Attributes:
        law: As given.
        section: What the body is.
        u: The displacement [length].
        at_rest: Whether it has not been moved: C is psi'' without strain.
        jumps: Strain of the jumps of preloads in cells, in Mandel components [-], which
            the strain E has beside the strain of u; None without any.
        load_form: The compiled form of its nodal forces, once it is made.
    """

    def __init__(
        self, space: Space, potential: Potential, law: PointLaw, parameters: Mapping[str, Ufl]
    ) -> None:
        self._space = space
        self._potential = potential
        self._parameters = parameters
        self.law = law
        self.section = space.section
        self.u = space.function()
        self.at_rest = True
        self.jumps: fem.Function | None = None
        self.load_form: fem.Form | None = None
        self._strain = self.strain_of(self.u)

    def take_jumps(self, strain: np.ndarray) -> None:
        """Take the strain of the jumps of preloads; collective.

        Args:
            strain: Mandel components in the cells of this rank [-], shape (cells, s).
        """
        self.jumps = self._space.domain.function("DG", 0, (strain.shape[1],))
        self.jumps.x.array[:] = strain.ravel()
        self._strain = self.strain_of(self.u)

    def strain_of(self, u: fem.Function) -> StrainOf:
        """Return the strain of a displacement [length], with the jumps; collective."""
        return StrainOf(self._space, u, self.jumps)

    def move(self, u: fem.Function) -> None:
        """Linearise about another displacement [length]; collective."""
        self.u.x.array[:] = u.x.array
        self.at_rest = False
        self._strain.update()

    @property
    def varies_in_cells(self) -> bool:
        """Tell whether C varies inside cells."""
        strain_varies = self._space.degree > 1 and not self.at_rest
        return self.law.varies_in_cells or self.section.varies or strain_varies

    @property
    def may_vary_in_cells(self) -> bool:
        """Tell whether C varies inside cells about some displacement: forms stay."""
        return self.law.varies_in_cells or self.section.varies or self._space.degree > 1

    # -- after a load step

    def state_at_end(self, u: fem.Function) -> LawState | None:
        """Return the state of the law after a load step that ends at u; collective."""
        state = self.law.state
        if state is None:
            return None
        strain_at = self.strain_of(u)

        def values_at(x: np.ndarray, cells: np.ndarray) -> np.ndarray:
            return self.law.new_state(strain_at(x, cells), x, cells)

        return LawState.of(self._space, state.size, values_at)

    def stress_at_end(self, u: fem.Function) -> LawState:
        """Return the stress of a displacement, six Mandel components; collective."""
        law = self.law
        strain_at = self.strain_of(u)

        def values_at(x: np.ndarray, cells: np.ndarray) -> np.ndarray:
            return law.in_space(law.whole_stress(strain_at(x, cells), x, cells))

        return LawState.of(self._space, 6, values_at)

    # -- UFL, as a material has it

    def stress(self, eps: Ufl, **_: Ufl) -> Ufl:
        """Return ``C eps`` [force/area], UFL, of the shape of eps."""
        return self._tensor(self._tangent * self._components(eps))

    @cached_property
    def given_stress(self) -> Ufl:
        """Return ``C eps_0 = C eps(u) - psi'(E)`` [force/area], UFL, like a strain."""
        of_strain = self._tangent * self._components(self.section.strain(self.u))
        return self._tensor(of_strain - self._derivatives(1.0).stress())

    @cached_property
    def _tangent(self) -> Ufl:
        """Return C in Mandel components, UFL (s, s)."""
        return self._derivatives(1 - BESIDE).tangent()

    def _derivatives(self, share: float) -> Derivatives:
        """Return the derivatives of the potential at a share of E."""
        eps = self.section.strain(self.u)
        if self.jumps is not None:
            units = [ufl.as_matrix(tensor.tolist()) for tensor in mandel_basis(self._space.d)]
            eps += self.section.in_body(sum(self.jumps[i] * unit for i, unit in enumerate(units)))
        if self.law.is_plane:
            eps = in_space(eps, 0)
        values = dict(self._parameters)
        if self.law.state is not None and remembers(self._potential):
            values |= self.law.state.ufl(self._potential.state)
        return Derivatives(self._potential, share * eps, self.law.rows, values)

    @cached_property
    def _tensors(self) -> list[Ufl]:
        """Return the basis of the strains of the body, UFL."""
        return [ufl.as_matrix(tensor.tolist()) for tensor in self.section.basis]

    def _components(self, tensor: Ufl) -> Ufl:
        """Return the components of a tensor of the body, UFL (s,)."""
        return ufl.as_vector([ufl.inner(unit, tensor) for unit in self._tensors])

    def _tensor(self, components: Ufl) -> Ufl:
        """Return the tensor of components of the body, UFL."""
        return sum(components[i] * tensor for i, tensor in enumerate(self._tensors))

    def modulus(self, **parameters: Ufl) -> Ufl:
        """Return the modulus that scales contact parameters [force/area], UFL."""
        return self._potential.modulus(**parameters)

    # -- at points

    def strain_at(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Evaluate E at points of cells, shape (n, q, s)."""
        return self._strain(x, cells)

    def tangent_at(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Evaluate C at points of cells [force/area], shape (n, q, s, s)."""
        return self._tangent_about(self.strain_at(x, cells), x, cells)

    def stress_at(self, strain: np.ndarray, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return ``psi'(E) + C (eps - eps(u))`` of strains eps [force/area].

        It is ``C (eps - eps_0)``, without the inverse of C.
        """
        about = self.strain_at(x, cells)
        change = self.with_jumps(strain, cells) - about
        tangent = self._tangent_about(about, x, cells)
        of_change = np.matmul(tangent, change[..., None])[..., 0]
        return np.asarray(self.law.stress(about, x, cells) + of_change)

    def with_jumps(self, strain: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return the strain E of strains eps (n, q, s): with the jumps of preloads."""
        if self.jumps is None:
            return strain
        of_hoop = strain.shape[2] - self.jumps.ufl_shape[0]
        return np.asarray(strain + np.pad(self._jumps_of(cells), [(0, 0), (0, 0), (0, of_hoop)]))

    def _tangent_about(self, strain: np.ndarray, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return C about strains [force/area], shape (n, q, s, s)."""
        return self.law.tangent((1 - BESIDE) * strain, x, cells)

    def _jumps_of(self, cells: np.ndarray) -> np.ndarray:
        """Return the strain of the jumps of preloads in cells [-], shape (n, 1, s)."""
        assert self.jumps is not None
        return self.jumps.x.array.reshape(-1, self.jumps.ufl_shape[0])[cells][:, None]

    def __call__(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Evaluate eps_0 at points of cells, as given strains are, shape (n, q, s)."""
        eps = self.strain_at(x, cells)
        stress = self.law.stress(eps, x, cells)
        tangent = self._tangent_about(eps, x, cells)
        given = eps - np.linalg.solve(tangent, stress[..., None])[..., 0]
        if self.jumps is not None:
            size = self.jumps.ufl_shape[0]
            given[..., :size] -= self._jumps_of(cells)
        return given


class TangentMatrix(ElasticMatrix):
    """Evaluate the tangent C of a linearised potential, or its inverse, at points."""

    def __init__(self, linearised: Linearised, *, inverse: bool = False) -> None:
        self.size = len(linearised.law.rows)
        self.section = linearised.section
        self._weighted = self.section.over if inverse else self.section.times
        self._constant = None
        self._parameters_vary = False  # its matrices are not made of parameters
        self._linearised = linearised
        self._inverse = inverse

    @property
    def varies_in_cells(self) -> bool:  # type: ignore[override]
        """Tell whether C varies inside cells."""
        return self._linearised.varies_in_cells

    @property
    def form_varies(self) -> bool:
        """Tell whether C varies inside cells about some displacement."""
        return self._linearised.may_vary_in_cells

    def of_material(self, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Evaluate the matrix, see :meth:`.constitution.ElasticMatrix.of_material`."""
        if not self.varies_in_cells:
            x = x[:, :1]
        tangent = self._linearised.tangent_at(x, cells)
        return definite_inverses(tangent) if self._inverse else tangent


class ConvexConstitution(Constitution):
    """Hold a linearised potential as the law of a body, with Fenchel's gap.

    Args:
        linearised: The linearisation.
    """

    def __init__(self, linearised: Linearised) -> None:
        self._linearised = linearised
        self._given: StrainField = linearised

    @cached_property
    def stiffness(self) -> TangentMatrix:
        """Return C [force/area]."""
        return TangentMatrix(self._linearised)

    @cached_property
    def metric(self) -> TangentMatrix:
        """Return C^-1 [area/force], the metric of stresses."""
        return TangentMatrix(self._linearised, inverse=True)

    def stress(self, strain: np.ndarray, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return the stress of a strain, see :meth:`.Constitution.stress`."""
        return self.stiffness.section.times(self._linearised.stress_at(strain, x, cells), x)

    def energy(
        self, strain: np.ndarray, stress: np.ndarray, x: np.ndarray, cells: np.ndarray
    ) -> np.ndarray:
        """Return the potential of a strain, see :meth:`.Constitution.energy`."""
        strain = self._linearised.with_jumps(strain, cells)
        psi = self._linearised.law.energy(strain, x, cells)
        return self.stiffness.section.times(psi, x)

    def fenchel(
        self,
        law: PointLaw,
        strain: np.ndarray,
        stress: np.ndarray,
        out_of_plane: np.ndarray,
        x: np.ndarray,
        cells: np.ndarray,
    ) -> np.ndarray:
        """Return twice Fenchel's gap, and the same with plus.

        Args:
            law: The law, perhaps with other data.
            strain: Strains, shape (n, q, s), or (n, 1, s) where neither strain nor law
                vary in the cells.
            stress: Stresses, shape (n, q, s), on rings times the circumference.
            out_of_plane: Stress out of plane from which its search starts [force/area].
            x: The points [length], shape (n, q, d).
            cells: The cells, shape (n,).

        Returns:
            ``2 (psi + psi* -+ sigma : eps)`` [force/area], shape (n, q, 2), on rings
            times the circumference.
        """
        factor = self.stiffness.section.weight(x)
        sigma = stress / factor
        psi = law.energy(strain, x[:, : strain.shape[1]], cells)
        work = np.einsum("nqi,nqi->nq", sigma, np.broadcast_to(strain, sigma.shape))
        search = Search(out_of_plane, psi - work, strain)
        psi_star, _ = law.complementary(sigma, search, x, cells)
        energies = np.stack([psi + psi_star - work, psi + psi_star + work], axis=-1)
        # A gap below zero is round-off.
        energies[..., 0] = np.maximum(energies[..., 0], 0.0)
        return np.asarray(2 * factor * energies)
