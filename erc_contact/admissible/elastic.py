"""Moduli in the cells of a model, strains of a displacement, and its stress."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from dolfinx import fem

from erc_contact.admissible.cells import CellGeometry
from erc_contact.admissible.kernels import kernels
from erc_contact.admissible.macro import macro_points
from erc_contact.admissible.reference import mandel, tensors
from erc_contact.model.data.quadrature import polynomials
from erc_contact.model.data.values import DATA_DEGREE
from erc_contact.model.law.constitution import act
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from namedmesh.simplex import (
    barycentric,
    bernstein,
    coefficients,
    from_means,
    gradients,
    nodes,
    projection,
    rule,
)

CHUNK = 2048
"""Number of cells that are worked on at once."""


@dataclass(frozen=True, eq=False)
class CellStrains:
    """Evaluate the strain of a displacement at points of cells.

    Attributes:
        degree: Degree k of the displacement.
        in_plane: Coefficients of degree k-1 in Mandel components, shape (n, N_(k-1),
            s); of an axisymmetric body of the part in the half plane.
    """

    degree: int
    in_plane: np.ndarray

    @staticmethod
    def of(space: Space, cells: CellGeometry, u: fem.Function) -> CellStrains:
        """Return the strains of a displacement [length] in all cells of this rank."""
        in_plane = strains(cells, u)
        if not space.axisymmetric:
            return CellStrains(cells.degree, in_plane)
        nodal = u.x.array.reshape(-1, cells.d)[cells.nodes, 0]
        return RingStrains(cells.degree, in_plane, nodal @ coefficients(cells.d, cells.degree).T)

    def at(self, cell: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Evaluate the strain [-], of rings with the hoop strain as last component.

        Args:
            cell: Cells, shape (n,).
            places: Barycentric coordinates for the sorted vertices, shape (n, q, d+1).
            x: The points [length], shape (n, q, d).

        Returns:
            Mandel components, shape (n, q, s).
        """
        return np.matmul(polynomials(self.degree - 1, places), self.in_plane[cell])

    def at_points(self, chunk: slice, points: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Evaluate the strain at the same points of some cells [-], as :meth:`at`.

        Args:
            chunk: The n cells.
            points: Reference points, shape (q, d).
            x: The points [length], shape (n, q, d).
        """
        return np.matmul(bernstein(points.shape[1], self.degree - 1, points), self.in_plane[chunk])


@dataclass(frozen=True, eq=False)
class RingStrains(CellStrains):
    """Evaluate the strain of an axisymmetric body, with the hoop strain ``u_r/r``.

    Attributes:
        radial: Coefficients of the radial displacement [length], shape (n, N_k).
    """

    radial: np.ndarray

    def at(self, cell: np.ndarray, places: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Evaluate the strain [-], see :meth:`.CellStrains.at`."""
        in_plane = polynomials(self.degree - 1, places), self.in_plane[cell]
        radial = polynomials(self.degree, places), self.radial[cell][..., None]
        return _with_hoop(in_plane, radial, x)

    def at_points(self, chunk: slice, points: np.ndarray, x: np.ndarray) -> np.ndarray:
        """Evaluate the strain [-], see :meth:`.CellStrains.at_points`."""
        in_plane = bernstein(2, self.degree - 1, points), self.in_plane[chunk]
        radial = bernstein(2, self.degree, points), self.radial[chunk, :, None]
        return _with_hoop(in_plane, radial, x)


def _with_hoop(
    in_plane: tuple[np.ndarray, np.ndarray], radial: tuple[np.ndarray, np.ndarray], x: np.ndarray
) -> np.ndarray:
    """Return strains of rings at points from polynomials and their coefficients."""
    strain = np.empty((*x.shape[:2], in_plane[1].shape[2] + 1))
    np.matmul(*in_plane, out=strain[..., :-1])
    np.matmul(*radial, out=strain[..., -1:])
    strain[..., -1] /= x[..., 0]
    return strain


@dataclass(frozen=True, eq=False)
class CellStress:
    """Hold a stress by the work that it does on polynomials of degree k in each cell.

    Attributes:
        in_plane: Coefficients of its projection on degree k-1 [force/area], shape (n,
            N_(k-1), d, d).
    """

    in_plane: np.ndarray

    def plus(self, stress: CellStress) -> CellStress:
        """Return the sum of two stresses."""
        return CellStress(self.in_plane + stress.in_plane)

    def of_owners(
        self, shared: Callable[[np.ndarray, np.ndarray | None], np.ndarray], cells: CellGeometry
    ) -> CellStress:
        """Return the stress that the owners of the cells have; collective.

        Args:
            shared: Gets values at nodes of the cells, and the place of each node in
                DOLFINx's order or None for one value a cell; returns those of owners.
            cells: Geometry.
        """
        is_constant = self.in_plane.shape[1] == 1
        return CellStress(shared(self.in_plane, None if is_constant else cells.order))

    def pull(self, forces: np.ndarray, shape: np.ndarray) -> None:
        """Add the forces of hoop stresses to forces, in place; here are none.

        Args:
            forces: Works on functions in the first n cells [force], shape (n, N, d).
            shape: The functions, as coefficients of degree k, shape (N_k, N).
        """

    def as_body_force(self, force: np.ndarray | None) -> np.ndarray | None:
        """Add the forces of hoop stresses to a body force; here are none.

        Args:
            force: Works on Bernstein polynomials of degree k [force], shape (n, N_k,
                d), or None without.
        """
        return force

    def at_macro_points(self, model: Model, cells: CellGeometry) -> np.ndarray:
        """Evaluate it in owned cells at the points of :func:`.macro.macro_points`.

        Returns:
            Mandel components [force/area], shape (owned, q, s).
        """
        _, points, _ = macro_points(cells.d, cells.degree)
        in_plane = mandel(self.in_plane[: model.domain.owned_cells])
        return np.matmul(bernstein(cells.d, cells.degree - 1, points), in_plane)

    def means(self, model: Model, cells: CellGeometry) -> np.ndarray:
        """Return its means in owned cells, Mandel components, shape (owned, s)."""
        return mandel(self.in_plane[: model.domain.owned_cells].mean(axis=1))


@dataclass(frozen=True, eq=False)
class RingStress(CellStress):
    """Hold the stress of an axisymmetric body, of which hoop stresses are forces.

    Attributes:
        hoop: Work of the hoop force, less the radial body force, on each radial
            Bernstein polynomial [force], shape (n, N_k).
    """

    hoop: np.ndarray

    def plus(self, stress: CellStress) -> RingStress:
        """Return the sum of two stresses."""
        assert isinstance(stress, RingStress)
        return RingStress(self.in_plane + stress.in_plane, self.hoop + stress.hoop)

    def of_owners(
        self, shared: Callable[[np.ndarray, np.ndarray | None], np.ndarray], cells: CellGeometry
    ) -> RingStress:
        """Return the stress that the owners have, see :meth:`.CellStress.of_owners`."""
        in_plane = super().of_owners(shared, cells).in_plane
        return RingStress(in_plane, shared(self.hoop, cells.places))

    def pull(self, forces: np.ndarray, shape: np.ndarray) -> None:
        """Add the forces of the hoop stress, see :meth:`.CellStress.pull`."""
        forces[..., 0] -= self.hoop[: len(forces)] @ shape

    def as_body_force(self, force: np.ndarray | None) -> np.ndarray:
        """Add the hoop force to a body force, see :meth:`.CellStress.as_body_force`."""
        total = np.zeros((*self.hoop.shape, 2)) if force is None else force
        total[..., 0] -= self.hoop
        return total

    def at_macro_points(self, model: Model, cells: CellGeometry) -> np.ndarray:
        """Evaluate it, of the hoop force its projection on degree k."""
        owned, k = model.domain.owned_cells, cells.degree
        _, points, _ = macro_points(2, k)
        places = macro_places(model.space, cells, owned)
        means = self.hoop[:owned, :, None] / cells.volume[:owned, None, None]
        hoop = places[..., :1] * np.matmul(bernstein(2, k, points), from_means(2, k, means))
        hoop = model.hoop_load.plus(hoop, places, model.space.owned_cells)
        return np.concatenate([super().at_macro_points(model, cells), hoop], axis=-1)

    def means(self, model: Model, cells: CellGeometry) -> np.ndarray:
        """Return its means per area, over the mean circumference."""
        owned = model.domain.owned_cells
        middles = cells.corners[:owned].mean(axis=1)
        in_plane = super().means(model, cells)
        # The hoop force is 2 pi sigma_tt.
        around = self.hoop[:owned].sum(axis=1) / cells.volume[:owned]
        hoop = middles[:, :1] * around[:, None]
        hoop = model.hoop_load.plus(hoop[:, None], middles[:, None], model.space.owned_cells)[:, 0]
        return model.space.section.over(np.column_stack([in_plane, hoop]), middles)


def strains_of_body(model: Model, cells: CellGeometry, u: fem.Function) -> CellStrains:
    """Return the strains of a displacement [length] as a law with a potential has them.

    They have the jumps of preloads, too.
    """
    assert model.linearised is not None
    strain = CellStrains.of(model.space, cells, u)
    jumps = model.linearised.jumps
    if jumps is None:
        return strain
    of_cells = jumps.x.array.reshape(len(strain.in_plane), 1, -1)
    return replace(strain, in_plane=strain.in_plane + of_cells)


def strains(cells: CellGeometry, u: fem.Function) -> np.ndarray:
    """Compute the strain of a displacement [-], of the part in the plane of the mesh.

    Returns:
        Coefficients of degree k-1 in Mandel components, shape (n, N_(k-1), s).
    """
    d, k = cells.d, cells.degree
    n = len(cells.nodes)
    # derivatives by the barycentric coordinates
    slopes = np.ascontiguousarray(gradients(d, k) @ coefficients(d, k))
    strain = np.empty((n, len(slopes), d * (d + 1) // 2))
    nodes = np.ascontiguousarray(cells.nodes)
    sizes = (nodes.shape[1], len(slopes), n)
    geometry = (nodes, cells.area, cells.volume)
    kernels(d)("cell_strains", *sizes, *geometry, slopes, u.x.array, strain)
    return strain


def strain_digits(cells: CellGeometry, u: fem.Function, count: int) -> np.ndarray:
    """Return the last digit of the strain of a displacement in each cell [-].

    The digits of a displacement of size |u| end at ``eps |u|``, with the accuracy eps
    of double precision, so its strain in a cell of the least height h has digits to
    ``eps |u|/h``.

    Returns:
        Shape (count,).
    """
    sizes = abs(u.x.array.reshape(-1, cells.d)).max(axis=1)
    size = sizes[cells.nodes[:count]].max(axis=1, initial=0.0)
    area = cells.area[:count]
    per_height = np.sqrt(np.einsum("nij,nij->n", area, area)) / (cells.d * cells.volume[:count])
    return np.asarray(np.finfo(float).eps * size * per_height)


def greatest_moduli(model: Model, cells: CellGeometry, count: int) -> np.ndarray:
    """Return the greatest entry of C in each cell [force/area], or in all cells."""
    matrices = moduli(model, cells, nodes(model.space.d, 0), count)
    return np.asarray(matrices[:, 0].max(axis=(1, 2)))


def elastic_coefficients(
    model: Model, cells: CellGeometry, u: fem.Function, count: int
) -> np.ndarray:
    """Compute ``C (eps(u) - eps_0)`` in Mandel components [force/area].

    The shape is (count, b, s). These are Bernstein coefficients of degree k-1; where
    the moduli or the given strains vary inside cells, values at the points of the
    sub-simplices.
    """
    if not model.constitution.varies_in_cells:
        return _constant_law(model, cells, u, count)
    points = macro_points(cells.d, cells.degree).points
    values = np.empty((count, len(points), model.constitution.stiffness.size))
    for chunk, _, of_chunk in _stress_in_chunks(model, cells, u, points, count):
        values[chunk] = of_chunk
    return values


def elastic_stress(model: Model, cells: CellGeometry, u: fem.Function, count: int) -> np.ndarray:
    """Compute ``C (eps(u) - eps_0)`` at the points of the sub-simplices [force/area].

    It is given in Mandel components. The shape is (count, (d+1) q, s), with 1 in place
    of (d+1) q where it is constant in each cell.
    """
    d, k = cells.d, cells.degree
    values = elastic_coefficients(model, cells, u, count)
    points = macro_points(d, k).points
    if values.shape[1] in (1, len(points)):
        return values
    return np.matmul(bernstein(d, k - 1, points), values)


def strains_at(
    space: Space, cells: CellGeometry, u: fem.Function, points: np.ndarray, count: int
) -> np.ndarray:
    """Evaluate the strain of a displacement at reference points of the cells [-].

    See :func:`moduli` for the arguments. Shape (count, q, s).
    """
    x = _places(cells, points, count, True)
    return CellStrains.of(space, cells, u).at_points(slice(count), points, x)


def macro_places(space: Space, cells: CellGeometry, count: int) -> np.ndarray:
    """Return the points of :func:`macro_points` in the first cells, (count, q, d)."""
    points = macro_points(space.d, space.degree).points
    return _places(cells, points, count, True)


def given_strains(model: Model, cells: CellGeometry, points: np.ndarray, count: int) -> np.ndarray:
    """Evaluate the given strains eps_0 at reference points of the cells [-].

    See :func:`moduli` for the arguments.

    Returns:
        Mandel components, shape (count, q, s), with 1 in place of q where they are
        constant in each cell.
    """
    assert model.strains is not None
    varying = model.strains.varies_in_cells
    return model.strains(_places(cells, points, count, varying), _numbers(count))


def moduli(
    model: Model, cells: CellGeometry, points: np.ndarray, count: int, *, inverse: bool = False
) -> np.ndarray:
    """Return the elasticity (or compliance) matrix at reference points of the cells.

    Args:
        model: The scene on a mesh.
        cells: Geometry.
        points: Reference points (q, d) for the sorted vertices.
        count: Number of cells, the first ones.
        inverse: Compliance C^-1 [area/force] instead of stiffness C [force/area].

    Returns:
        Mandel components, shape (count, q, s, s), with 1 in place of count or q where
        the material does not vary.
    """
    law = model.constitution
    matrix = law.metric if inverse else law.stiffness
    if matrix.plain is not None:
        return matrix.plain[None, None]
    if not matrix.varies_in_cells:
        return matrix(_places(cells, points, count, False), _numbers(count))
    values = np.empty((count, len(points), matrix.size, matrix.size))
    for chunk in chunks_of_cells(count):
        x = np.matmul(barycentric(points), cells.corners[chunk])
        values[chunk] = matrix(x, _numbers(count)[chunk])
    return values


def _places(cells: CellGeometry, points: np.ndarray, count: int, varying: bool) -> np.ndarray:
    """Return reference points of the cells in 3D, or only the middle of each cell.

    Shape (count, q, d), or (count, 1, d) where data do not vary inside cells.
    """
    places = np.full((1, cells.d + 1), 1 / (cells.d + 1))
    if varying:
        places = barycentric(points)
    return np.matmul(places, cells.corners[:count])


def _numbers(count: int) -> np.ndarray:
    """Return the numbers of the first cells of this rank."""
    return np.arange(count, dtype=np.int32)


def macro_moduli(
    model: Model, cells: CellGeometry, count: int, *, inverse: bool = False
) -> np.ndarray:
    """Return stiffness (or compliance) matrices at the points of the sub-simplices.

    The first ``count`` cells have them, each at the q points of its d+1 sub-simplices.

    Returns:
        Mandel components, shape (count, (d+1) q, s, s). The first number is 1 if all
        cells have the same matrix, the second is 1 if no matrix varies inside a cell.
    """
    points = macro_points(model.space.d, model.space.degree).points
    return moduli(model, cells, points, count, inverse=inverse)


def cell_stress(
    model: Model, cells: CellGeometry, u: fem.Function, *, change: bool = False
) -> CellStress:
    """Project ``C (eps(u) - eps_0)`` on degree k-1 in each cell [force/area].

    The L2 projection does the same work as the stress on the strains of all P_k fields.

    Args:
        model: The scene on a mesh.
        cells: Geometry.
        u: Displacement [length].
        change: Whether u is the change of a displacement, whose stress is ``C eps(u)``,
            and which no load goes with.
    """
    d, k = cells.d, cells.degree
    count = len(cells.nodes)
    if model.space.axisymmetric:
        return _stress_of_rings(model, cells, u, change)
    if not model.constitution.varies_in_cells:
        return CellStress(tensors(_constant_law(model, cells, u, count, change=change), d))
    points, weights = rule(d, DATA_DEGREE)
    project = projection(d, k - 1, points, weights)
    projected = np.empty((count, len(project), d * (d + 1) // 2))
    for chunk, _, values in _stress_in_chunks(model, cells, u, points, count, change=change):
        np.matmul(project, values, out=projected[chunk])
    return CellStress(tensors(projected, d))


def _stress_of_rings(
    model: Model, cells: CellGeometry, u: fem.Function, change: bool
) -> CellStress:
    """Return :func:`cell_stress` of an axisymmetric body, by the rule of the solver."""
    d, k = cells.d, cells.degree
    points, weights = rule(d, DATA_DEGREE)
    to_hoop = weights[:, None] * bernstein(d, k, points)
    to_in_plane = projection(d, k - 1, points, weights)
    count = len(cells.nodes)
    in_plane = np.empty((count, len(to_in_plane), d * (d + 1) // 2))
    hoop = np.empty((count, to_hoop.shape[1]))
    for chunk, x, values in _stress_in_chunks(model, cells, u, points, count, change=change):
        numbers = _numbers(count)[chunk]
        of_body = values if change else model.hoop_load.minus(values, x, numbers)
        # The hoop force is 2 pi sigma_tt, and the component is 2 pi r sigma_tt.
        hoop[chunk] = (of_body[..., -1] / x[..., 0]) @ to_hoop
        np.matmul(to_in_plane, of_body[..., :-1], out=in_plane[chunk])
    return RingStress(tensors(in_plane, d), cells.volume[:, None] * hoop)


def _constant_law(
    model: Model, cells: CellGeometry, u: fem.Function, count: int, *, change: bool = False
) -> np.ndarray:
    """Return coefficients of ``C (eps(u) - eps_0)`` where C and eps_0 are constant.

    They are constant in each cell. C acts on the coefficients of the strain, and a
    constant has equal coefficients. See :func:`cell_stress` for the arguments.
    """
    middle = nodes(cells.d, 0)
    strain = strains(cells, u)[:count]
    if model.strains is not None and not change:
        strain = strain - given_strains(model, cells, middle, count)
    return act(moduli(model, cells, middle, count), strain)


def _stress_in_chunks(
    model: Model,
    cells: CellGeometry,
    u: fem.Function,
    points: np.ndarray,
    count: int,
    *,
    change: bool = False,
) -> Iterator[tuple[slice, np.ndarray, np.ndarray]]:
    """Evaluate ``C (eps(u) - eps_0)`` at reference points of some cells at a time.

    See :func:`moduli` and :func:`cell_stress` for the arguments.

    Yields:
        The cells, the points in them [length], shape (n, q, d), and the stress
        [force/area], shape (n, q, s).
    """
    law = model.constitution
    stress = law.stress_change if change else law.stress
    strain = CellStrains.of(model.space, cells, u)
    for chunk in chunks_of_cells(count):
        x = np.matmul(barycentric(points), cells.corners[chunk])
        yield chunk, x, stress(strain.at_points(chunk, points, x), x, _numbers(count)[chunk])


def chunks_of_cells(count: int) -> Iterator[slice]:
    """Return slices of some cells each, whose values stay in the cache.

    A rank without cells gets an empty one: what laws need is compiled together.
    """
    for start in range(0, max(count, 1), CHUNK):
        yield slice(start, min(start + CHUNK, count))
