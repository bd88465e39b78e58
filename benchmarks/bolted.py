"""Make two plates and a bolt through them, of boxes, in the plane or in 3D."""

from __future__ import annotations

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled
from mpi4py import MPI

SIDES = ("upper end", "lower end")
"""Names of the sides of the cut through the shank."""
SEATS = (("head", "upper seat"), ("nut", "lower seat"), ("joint", "joint below"))
"""Names of the sides of the contacts."""
REGIONS = (("above", "below"), ("above", "upper"), ("below", "lower"), ("upper", "lower"))
"""Regions on both sides of the cut and of the contacts."""
SHANK, HEAD, HOLE, WIDTH = 1.0, 2.0, 1.25, 5.0
UPPER, LOWER, HEIGHT, CUT = 2.0, -1.5, 1.0, 0.5


def bolted_plates(d: int, size: float, comm: MPI.Comm = MPI.COMM_WORLD) -> ec.Domain:
    """Make one half of the joint, in 3D a quarter, with square sections; collective.

    The planes of symmetry are x = 0, and y = 0 in 3D. The plates reach from z = -1.5
    to 0 and from 0 to 2 (y in the plane), the joint is between them.

    Args:
        d: Dimension.
        size: Size of the cells [length].
        comm: Communicator that shares the mesh.
    """
    model = None
    if comm.rank == 0:
        gmsh.initialize()
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        model = gmsh.model
        occ = model.occ
        head = _block(d, HEAD, UPPER, UPPER + HEIGHT)
        nut = _block(d, HEAD, LOWER - HEIGHT, LOWER)
        upper, _ = occ.fuse([_block(d, SHANK, CUT, UPPER)], [head])
        lower, _ = occ.fuse([_block(d, SHANK, LOWER, CUT)], [nut])
        plates = []
        for ends in ((0.0, UPPER), (LOWER, 0.0)):
            plate, _ = occ.cut([_block(d, WIDTH, *ends)], [_block(d, HOLE, *ends)])
            plates += plate
        _, pieces = occ.fragment(upper, [*lower, *plates])
        occ.synchronize()
        for name, of_name in zip(("above", "below", "upper", "lower"), pieces, strict=True):
            model.addPhysicalGroup(d, [tag for _, tag in of_name], name=name)
    parts = {"symmetry x": ec.where(x=0.0), "outer": ec.where(x=WIDTH)}
    free = (HEAD, None)
    if d == 2:
        parts |= {"top": ec.where(x=free, y=UPPER), "bottom": ec.where(x=free, y=LOWER)}
    else:
        parts["symmetry y"] = ec.where(y=0.0)
        parts |= {"top": ec.where(x=free, z=UPPER), "bottom": ec.where(x=free, z=LOWER)}
    domain = ec.from_gmsh(model, comm, parts=parts)
    if model is not None:
        gmsh.finalize()
    for names, regions in zip((SIDES, *SEATS), REGIONS, strict=True):
        domain = domain.split(dict(zip(names, regions, strict=True)))
    return domain


def _block(d: int, width: float, low: float, high: float) -> tuple[int, int]:
    """Add a rectangle or box from the planes of symmetry to a width, at a height."""
    occ = gmsh.model.occ
    if d == 2:
        return 2, occ.addRectangle(0.0, low, 0.0, width, high - low)
    return 3, occ.addBox(0.0, 0.0, low, width, width, high - low)
