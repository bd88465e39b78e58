"""Reconstruct the stress of axisymmetric bodies."""
