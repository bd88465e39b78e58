"""Know the forces that a scene gives where displacements jump, and the shifts there.

A preload gives the force of a bolt, and periodic sides under a mean stress give the
force of a side, component by component. What moves with each of them is a shift of the
scene: the displacement jumps by it, and the force does work on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.model.contact.foundation import ContactOnMesh
from erc_contact.model.contact.periodic import area_vector, pair_of
from erc_contact.model.model import Model
from erc_contact.model.space import Space
from erc_contact.scene.contact import Contact
from erc_contact.scene.periodic import Periodic, translated_sides
from erc_contact.scene.scene import Scene
from erc_contact.scene.tied import Preload

SAME_DIRECTION = 1e-9
"""Size of what is left of a translation beside others that counts as none [-]."""


@dataclass(frozen=True, eq=False)
class GivenForce:
    """Hold a force that a scene gives where displacements jump.

    Attributes:
        name: Name of its shift.
        part: Name of the part on which it acts.
        direction: Its direction [-], shape (d,).
        force: The force [force].
        shift: The shift [length]; None where it is to be found.
        contact: The joint or the sides that transmit it.
        length: Length of what it stretches, estimated [length].
    """

    name: str
    part: str
    direction: np.ndarray
    force: float
    shift: float | None
    contact: ContactOnMesh
    length: float

    @property
    def of_sides(self) -> bool:
        """Tell whether it acts on periodic sides, and not on a bolt."""
        return self.contact.is_periodic


def given_forces(scene: Scene, model: Model) -> list[GivenForce]:
    """Return the forces that a scene gives, with their shifts; collective.

    Args:
        scene: The scene.
        model: The same bodies and contacts on a mesh.
    """
    forces = []
    axes = {preload.name: preload.axis for preload in model.preloads}
    for tie in scene.ties:
        if isinstance(tie, Preload) and tie.force is not None:
            joint = model.contact(tie.facets)
            part = tie.facets
            force, shift = float(tie.force), tie.shortening
            extent = model.domain.extent
            forces.append(GivenForce(part, part, axes[part], force, shift, joint, extent))
    stressed = stressed_sides(scene.contacts)
    if stressed:
        _check_translations(model.space, translated_sides(scene.contacts))
    for entry in stressed:
        forces += _of_sides(model, entry)
    return forces


def stiffnesses(space: Space, forces: Sequence[GivenForce]) -> np.ndarray:
    """Estimate ``E A/L`` of what forces stretch [force/length], (m,); collective."""
    local = []
    for given in forces:
        side = given.contact.trace.here
        local.append([side.owned_areas @ side.modulus, side.owned_areas.sum()])
    of_joints, areas = space.comm.allreduce(np.array(local)).T
    moduli = of_joints / areas
    of_sides = np.array([given.of_sides for given in forces])
    if of_sides.any():
        # With a modulus for all sides, copies that are sheared do not turn.
        moduli[of_sides] = moduli[of_sides].mean()
    lengths = np.array([given.length for given in forces])
    return np.asarray(moduli * areas / lengths)


def stressed_sides(contacts: Sequence[Contact]) -> list[Periodic]:
    """Return the periodic sides with a mean stress among contacts."""
    return [entry for entry in translated_sides(contacts) if entry.mean_stress is not None]


def _check_translations(space: Space, entries: Sequence[Periodic]) -> None:
    """Check that jumps of periodic sides belong to one mean strain E.

    Each pair jumps by ``E t``. With a mean stress its jump is found by itself, so that
    its translation t may be no combination of the translations of other pairs.

    Raises:
        InputError: If a translation is one.
    """
    shifts = np.array([pair.shift for pair in (pair_of(space, e) for e in entries) if pair])
    size = abs(shifts).max()
    independent = int(np.linalg.matrix_rank(shifts, tol=SAME_DIRECTION * size))
    if independent < len(shifts):
        sides = ", ".join(f"{entry.facets!r}" for entry in entries)
        raise InputError(
            f"Periodic sides with mean_stress=: the {len(shifts)} pairs of {sides} have"
            f" {independent} independent translations, and their jumps would belong to no common"
            " mean strain. Give mean_strain= for each pair, as of a hexagonal cell, and one name"
            " to sides with one translation."
        )


def shift_name(entry: Periodic, component: int) -> str:
    """Return the name of a component of the jump of periodic sides."""
    return f"{entry.facets} {'xyz'[component]}"


def _of_sides(model: Model, entry: Periodic) -> list[GivenForce]:
    """Return the components of the force ``S a`` of a mean stress; collective."""
    pair = pair_of(model.space, entry)
    assert pair is not None
    area = area_vector(model.space, entry.against)
    rows = np.array(entry.mean_stress, dtype=float)
    contact = model.contact(entry.facets)
    forces = []
    for i in np.flatnonzero(entry.is_free(pair, area)):
        shift = None if entry.found is None else entry.found[i]
        force = float(np.nan_to_num(rows[i]) @ area)
        direction = np.eye(len(area))[i]
        length = float(np.linalg.norm(pair.shift))
        name = shift_name(entry, int(i))
        forces.append(GivenForce(name, entry.against, direction, force, shift, contact, length))
    return forces
