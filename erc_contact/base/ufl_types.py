"""The type of UFL expressions.

UFL has no type hints, so for a type checker its expressions are `Any`. The alias tells
a reader where an expression, a form or an argument of UFL is meant.
"""

from typing import Any

Ufl = Any
"""UFL expression, form or argument."""
