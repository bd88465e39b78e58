"""Read orthotropic moduli and their axes."""

from __future__ import annotations

from dataclasses import replace
from itertools import chain

import numpy as np

from erc_contact.base.exceptions import InputError
from erc_contact.decks.reading import DeckReading, MaterialCards, SolidSection
from erc_contact.decks.told import numbers_in
from erc_contact.scene.orthotropic import OrthotropicElastic
from namedmesh.for_solvers import Card, DeckSpace

STIFFNESSES = ("ORTHO", "ORTHOTROPIC")
"""Values of TYPE of entries of the stiffness."""
CONSTANTS = ("ENGINEERING CONSTANTS", "ENGINEERINGCONSTANTS")
"""Values of TYPE of engineering constants."""
COUNT = 9
"""Moduli of an orthotropic material."""
UPRIGHT = 1e-9
"""Error of a third axis that is out of the plane [-]."""


def read_orthotropic(reading: DeckReading, card: Card, material: MaterialCards) -> None:
    """Read the stiffness or the constants of an orthotropic material."""
    numbers = list(chain.from_iterable(numbers_in(card, line) for line in range(len(card.lines))))
    if not COUNT <= len(numbers) <= COUNT + 1:
        reading.told.refuse(
            card, f"it has {len(numbers)} numbers; give the nine moduli of one temperature."
        )
        return
    try:
        if card.get("TYPE").upper() in CONSTANTS:
            E, nu, G = (_three(numbers[i : i + 3]) for i in (0, 3, 6))
            material.orthotropic = OrthotropicElastic(E, nu, G)
        else:
            material.orthotropic = _of_stiffness(numbers)
    except (InputError, np.linalg.LinAlgError) as reason:
        reading.told.refuse(card, f"it is no stiffness. {reason}")


def _of_stiffness(D: list[float]) -> OrthotropicElastic:
    """Return the material of ``D1111, D1122, D2222, D1133, D2233, D3333``, and G."""
    stiffness = np.array([[D[0], D[1], D[3]], [D[1], D[2], D[4]], [D[3], D[4], D[5]]])
    S = np.linalg.inv(stiffness)
    E = 1 / np.diag(S)
    nu = [float(-S[i, j] * E[i]) for i, j in ((0, 1), (0, 2), (1, 2))]
    return OrthotropicElastic(_three(E.tolist()), _three(nu), _three(D[6:9]))


def _three(values: list[float]) -> tuple[float, float, float]:
    """Return three numbers as a tuple."""
    first, second, third = values
    return first, second, third


def read_orientation(reading: DeckReading, card: Card, space: DeckSpace) -> None:
    """Keep axes until an orthotropic section asks for them."""
    reading.orientations[card.get("NAME").upper()] = card


def rectangular(numbers: list[float]) -> np.ndarray:
    """Return axes as rows, of a point a on the first axis and a point b in their plane.

    Args:
        numbers: a and b [length], and the origin if it is another point.
    """
    a, b, *origin = np.array([*numbers, *([0.0] * 9)][:9]).reshape(3, 3)
    x = a - origin[0]
    z = np.cross(x, b - origin[0])
    x /= np.linalg.norm(x)
    z /= np.linalg.norm(z)
    return np.array([x, np.cross(z, x), z])


def turned(reading: DeckReading, material: MaterialCards, section: SolidSection) -> MaterialCards:
    """Return a material in the axes of a section."""
    law = material.orthotropic
    if law is None or not section.orientation:
        return material
    card = reading.orientations.get(section.orientation)
    told = reading.told
    if card is None:
        told.refuse(section.card, f"no *ORIENTATION is called {section.orientation!r}.")
        return material
    if card.get("SYSTEM").upper() not in ("", "RECTANGULAR"):
        told.refuse(card, f"SYSTEM={card.get('SYSTEM')}: rectangular axes alone are read.")
        return material
    if any(numbers_in(card, 1)[1:]):
        told.refuse(card, "axes that are turned by a second line are not read; give them turned.")
        return material
    axes = rectangular(numbers_in(card))
    if reading.mesh.d == 2 and abs(abs(axes[2, 2]) - 1.0) > UPRIGHT:
        told.refuse(card, "the third axis of a plane body has to be out of the plane.")
        return material
    return replace(material, orthotropic=replace(law, axes=axes.tolist()))
