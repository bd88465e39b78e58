"""Compliant foundations: the error in their law, their energy, and the slip on them.

A compliant foundation is a spring in a row with a stop along the normal, and
tangentially with a slider whose friction bound is b. The displacement of both, ``d =
w_n - g`` or ``d = w_t - s``, is t/k, the deflection of the spring under the traction
t, and what stop or slider take. A stop, and a slider, is a convex set K of tractions:
``p >= 0``, and ``|t| <= b``. Its potential is the support function h of K: zero for ``d
<= 0`` and infinite beyond, and ``b |d|``. So the potential of both in a row is the
infimal convolution

    psi(d) = min_v  k/2 |v|^2 + h(d - v).

Its minimum is at ``v = P/k``, where P is the traction of K nearest to ``k d``. Along
the normal it is ``k/2 <d>_+^2``, <.>_+ the positive part; tangentially it is Huber's
function, ``k/2 |d|^2`` where ``k |d| <= b`` and ``b |d| - b^2/(2 k)`` beyond. The
conjugate of an infimal convolution is the sum of the conjugates,

    psi*(t) = |t|^2/(2 k) + I_K(t),

with I_K zero in K and infinite elsewhere. So the law allows the tractions that a rigid
foundation allows, r^ is made as there, and Fenchel's inequality is, for t in K,

    psi(d) + psi*(t) - t.d  =  (|t - P|^2/2 + (P - t).(k d - P))/k  >=  0.         (F)

It is an equality exactly if ``t = P``. This is the law: ``p = k <w_n - g>_+``; and with
``t = -r_t`` it is ``t = k (w_t - s)`` where its length is below b (stick), and b in the
direction of ``w_t - s`` beyond (slip). The left sides of the normal and of the
tangential part are what e^2/2 contains
(:func:`erc_contact.error.contact_term.law_error`). With a given b both parts are
convex, and e bounds both errors as on a rigid foundation: J has the energies of the
springs, too. With Coulomb friction b is ``b(p^)``, and e^2 has a third term, in which
the slip stands for the tangential displacement.

For large k a foundation tends to a rigid one: psi to h, psi* to I_K (along the normal
with the work ``g p``), and the left side of (F) to ``p (g - w_n)`` and to ``b |w_t - s|
+ r_t.(w_t - s)``. For small k_t no shear is left.

The slip is ``w_t - s - v``. Friction dissipates energy on it alone, and the next step
of a history counts from the slip so far, s. So what the spring stores is given back.

Symbols: p pressure, t traction of the spring, r_t tangential traction on the body, w
displacement of the contact, g gap, b friction bound, s slip at the end of the last step
of a history (zero without), k stiffness of the foundation, k_t tangentially.
"""

from __future__ import annotations

import numpy as np
from dolfinx import fem

from erc_contact.admissible.traction import ContactTraction
from erc_contact.error.contact_integral import contact_integral
from erc_contact.error.contact_term import slider_of
from erc_contact.model.contact.contact_values import ContactData
from erc_contact.model.contact.foundation import pressures
from erc_contact.model.contact.jumps import kinks_on_facets
from erc_contact.model.contact.trace import split
from erc_contact.model.data.quadrature import Integral
from erc_contact.model.space import Space


def foundation_energies(
    space: Space, traction: ContactTraction, u: fem.Function, floor: float
) -> Integral:
    """Compute what a foundation stores on each facet [force length]; collective.

    It is ``int k_n/2 <u_n - g>_+^2 + |P|^2/(2 k_t)`` with the friction bound of r^, and
    0 for ghosts. The integrals may leave their share or ``floor`` unknown.
    """
    contact = traction.contact
    data = ContactData(contact, space.mesh)
    sliding = Sliding(space, traction)

    def energy(
        facet: np.ndarray, shape: np.ndarray, w: np.ndarray, n: np.ndarray, x: np.ndarray
    ) -> np.ndarray:
        w_n = split(w, n).normal
        stored = np.zeros(w_n.shape)
        stiffness = data.stiffness(facet, x)
        if stiffness is not None:
            stored += 0.5 * stiffness * np.maximum(w_n - data.gap(facet, x), 0.0) ** 2
        tangential = data.tangential_stiffness(facet, x)
        if tangential is not None:
            given_way = sliding.give_way(facet, shape, w, n, x)
            stored += 0.5 * tangential * np.sum(given_way**2, axis=-1)
        return stored

    cuts = kinks_on_facets(space, contact.data, contact.facets)
    return contact_integral(space, contact, u, energy, floor, cuts)


class Sliding:
    """Evaluate friction bound and slip of u^ on a contact; construction is collective.

    Its methods have the arguments of a density of
    :func:`erc_contact.error.contact_integral.contact_integral`.

    Args:
        model: The scene on a mesh.
        traction: r^ on the contact.
    """

    def __init__(self, space: Space, traction: ContactTraction) -> None:
        self._traction = traction
        self._data = ContactData(traction.contact, space.mesh)

    def bound(
        self, facet: np.ndarray, shape: np.ndarray, n: np.ndarray, x: np.ndarray
    ) -> np.ndarray:
        """Return the friction bound b(p^) [force/area], shape (f, q)."""
        pressure = pressures(np.matmul(shape, self._traction.values[facet]), n)
        return self._data.bound(facet, x, pressure)

    def give_way(
        self, facet: np.ndarray, shape: np.ndarray, w: np.ndarray, n: np.ndarray, x: np.ndarray
    ) -> np.ndarray | float:
        """Return the tangential deflection of the foundation, v [length].

        Shape (f, q, d); 0 on a rigid one.
        """
        tangential = self._data.tangential_stiffness(facet, x)
        if tangential is None:
            return 0.0
        slide = split(w, n).tangential
        spring = slider_of(slide, 0.0 * slide, self.bound(facet, shape, n, x), tangential)
        return spring.allowed / tangential[..., None]

    def slip(
        self, facet: np.ndarray, shape: np.ndarray, w: np.ndarray, n: np.ndarray, x: np.ndarray
    ) -> np.ndarray:
        """Return the slip ``w_t - s - v`` [length], shape (f, q, d)."""
        slide = split(w, n).tangential
        return slide - self.give_way(facet, shape, w, n, x)
