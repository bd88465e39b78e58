"""Compute results of an admissible pair: forces, profiles, values at points, stresses.

They are the same on all ranks. Forces balance to round-off, and the friction law allows
the contact tractions. A :class:`erc_contact.Solution` has the same results of its own
fields as members.
"""

from erc_contact.model.contact.status import CLOSED, OPEN, SLIP, STICK
from erc_contact.model.contact_area import ContactArea, Strip
from erc_contact.model.contact_end import Estimate
from erc_contact.model.contact_force import ContactForce
from erc_contact.model.forces import Force
from erc_contact.model.maximum import Maximum
from erc_contact.model.motions.rigid_faces import Motion
from erc_contact.model.von_mises import von_mises
from erc_contact.results.forces import force, reactions, whole_force
from erc_contact.results.points import Values, along, at
from erc_contact.results.profile import contact_area, contact_force, contact_status, profile
from erc_contact.results.states import plastic_share, state
from erc_contact.results.stresses import mean_stress
from erc_contact.results.true_gaps import gap_deviation

__all__ = [
    "CLOSED",
    "OPEN",
    "SLIP",
    "STICK",
    "ContactArea",
    "ContactForce",
    "Estimate",
    "Force",
    "Maximum",
    "Motion",
    "Strip",
    "Values",
    "along",
    "at",
    "contact_area",
    "contact_force",
    "contact_status",
    "force",
    "gap_deviation",
    "mean_stress",
    "plastic_share",
    "profile",
    "reactions",
    "state",
    "von_mises",
    "whole_force",
]
