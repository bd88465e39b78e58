"""Repair or speed up other libraries while this package calls them.

They are DOLFINx, FFCx, UFL, PETSc, MPI and signals. The page "What import does" has
a table of the modules, with the reason of each and when it can go.
"""
