"""Make parts that share no face of what the cards of a deck claim.

A face may be held, loaded and in a surface, by sets that overlap. Each part has the
faces that the same claims have, and the names of these.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np

NAMELESS = "part"
"""Name of faces that the deck calls by their numbers."""
INNER = re.compile(r"_|internal", re.IGNORECASE)
"""Beginning of names of sets that programs make for their own use."""


@dataclass
class Claims:
    """Collect faces that cards speak of, by names.

    Attributes:
        known: Surfaces and sets of the deck by their faces, as bytes: their names stand
            for faces that cards call by numbers or by sets of programs.
        names: Name of each claim, "" of single nodes or faces.
        faces: Faces of each claim.
    """

    known: dict[bytes, str]
    names: list[str] = field(default_factory=list)
    faces: list[np.ndarray] = field(default_factory=list)

    def add(self, name: str, faces: np.ndarray) -> int:
        """Add a claim and return its number; equal claims are one."""
        faces = np.unique(faces)
        if not name or INNER.match(name):
            name = self.known.get(faces.tobytes(), name)
        for number, claimed in enumerate(self.names):
            if claimed == name and np.array_equal(self.faces[number], faces):
                return number
        self.names.append(name)
        self.faces.append(faces)
        return len(self.names) - 1

    def parts(self) -> tuple[dict[str, np.ndarray], list[tuple[str, ...]]]:
        """Return the faces of each part, and the names of the parts of each claim."""
        every = np.unique(np.concatenate([np.empty(0, dtype=np.int64), *self.faces]))
        claimed = np.zeros((len(every), len(self.names)), dtype=bool)
        for number, faces in enumerate(self.faces):
            claimed[np.searchsorted(every, faces), number] = True
        patterns, which = np.unique(claimed, axis=0, return_inverse=True)
        parts: dict[str, np.ndarray] = {}
        names = []
        for number, pattern in enumerate(patterns):
            words = dict.fromkeys(self.names[i] for i in np.flatnonzero(pattern))
            words.pop("", None)
            name = self._free_name(" & ".join(words) or NAMELESS, parts)
            parts[name] = every[which.ravel() == number]
            names.append(name)
        of_claim = []
        for number in range(len(self.names)):
            of_claim.append(tuple(names[i] for i in np.flatnonzero(patterns[:, number])))
        return parts, of_claim

    def _free_name(self, name: str, taken: dict[str, np.ndarray]) -> str:
        """Return a name that no part has."""
        free = name
        number = 2
        while free in taken:
            free = f"{name} {number}"
            number += 1
        return free
