"""Know the body of which a mesh is a section: in the plane and in 3D the mesh itself.

What differs where the mesh is the half plane of a body of revolution
(:class:`erc_contact.model.meridian.Meridian`) is a method here: the weights of points,
the strain of a displacement, the axis, and the rigid motions. Of other bodies weights
are 1, tensors are as the mesh has them, and there is no axis.

Symbols: d dimension of the mesh, k degree of the displacement, s components of a tensor
in Mandel's notation, f facets, m nodes of a facet, q points.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations

import numpy as np

from erc_contact.base.ufl_types import Ufl
from erc_contact.model.contact.side import Side
from erc_contact.scene.material import mandel_basis, strain
from namedmesh.simplex import bernstein, measures


class Section:
    """Know a body that is its mesh.

    Args:
        x: Position, UFL.
        d: Dimension of the mesh.
        degree: Degree k of the displacement.
        extent: Size of the mesh [length].

    Attributes:
        circumference: Length of the ring through each point of a body of revolution
            [length], UFL; None of any other body.
        axisymmetric: Whether the mesh is the half plane of bodies of revolution.
        varies: Whether weights vary in cells.
        letters: Names of the coordinates.
        motions: Which rigid motions of the mesh are motions of the body.
        holds: What holds a body beside its supports, in words.
        tensor_words: What the rows of its tensors are, in words.
    """

    circumference: Ufl | None = None
    axisymmetric = False
    varies = False
    letters = "xyz"
    motions = slice(None)
    holds = ""
    tensor_words = ""

    def __init__(self, x: Ufl, d: int, degree: int, extent: float) -> None:
        self.x = x
        self.d = d
        self.degree = degree
        self.extent = extent

    # -- weights: areas and volumes of the body over areas and volumes of the mesh

    def on_mesh(self, density: Ufl) -> Ufl:
        """Return a density per area or volume of the body as a density on the mesh."""
        return density

    def weight(self, x: np.ndarray) -> np.ndarray:
        """Return the weights of points (n, q, d), shape (n, q, 1) or (1, 1, 1)."""
        return np.ones((1, 1, 1))

    def times(self, values: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Multiply values (..., *s) by the weights of points (..., d)."""
        return values

    def over(self, values: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Divide values (..., *s) by the weights of points (..., d)."""
        return values

    def rule_degree(self, degree: int) -> int:
        """Return the degree of a rule for polynomials of a degree over the weight."""
        return degree

    # -- on facets

    def weighted(self, values: np.ndarray, side: Side) -> np.ndarray:
        """Multiply a density by the weights, projected on degree k.

        Args:
            values: Its Bernstein coefficients on the facets, shape (f, m, d).
            side: The facets.
        """
        return values

    def per_area(self, corners: np.ndarray, values: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Evaluate a density on facets of the mesh, per area of the body.

        Args:
            corners: Vertices of the facets [length], shape (f, d, d).
            values: Bernstein coefficients, shape (f, m, ...).
            points: Reference points of the facets, shape (q, d-1).

        Returns:
            Shape (f, q, ...). On the axis it is the limit.
        """
        f, m, *trailing = values.shape
        flat = values.reshape(f, m, int(np.prod(trailing)))
        at_points = np.matmul(bernstein(self.d - 1, self.degree, points), flat)
        return at_points.reshape(f, len(points), *trailing)

    def area_ratio(self, corners: np.ndarray, others: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return the ratio of the areas of facets to other areas at their points [-].

        Facing facets of two bodies that are apart have the same forces, so a traction
        times this ratio is the traction on the other body.

        Args:
            corners: Vertices of the facets [length], shape (f, d, d).
            others: Vertices of the other facets, in the same order.
            points: Reference points of the facets, shape (q, d-1).

        Returns:
            Shape (f, q), or (f, 1) where it is constant. On the axis it is the limit.
        """
        return (measures(corners) / measures(others))[:, None]

    def shown(self, values: np.ndarray, corners: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Return a density on facets per area of other facets, for pictures.

        Args:
            values: Its Bernstein coefficients, shape (f, m, ...).
            corners: Vertices of the facets [length], shape (f, d, d).
            others: Vertices of the other facets, in the same order.

        Returns:
            Coefficients of the density per area, interpolated at the nodes.
        """
        share = measures(corners) / measures(others)
        return share.reshape(-1, *[1] * (values.ndim - 1)) * values

    def to_tractions(self, nodal: np.ndarray, side: Side, x: np.ndarray) -> None:
        """Replace nodal forces over areas of the mesh by tractions, in place.

        Args:
            nodal: Forces over areas at all nodes [force/area], shape (nodes, d).
            side: The facets of a contact, ghosts included.
            x: Places of all nodes [length], shape (nodes, 3).
        """

    def from_tractions(self, at_nodes: np.ndarray, side: Side, x: np.ndarray) -> np.ndarray:
        """Return nodal forces over areas of the mesh, from tractions.

        Args:
            at_nodes: Tractions at the nodes of facets [force/area], shape (f, m, d).
            side: These facets.
            x: As in :meth:`to_tractions`.
        """
        return at_nodes

    # -- the axis, where tractions vanish

    def on_axis(self, x: np.ndarray) -> np.ndarray:
        """Tell which points (..., d) lie on the axis, shape (...)."""
        return np.zeros(x.shape[:-1], dtype=bool)

    def beside_axis(self, x: np.ndarray, sizes: np.ndarray | float) -> np.ndarray:
        """Return points (n, d), near the axis moved by a small part of sizes (n,)."""
        return x

    def off_axis(self, corners: np.ndarray, degree: int) -> np.ndarray:
        """Tell which coefficients on facets are off the axis, (f, m) or (1, 1).

        Args:
            corners: Vertices of the facets [length], shape (f, d, d).
            degree: Degree of the polynomials.
        """
        return np.ones((1, 1), dtype=bool)

    def vanishing(self, values: np.ndarray, off: np.ndarray) -> np.ndarray:
        """Return tractions that vanish on the axis, with the same forces.

        Args:
            values: Bernstein coefficients of tractions, shape (f, m, d).
            off: Coefficients off the axis, see :meth:`off_axis`.
        """
        return values

    def vanishing_moments(self, moment: np.ndarray, corners: np.ndarray) -> np.ndarray:
        """Return the moments of tractions that vanish on the axis.

        Args:
            moment: Moments of tractions that need not vanish [force], shape (f, m, d).
            corners: Vertices of the facets [length], shape (f, d, d).
        """
        return moment

    # -- tensors of the body

    @property
    def basis(self) -> np.ndarray:
        """Return the orthonormal basis of the tensors of the body, (s, rows, rows)."""
        return mandel_basis(self.d)

    @property
    def rows(self) -> int:
        """Return the number of rows of tensors of the body."""
        return self.basis.shape[1]

    def strain(self, u: Ufl) -> Ufl:
        """Return the strain of a displacement [-], UFL, shape (rows, rows)."""
        return strain(u)

    def in_body(self, tensor: Ufl) -> Ufl:
        """Return a tensor (d, d) as a tensor of the body, UFL."""
        return tensor

    def in_mesh(self, tensor: Ufl) -> Ufl:
        """Return the part (d, d) of a tensor of the body, UFL."""
        return tensor

    def strain_at(
        self, in_mesh: np.ndarray, u: Callable[[], np.ndarray], x: np.ndarray
    ) -> np.ndarray:
        """Return the strain at points in Mandel components [-], shape (..., s).

        Args:
            in_mesh: Components of the part (d, d), shape (..., d(d+1)/2).
            u: Returns the displacement there [length], shape (..., d).
            x: The points [length], shape (..., d).
        """
        return in_mesh

    def hoop_strains(self, u: np.ndarray, vertices: np.ndarray, corners: np.ndarray) -> np.ndarray:
        """Return the mean hoop strain of cells [-], shape (n,).

        Args:
            u: Displacement of all nodes [length], shape (nodes, d).
            vertices: Nodes at the vertices of the cells, shape (n, d+1).
            corners: Places of these [length], shape (n, d+1, d).
        """
        return np.zeros(len(vertices))

    # -- forces and motions

    def hoop_density(self, force: Ufl | None) -> Ufl | None:
        """Return the hoop stress that a body force is, UFL; None without.

        Args:
            force: The body force [force/volume], UFL, shape (d,), or None.
        """
        return None

    def carried(self, forces: np.ndarray) -> np.ndarray:
        """Return forces (..., d) without components that hoop stresses balance."""
        return forces

    def carried_density(self, force: Ufl | None) -> Ufl | None:
        """Return a body force without components that hoop stresses balance, UFL."""
        return force

    @property
    def motion_names(self) -> list[str]:
        """Return the names of the rigid motions of the body."""
        axes = self.letters[: self.d]
        names = [f"translation in {axis}" for axis in axes]
        names += [f"rotation in the plane {a}{b}" for a, b in combinations(axes, 2)]
        return names
