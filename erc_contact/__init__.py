"""Contact of elastic bodies with certified accuracy, on FEniCSx.

Declare a scene, solve it, reconstruct an admissible pair, measure the error in the
constitutive relation, and refine until a prescribed accuracy is reached::

    history = erc_contact.adapt(scene, domain, accuracy=0.02)

Source: Coorevits, Hild, Hjiaj, "An a posteriori error estimator for finite element
approximations of Coulomb's friction problem"; the same authors, SIAM J. Sci. Comput. 23
(2001).
"""

import importlib
import importlib.util
from typing import TYPE_CHECKING, Any

from erc_contact.base.runtime.sigterm import sigterm_blocked

with sigterm_blocked():  # the threads that MPI starts block it, too
    if importlib.util.find_spec("dolfinx_solver"):  # the wheel of DOLFINx must load MPI first
        import dolfinx_solver  # noqa: F401
    from mpi4py import MPI  # noqa: F401

    # Old releases of other packages are refused before our modules miss a name in them.
    import namedmesh.base.releases  # noqa: F401

from erc_contact.base.exceptions import (
    ErcContactError,
    InputError,
    NotBalanced,
    NotConverged,
    NotHeldError,
)
from erc_contact.base.keywords import name_nearest
from erc_contact.base.logs import log_to_console
from erc_contact.base.versions import versions
from erc_contact.scene import goal as goals  # noqa: F401 - ec.goals has the names of goals
from erc_contact.scene.contact import Contact, Foundation, Symmetry
from erc_contact.scene.goal import (
    BoltForce,
    Energy,
    Functional,
    MeanDisplacement,
    Moment,
    Opening,
    Resultant,
    Rotation,
    Shortening,
    Slip,
    StressIntensity,
)
from erc_contact.scene.hardening import HardeningCurve, Swift, Voce
from erc_contact.scene.law import Coulomb, Law, Orthotropic, Tresca
from erc_contact.scene.load import BodyForce, Load, Traction
from erc_contact.scene.material import Elastic, Material
from erc_contact.scene.orthotropic import OrthotropicElastic
from erc_contact.scene.periodic import Cyclic, Periodic
from erc_contact.scene.plastic import Plastic
from erc_contact.scene.potential import Potential, Remembering
from erc_contact.scene.remote import RemoteForce
from erc_contact.scene.scene import Scene
from erc_contact.scene.strain import Eigenstrain, GivenStrain, ThermalStrain
from erc_contact.scene.support import Displacement, PlaneSection, Rigid, Spring
from erc_contact.scene.table import table
from erc_contact.scene.tied import Preload, Tied
from namedmesh import (
    Domain,
    assembly,
    box,
    draw_parts,
    from_gmsh,
    read_domain,
    read_mesh,
    rectangle,
    where,
    write_domain,
)

if TYPE_CHECKING:
    from erc_contact.admissible.equilibrate import equilibrate
    from erc_contact.admissible.pair import Admissible
    from erc_contact.decks.deck import Deck, read_deck
    from erc_contact.error.bounds import potential_energy, resultant, work_of_loads
    from erc_contact.error.certify import Certificate, certify
    from erc_contact.error.constitutive import ConstitutiveError, constitutive_error
    from erc_contact.error.coulomb.certificate import CoulombCertificate, coulomb_certificate
    from erc_contact.error.goals.interval import interval
    from erc_contact.error.multiplicity import other_solutions
    from erc_contact.error.numbers import Bounds
    from erc_contact.error.optimal import SizeMap
    from erc_contact.error.oscillation import Oscillations
    from erc_contact.error.sizes import Sizes, size_map
    from erc_contact.error.stiffness import stiffness
    from erc_contact.error.strategy import Mark, Strategy, Uniform, mark
    from erc_contact.newton.methods import AugmentedLagrangian, Method, Nitsche
    from erc_contact.newton.solution import Solution
    from erc_contact.newton.solve import solve
    from erc_contact.run.adapt import adapt
    from erc_contact.run.evolution import Evolution
    from erc_contact.run.evolve import evolve
    from erc_contact.run.history import History
    from erc_contact.run.saved import read_history
    from erc_contact.run.step import Step
    from erc_contact.run.time_row import TimeStep

__all__ = [
    "Admissible",
    "AugmentedLagrangian",
    "BodyForce",
    "BoltForce",
    "Bounds",
    "Certificate",
    "ConstitutiveError",
    "Contact",
    "Coulomb",
    "CoulombCertificate",
    "Cyclic",
    "Deck",
    "Displacement",
    "Domain",
    "Eigenstrain",
    "Elastic",
    "Energy",
    "ErcContactError",
    "Evolution",
    "Foundation",
    "Functional",
    "GivenStrain",
    "HardeningCurve",
    "History",
    "InputError",
    "Law",
    "Load",
    "Mark",
    "Material",
    "MeanDisplacement",
    "Method",
    "Moment",
    "Nitsche",
    "NotBalanced",
    "NotConverged",
    "NotHeldError",
    "Opening",
    "Orthotropic",
    "OrthotropicElastic",
    "Oscillations",
    "Periodic",
    "PlaneSection",
    "Plastic",
    "Potential",
    "Preload",
    "Remembering",
    "RemoteForce",
    "Resultant",
    "Rigid",
    "Rotation",
    "Scene",
    "Shortening",
    "SizeMap",
    "Sizes",
    "Slip",
    "Solution",
    "Spring",
    "Step",
    "Strategy",
    "StressIntensity",
    "Swift",
    "Symmetry",
    "ThermalStrain",
    "Tied",
    "TimeStep",
    "Traction",
    "Tresca",
    "Uniform",
    "Voce",
    "adapt",
    "assembly",
    "box",
    "certify",
    "constitutive_error",
    "coulomb_certificate",
    "draw_parts",
    "equilibrate",
    "evolve",
    "from_gmsh",
    "interval",
    "log_to_console",
    "mark",
    "other_solutions",
    "potential_energy",
    "read_deck",
    "read_domain",
    "read_history",
    "read_mesh",
    "rectangle",
    "resultant",
    "size_map",
    "solve",
    "stiffness",
    "table",
    "where",
    "work_of_loads",
    "write_domain",
]

_LATE = {
    "Admissible": "erc_contact.admissible.pair",
    "AugmentedLagrangian": "erc_contact.newton.methods",
    "Bounds": "erc_contact.error.numbers",
    "Certificate": "erc_contact.error.certify",
    "ConstitutiveError": "erc_contact.error.constitutive",
    "CoulombCertificate": "erc_contact.error.coulomb.certificate",
    "Deck": "erc_contact.decks.deck",
    "Evolution": "erc_contact.run.evolution",
    "History": "erc_contact.run.history",
    "Mark": "erc_contact.error.strategy",
    "Method": "erc_contact.newton.methods",
    "Nitsche": "erc_contact.newton.methods",
    "Oscillations": "erc_contact.error.oscillation",
    "SizeMap": "erc_contact.error.optimal",
    "Sizes": "erc_contact.error.sizes",
    "Solution": "erc_contact.newton.solution",
    "Step": "erc_contact.run.step",
    "Strategy": "erc_contact.error.strategy",
    "TimeStep": "erc_contact.run.time_row",
    "Uniform": "erc_contact.error.strategy",
    "adapt": "erc_contact.run.adapt",
    "certify": "erc_contact.error.certify",
    "constitutive_error": "erc_contact.error.constitutive",
    "coulomb_certificate": "erc_contact.error.coulomb.certificate",
    "equilibrate": "erc_contact.admissible.equilibrate",
    "evolve": "erc_contact.run.evolve",
    "interval": "erc_contact.error.goals.interval",
    "mark": "erc_contact.error.strategy",
    "other_solutions": "erc_contact.error.multiplicity",
    "potential_energy": "erc_contact.error.bounds",
    "read_deck": "erc_contact.decks.deck",
    "read_history": "erc_contact.run.saved",
    "resultant": "erc_contact.error.bounds",
    "size_map": "erc_contact.error.sizes",
    "solve": "erc_contact.newton.solve",
    "stiffness": "erc_contact.error.stiffness",
    "work_of_loads": "erc_contact.error.bounds",
}
"""Names of what is done with a scene -> their modules, imported when asked for.

Declaring a scene on a mesh needs no solver.
"""
_ROOMS = ("output", "results")
"""Packages whose functions users call by them, imported likewise."""
name_nearest(__name__, set(__all__) - set(_LATE))


def __getattr__(name: str) -> Any:
    """Import what a scene alone does not need, and look the version up."""
    if name == "__version__":
        return versions()["erc_contact"]
    if name in _ROOMS:
        return importlib.import_module(f"{__name__}.{name}")
    if name not in _LATE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = importlib.import_module(_LATE[name])
    name_nearest(module.__name__, [name])
    globals()[name] = getattr(module, name)
    return globals()[name]


def __dir__() -> list[str]:
    """List the public names alone, which users complete and see in ``dir``."""
    return sorted([*__all__, "goals", *_ROOMS])
