"""Solve the elastic equations of a body: factors, substructures, multigrid, Krylov methods; no contact method.

:class:`~erc_contact.newton.linear.solver.ElasticSolver` is what they are to others. Two
modules make one: :mod:`~erc_contact.newton.linear.stiffness` with a factor of MUMPS,
:mod:`~erc_contact.newton.linear.multigrid` with conjugate gradients.
``tests/test_imports.py`` holds that nothing here imports from the rest of ``newton``.
"""
