"""The same body on another mesh, and what it tells of the limit of a norm.

The norm q of the map of :mod:`erc_contact.error.coulomb.coupling` changes with the
mesh. How far it is from its limit is told by the same body on another mesh, with the
same field t, interpolated to the nodes there. A small body is refined once. Of a larger
one a coarser mesh is made, so that this costs little beside the solve of the body
itself. Where corners and edges of a contact see it on every scale, q grows like the
inverse of a logarithm: ``q(h) = q(0) - c/log(1 + L/h)`` with the size L of the contact.
Two meshes tell c; then ``c/log(1 + L/h)`` is what is missing on the mesh of size h.
Where q converges faster this is more than what is missing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from erc_contact.base.exceptions import ErcContactError
from erc_contact.error.coulomb.coupling import coupling
from erc_contact.error.coulomb.surface import CoulombSurface, coulomb_surface
from erc_contact.model.model import Model
from erc_contact.model.promises import bind
from erc_contact.newton.linear.loose_stiffness import stiffness_of
from erc_contact.newton.linear.solver import Traces
from namedmesh import Domain
from namedmesh.for_solvers import NodalMesh

MOST_CELLS = {2: 1000, 3: 3000}
"""Greatest number of cells of a coarser mesh, by dimension."""
MOST_REFINED = {2: 1000, 3: 12000}
"""Greatest number of cells of the mesh that is refined once, by dimension.

In 3D a coarser mesh tells half of the change that the refined one tells (median of
22 random boxes), in the plane as much. So there more is spent on the refined one.
"""
COARSER = 3.0
"""A coarser mesh has cells of this many times the size, or larger ones."""
UNKNOWN_CHANGE = 0.1
"""Share of q that is its change where there is no other mesh to compare with [-]."""
SAME_MESH = 0.01
"""Relative difference of ``1/log(1 + L/h)`` below which two meshes are the same [-]."""


@dataclass(frozen=True, eq=False)
class OtherMesh:
    """Represent the same body on another mesh, as its contact sees it.

    Attributes:
        surface: The contacts with Coulomb friction.
        traces: The body as they see it.
    """

    surface: CoulombSurface
    traces: Traces

    def norm(self, surface: CoulombSurface, t: np.ndarray) -> tuple[float, np.ndarray]:
        """Compute the norm q for the field t (n, d) of a surface; collective.

        Returns:
            q [-], and the normal displacements that go with it, on the surface of t,
            shape (n,).
        """
        here = self.surface
        # The other surface gives the field; edges and supports of this one block it.
        x = here.positions()
        field = np.where(here.blocked[:, None], 0.0, surface.interpolate(t, x))
        norm = coupling(here.normal, self.traces, field, x)
        along = here.interpolate(norm.displacement[:, None] * here.normal, surface.positions())
        return norm.q, (along * surface.normal).sum(axis=1)


def other_mesh(model: Model) -> OtherMesh | None:
    """Make the other mesh of a body; collective.

    Returns:
        A finer mesh, or a coarser one; None where the body is known only as a mesh, or
        cannot be meshed so coarsely.
    """
    domain = model.domain
    d = model.space.d
    try:
        if domain.cells * 2**d <= MOST_REFINED[d]:
            return body_on(model, domain.refined())
        if domain.geometry is None:
            return None
        # It must be coarse enough to cost little, and to differ from this one.
        factor = max(COARSER, (domain.cells / MOST_CELLS[d]) ** (1 / d))
        return body_on(model, domain.remeshed(factor * NodalMesh(domain).mean_size()))
    except ErcContactError:
        return None


def body_on(model: Model, domain: Domain) -> OtherMesh:
    """Make the body of a model on another mesh; collective."""
    new_model = bind(model.scene, domain, model.space.degree)
    surface = coulomb_surface(new_model)
    stiffness = stiffness_of(new_model)
    with stiffness.in_memory():
        return OtherMesh(surface, stiffness.traces(surface.numbers))


def change_of_norm(
    q: float, surface: CoulombSurface, other_q: float, comparison: OtherMesh | None
) -> float:
    """Estimate how far the norm q of a field is from its limit [-].

    The value on another mesh tells.

    Args:
        q: The norm on the mesh of the body [-].
        surface: The contacts on this mesh.
        other_q: The norm of the same field on the other mesh [-].
        comparison: The other mesh.

    Returns:
        c/log(1 + L/h); a tenth of q where the other mesh tells nothing.
    """
    if comparison is None or not np.isfinite(q):
        return UNKNOWN_CHANGE * q
    here = _missing(surface)
    there = _missing(comparison.surface)
    if abs(here - there) < SAME_MESH * here:
        return max(UNKNOWN_CHANGE * q, abs(q - other_q))
    return here * abs(q - other_q) / abs(here - there)


def _missing(surface: CoulombSurface) -> float:
    """Return what is missing of q on a mesh, over c: ``1/log(1 + L/h)`` [-]."""
    d = surface.normal.shape[1]
    size = float(surface.area.mean()) ** (1 / (d - 1))
    length = float(np.ptp(surface.positions(), axis=0).max())
    return 1 / float(np.log1p(length / size))
