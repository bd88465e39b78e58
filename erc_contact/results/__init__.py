"""Questions that a user asks of a result: forces, profiles of contacts, values at points, maxima.

The answers are the same on all ranks. They are read off an admissible pair, so forces balance to round-off and contact
tractions lie in the cone.
"""

from erc_contact.results.forces import Force, force, reactions
from erc_contact.results.maximum import Maximum, maximum
from erc_contact.results.points import Values, at
from erc_contact.results.profile import OPEN, SLIP, STICK, contact_status, profile
from erc_contact.results.stress import mean_stress, von_mises

__all__ = [
    "OPEN",
    "SLIP",
    "STICK",
    "Force",
    "Maximum",
    "Values",
    "at",
    "contact_status",
    "force",
    "maximum",
    "mean_stress",
    "profile",
    "reactions",
    "von_mises",
]
