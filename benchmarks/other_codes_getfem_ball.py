"""Solve the layer on a ball of other_codes.py with GetFEM, in the Python that has it.

    python3 other_codes_getfem_ball.py FOLDER

It reads FOLDER/scene.npz and prints force, energy, unknowns, iterations and seconds as
JSON. GetFEM has no axisymmetric elements: the weight of the rings and the hoop strain
are written by hand. Displacements of degree 2, a multiplier of degree 1 on the bottom,
Alart and Curnier's augmented Lagrangian in integral form.
"""

import json
import sys
from pathlib import Path
from time import process_time

import getfem as gf  # type: ignore[import-not-found]
import numpy as np

scene = np.load(Path(sys.argv[1]) / "scene.npz")
outer, height, depth, radius = scene["sizes"]
young, nu = scene["moduli"]
TOP, AXIS, CONTACT = 1, 2, 3

began = process_time()
model = gf.Model("real")
mesh = gf.Mesh("empty", 2)
corners = scene["points"][scene["triangles"]]
mesh.add_convex(gf.GeoTrans("GT_PK(2,1)"), np.transpose(corners, (2, 1, 0)))
boundary = mesh.outer_faces()
points = mesh.pts()
for region, axis, level in ((TOP, 1, height), (AXIS, 0, 0.0), (CONTACT, 1, 0.0)):
    sides = []
    for side in boundary.T:
        ends = mesh.pid_in_faces(side.reshape(2, 1))
        if np.all(abs(points[axis, ends] - level) < 1e-9):
            sides.append(side)
    mesh.set_region(region, np.array(sides).T)
space = gf.MeshFem(mesh, 2)
space.set_fem(gf.Fem("FEM_PK(2,2)"))
of_pressure = gf.MeshFem(mesh, 1)
of_pressure.set_fem(gf.Fem("FEM_PK(2,1)"))
integration = gf.MeshIm(mesh, gf.Integ("IM_TRIANGLE(6)"))
model.add_fem_variable("u", space)
model.add_filtered_fem_variable("p", of_pressure, CONTACT)
values = {
    "lam": young * nu / (1 + nu) / (1 - 2 * nu),
    "mu": young / (2 * (1 + nu)),
    "gamma": 10.0 * young,
    "R": radius,
}
for name, value in values.items():
    model.add_initialized_data(name, float(value))
# Of the strain, eps_rr, eps_zz, 2 eps_rz and the hoop strain u_r/r; w weighs the rings.
model.add_macro("w", "(2*pi*X(1))")
model.add_macro("hoop(v)", "(v(1)/X(1))")
model.add_macro("volume(v, D)", "(Trace(D) + hoop(v))")
model.add_nonlinear_term(
    integration,
    "w*(lam*volume(u, Grad_u)*volume(Test_u, Grad_Test_u)"
    " + 2*mu*(Sym(Grad_u):Sym(Grad_Test_u) + hoop(u)*hoop(Test_u)))",
)
# The outward normal is -z: the layer enters the ball by -u_z - gap.
model.add_macro("pushed", "pos_part(p + gamma*(-u(2) - X(1)*X(1)/(2*R)))")
model.add_nonlinear_term(integration, "-w*pushed*Test_u(2) + w/gamma*(pushed - p)*Test_p", CONTACT)
model.add_initialized_data("down", [0.0, -float(depth)])
model.add_Dirichlet_condition_with_multipliers(integration, "u", 2, TOP, "down")
model.add_initialized_data("zero", [0.0, 0.0])
model.add_initialized_data("along_r", [[1.0, 0.0], [0.0, 0.0]])
model.add_generalized_Dirichlet_condition_with_multipliers(
    integration, "u", 2, AXIS, "zero", "along_r"
)
# With the default line search Newton's method has not converged after 60 steps.
full_steps = ("lsearch", "simplest", "alpha min", 0.8)
iterations = model.solve("max_res", 1e-9, "max_iter", 60, *full_steps)[0]
density = "w*(lam*sqr(volume(u, Grad_u)) + 2*mu*(Norm_sqr(Sym(Grad_u)) + sqr(hoop(u))))/2"
energy = gf.asm_generic(integration, 0, density, -1, model)
force = gf.asm_generic(integration, 0, "w*p", CONTACT, model)
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
