"""Bring meshes of other programs in: cells of any shape become simplices, sets names.

A reader makes a :class:`~namedmesh.files.file_mesh.FileMesh` of a file. It is
cleaned, split into simplices, and its sets become boundary parts and regions.
"""
