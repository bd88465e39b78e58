"""Makes ``hinge.step``, a bracket as CAD would write it: python meshes/hinge.py."""

from pathlib import Path

import gmsh

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
occ = gmsh.model.occ
plate = occ.addBox(0.0, 0.0, 0.0, 60.0, 40.0, 10.0)
ear = occ.addBox(0.0, 0.0, 0.0, 10.0, 40.0, 40.0)
eye = occ.addCylinder(
    0.0, 20.0, 40.0, 10.0, 0.0, 0.0, 20.0
)  # rounds the ear off, about the axis of its bore
(body,), _ = occ.fuse([(3, plate)], [(3, ear), (3, eye)])
bores = [
    (3, occ.addCylinder(-5.0, 20.0, 40.0, 20.0, 0.0, 0.0, 8.0)),
    (3, occ.addCylinder(40.0, 20.0, -5.0, 0.0, 0.0, 20.0, 6.0)),
    (3, occ.addCylinder(40.0, 20.0, 8.0, 0.0, 0.0, 5.0, 11.0)),  # the seat of the bolt's head
]
(body,), _ = occ.cut([body], bores)
occ.synchronize()
inner = gmsh.model.getEntitiesInBoundingBox(
    9.9, -0.1, 9.9, 10.1, 40.1, 10.1, 1
)  # the edge between plate and ear
(body,) = occ.fillet([body[1]], [inner[0][1]], [6.0])
occ.synchronize()
gmsh.write(str(Path(__file__).parent / "hinge.step"))
gmsh.finalize()
