"""Solve the two blocks of other_codes.py with GetFEM, in the Python that has it.

    python3 other_codes_getfem_blocks.py FOLDER

It reads FOLDER/scene.npz and prints force, energy, unknowns, iterations and seconds as
JSON. Displacements of degree 2, a multiplier of degree 1 on the upper side, Alart and
Curnier's augmented Lagrangian in integral form.
"""

import json
import sys
from pathlib import Path
from time import process_time

import getfem as gf  # type: ignore[import-not-found]
import numpy as np

blocks = np.load(Path(sys.argv[1]) / "scene.npz")
moduli, nu, mu = blocks["moduli"], float(blocks["nu"]), float(blocks["mu"])
d = blocks["points"].shape[1]
TOP, BOTTOM, CONTACT = 1, 2, 3
INTEGRATION = {2: "IM_TRIANGLE(6)", 3: "IM_TETRAHEDRON(6)"}
ENDS = {"upper": (1.0, TOP), "lower": (-1.0, BOTTOM)}

began = process_time()
model = gf.Model("real")
integrations = {}
for index, (name, (height, held)) in enumerate(ENDS.items()):
    mesh = gf.Mesh("empty", d)
    corners = blocks["points"][blocks["cells"][blocks["region"] == index]]
    mesh.add_convex(gf.GeoTrans(f"GT_PK({d},1)"), np.transpose(corners, (2, 1, 0)))
    boundary = mesh.outer_faces()
    points = mesh.pts()
    for region, level in ((held, height), (CONTACT, 0.0)):
        sides = []
        for side in boundary.T:
            ends = mesh.pid_in_faces(side.reshape(2, 1))
            if np.all(abs(points[-1, ends] - level) < 1e-9):
                sides.append(side)
        mesh.set_region(region, np.array(sides).T)
    space = gf.MeshFem(mesh, d)
    space.set_fem(gf.Fem(f"FEM_PK({d},2)"))
    integrations[name] = gf.MeshIm(mesh, gf.Integ(INTEGRATION[d]))
    u = f"u_{name}"
    model.add_fem_variable(u, space)
    young = float(moduli[index])
    model.add_initialized_data(f"lambda_{name}", young * nu / (1 + nu) / (1 - 2 * nu))
    model.add_initialized_data(f"mu_{name}", young / (2 * (1 + nu)))
    model.add_isotropic_linearized_elasticity_brick(
        integrations[name], u, f"lambda_{name}", f"mu_{name}"
    )
    model.add_initialized_data(f"move_{name}", blocks["moves"][index])
    model.add_Dirichlet_condition_with_multipliers(integrations[name], u, 2, held, f"move_{name}")
    if name == "upper":
        pressure = gf.MeshFem(mesh, d)
        pressure.set_fem(gf.Fem(f"FEM_PK({d},1)"))
        model.add_filtered_fem_variable("traction", pressure, CONTACT)

model.add_initialized_data("r", 10.0 * float(moduli.min()))
model.add_initialized_data("friction", mu)
# The last number chooses the method with an additional augmentation: with the default,
# 1, Newton's method cycles here for this r.
model.add_integral_contact_between_nonmatching_meshes_brick(
    integrations["upper"], "u_upper", "u_lower", "traction", "r", "friction", CONTACT, CONTACT, 3
)
iterations = model.solve("max_res", 1e-9, "max_iter", 60)[0]
energy = 0.0
for name in ENDS:
    density = (
        f"(lambda_{name}*sqr(Trace(Grad_u_{name})) + 2*mu_{name}*Norm_sqr(Sym(Grad_u_{name})))/2"
    )
    energy += gf.asm_generic(integrations[name], 0, density, -1, model)
force = gf.asm_generic(integrations["upper"], 0, "traction", CONTACT, model)
print(
    json.dumps(
        {
            "force": np.ravel(force).tolist(),
            "energy": float(energy),
            "unknowns": int(model.nbdof()),
            "iterations": int(iterations),
            "seconds": process_time() - began,
        }
    )
)
