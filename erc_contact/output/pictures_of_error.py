"""Add the pictures of an error to a gallery, the most telling picture first."""

from __future__ import annotations

from functools import partial

import numpy as np

from erc_contact.error.constitutive import ConstitutiveError
from erc_contact.output.contact_plots import plot_contact
from erc_contact.output.deformed import add_near, draw_deformed
from erc_contact.output.foundations import STILL_SHARE
from erc_contact.output.gallery import Gallery
from erc_contact.output.pictures import add_states, draw_error
from erc_contact.results import OPEN
from namedmesh.base.names import file_stem


def add_error(gallery: Gallery, error: ConstitutiveError, code: str) -> None:
    """Draw all pictures of an error that show something; collective.

    An exact solution has no map of its error, and a body that does not move is not
    drawn deformed.

    Args:
        gallery: The gallery.
        error: The error.
        code: The error as a user writes it.
    """
    if error.maximum("displacement").value > STILL_SHARE * error.domain.extent:
        words = "The deformed body."
        line = f'erc_contact.output.draw_deformed({code}, "deformed.png")'
        gallery.add("deformed.png", words, line, partial(draw_deformed, error), is_body=True)
    model = error.model
    for joint in (*model.contacts, *model.ties):
        name = joint.name
        kind = "tied joint" if joint in model.ties else "contact"
        if np.any(error.profile(name)["status"] != OPEN):
            words = f"Traction on the {kind} {joint.title}, of the admissible stress."
            file = f"contact_{file_stem(name)}.png"
            line = f"erc_contact.output.plot_contact({code}, {name!r}, {file!r})"
            gallery.add(file, words, line, partial(plot_contact, error.admissible, name))
    for contact in model.contacts:
        add_near(gallery, error, contact.name, code)
    add_states(gallery, error, code)
    if error.absolute > 0:
        words = "Share of each element in eps."
        line = f'erc_contact.output.draw_error({code}, "error_map.png")'
        gallery.add("error_map.png", words, line, partial(draw_error, error), is_body=True)
