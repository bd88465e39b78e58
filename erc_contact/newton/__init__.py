"""The contact solve: from a scene on a mesh to a Solution.

It has the methods, the elastic solvers, the contact problems, Newton's method and its
first guesses.
"""
