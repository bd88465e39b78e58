"""Prove bounds and uniqueness with Coulomb friction.

:mod:`~erc_contact.error.coulomb.certificate` has the theorem; the norm q that it needs
is computed by :mod:`~erc_contact.error.coulomb.coupling`.
"""
