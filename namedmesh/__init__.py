"""Make DOLFINx meshes of simplices whose parts have names, on any ranks.

Any mesh file, drawing or assembly becomes a :class:`Domain`: its boundary parts and
regions have names, sides of bodies that touch are paired, new vertices go to the true
shape. Here is nothing of mechanics::

    domain = namedmesh.read_mesh("clamp.step", size=8.0)
    print(domain.parts())
    mesh, tags = domain.mesh, domain.facet_tags  # DOLFINx's own
"""

import importlib.util

if importlib.util.find_spec("dolfinx_solver"):  # the wheel of DOLFINx must load MPI first
    import dolfinx_solver  # noqa: F401
from mpi4py import MPI  # noqa: F401

from namedmesh.assembly import assembly

# Old releases of other packages are refused before our modules miss a name in them.
from namedmesh.base import releases  # noqa: F401
from namedmesh.base.exceptions import InputError, NamedMeshError
from namedmesh.domain import Domain
from namedmesh.keeping.domain_file import read_domain, write_domain
from namedmesh.periodic import PeriodicPair, translated, turned
from namedmesh.pictures.part_pictures import draw_parts
from namedmesh.sources import box, from_gmsh, read_mesh, rectangle
from namedmesh.where import where

__all__ = [
    "Domain",
    "InputError",
    "NamedMeshError",
    "PeriodicPair",
    "assembly",
    "box",
    "draw_parts",
    "from_gmsh",
    "read_domain",
    "read_mesh",
    "rectangle",
    "translated",
    "turned",
    "where",
    "write_domain",
]
