"""A perturbation: what a goal moves, and how its number follows from the energy.

A goal is the derivative of the energy by data of the scene, a load or the place of
supports (:mod:`erc_contact.error.goals.difference_quotient`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from dolfinx import fem

from erc_contact.error.numbers import BoundedNumber
from erc_contact.model.model import Model
from erc_contact.scene.scene import Scene


@dataclass(frozen=True, eq=False)
class BaseScene:
    """Hold the scene that is perturbed, with the sizes of its solution.

    Attributes:
        model: The scene on a mesh.
        scene: The scene, with the friction bounds of its pair.
        e: Its error, or the least one that t is for [sqrt(force length)].
        norm: Energy norm of its displacement [sqrt(force length)].
        length: Its largest displacement [length].
    """

    model: Model
    scene: Scene
    e: float
    norm: float
    length: float

    def step_of(self, size: float) -> float:
        """Return a first t of a motion of supports of this size [-]."""
        return self.e / self.norm * self.length / size


def no_load(_: fem.Function) -> BoundedNumber:
    """Return ``psi(u)`` of a perturbation that moves no load, which is zero."""
    return BoundedNumber(0.0)


@dataclass(frozen=True, eq=False)
class Perturbation:
    """Hold what a goal moves, and how its number follows from Q.

    Attributes:
        scene_at: Makes the scene moved by t, with the friction bounds of the pair; None
            if loads alone dictate the number, which is then the constant.
        psi: ``psi(u)`` of a displacement.
        sign: Factor of Q in the number [-].
        constant: What is added to it.
        step: A first t.
        varies: Whether the moved load varies in space: a mesh may not represent it.
        size: Size of psi, its value for a unit displacement; 0 if no load moves.
        least: What the number is at least.
        unit: Unit of the number as it stands behind it; "" if the scene has none.
    """

    scene_at: Callable[[float], Scene] | None
    psi: Callable[[fem.Function], BoundedNumber]
    sign: float
    constant: BoundedNumber
    step: float
    varies: bool = False
    size: float = 0.0
    least: float = -np.inf
    unit: str = ""
