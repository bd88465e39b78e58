"""Contact of elastic bodies with certified accuracy on FEniCSx."""

import importlib.util

if importlib.util.find_spec("dolfinx_solver"):
    import dolfinx_solver  # noqa: F401
from erc_contact.meshing import box, from_gmsh, read_mesh, rectangle
from erc_contact.domain import Domain
from erc_contact.material import Elastic
from erc_contact.scene import *
from erc_contact.methods import Nitsche
from erc_contact.solve import solve
from erc_contact.admissible import equilibrate
from erc_contact.error import constitutive_error
