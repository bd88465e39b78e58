"""Perturbations of preloads: a shift or a force moves by t.

Let q be the shift of a bolt, F its force along the axis, and J the energy with the work
of the loads on the whole displacement ``u = u_c + q psi``
(:mod:`erc_contact.model.preload`). If the shift is given, the jump of u at the cut is a
support that moves with q, and ``J' = F``. If the force is given, J has the further work
``-F q``, and its derivative by F is -q. That needs a sigma^ whose resultants are the
given forces: where supports hold both halves of a bolt they are near them alone, and
the interval is an estimate. See :mod:`erc_contact.error.goals.perturbation`.
"""

from __future__ import annotations

from dataclasses import replace

from erc_contact.admissible.pair import Admissible
from erc_contact.base.exceptions import InputError
from erc_contact.error.bolts import has_forces
from erc_contact.error.goals.perturbation import BaseScene, Perturbation, no_load
from erc_contact.error.numbers import BoundedNumber
from erc_contact.scene.goal import BoltForce, GoalOfBolt, Shortening
from erc_contact.scene.scene import Scene
from erc_contact.scene.tied import Preload
from namedmesh.base.names import listed


def bolt_perturbation(base: BaseScene, goal: GoalOfBolt, pair: Admissible) -> Perturbation:
    """Return the perturbation for the force or the shift of a bolt; collective.

    Args:
        base: The scene.
        goal: The goal.
        pair: Its pair.

    Raises:
        InputError: As :func:`checked_preload`.
    """
    scene = base.scene
    preload = checked_preload(scene, goal)
    assert preload.shortening is not None
    if isinstance(goal, BoltForce):
        q = float(preload.shortening)

        def shifted(t: float) -> Scene:
            return _with(scene, preload.found(q + t, locked=preload.locked))

        return Perturbation(shifted, no_load, -1.0, BoundedNumber(0.0), base.step_of(1.0))
    assert preload.force is not None
    force = preload.force
    # All bolts keep their forces, and their shifts are found.
    loose = scene
    for tie in scene.ties:
        if isinstance(tie, Preload) and tie.force is not None:
            loose = _with(loose, replace(tie, shortening=None))

    def tightened(t: float) -> Scene:
        return _with(loose, replace(preload, force=force + t, shortening=None))

    shift = BoundedNumber(float(preload.shortening), resolved=has_forces(pair))
    step = base.e * base.norm / base.length
    return Perturbation(tightened, no_load, 1.0, shift, step)


def _with(scene: Scene, preload: Preload) -> Scene:
    """Return a scene with another preload at the same cut."""
    ties = [preload if tie.facets == preload.facets else tie for tie in scene.ties]
    return replace(scene, ties=ties)


def checked_preload(scene: Scene, goal: GoalOfBolt) -> Preload:
    """Return the preload that has the part of a goal.

    Raises:
        InputError: If no preload has the part, or the number is given.
    """
    parts: list[str] = []
    found: Preload | None = None
    for tie in scene.ties:
        if isinstance(tie, Preload):
            parts += tie.sides
            found = tie if goal.part in tie.sides else found
    if found is None:
        raise InputError(f"{goal!r}: give a side of a preload; this scene has {listed(parts)}.")
    if isinstance(goal, BoltForce) and found.force is not None:
        raise InputError(f"{goal!r}: this force is given, {found.force:g}; ask for the Shortening.")
    if isinstance(goal, Shortening) and found.force is None:
        raise InputError(
            f"{goal!r}: this shift is given, {found.shortening:g}; ask for the BoltForce."
        )
    return found
