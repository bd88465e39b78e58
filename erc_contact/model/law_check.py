"""Check at samples that a friction law has what the bound of the error needs."""

from __future__ import annotations

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.model.contact_values import friction_parameters
from erc_contact.model.foundation import ContactOnMesh
from erc_contact.model.model import Model

EXACT_BOUND = 1e-8
"""Relative difference of friction bounds that counts as none [-]."""
DECADES = 12
"""Number of powers of ten below the modulus of the pressures that try a law.

It is also tried with the pressure 0.
"""
LAW_SAMPLES = 50
"""Greatest number of places at which a law is tried on each rank.

The places with the extreme values of its parameters are added.
"""


def check_law(model: Model, contact: ContactOnMesh) -> None:
    """Check a law at samples: its bound is finite, >= 0, concave and never decreases.

    In a bilateral contact it does not depend on the pressure. Collective.
    """
    law = contact.friction.law if contact.friction else None
    what = f"Contact({contact.name!r}): the friction bound of {type(law).__name__}"
    pressure = model.stiffest() * np.logspace(-DECADES, 0, 4 * DECADES + 1)
    pressure = np.concatenate([[0.0], pressure])
    bound = _sample_bound(model, contact, pressure)

    def refuse(wrong: np.ndarray, message: str) -> None:
        """Raise on all ranks if an entry of one rank is wrong.

        The last axis of ``wrong`` counts the pressures.
        """
        example = None
        if wrong.any():
            i, j = np.argwhere(wrong)[0]
            pairs = zip(pressure[j : j + 3], bound[i, j : j + 3], strict=True)
            example = ", ".join(f"b({p:.3g}) = {b:.3g}" for p, b in pairs)
        examples = [text for text in model.comm.allgather(example) if text]
        if examples:
            raise InputError(f"{what} {message} {examples[0]}.")

    refuse(
        ~np.isfinite(bound),
        "is not finite everywhere; it must be a number for every pressure p >= 0:",
    )
    refuse(bound < 0.0, "is negative somewhere; it must be >= 0:")
    change = np.diff(bound, axis=1)
    round_off = EXACT_BOUND * np.maximum(bound[:, 1:], bound[:, :-1])
    if contact.bilateral:
        refuse(
            abs(change) > round_off,
            "depends on the pressure, and the contact is bilateral: it can pull, the tractions"
            " that it allows are no convex set, and no error can be certified. Give a bound"
            " without pressure, e.g. Tresca(limit):",
        )
    refuse(change < -round_off, "decreases with the pressure; it must not:")
    # A concave bound lies above the chord between any two of its neighbours.
    share = (pressure[1:-1] - pressure[:-2]) / (pressure[2:] - pressure[:-2])
    chord = bound[:, :-2] + share * (bound[:, 2:] - bound[:, :-2])
    refuse(
        bound[:, 1:-1] < chord - round_off[:, 1:],
        "is not concave in the pressure: the tractions that it allows are no convex set, and no"
        " error can be certified. It must lie above its chords:",
    )


def _sample_bound(model: Model, contact: ContactOnMesh, pressure: np.ndarray) -> np.ndarray:
    """Evaluate the friction bound of a contact at sampled places, for all pressures.

    The places are spread evenly over the samples of the facets of this rank, and those
    with an extreme value of a parameter are added.

    Args:
        model: The scene on a mesh.
        contact: The contact, with friction.
        pressure: Pressures [force/area], shape (p,).

    Returns:
        The bound [force/area], shape (places, p).
    """
    points = model.facet_samples
    parameters = {}
    for name, values in friction_parameters(model, contact, points).items():
        parameters[name] = values.ravel()
    count = len(contact.facets) * len(points)
    places = list(np.linspace(0, max(count - 1, 0), min(count, LAW_SAMPLES)).astype(int))
    if count:
        for values in parameters.values():
            places += [values.argmin(), values.argmax()]
    chosen = np.unique(np.array(places, dtype=int))
    # Each place gets all pressures.
    shape = (len(chosen), len(pressure))
    sampled = {}
    for name, values in parameters.items():
        sampled[name] = values[chosen][:, None] + 0.0 * pressure
    return contact.friction_bound(np.broadcast_to(pressure, shape), sampled)
