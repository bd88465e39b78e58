"""Put the loads of a scene on a mesh: their densities as UFL."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from ufl.algorithms import extract_type

from erc_contact.base.exceptions import InputError
from erc_contact.base.ufl_types import Ufl
from erc_contact.model.data.expressions import Everywhere
from erc_contact.model.data.symbolic import sum_of, varies_in_cells
from erc_contact.model.data.users import IN_UFL, call_of_user, vector
from erc_contact.model.data.values import DATA_DEGREE, value_of, without_plain_numbers
from erc_contact.model.space import Space
from erc_contact.scene.load import Load
from erc_contact.scene.material import parameter
from namedmesh.simplex import rule


@dataclass(frozen=True, eq=False)
class SurfaceLoad:
    """Hold a load on a part of the boundary of a mesh.

    Attributes:
        facets: Name of the boundary part.
        ds: Measure of the part.
        density: Force per area [force/area], times the circumference if there is one,
            UFL, shape (d,).
    """

    facets: str
    ds: Ufl
    density: Ufl

    @property
    def varies(self) -> bool:
        """Tell whether the load varies inside facets."""
        return varies_in_cells(self.density)


def bind_loads(space: Space, loads: Sequence[Load]) -> tuple[list[SurfaceLoad], Ufl | None]:
    """Put loads on a mesh; collective.

    Returns:
        The loads on parts of the boundary, and the sum of the loads in the body
        [force/volume], UFL of shape (d,), or None without them.

    Raises:
        InputError: If a density has another shape, is not finite, or the code of the
            user raises.
    """
    on_surface = []
    in_body = []
    densities = [_density(space, load) for load in loads]
    for load, density in zip(loads, densities, strict=True):
        if load.facets is None:
            in_body.append(density)
        else:
            ds = space.ds(space.domain.tag(load.facets))
            on_surface.append(SurfaceLoad(load.facets, ds, density))
    return on_surface, sum_of(in_body)


def _density(space: Space, load: Load) -> Ufl:
    """Return the density of a load [force/area] or [force/volume], UFL; collective.

    Raises:
        InputError: If it has another shape than (d,), is not finite, or the code of the
            user raises.
    """
    on_boundary = load.facets is not None
    what = type(load).__name__
    if on_boundary:
        what += f"({load.facets!r})"
    parameters = {}
    for name in load.parameters:
        what_value = what if name == "value" else f"{what}: {name}"
        parameters[name] = value_of(space, parameter(load, name), what_value)
    normal = space.n if on_boundary else None

    def call() -> Ufl:
        return vector(load.density(space.x, normal, **parameters))

    density = without_plain_numbers(call_of_user(space.comm, what, call), space.mesh)
    if density.ufl_shape != (space.d,):
        raise InputError(
            f"{what} has shape {density.ufl_shape}; the mesh needs ({space.d},). {IN_UFL}"
        )
    if varies_in_cells(density):
        entities = space.owned_cells
        if load.facets is not None:
            entities = space.domain.facets(load.facets)
        points, _ = rule(space.d - 1 if on_boundary else space.d, DATA_DEGREE)
        values = space.evaluate(density, points, entities)
        if not np.isfinite(space.extremes(values)).all():
            raise InputError(f"{what} is not finite everywhere; look at its callables.")
    region = getattr(load, "region", None)
    if region is not None:
        density = space.indicator(space.domain.region(region)) * density
    # A pressure acts on the vector area, which facets share with the true surface.
    if load.facets is not None and not extract_type(density, ufl.FacetNormal):
        factor = space.area_factor(load.facets)
        density = density if factor is None else factor * density
    return space.on_meridian(density)


class HoopLoad:
    """Hold the body force that is the hoop component of a stress.

    Args:
        hoop: This component at points of cells, None without any.
    """

    def __init__(self, hoop: Everywhere | None) -> None:
        self.hoop = hoop

    def plus(
        self, stress: np.ndarray, x: np.ndarray, cells: np.ndarray, *, sign: float = 1.0
    ) -> np.ndarray:
        """Add the hoop component to stresses at points, in place.

        Args:
            stress: Mandel components, the hoop component last, shape (n, q, s).
            x: The points [length], shape (n, q, d).
            cells: Their cells, shape (n,).
            sign: Factor of the component.

        Returns:
            The stresses.
        """
        if self.hoop is not None:
            stress[..., -1] += sign * self.hoop(x, cells.astype(np.int32))
        return stress

    def minus(self, stress: np.ndarray, x: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Subtract the hoop component from stresses at points, see :meth:`plus`."""
        return self.plus(stress, x, cells, sign=-1.0)


def bind_hoop_load(space: Space, body_force: Ufl | None) -> HoopLoad:
    """Put the part of a body force that is a hoop stress on a mesh; collective.

    Args:
        space: The mesh.
        body_force: The body force [force/volume], UFL, shape (d,), or None.
    """
    hoop = space.section.hoop_density(body_force)
    return HoopLoad(None if hoop is None else space.everywhere(hoop))
