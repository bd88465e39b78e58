"""Join the sides of bodies: their facets become pairs, at the same places.

:func:`~namedmesh.joining.joint.joint` decides how, by what the sides are:

- meshes that match, or have the same facets up to round-off:
  :mod:`~namedmesh.joining.matching`;
- curves in the plane: both get the vertices of both,
  :mod:`~namedmesh.joining.aligning`;
- plane sides in 3D: both outlines are drawn on the common plane (an imprint, as CAD
  says), and the regions behind are meshed anew,
  :mod:`~namedmesh.joining.imprint_plane`;
- curved sides in 3D: one side keeps its facets and the other takes them,
  :mod:`~namedmesh.joining.imprint_curved`; where each ends amid the other, they
  take facets in turn, :mod:`~namedmesh.joining.imprint_mutual`.

But for the joint itself all of it works on plain arrays of rank 0. Thresholds of
several ways are in :mod:`~namedmesh.joining.thresholds`.
"""
