"""Mesh a drawing in a process of its own, so that no fault of gmsh's ends the caller's.

This process knows nothing of MPI: it imports neither the package itself nor DOLFINx.
It gets a job as JSON, writes ``mesh.msh`` and ``result.json`` into a folder, and each
sentence for the user to its standard output as soon as it knows it.
"""

from __future__ import annotations

import json
import os
import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from namedmesh.curvature import follow_curves
from namedmesh.drawings import kept, opened, pieces, small

EDGES_OF_CIRCLE = 8
"""Number of edges along a full circle of small radius."""
OPTIONS = {
    "General.Terminal": 0,
    "Mesh.ElementOrder": 1,
    "Mesh.RecombineAll": 0,
    "Mesh.Binary": 1,
    "Mesh.MshFileVersion": 4.1,
    "Mesh.SaveAll": 0,
}
"""gmsh's options, whatever a .geo file says."""


def main() -> None:
    """Do the job of the first argument."""
    job = json.loads(sys.argv[1])
    # What OpenCASCADE prints goes nowhere; standard output is ours.
    sentences = os.fdopen(os.dup(1), "w")
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)

    def tell(kind: str, sentence: str) -> None:
        print(json.dumps([kind, sentence]), file=sentences, flush=True)

    import gmsh  # noqa: PLC0415 - after its messages have a place to go

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        _mesh(gmsh, job, tell)
    except opened.Refused as reason:
        tell("refused", str(reason))
    except Exception as reason:  # gmsh's errors are of no other class
        tell("failed", str(reason))
    gmsh.finalize()


def _mesh(gmsh: Any, job: dict[str, Any], tell: Any) -> None:
    """Open, repair, put in one piece and mesh a drawing; write the result."""
    _options(gmsh)
    tell("stage", "reading")
    gmsh.model.add("drawing")
    solids = opened.open_drawing(gmsh, Path(job["path"]), job["kind"], tell)
    model = gmsh.model
    size = job["size"] or small.extent(gmsh) / 10
    if not job["size"] and job["kind"] in opened.OF_OCC:
        raise opened.Refused(
            f"it has no size of cells; its extent is {small.extent(gmsh):.4g}: give "
            f"read_mesh(..., size=), a length, for instance size={float(f'{size:.1g}'):g}"
        )
    of_occ = bool(model.occ.getEntities())
    named = bool(model.getPhysicalGroups())
    if of_occ and not named:
        if job["heal"]:
            tell("stage", "healing")
            whole = small.extent(gmsh) * small.ROUND_OFF
            solids = small.heal(gmsh, solids, whole if job["heal"] is True else job["heal"])
        if job["defeature"]:
            tell("stage", "removing small faces")
            solids = small.defeature(gmsh, solids, job["defeature"], tell)
        tell("stage", "putting the solids in one piece")
        bodies = pieces.in_one_piece(gmsh, solids, tell)
        pieces.tell_touches(gmsh, bodies, tell)
        small.tell_tiny(gmsh, bodies[0][1][0][0], size, tell)
    else:
        bodies = [(name, [entity]) for name, entity in solids]
    dim = bodies[0][1][0][0]
    _name(model, dim, bodies)
    drawing = kept.drawing_of(model)
    tell("stage", "meshing")
    _options(gmsh)
    if job["size"]:
        gmsh.option.setNumber("Mesh.MeshSizeMax", job["size"])
        follow_curves(gmsh, EDGES_OF_CIRCLE, job["size"], job["size"])
    model.mesh.generate(dim)
    empty = [name for name, pieces_ in bodies if not _has_cells(model, pieces_)]
    if empty:
        raise opened.Refused(f"gmsh made no cell in {', '.join(map(repr, empty))}")
    folder = Path(job["folder"])
    gmsh.write(str(folder / "mesh.msh"))
    result = None
    if drawing is not None:
        suffix, text, curved = drawing
        result = [suffix, text, sorted(curved)]
    (folder / "result.json").write_text(json.dumps(result))
    tell("stage", "done")


def _options(gmsh: Any) -> None:
    """Set gmsh's options, which a .geo file may have changed."""
    for name, value in OPTIONS.items():
        gmsh.option.setNumber(name, value)


def _has_cells(model: Any, entities: Sequence[pieces.Entity]) -> bool:
    """Tell whether each of some entities has cells."""
    return all(len(np.concatenate([[], *model.mesh.getElements(*e)[1]])) for e in entities)


def _name(model: Any, dim: int, bodies: pieces.Solids) -> None:
    """Make physical groups: regions with names, faces with numbers.

    Faces are numbered body by body. Groups that a .geo file has stay as they are.
    """
    grouped = set()
    last = 0
    for group in model.getPhysicalGroups():
        grouped |= {(group[0], int(tag)) for tag in model.getEntitiesForPhysicalGroup(*group)}
        last = max(last, group[1])
    beside: Counter[pieces.Entity] = Counter()
    for _, entities in bodies:
        beside.update(model.getBoundary(entities, oriented=False))
    # Faces between two bodies come last: once the bodies are split they have names.
    for face in sorted(beside, key=beside.__getitem__):
        if face not in grouped:
            last += 1
            model.addPhysicalGroup(dim - 1, [face[1]], tag=last, name=str(last))
    taken = {model.getPhysicalName(*group) for group in model.getPhysicalGroups(dim)}
    if taken:
        return
    for number, (name, entities) in enumerate(bodies, start=last + 1):
        model.addPhysicalGroup(dim, [tag for _, tag in entities], tag=number, name=name)


if __name__ == "__main__":
    main()
