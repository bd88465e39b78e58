"""Declare springs: supports that give way in proportion to their force."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from numbers import Real
from typing import Any

from erc_contact.base.exceptions import InputError
from erc_contact.scene.checks import check_name

STIFFNESS = "a number >= 0 [force/length^3]"
"""What is allowed, in words."""


@dataclass(frozen=True)
class Spring:
    """Declare springs all over a boundary part, which pull it back to its place.

    The traction on the body is ``-k_n u_n n - k_t u_t``. No support is rigid: springs
    are a bed, a seal, a machine that gives way. The other end of the springs is moved
    by U if a Traction ``k U`` acts on the same part.

    Args:
        facets: Name of the boundary part.
        normal: k_n, force per area over displacement along the normal [force/length^3].
        tangential: k_t, that along the facet [force/length^3].

    Raises:
        InputError: If a stiffness is no finite number >= 0, or both are zero.

    Example:
        >>> ec.Spring("left", normal=100.0)
        Spring(facets='left', normal=100.0, tangential=0.0)
    """

    facets: str
    normal: float = 0.0
    tangential: float = 0.0

    def __post_init__(self) -> None:
        """Check the arguments."""
        check_name("Spring", self.facets)
        what = f"Spring({self.facets!r})"
        for name in ("normal", "tangential"):
            value: Any = getattr(self, name)
            is_number = isinstance(value, Real) and not isinstance(value, bool)
            if not is_number or not isfinite(value) or value < 0:
                raise InputError(
                    f"{what}: {name} is {value!r}; give {STIFFNESS}. Where it varies, use several"
                    " boundary parts."
                )
            object.__setattr__(self, name, float(value))
        if self.normal == self.tangential == 0.0:
            raise InputError(f"{what} has no stiffness; leave it out.")
