"""The types of UFL expressions, and of values that a user may give by them.

UFL has no type hints, so for a type checker its expressions are `Any`. The alias tells
a reader where an expression, a form or an argument of UFL is meant.
"""

from collections.abc import Callable
from typing import Any

Ufl = Any
"""UFL expression, form or argument."""
Value = float | Callable[[Any], Any]
"""A number, or a callable of the position x that returns a number or UFL of x."""
