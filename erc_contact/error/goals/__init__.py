"""Ask for single numbers of the solution in certified intervals.

A goal is a :class:`~erc_contact.error.goals.perturbation.Perturbation`: what moves by t
in the scene, so that the number is a derivative of the energy. Admissible pairs of the
moved scenes (:mod:`~erc_contact.error.goals.moved_pairs`) give the interval
(:mod:`~erc_contact.error.goals.difference_quotient`), for several t
(:mod:`~erc_contact.error.goals.trials`).
"""
