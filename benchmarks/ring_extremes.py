"""Turn the extreme scenes of the plane: their outlines as rings, with and without axis.

Each scene in the plane that has a solution (``benchmarks/extreme_scenes.py``) becomes
two axisymmetric scenes: its left end is at 0.3 of its width from the axis, and on the
axis. At the axis no radial displacement and no condition is possible: radial components
of supports grow with r there, and what is on the left end is left out.

    OMP_NUM_THREADS=1 python benchmarks/ring_extremes.py

prints how many pairs (scene, method) are solved and certified, and which are not.
"""

from __future__ import annotations

import logging
from collections import Counter
from dataclasses import fields, replace
from typing import Any

import erc_contact as ec

import numpy as np  # isort: skip - after erc_contact, which loads MPI first
from extreme_domains import mapped  # isort: skip
from extreme_scenes import SCENES, Extreme  # isort: skip

METHODS: tuple[Any, ...] = (ec.Nitsche(), ec.AugmentedLagrangian())
HOLE = 0.3
"""Inner radius over the width [-]."""


def moved(value: Any, by: float) -> Any:
    """Return an argument of a scene whose callables see x before the outline moved."""
    if isinstance(value, tuple):
        return tuple(moved(entry, by) for entry in value)
    if callable(value) and not isinstance(value, type):
        return lambda x: value([x[0] - by, x[1]])
    return value


def moved_entry(entry: Any, by: float) -> Any:
    """Return a material, support, load or contact on the moved outline."""
    changes = {}
    for field in fields(entry):
        value = getattr(entry, field.name)
        if callable(value) or isinstance(value, tuple):
            changes[field.name] = moved(value, by)
    return replace(entry, **changes)


def growing(support: ec.Displacement, width: float) -> ec.Displacement:
    """Return a support whose radial component is zero on the axis."""
    radial, axial = support.value
    if radial is None or radial == 0.0:
        return support

    def value(x: Any) -> Any:
        size = radial(x) if callable(radial) else radial
        return size * x[0] / width

    return replace(support, value=(value, axial))


def turned(extreme: Extreme, hole: float) -> tuple[ec.Scene, ec.Domain] | None:
    """Return the scene as rings; None in 3D, and of rigid faces at the axis."""
    scene, domain = extreme.build()
    if domain.dim != 2 or not isinstance(scene.material, ec.Elastic):
        return None
    x = domain.mesh.geometry.x[:, 0]
    width = float(np.ptp(x))
    by = hole * width - float(x.min())
    domain = mapped(domain, lambda x: (x[0] + by, x[1]))
    material = replace(moved_entry(scene.material, by), hypothesis="axisymmetric")
    entries: dict[str, Any] = {}
    for name in ("supports", "loads", "contacts"):
        kept = [entry for entry in getattr(scene, name) if hole > 0 or entry.facets != "left"]
        entries[name] = [moved_entry(entry, by) for entry in kept]
    if hole == 0:
        held = entries["supports"]
        if any(isinstance(support, ec.Rigid) for support in held):
            return None
        entries["supports"] = [growing(support, width) for support in held]
    return replace(scene, material=material, **entries), domain


def main() -> None:
    """Print what became of the scenes."""
    logging.disable(logging.WARNING)
    for what, hole in (("with a hole", HOLE), ("with the axis", 0.0)):
        endings: Counter[str] = Counter()
        for name, extreme in SCENES.items():
            if not extreme.solvable or extreme.refusable:
                continue
            pair = turned(extreme, hole)
            if pair is None:
                continue
            for method in METHODS:
                if set(extreme.parameters) - {field.name for field in fields(method)}:
                    continue
                chosen = replace(method, **extreme.parameters)
                try:
                    solution = ec.solve(*pair, chosen)
                    ec.constitutive_error(ec.equilibrate(solution))
                    endings["certified"] += 1
                except ec.ErcContactError as reason:
                    endings[type(reason).__name__] += 1
                    print(f"{what}: {name}, {type(method).__name__}: {str(reason)[:160]}")
        print(f"{what}: {dict(endings)}", flush=True)


if __name__ == "__main__":
    main()
