"""Constants of the two searches for t, in the order in which a run meets them.

The search of :mod:`erc_contact.error.goals.goal_error` asks for the narrowest interval
on one mesh. The search of :mod:`erc_contact.error.goals.controller` asks on every mesh
of a run whether the interval is narrow enough, with as few solved scenes as can be.
Both step by :class:`erc_contact.error.goals.trials.Trials`.
"""

LEAST_ERROR = 1e-6
"""Relative error that t is chosen for at least [-].

The number is a difference over t. A smaller t would be no better where the error is
smaller, and show its round-off.
"""

FACTOR = 10.0
"""Largest ratio of one t to the next that is tried [-]."""
GROWTH = 3.0
"""The same where a larger t is not tried at once [-]."""
POWER = 2
"""Power of t with which a motion that changes the contact set moves both V apart.

Where it moves the edge of a contact by t, the pressure is like the root of the distance
to the edge, and the gap like its third power.
"""
COUNT_OF_T = 60
"""Number of values of t among which the better one is chosen."""
NEAR = 1.5
"""Ratio of two t below which they are as good as each other [-]."""

LARGEST_COUNT = 6
"""Number of values of t that are tried at most for the narrowest interval."""
NARROWER = 0.9
"""Width over the width of the best t so far from which no other t is tried [-]."""

FIRST = 3.0
"""First t of a run over the t of a perturbation [-]: about the best, as measured."""
GUESSES = 2
"""Number of values of t for which a run estimates the interval of a mesh at most."""
COUNT = 3
"""Number of values of t that a run tries at most on a mesh where it may end."""
LAST_COUNT = 2
"""The same on the last mesh of a run that ends for another reason."""
CLOSE = 1.3
"""Half width over the half width asked for from which another t may be enough [-]."""
CHANGED = 0.5
"""Part of a width that changes of the contact set make where t is far too large [-]."""
