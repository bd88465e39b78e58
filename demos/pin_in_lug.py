r"""
A pin in a lug, and its clearance
=================================

A pin holds a lug that is pulled. The hole is wider than the pin by the clearance
:math:`c` of the radii. If this is large the pin touches little of the hole, as two
cylinders do; if it is small, or the pull great, the contact goes nearly half-way around.
Such a contact is called *conforming*, and Hertz's theory is not for it: the contact is
as wide as the bodies are curved.

Only one number counts, :math:`c E' / Q` with :math:`E' = E/(1 - \nu^2)` and the pull
:math:`Q` per thickness. For a plate without end and a pin of the same material A.
Persson (1964) found the half of the angle of contact :math:`\varepsilon`, with
:math:`b = \tan \varepsilon/2`, and the pressure in its middle:

.. math::

    \frac{c E'}{Q} = \frac{2 - \ln(1 + b^2) - 2 b^4}{\pi b^2 (1 + b^2)}, \qquad
    \frac{p_0 R}{Q} = \frac{2 b}{\pi \sqrt{1 + b^2}} + \frac{1}{2 \pi b^2 (1 + b^2)}
    \ln \frac{\sqrt{1 + b^2} + b}{\sqrt{1 + b^2} - b} .

Without clearance the angle is 84.8 degrees, under any pull. A real lug is not without
end. This one is five times as wide as the pin and ends three radii beyond its middle.
The pin is held at its core. There is no friction. Lengths are in mm, stresses in MPa.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import erc_contact as ec

import gmsh  # isort: skip - after erc_contact, as all that is compiled

FOLDER = Path("results/pin_in_lug")
R, CORE = 10.0, 2.0
BACK, END, HALF_WIDTH = 80.0, 30.0, 25.0
E, NU, PULL = 210e3, 0.3, 4000.0
STRAIN_MODULUS = E / (1 - NU**2)
CLEARANCES = [0.0, 0.02, 0.2]

# %%
# Half of the lug, with its hole on the pin: both sides of the contact are meshed in one
# place, whatever the clearance is.


def lug():
    """Half of the pin in half of the lug."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 8.0)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 40)
    occ = gmsh.model.occ
    plate = [(2, occ.addRectangle(-BACK, 0, 0, BACK + END, HALF_WIDTH))]
    pin = [(2, occ.addDisk(0, 0, 0, R, R))]
    core = [(2, occ.addDisk(0, 0, 0, CORE, CORE))]
    pin, _ = occ.intersect(pin, plate, removeTool=False)
    pin, _ = occ.cut(pin, core, removeTool=False)
    plate, _ = occ.cut(plate, core)
    occ.fragment(plate, pin)
    occ.synchronize()
    by_area = sorted(gmsh.model.getEntities(2), key=lambda face: occ.getMass(*face))
    for name, (_, face) in zip(("pin", "lug"), by_area, strict=True):
        gmsh.model.addPhysicalGroup(2, [face], name=name)
    parts = {"symmetry": [], "pulled": [], "core": []}
    for _, curve in gmsh.model.getEntities(1):
        left, _, _, right, high, _ = gmsh.model.getBoundingBox(1, curve)
        if high < 1e-3:
            parts["symmetry"].append(curve)
        elif right < 1e-3 - BACK:
            parts["pulled"].append(curve)
        elif right < CORE + 1e-3 and left > -CORE - 1e-3:
            parts["core"].append(curve)
    for name, curves in parts.items():
        gmsh.model.addPhysicalGroup(1, curves, name=name)
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    return domain.split({"rim": "pin", "hole": "lug"})


# %%
# At first the pin lies in the hole where it will be pressed. The gap is then
# :math:`c (1 - \cos\theta)`, data of the contact. Only the contact holds the lug.


def pulled(domain, clearance):
    """The lug under the pull, to a certified 3%."""

    def gap(x):
        return clearance * (1 - x[0] / R)

    supports = [
        ec.Displacement("core", (0.0, 0.0)),
        ec.Displacement("symmetry", (None, 0.0)),
    ]
    pull = ec.Traction("pulled", (-PULL / (2 * HALF_WIDTH), 0.0))
    contact = ec.Contact("rim", gap=gap, against="hole")
    scene = ec.Scene(ec.Elastic(E, NU), supports, pull, contacts=contact)
    return ec.adapt(scene, domain, accuracy=0.03, degree=2, strategy=ec.SizeMap())


def angle_of(contact):
    """The angle of the points of a profile, and of the end of the contact [degrees]."""
    theta = np.degrees(np.arctan2(contact["y"], contact["x"]))
    return theta, theta[contact["pressure"] > 0].max()


ec.log_to_console()
domain = lug()
runs = [pulled(domain, clearance) for clearance in CLEARANCES]
runs[1].save(FOLDER)
print([angle_of(run.profile("rim"))[1] for run in runs])
for run in runs:
    c = run.profile("rim"); th,_ = angle_of(c)
    print(run.reached, run.force("rim"), c["pressure"].max()*R/PULL, c["pressure"][th<5].mean()*R/PULL)
