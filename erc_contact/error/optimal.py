"""The strategy that meshes the true geometry anew, with the sizes of the optimal mesh.

Source: Coorevits, Hild, Hjiaj, the section on adaptivity; the leaps are ours.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, log

from erc_contact.base.exceptions import InputError
from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.error.sizes import is_out_of_reach, size_map
from erc_contact.error.strategy import mark, refined
from namedmesh import Domain
from namedmesh.base import checks
from namedmesh.base.percent import percent

CLOSE = 1.2
"""Multiple of the accuracy below which no gain by other sizes is expected [-].

The prediction is right to 5 or 10% only, so a new mesh of nearly the same sizes might
miss the accuracy again and again.
"""
CLOSURE = 1.5
"""Multiple of the cells of a new mesh up to which marked elements are refined [-].

Refinement is sure to gain. But where sizes vary much in 3D, bisection of an element
takes dozens of others with it.
"""


@dataclass(frozen=True)
class SizeMap:
    """Mesh the true geometry again with the optimal sizes.

    They may be larger than before.

    Args:
        aim: Factor of the accuracy for which the sizes are optimal. It is below 1,
            because a mesh that just misses the accuracy costs another mesh. A mesh that
            is 5% below the accuracy costs only 10% more elements (degree 1, 2D).
        leap: Greatest factor by which the error is to fall from one mesh to the next. A
            larger fall takes several equal steps, because a coarse mesh predicts the
            sizes of a much finer one badly.

    Raises:
        InputError: If aim is outside (0, 1], or leap is not > 1.

    Example:
        >>> ec.SizeMap().next(error, accuracy=0.1, max_cells=1000)
        <Domain in 2D: ... cells, boundary parts left, right, bottom, top>
    """

    aim: float = 0.95
    leap: float = 4.0

    def __post_init__(self) -> None:
        checks.fraction("SizeMap: aim", self.aim)
        if checks.positive("SizeMap: leap", self.leap, "> 1") <= 1:
            raise InputError(f"SizeMap: leap is {self.leap!r}; it must be > 1.")

    def next(self, error: ConstitutiveError, accuracy: float, max_cells: int) -> Domain:
        """Return the domain meshed again; collective.

        Where the error is near the accuracy, it has marked elements refined instead,
        unless they take many others with them.

        Raises:
            InputError: If the accuracy takes more cells than allowed, as far as this
                mesh can predict, or the geometry is not known or cannot be meshed.
        """
        aim = self.aim * accuracy
        domain = error.domain
        if error.total <= CLOSE * accuracy:
            # Halving an element leaves 4^-k of its squared error.
            gain = 1 - 4.0**-error.degree
            fraction = min((1 - (aim / error.total) ** 2) / gain, 1.0)
            finer = refined(domain, mark(error, fraction), max_cells)
            # With the present distribution of sizes.
            cells = domain.cells * (error.total / aim) ** (domain.dim / error.degree)
            if finer.cells <= CLOSURE * cells or domain.geometry is None:
                return finer
            sizes = size_map(error, aim)
            scale = (sizes.predicted_cells / cells) ** (1 / domain.dim)
            return domain.remeshed(min(scale, 1.0) * sizes.values)
        fall = error.total / aim
        leaps = ceil(log(fall) / log(self.leap))
        sizes = size_map(error, error.total / fall ** (1 / leaps))
        # The next mesh may predict fewer cells, so try smaller leaps first.
        while sizes.predicted_cells > max_cells and fall ** (1 / leaps) > CLOSE:
            leaps += 1
            sizes = size_map(error, error.total / fall ** (1 / leaps))
        if sizes.predicted_cells > max_cells or is_out_of_reach(error, aim, max_cells):
            # No number is told: one mesh alone may be wrong by a factor.
            raise InputError(
                f"{percent(accuracy)} takes more cells than max_cells = {max_cells}, as far as "
                f"this mesh of {domain.cells} cells can tell; allow more, or a larger error."
            )
        return domain.remeshed(sizes)
