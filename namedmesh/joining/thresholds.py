"""Thresholds that several ways to join sides have in common.

A way that needs another value says so beside it. Lengths are shares of an edge or facet
of the sides.
"""

SAME = 1e-3
"""Distance that counts as none, as numbers in a file have it, by the edge [-]."""
CLOSE = (0.4, 0.2, 0.05)
"""Distance below which points of both sides become one, by the shorter edge [-].

A smaller one is taken if the larger one would crush a cell or a triangle.
"""
CRUSHED = 0.25
"""Least share of its measure that a cell or triangle keeps when points move [-]."""
CORNER = 0.7
"""Angle at which a side has a corner, whose vertex stays where it is [rad]."""
FACING = 0.5
"""Least cosine of the angle between facets that face each other [-]."""
LEAST_ANGLE = 2.0
"""Least angle of new triangles of a surface [degrees]."""
