"""Evaluate the law part of e^2 with numpy alone, for ``families.py``.

Nothing here uses the package but to read the coefficients of both fields of a pair and
the mesh: the gradient of u^, the laws and the integrals are of this file. A law is a
function of strains and stresses at points, shape (..., 3, 3), that returns

    2 (psi(eps) + psi*(sigma) - sigma : eps),

with the least psi* over the stress out of the plane where the strain is plane.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from pair_evaluation import EDGES, tensors, values  # isort: skip

COUNTS = {2: 16, 3: 8}
"""Gauss points along each axis of a piece of a cell, by dimension."""
BISECTIONS = 60
"""Bisections of an interval for a root."""
FAR = 1e3
"""Plastic strain beyond the last point of a curve up to which its law goes [-]."""
PAIRS = ((0, 1), (0, 2), (1, 2))
"""Pairs of axes: 12, 13, 23."""
PLANE, RINGS, SPACE = "plane", "rings", "space"
COMPONENTS = {
    PLANE: [(0, 0), (1, 1), (0, 1)],
    RINGS: [(0, 0), (1, 1), (0, 1), (2, 2)],
    SPACE: [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)],
}
"""Components of strains and stresses."""

Law = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""Type of a law, see the head of the file."""
Field = Callable[[np.ndarray], Any]
"""Type of a field of places, shape (d, ...)."""


def law_part(error: ec.ConstitutiveError, kind: str, law_of: Any, heat: Field) -> float:
    """Return the law part of e^2 [force length], on one rank.

    Args:
        error: The error of a pair.
        kind: "plane", "rings" or "space".
        law_of: Makes the law of a cell region, of whether cells are above y = 1, as
            the upper one of two bodies is.
        heat: Strain of heat, in all directions [-].
    """
    pair = error.admissible
    d = pair.model.space.d
    nodes = pair.cell_geometry.nodes
    x = pair.model.space.V.tabulate_dof_coordinates()[nodes[:, : d + 1], :d]
    u = pair.displacement.x.array.reshape(-1, d)[nodes]
    places, weights = points_of_simplex(d)
    is_upper = x.mean(axis=1)[:, -1] > 1.0
    total = 0.0
    for piece in range(d + 1):
        in_piece = np.eye(d + 1)
        in_piece[piece] = 1 / (d + 1)
        of_cell = places @ in_piece
        at = np.einsum("qv,cvi->cqi", of_cell, x)
        strain = strain_of(x, u, of_cell)
        of_piece = np.broadcast_to(places, (len(x), *places.shape))
        stress = np.zeros_like(strain)
        measure = abs(np.linalg.det(x[:, 1:] - x[:, :1]))[:, None] / (d + 1) * weights
        if kind == RINGS:
            circumference = 2 * np.pi * at[..., 0]
            strain[..., 2, 2] = displacement_of(u, of_cell)[..., 0] / at[..., 0]
            measure = measure * circumference
            stress[..., :2, :2] = values(tensors(pair.stress[:, piece, :, :3], 2), of_piece)
            hoop = pair.stress[:, piece, :, 3, None, None]
            stress[..., 2, 2] = values(hoop, of_piece)[..., 0, 0]
            stress /= circumference[..., None, None]
        else:
            stress[..., :d, :d] = values(tensors(pair.stress[:, piece], d), of_piece)
        strain -= np.asarray(heat(np.moveaxis(at, -1, 0)))[..., None, None] * np.eye(3)
        for above in np.unique(is_upper).tolist():
            here = is_upper == above
            density = law_of(above)(strain[here], stress[here])
            total += float((density * measure[here]).sum())
    return total


def points_of_simplex(d: int) -> tuple[np.ndarray, np.ndarray]:
    """Return barycentric points (q, d+1) and weights of a simplex of volume 1/d!."""
    count = COUNTS[d]
    line, of_line = np.polynomial.legendre.leggauss(count)
    line, of_line = (line + 1) / 2, of_line / 2
    places, weights = [], []
    for index in product(range(count), repeat=d):
        rest, weight = 1.0, 1.0
        place = []
        for i in index:
            # Each coordinate takes a share of what is left.
            weight *= of_line[i] * rest
            place.append(rest * line[i])
            rest -= place[-1]
        places.append([rest, *place])
        weights.append(weight)
    return np.array(places), np.array(weights)


def slopes(x: np.ndarray) -> np.ndarray:
    """Return the gradients of barycentric coordinates of cells (n, d+1, d)."""
    inner = np.linalg.inv(x[:, 1:] - x[:, :1]).swapaxes(1, 2)
    return np.concatenate([-inner.sum(axis=1, keepdims=True), inner], axis=1)


def strain_of(x: np.ndarray, u: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return the strains of Lagrange polynomials at places, shape (n, q, 3, 3)."""
    n, _, d = x.shape
    of_vertices = slopes(x)
    if u.shape[1] == d + 1:
        at_places = np.broadcast_to(of_vertices[:, None], (n, len(places), d + 1, d))
    else:
        of_shape = [(4 * places[:, i] - 1)[:, None] * of_vertices[:, None, i] for i in range(d + 1)]
        for i, j in EDGES[d]:
            first = places[:, i][:, None] * of_vertices[:, None, j]
            of_shape.append(4 * (first + places[:, j][:, None] * of_vertices[:, None, i]))
        at_places = np.stack(of_shape, axis=2)
    gradient = np.einsum("cqvj,cvi->cqij", at_places, u)
    result = np.zeros((n, len(places), 3, 3))
    result[..., :d, :d] = (gradient + gradient.swapaxes(2, 3)) / 2
    return result


def displacement_of(u: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return Lagrange polynomials of triangles at places, shape (n, q, 2)."""
    shape = places
    if u.shape[1] == 6:
        products = [4 * places[:, i] * places[:, j] for i, j in EDGES[2]]
        shape = np.column_stack([places * (2 * places - 1), *products])
    return np.asarray(np.einsum("qv,cvi->cqi", shape, u))


# -- linear laws
# ----------------------------------------------------------------------------


def compliance_of(E: Any, nu: Any, G: Any, axes: Any) -> np.ndarray:
    """Return the compliance [area/force] of engineering constants, (3, 3, 3, 3)."""
    S = np.zeros((3, 3, 3, 3))
    for i in range(3):
        S[i, i, i, i] = 1 / E[i]
    for (i, j), ratio, shear in zip(PAIRS, nu, G, strict=True):
        S[i, i, j, j] = S[j, j, i, i] = -ratio / E[i]
        for a, b in ((i, j), (j, i)):
            S[a, b, i, j] = S[a, b, j, i] = 1 / (4 * shear)
    R = np.array(axes)
    return np.asarray(np.einsum("ai,bj,ck,dl,abcd->ijkl", R, R, R, R, S))


def linear(S: np.ndarray, kind: str, *, in_plane_stress: bool) -> Law:
    """Return the law of a compliance; plane strain stands beside plane stress."""
    basis = mandel_basis(COMPONENTS[SPACE])
    whole = np.einsum("mij,ijkl,nkl->mn", basis, S, basis)
    places = [COMPONENTS[SPACE].index(pair) for pair in COMPONENTS[kind]]
    reduced = whole[np.ix_(places, places)]
    if kind == PLANE and not in_plane_stress:
        out = whole[places, 2]
        reduced = reduced - np.outer(out, out) / whole[2, 2]
    stiffness = np.linalg.inv(reduced)
    basis = mandel_basis(COMPONENTS[kind])

    def density(strain: np.ndarray, stress: np.ndarray) -> np.ndarray:
        of_strain = np.einsum("mij,...ij->...m", basis, strain)
        of_stress = np.einsum("mij,...ij->...m", basis, stress)
        misfit = of_strain - of_stress @ reduced
        return np.asarray(np.einsum("...m,mn,...n->...", misfit, stiffness, misfit))

    return density


def mandel_basis(pairs: list[tuple[int, int]]) -> np.ndarray:
    """Return unit tensors of components, shape (s, 3, 3)."""
    basis = np.zeros((len(pairs), 3, 3))
    for s, (i, j) in enumerate(pairs):
        basis[s, i, j] = basis[s, j, i] = 1.0 if i == j else np.sqrt(0.5)
    return basis


# -- plasticity from rest
# ----------------------------------------------------------------------------


class Yielding:
    """Know the law of a body that yields, from rest.

    With the length q of the deviator and the accumulated plastic strain a, psi is the
    least, and psi* the greatest, over a, of ``p``'s part and

        (q_trial - 3 G a)^2/(6 G) + W(a),    q^2/(6 G) + q a - W(a).

    Args:
        law: What is declared; its hardenings are numbers or a curve.
        kind: Kind of the mesh.
    """

    def __init__(self, law: Any, kind: str) -> None:
        self.G = law.E / (2 * (1 + law.nu))
        self.K = law.E / (3 * (1 - 2 * law.nu))
        self.kind = kind
        self.kinematic = law.kinematic
        if hasattr(law.hardening, "of_law"):
            curve = law.hardening.of_law()
            slope = curve.last_slope
            points = np.array([curve.plastic_strain, curve.stress])
            self.bulge = np.append(curve.bulge, 0.0)
        else:
            slope = law.hardening
            points = np.array([[0.0], [law.yield_stress]])
            self.bulge = np.zeros(1)
        far = points[:, -1] + np.array([FAR, FAR * slope])
        self.strain, self.stress = np.column_stack([points, far])
        widths = np.diff(self.strain)
        # The mean of a parabola 4 b x (1 - x) is 2/3 of its height b.
        means = (self.stress[1:] + self.stress[:-1]) / 2 + 2 / 3 * self.bulge
        self.work = np.append(0.0, np.cumsum(widths * means))

    def k(self, a: np.ndarray) -> np.ndarray:
        """Return the slope of W: the yield stress and the back stress [force/area]."""
        piece, part = self.place(a)
        above = 4 * self.bulge[piece] * part * (1 - part)
        return np.asarray(np.interp(a, self.strain, self.stress) + above + self.kinematic * a)

    def W(self, a: np.ndarray) -> np.ndarray:
        """Return the energy of hardening and the work of yielding [force/area]."""
        piece, part = self.place(a)
        of_line = self.stress[piece] + np.diff(self.stress)[piece] * part / 2
        of_bulge = self.bulge[piece] * part * (2 - 4 / 3 * part)
        into = part * np.diff(self.strain)[piece]
        of_curve = self.work[piece] + into * (of_line + of_bulge)
        return np.asarray(of_curve + self.kinematic * a**2 / 2)

    def place(self, a: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the piece of the curve, and the part of it that lies before a."""
        piece = np.clip(np.searchsorted(self.strain, a) - 1, 0, len(self.strain) - 2)
        return piece, (a - self.strain[piece]) / np.diff(self.strain)[piece]

    def root(self, rise: Callable[[np.ndarray], np.ndarray], most: np.ndarray) -> np.ndarray:
        """Return the root of a rising function from 0 to most, 0 if it is above."""
        low, high = np.zeros_like(most), most
        for _ in range(BISECTIONS):
            middle = (low + high) / 2
            is_above = rise(middle) > 0
            low, high = np.where(is_above, low, middle), np.where(is_above, middle, high)
        return np.where(rise(np.zeros_like(most)) > 0, 0.0, (low + high) / 2)

    def psi(self, strain: np.ndarray) -> np.ndarray:
        """Return psi of strains [force/area]."""
        trace = np.trace(strain, axis1=-2, axis2=-1)
        trial = 2 * self.G * length(strain)
        a = self.root(lambda a: self.k(a) + 3 * self.G * a - trial, trial / (3 * self.G))
        left = trial - 3 * self.G * a
        return np.asarray(self.K / 2 * trace**2 + left**2 / (6 * self.G) + self.W(a))

    def yielded(self, q: np.ndarray) -> np.ndarray:
        """Return the accumulated plastic strain of deviators of length q."""
        rises = np.diff(self.stress) - 4 * abs(self.bulge)
        least = (rises / np.diff(self.strain)).min() + self.kinematic
        most = np.maximum(q - self.stress[0], 0.0) / least
        return self.root(lambda a: self.k(a) - q, most)

    def conjugate(self, stress: np.ndarray) -> np.ndarray:
        """Return psi* of stresses [force/area]."""
        trace = np.trace(stress, axis1=-2, axis2=-1)
        q = length(stress)
        a = self.yielded(q)
        return np.asarray(trace**2 / (18 * self.K) + q**2 / (6 * self.G) + q * a - self.W(a))

    def strain_33(self, stress: np.ndarray) -> np.ndarray:
        """Return the strain out of the plane of stresses [-]."""
        trace = np.trace(stress, axis1=-2, axis2=-1)
        deviator = stress[..., 2, 2] - trace / 3
        q = length(stress)
        flow = 1.5 * self.yielded(q) / np.maximum(q, np.finfo(float).tiny)
        return np.asarray(trace / (9 * self.K) + deviator * (1 / (2 * self.G) + flow))

    def __call__(self, strain: np.ndarray, stress: np.ndarray) -> np.ndarray:
        """Return the density of e^2, see the head of the file."""
        if self.kind == PLANE:
            stress = self.with_least_conjugate(strain, stress)
        work = np.einsum("...ij,...ij->...", strain, stress)
        return 2 * (self.psi(strain) + self.conjugate(stress) - work)

    def with_least_conjugate(self, strain: np.ndarray, stress: np.ndarray) -> np.ndarray:
        """Return stresses whose stress out of the plane strains it as it is."""
        result = stress.copy()
        size = 10 * (abs(stress).max() + 9 * self.K * abs(strain).max())
        low = np.full(stress.shape[:-2], -size)
        high = -low
        for _ in range(BISECTIONS):
            result[..., 2, 2] = (low + high) / 2
            is_above = self.strain_33(result) > strain[..., 2, 2]
            low = np.where(is_above, low, result[..., 2, 2])
            high = np.where(is_above, result[..., 2, 2], high)
        return result


def length(tensor: np.ndarray) -> np.ndarray:
    """Return the equivalent length of deviators: ``sqrt(3/2 s : s)``."""
    third = np.trace(tensor, axis1=-2, axis2=-1)[..., None, None] / 3
    deviator = tensor - third * np.eye(3)
    return np.asarray(np.sqrt(1.5 * np.einsum("...ij,...ij->...", deviator, deviator)))
