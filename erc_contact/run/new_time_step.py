"""Make the row of a step of a loading history: its errors, forces and energies."""

from __future__ import annotations

from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.run.energy import energies
from erc_contact.run.history import History
from erc_contact.run.time_row import SUMS, TimeStep


def new_time_step(
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
    greatest_energy = 0.0
    if before is not None:
        sums = {name: getattr(before, name) for name in SUMS}
        greatest_energy = before.greatest_energy
    dissipated = sums["dissipated"] + energy.dissipated
    plastic_work = sums["plastic_work"] + energy.plastic
    # without stress both energies of the step are round-off
    if error.scale > 0:
        greatest_energy = max(greatest_energy, energy.stored, dissipated, plastic_work)
    linearised = error.model.linearised
    state = None if linearised is None else linearised.law.state
    moved = 0.0 if state is None else state.moved
    forces = {}
    moments = {}
    for joint in (*error.model.contacts, *error.model.ties):
        resultant = error.force(joint.name)
        forces[joint.name] = resultant.force.tolist()
        moments[joint.name] = resultant.moment.tolist()
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
        dissipated=dissipated,
        stored=energy.stored,
        scale=error.scale,
        solve_seconds=sum(step.solve_seconds for step in history.steps),
        equilibrate_seconds=sum(step.equilibrate_seconds for step in history.steps),
        seconds=0.0,
        greatest_energy=greatest_energy,
        plastic_work=plastic_work,
        moved=moved,
    )
