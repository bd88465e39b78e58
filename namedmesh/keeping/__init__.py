"""Keep domains in files, which are whole or known as damaged.

Who keeps results on these meshes packs them beside the tables of the mesh.
"""

from namedmesh.keeping.checked import check_floats, demand
from namedmesh.keeping.domain_file import (
    about_mesh,
    check_domain,
    drawn_tables,
    mesh_of,
    write_domain,
)
from namedmesh.keeping.packed import BLOCK, Contents, Damaged, pack, unpack
from namedmesh.tables import CellRows, describe_shape, rules_of, tag_tables

__all__ = [
    "BLOCK",
    "CellRows",
    "Contents",
    "Damaged",
    "about_mesh",
    "check_domain",
    "check_floats",
    "demand",
    "describe_shape",
    "drawn_tables",
    "mesh_of",
    "pack",
    "rules_of",
    "tag_tables",
    "unpack",
    "write_domain",
]
