"""Mesh drawings of CAD programs: solids become regions, their faces get numbers."""
