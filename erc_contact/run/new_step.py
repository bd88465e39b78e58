"""Make the row of a mesh of an adaptive run."""

from __future__ import annotations

from time import perf_counter

from mpi4py import MPI

from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.results.peaks import peaks
from erc_contact.run.step import Step


def new_step(error: ConstitutiveError, mesh_seconds: float, began: float) -> Step:
    """Make the row of a mesh; collective.

    Args:
        error: The error on the mesh.
        mesh_seconds: Wall time of making the mesh [s].
        began: Time at which the run began, as ``perf_counter`` has it [s].
    """
    admissible = error.admissible
    solution = admissible.solution
    model = solution.model
    domain = solution.domain
    scale = error.scale or 1.0
    greatest = peaks(admissible)
    return Step(
        cells=domain.cells,
        vertices=domain.vertices,
        dofs=model.V.dofmap.index_map.size_global * domain.dim,
        newton_steps=solution.newton_steps,
        method=type(solution.method).__name__,
        eps=error.relative,
        eps_bulk=error.bulk_error / scale,
        eps_contact=error.contact_error / scale,
        eps_geometry=error.geometry_error / scale,
        solve_seconds=solution.seconds,
        equilibrate_seconds=admissible.seconds,
        error_seconds=error.seconds,
        mesh_seconds=mesh_seconds,
        seconds=model.comm.allreduce(perf_counter() - began, MPI.MAX),
        **greatest,
    )
