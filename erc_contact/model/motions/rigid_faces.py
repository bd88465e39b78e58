"""Put rigid faces on a mesh: shapes of their motions, and forces of their resultants.

A face whose motions are all given is a support. Of any other one the motions q_j that
are not given are unknowns, and their resultants Q_j are known:

    u = u_0 + sum_j q_j R_j  on the face,    int_face sigma n . R_j = Q_j,

with the shapes R_j: unit translations, and unit rotations about a point of the face.
Such a face is called *loose*. Other supports and contacts may share nodes with it where
no R_j moves what they hold; so no force that they exchange at a node changes a Q_j.
Of a ring the only R is the translation along the axis. If u_r is not given there, the
face is a roller along r. A plane section is a roller along its plane likewise: it has
the components of R along its normal alone, a translation and the rotations about the
axes in its plane.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from erc_contact.base.exceptions import InputError
from erc_contact.model.motions.rigid_shapes import motions_about_axes
from erc_contact.model.space import Space
from erc_contact.scene.support import AXES, PlaneSection, Rigid
from namedmesh.base.names import known_names
from namedmesh.base.ranks import box, union

FLAT = 1e-6
"""Depth of a part over the extent of the mesh that counts as none [-]."""


@dataclass(frozen=True, eq=False)
class RigidFace:
    """Hold a rigid face on a mesh.

    Attributes:
        kind: Name of the class that declares it.
        name: Name of the boundary part.
        facets: Its facets (cell, local facet) on this rank, shape (f, 2).
        nodes: Its nodes on this rank, ghosts included, shape (n,).
        owned: Which of them this rank owns, shape (n,).
        about: The point about which it turns [length], shape (d,).
        shapes: Its motions R at the nodes [-; length], shape (n, d, freedoms).
        free: Which of its motions are unknowns, shape (freedoms,).
        resultants: Q of each motion [force; force length], 0 where it is not given,
            shape (freedoms,).
        sizes: Size of each R: 1 for a translation, the size of the body for a rotation.
        comm: The ranks.
    """

    kind: str
    name: str
    facets: np.ndarray
    nodes: np.ndarray
    owned: np.ndarray
    about: np.ndarray
    shapes: np.ndarray
    free: np.ndarray
    resultants: np.ndarray
    sizes: np.ndarray
    comm: MPI.Comm

    @property
    def what(self) -> str:
        """Return the face in words for messages."""
        return f"{self.kind}({self.name!r})"

    @property
    def reach(self) -> np.ndarray:
        """Return the sizes of unit motions at the nodes [-], shape (n, d, freedoms)."""
        return np.asarray(abs(self.shapes) / self.sizes)

    def work(self, nodal: np.ndarray) -> np.ndarray:
        """Return ``sum R_j . f`` over the nodes, shape (freedoms, ...); collective.

        Args:
            nodal: Values at all nodes of this rank, complete at its owned nodes, shape
                (nodes, d, ...).
        """
        of_owned = self.nodes[self.owned]
        local = np.einsum("ndj,nd...->j...", self.shapes[self.owned], nodal[of_owned])
        total: np.ndarray = self.comm.allreduce(local, MPI.SUM)
        return total

    def motion(self, nodal: np.ndarray) -> np.ndarray:
        """Return the motion whose displacement of the nodes is nearest; collective.

        Args:
            nodal: Displacements at all nodes of this rank, shape (nodes, d, ...).

        Returns:
            Translations of the point ``about`` and rotations, shape (freedoms, ...).
        """
        return self._amounts(self.work(nodal))

    def follow(self, prescribed: fem.Function, u: np.ndarray) -> None:
        """Give the face the free motion of a displacement u, in place; collective.

        Args:
            prescribed: Displacement with the given motion of the face [length].
            u: Displacements at all nodes of this rank [length], shape (nodes, d).
        """
        nodal = prescribed.x.array.reshape(u.shape)
        amounts = self.motion(u - nodal) * self.free
        nodal[self.nodes] += self.shapes @ amounts
        prescribed.x.scatter_forward()

    def nodal_forces(self) -> np.ndarray:
        """Return forces at the owned nodes with the resultants Q [force]; collective.

        Shape (owned nodes, d). Only their work on the shapes matters.
        """
        return np.asarray(self.shapes[self.owned] @ self._amounts(self.resultants))

    def body(self, bodies: np.ndarray) -> int:
        """Return the number of the body that the face is on; collective.

        Args:
            bodies: Body of each node of this rank, shape (nodes,).

        Raises:
            InputError: If it is on several bodies.
        """
        numbers = union(self.comm, bodies[self.nodes].tolist())
        if len(numbers) > 1:
            raise InputError(
                f"{self.what} is on {len(numbers)} bodies; give each body a face of its"
                " own name, or give all motions of the face."
            )
        number: int = numbers.pop()
        return number

    def _amounts(self, works: np.ndarray) -> np.ndarray:
        """Return a with ``sum_j (R_i . R_j) a_j = works_i`` over all nodes; collective.

        Args:
            works: Works on the shapes, shape (freedoms, ...).
        """
        # In units far from 1, rotations would else be round-off beside translations.
        sizes = self.sizes.reshape(-1, *[1] * (works.ndim - 1))
        owned = self.shapes[self.owned] / self.sizes
        products = self.comm.allreduce(np.einsum("ndi,ndj->ij", owned, owned), MPI.SUM)
        return np.asarray(np.linalg.lstsq(products, works / sizes, rcond=None)[0] / sizes)


def bind_rigid(space: Space, rigid: Rigid) -> RigidFace:
    """Put a rigid face on a mesh; collective.

    Raises:
        InputError: If ``about`` is a point of another dimension, or a plane section is
            not flat.
    """
    d = space.d
    facets = space.domain.facets(rigid.facets)
    if isinstance(rigid, PlaneSection):
        _check_flat(space, rigid, facets)
    nodes = np.unique(space.facet_nodes(facets))
    about = centroid(space, facets) if rigid.about is None else np.array(rigid.about, dtype=float)
    if len(about) != d:
        what = f"{type(rigid).__name__}({rigid.facets!r})"
        raise InputError(f"{what}: about has {len(about)} numbers, but the mesh is {d}D.")
    x = space.V.tabulate_dof_coordinates()[nodes, :d]
    shapes = motions_about_axes(x - about)
    given = zip(rigid.motions, rigid.resultants, strict=True)
    free = np.array([motion is None and resultant is not None for motion, resultant in given])
    # A section slides in these components: its motions have no part in them.
    slides = [value is None for value in rigid.value]
    shapes[:, slides] = 0.0
    # What a displacement has beside the motions of the body is no motion of the face.
    of_body = np.zeros_like(shapes)
    of_body[:, :, space.section.motions] = shapes[:, :, space.section.motions]
    sizes = np.ones(len(free))
    sizes[d:] = space.domain.extent
    return RigidFace(
        kind=type(rigid).__name__,
        name=rigid.facets,
        facets=facets,
        nodes=nodes,
        owned=nodes < space.V.dofmap.index_map.size_local,
        about=about,
        shapes=of_body,
        free=free,
        resultants=np.array([resultant or 0.0 for resultant in rigid.resultants]),
        sizes=sizes,
        comm=space.mesh.comm,
    )


def _check_flat(space: Space, section: PlaneSection, facets: np.ndarray) -> None:
    """Check that a plane section lies in a plane normal to its axis; collective."""
    axis = section.axis
    low, high = box(space.comm, space.facet_corners(facets).reshape(-1, space.d))
    depth = float((high - low)[axis])
    if depth > FLAT * space.domain.extent:
        letter = AXES[axis]
        raise InputError(
            f"PlaneSection({section.facets!r}): the part reaches over {depth:.3g} along {letter},"
            f" and must lie in a plane normal to {letter}. Give the component along the normal of"
            " the part. Where no axis is normal to it, turn the mesh so that one is; on a plane"
            " that does not move, ec.Symmetry needs no axis."
        )


def face_forces(space: Space, faces: Sequence[RigidFace]) -> fem.Function | None:
    """Return the nodal forces of the resultants of all loose faces [force]; collective.

    Each is at the node of its owner alone. None without loose faces.
    """
    if not faces:
        return None
    forces = space.function()
    nodal = forces.x.array.reshape(-1, space.d)
    for face in faces:
        nodal[face.nodes[face.owned]] += face.nodal_forces()
    return forces


def centroid(space: Space, facets: np.ndarray) -> np.ndarray:
    """Return the centroid of a boundary part [length]; collective."""
    mine = facets[space.owned(facets)]
    areas = space.facet_areas(mine)
    middles = space.facet_corners(mine).mean(axis=1)
    local = np.concatenate([areas @ middles, [areas.sum()]])
    total: Any = space.comm.allreduce(local, MPI.SUM)
    return np.asarray(total[:-1] / total[-1])


@dataclass(frozen=True)
class Motion:
    """Hold the motion of a rigid face or a plane section.

    It is zero in freedoms in which a section slides.

    Attributes:
        displacement: Of the point ``about`` [length], shape (d,).
        rotation: Angle [rad]; in 3D about each axis, shape (3,).
        about: The point [length], shape (d,).
    """

    displacement: np.ndarray
    rotation: np.ndarray
    about: np.ndarray


def motion_of(space: Space, supports: Sequence[Any], part: str, u: fem.Function) -> Motion:
    """Return the motion of a rigid face under a displacement u; collective.

    Raises:
        InputError: If no rigid face has this name.
    """
    rigid = [support for support in supports if isinstance(support, Rigid)]
    names = [face.facets for face in rigid]
    if part not in names:
        raise InputError(
            f"No rigid face is called {part!r}; this scene has {known_names(part, names)}"
        )
    face = bind_rigid(space, rigid[names.index(part)])
    d = space.d
    motion = face.motion(u.x.array.reshape(-1, d))
    return Motion(motion[:d], motion[d:], face.about)
