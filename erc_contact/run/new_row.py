"""Make the row of a mesh of an adaptive run, and of a step of a loading history."""

from __future__ import annotations

from time import perf_counter

from mpi4py import MPI

from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.results.peaks import peaks
from erc_contact.run.energy import energies
from erc_contact.run.history import History
from erc_contact.run.step import Step
from erc_contact.run.time_row import SUMS, TimeStep


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


def new_row(
    time: float, history: History, last: ConstitutiveError | None, before: TimeStep | None
) -> TimeStep:
    """Make the row of a step; collective. Its seconds are not known yet.

    Args:
        time: Its end.
        history: The adaptive run at its end.
        last: The error at the end of the last step; None at the first time.
        before: The row of the last step.
    """
    error = history.best
    energy = energies(error, last)
    # energies are sums from the first time on
    sums = dict.fromkeys(SUMS, 0.0)
    if before is not None:
        sums = {name: getattr(before, name) for name in SUMS}
    forces = {}
    moments = {}
    for contact in error.solution.model.contacts:
        resultant = error.force(contact.name)
        forces[contact.name] = resultant.force.tolist()
        moments[contact.name] = resultant.moment.tolist()
    return TimeStep(
        time=time,
        cells=error.domain.cells,
        meshes=len(history.steps),
        newton_steps=sum(step.newton_steps for step in history.steps),
        eps=error.relative,
        eps_contact=error.contact_error / (error.scale or 1.0),
        total=error.total,
        reached=history.reached,
        force=forces,
        moment=moments,
        work=sums["work"] + energy.work,
        contact_work=sums["contact_work"] + energy.contact,
        friction_work=sums["friction_work"] + energy.friction,
        dissipated=sums["dissipated"] + energy.dissipated,
        stored=energy.stored,
        scale=error.scale,
        solve_seconds=sum(step.solve_seconds for step in history.steps),
        equilibrate_seconds=sum(step.equilibrate_seconds for step in history.steps),
        seconds=0.0,
    )
