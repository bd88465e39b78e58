"""A contact problem with a continuum of solutions, and how it is reported.

Coulomb friction can have many static solutions where it is strong. The triangle (0, 0), (1, 0), (0.4, 0.3) of E = 1.2
and nu = 0.2 stands on its lower side; its left side is moved by (0.1 + 8/15 y, -0.1 y), its right side pulled by
sqrt(5)/10. With mu = 2 every displacement

    u = (0.1 + 8/15 y + a (x - 4 y/3), -0.1 y),    -0.1 <= a <= 0.4,

is a solution: the error in the constitutive relation vanishes for each of them, and which one a solver returns depends
on where it starts. ``Solution.singular`` says so: the tangent of the contact problem has no inverse there.
``other_solutions`` finds some of the others. With mu = 1.9 there is one solution, a = 0.4, but ``coulomb_certificate``
proves that there is no other one below about mu = 1.2 only.

Source of the case: P. Hild, "Non-unique slipping in the Coulomb friction model in two-dimensional linear elasticity",
Q. J. Mech. Appl. Math. 57 (2004), has the construction.
"""

import numpy as np

import erc_contact as ec

import gmsh  # isort: skip


def triangle():
    """The triangle from gmsh, its sides named."""
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    geo = gmsh.model.geo
    points = [geo.addPoint(x, y, 0.0, 0.2) for x, y in ((0.0, 0.0), (1.0, 0.0), (0.4, 0.3))]
    sides = [geo.addLine(points[i], points[(i + 1) % 3]) for i in range(3)]
    surface = geo.addPlaneSurface([geo.addCurveLoop(sides)])
    geo.synchronize()
    for side, name in zip(sides, ("foot", "pulled", "held"), strict=True):
        gmsh.model.addPhysicalGroup(1, [side], name=name)
    gmsh.model.addPhysicalGroup(2, [surface], name="body")
    domain = ec.from_gmsh(gmsh.model)
    gmsh.finalize()
    return domain


ec.log_to_console()
domain = triangle()
for friction in (0.9, 1.9, 2.0):
    scene = ec.Scene(
        material=ec.Elastic(E=1.2, nu=0.2),
        supports=[ec.Displacement("held", (lambda x: 0.1 + 8 / 15 * x[1], lambda x: -0.1 * x[1]))],
        loads=[ec.Traction("pulled", (5**0.5 / 10, 0.0))],
        contacts=[ec.Contact("foot", friction=friction)],
    )
    solution = ec.solve(scene, domain)
    error = ec.constitutive_error(ec.equilibrate(solution))
    comm = domain.mesh.comm
    largest = max(comm.allgather(float(np.abs(solution.u.x.array).max(initial=0.0))))
    if comm.rank == 0:
        verdict = "one of many" if solution.singular else "the only one near"
        print(f"friction {friction}: largest displacement {largest:.4f}, eps = {error.relative:.1e}, {verdict}")
    certificate = ec.coulomb_certificate(error)
    others = ec.other_solutions(solution)
    if comm.rank == 0:
        print(f"  {certificate}")
        print(f"  {len(others)} other solutions found, eps = {', '.join(f'{one.relative:.1e}' for one in others)}")

    assert solution.singular == (friction == 2.0)
    assert certificate.unique == (friction == 0.9)
    assert (len(others) >= 2) == (friction == 2.0)
    assert all(one.relative < 1e-5 for one in [error, *others])
    if friction < 2.0:
        assert abs(largest - 0.5) < 1e-4
