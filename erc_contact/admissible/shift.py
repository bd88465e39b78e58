"""Shifts of contact tractions in the direction that lowers the contact part of e.

Symbols: n normal of the foundation, w displacement, tangentially since the last step of
a history, g gap, r contact traction on the body; index n normal component, index t
tangential part; b friction bound, mu its slope, E modulus, h size of a facet, f facets,
m number of coefficients of a facet, d dimension.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from erc_contact.model.contact.contact_values import gap_at_nodes
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.jumps import jumps
from erc_contact.model.contact.trace import split
from erc_contact.model.contact.turning import Turning
from erc_contact.model.data.symbolic import varies_in_cells
from erc_contact.model.space import Space
from namedmesh.simplex import averages, barycentric, lagrange, rule

MOBILITY = 0.1
"""kappa of a :class:`Shift` where a traction must change for the balance [-].

0.01 to 1 give the same e within 3%.
"""
ROUND_OFF_MOBILITY = 1e-12
"""kappa where no balance is needed [-].

It is the accuracy of the traction of a method, over ``E/h |w|``.
"""
FAR_OPEN = 2.0
"""Mean opening over ``h/E |r|`` beyond which a facet with a jump is far open [-].

Its shift is the opening over this number, which is more than the traction. 1 to 3 give
the same e within 30%.
"""
FAR_SLIP = 1e3
"""Slip over ``h/E |r|`` beyond which this kappa grows with the slip [-]."""


@dataclass(frozen=True, eq=False)
class Shift:
    """Shift a traction by slip and opening.

    The shift is ``-kappa E/h v`` with ``v = w_t + (w_n - g - mu |w_t|) n``. Half of the
    contact part of e^2 is ``int b |w_t| + r_t.w_t + r_n (w_n - g)``. Where ``b = offset
    + mu p`` with the pressure p, this is ``int r.v`` up to a constant (de Saxce's
    bipotential). A change dr of the traction adds about ``h/(kappa E) |dr|^2`` to the
    bulk part. So the best r is the allowed traction nearest to ``r_0 - kappa E/h v``. A
    traction that slips stays on the surface of its cone, where it adds nothing, however
    long the slip is.

    The attributes are means on a facet, weighted with its Bernstein polynomials. Their
    products with the coefficients of a traction are integrals.

    Attributes:
        slip: E/h times the mean of w_t [force/area], shape (f, m, d); of ``opposing(
            w_t)`` where friction is orthotropic, as all distances of tractions are
            taken in the coordinates in which its ellipse is a disc.
        path: E/h times the mean of ``|w_t|``, or ``support(w_t)`` [force/area], shape
            (f, m).
        opening: E/h times the mean of ``max(g - w_n, 0)`` [force/area], shape (f, m).
        n: Normals, shape (f, 1, d).

    Source: G. de Saxce, Z.-Q. Feng, "The bipotential method", Math. Comput. Modelling
    28 (1998).
    """

    slip: np.ndarray
    path: np.ndarray
    opening: np.ndarray
    n: np.ndarray

    def __call__(self, slope: np.ndarray | float) -> np.ndarray:
        """Return ``-kappa E/h v`` for slopes mu of the friction bound [force/area].

        Args:
            slope: mu [-], shape (f, m) or a number.

        Returns:
            The shift, shape (f, m, d).
        """
        normal = slope * self.path + self.opening
        return MOBILITY * (normal[..., None] * self.n - self.slip)

    def round_off(self, r: np.ndarray) -> np.ndarray:
        """Return the shift of tractions with the kappa of round-off [force/area].

        Kappa grows where the slip is far beyond ``h/E |r|``, because the round-off of a
        traction that slips enters e multiplied by the slip.

        Args:
            r: Tractions [force/area], shape (f, m, d).
        """
        # Where there is no traction, kappa stays as it is.
        far = FAR_SLIP * np.linalg.norm(r, axis=-1)
        length = self.path + self.opening
        ratio = np.divide(length, far, out=np.zeros_like(far), where=far > 0)
        kappa = ROUND_OFF_MOBILITY * (1 + ratio)
        return kappa[..., None] * (self.opening[..., None] * self.n - self.slip)


def shift_by_slip(
    space: Space, contact: ContactOnMesh, u: np.ndarray, turning: Turning | None
) -> Shift:
    """Compute the shift of the traction of a contact; collective.

    Args:
        space: The mesh.
        contact: The contact.
        u: Displacements at the nodes of its facets, tangentially since the last step
            [length], shape (f, m, d).
        turning: How tractions turn with the normals, or None.
    """
    d, k = space.d, space.degree
    n = contact.direction[:, None, :]
    points, weights = rule(d - 1, space.contact_degree)
    shape = lagrange(d - 1, k, points)
    w = np.matmul(shape, u)
    if turning is not None:
        w = turning.back(w, points)
        k = turning.degree
    average = averages(d - 1, k, points, weights)
    w_n, w_t, _ = split(w, n)
    allowed = contact.friction_set
    # A bilateral contact cannot open.
    opening = np.zeros_like(w_n)
    if not contact.bilateral:
        opening = np.maximum(gap_at_nodes(space, contact) @ shape.T - w_n, 0.0)
    stiffness = contact.trace.stiffness[:, None]
    along = _tangential_stiffness(space, contact)[:, None]
    slip = along[..., None] * np.matmul(average, allowed.opposing(w_t, n))
    mean_path = along * allowed.support(w_t, n) @ average.T
    mean_opening = stiffness * opening @ average.T
    return Shift(slip, mean_path, mean_opening, n)


def _tangential_stiffness(space: Space, contact: ContactOnMesh) -> np.ndarray:
    """Return E/h of the facets, in a row with springs of the foundation, (f,).

    A change of the traction adds ``|dr|^2/k_t`` to the contact part of e^2, too.
    """
    stiffness = contact.trace.stiffness
    if contact.tangential_stiffness is None:
        return stiffness
    at_nodes = space.evaluate(contact.tangential_stiffness, space.facet_points, contact.facets)
    k = at_nodes.mean(axis=1)
    return k * stiffness / (k + MOBILITY * stiffness)


def shift_of_far_open(
    space: Space,
    contact: ContactOnMesh,
    shift: Shift,
    u: np.ndarray,
    r: np.ndarray,
    turning: Turning | None,
) -> np.ndarray:
    """Compute a shift by opening on facets that are far open; collective.

    A gap that jumps leaves a facet open beside one that is closed. The pressure at
    their common node would act through the opening.

    Args:
        space: The mesh.
        contact: The contact.
        shift: Its shift, with the gap of the nodes.
        u: As in :func:`shift_by_slip`.
        r: Tractions [force/area], shape (f, m, d).
        turning: How they turn with the normals, or None.

    Returns:
        The shift, shape (f, m, d).
    """
    result = np.zeros_like(r)
    if contact.gap is None or contact.bilateral or not varies_in_cells(contact.gap):
        return result
    pressure = -(r * shift.n).sum(axis=2)
    limit = FAR_OPEN * np.linalg.norm(r, axis=2).max(axis=1, initial=0.0)
    pressed = pressure.max(axis=1, initial=0.0) > 0
    far = np.flatnonzero(pressed & (shift.opening.mean(axis=1) > limit))
    if not space.comm.allreduce(len(far) > 0, MPI.LOR):
        return result
    far = far[jumps(space, contact, gap_at_nodes(space, contact), far)]
    # There the gap at the nodes does not tell the gap between them.
    points, weights = rule(space.d - 1, space.contact_degree)
    shape = lagrange(space.d - 1, space.degree, points)
    x = np.matmul(barycentric(points), contact.trace.here.corners[far])
    gap = space.everywhere(contact.gap)(x, contact.facets[far])
    normals = contact.trace.normals_at_places(barycentric(points), far)
    w_n = (np.matmul(shape, u[far]) * normals).sum(axis=-1)
    opening = np.maximum(gap - w_n, 0.0)
    degree = space.degree if turning is None else turning.degree
    average = averages(space.d - 1, degree, points, weights)
    opening = contact.trace.stiffness[far, None] * opening @ average.T
    opening[opening.mean(axis=1) <= limit[far]] = 0.0
    result[far] = opening[..., None] / FAR_OPEN * shift.n[far]
    return result
