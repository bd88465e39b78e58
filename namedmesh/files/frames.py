"""Coordinate systems in which files give nodes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from namedmesh.base.exceptions import InputError

IN_LINE = 1e-8
"""Sine of an angle between directions that is none [-]."""


def as_given(x: np.ndarray) -> np.ndarray:
    """Return Cartesian coordinates as they are."""
    return x


def of_cylinder(x: np.ndarray) -> np.ndarray:
    """Return points (r, theta in degrees, z) as (x, y, z), shape (n, 3)."""
    r, degrees, z = x.T
    theta = np.radians(degrees)
    return np.column_stack([r * np.cos(theta), r * np.sin(theta), z])


def of_sphere(x: np.ndarray) -> np.ndarray:
    """Return points (r, theta, phi) as (x, y, z), shape (n, 3).

    theta is the angle from the axis z and phi the angle around it, from x, in degrees.
    """
    r, from_axis, around = x.T
    theta = np.radians(from_axis)
    phi = np.radians(around)
    of_plane = r * np.sin(theta)
    return np.column_stack([of_plane * np.cos(phi), of_plane * np.sin(phi), r * np.cos(theta)])


@dataclass(frozen=True, eq=False)
class Frame:
    """Represent a coordinate system.

    Args:
        origin: Its origin [length], shape (3,).
        axes: Its unit vectors, row by row, shape (3, 3).
        straight: Function that makes Cartesian coordinates of its own.
    """

    origin: np.ndarray
    axes: np.ndarray
    straight: Callable[[np.ndarray], np.ndarray] = as_given

    def place(self, x: np.ndarray) -> np.ndarray:
        """Return points of this system in the basic system [length], shape (n, 3)."""
        return self.origin + self.straight(x) @ self.axes


def frame_of(
    origin: np.ndarray, first: np.ndarray, beside: np.ndarray, number: int, what: str
) -> Frame:
    """Return the system of three points.

    Args:
        origin: The origin [length], shape (3,).
        first: A direction along an axis, shape (3,).
        beside: A direction in the plane of this axis and the next axis in the order x,
            y, z, x, on the side of that.
        number: Number of the axis along ``first``: 0 for x, 2 for z.
        what: What it is called in the message.

    Raises:
        InputError: If the directions are in line.
    """
    normal = np.cross(first, beside)
    lengths = np.linalg.norm(first) * np.linalg.norm(beside)
    if not np.linalg.norm(normal) > IN_LINE * lengths:
        raise InputError(f"{what} is of three points in a line; look at its card.")
    along = first / np.linalg.norm(first)
    up = normal / np.linalg.norm(normal)
    axes = [along, np.cross(up, along), up]
    return Frame(origin, np.roll(axes, number, axis=0))
