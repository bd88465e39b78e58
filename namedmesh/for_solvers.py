"""Name what a solver needs of meshes beside their public names.

Who computes on the meshes of this package asks for facets, tags, normals and the true
shape here, and need not know where they are made.
"""

from namedmesh.bodies import Bodies, Geometry
from namedmesh.closest import closest
from namedmesh.copies import points_in_words, shared_points
from namedmesh.deck_mesh import Card, DeckMesh, DeckSpace, domain_of, read_deck_mesh
from namedmesh.deck_refinement import FinerDeckMesh, refined_deck_mesh
from namedmesh.field_in_cells import FieldInCells
from namedmesh.field_on_mesh import SAME_PLACE, FieldOnMesh
from namedmesh.files.abaqus_tables import shape_of
from namedmesh.files.displacements import FileField, from_file
from namedmesh.files.file_mesh import FileMesh
from namedmesh.graphs import components, order_along_curves, successors, to_chain_ends
from namedmesh.interface_map import Interface
from namedmesh.named import INSIDE_CELLS
from namedmesh.naming import Rules
from namedmesh.nodal import NodalMesh, count_cells
from namedmesh.normals import spread, vertex_normals
from namedmesh.partition import check_shape
from namedmesh.parts import shape_in_words
from namedmesh.parts_table import NAMELESS, facets_of_parts
from namedmesh.rows import count_up, in_space, row_numbers
from namedmesh.sides import boundary_sides, inner_facets
from namedmesh.size_field import FILL
from namedmesh.surface import Slivers, sides_of_facets, slivers
from namedmesh.tags import NO_TAG, tag_table

__all__ = [
    "FILL",
    "INSIDE_CELLS",
    "NAMELESS",
    "NO_TAG",
    "SAME_PLACE",
    "Bodies",
    "Card",
    "DeckMesh",
    "DeckSpace",
    "FieldInCells",
    "FieldOnMesh",
    "FileField",
    "FileMesh",
    "FinerDeckMesh",
    "Geometry",
    "Interface",
    "NodalMesh",
    "Rules",
    "Slivers",
    "boundary_sides",
    "check_shape",
    "closest",
    "components",
    "count_cells",
    "count_up",
    "domain_of",
    "facets_of_parts",
    "from_file",
    "in_space",
    "inner_facets",
    "order_along_curves",
    "points_in_words",
    "read_deck_mesh",
    "refined_deck_mesh",
    "row_numbers",
    "shape_in_words",
    "shape_of",
    "shared_points",
    "sides_of_facets",
    "slivers",
    "spread",
    "successors",
    "tag_table",
    "to_chain_ends",
    "vertex_normals",
]
