"""Solve the elastic equations of a body; nothing here knows a contact method.

:class:`~erc_contact.newton.linear.solver.ElasticSolver` is what the solvers are to
others. Two modules make one: :mod:`~erc_contact.newton.linear.stiffness` with a factor
of MUMPS, :mod:`~erc_contact.newton.linear.multigrid` with conjugate gradients.
``tests/base/test_imports.py`` checks that nothing here imports from elsewhere in
``newton``.
"""
