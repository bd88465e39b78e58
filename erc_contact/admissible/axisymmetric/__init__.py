"""Reconstruct the stress of axisymmetric bodies, whose hoop force is free in each cell."""
