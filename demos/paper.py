"""The experiment of Coorevits, Hild and Hjiaj: one mesh of the block, one optimal mesh, an accuracy of 10%.

A block of 2 m x 7 m on a foundation with friction 0.3, its first mesh of 490 triangles in error by 29%. The loads, the
supports and the material of the paper are in a figure that is lost, so **these are ours**: the left side is held, the
top is pressed down, more on the left, and pushed to the right; chosen so that 490 triangles are in error by 29% as in
the paper. What can be compared is how near one remeshing comes to the 10% asked for, and N eps^2, N the number of
elements, which stays as it is where the error falls like N^-1/2. Run it with

    python demos/paper.py            or            mpirun -n 2 python demos/paper.py

and look into results/paper: the meshes, the map of eps_E, the map of the size ratio r_E, the tables.
"""

from pathlib import Path

import erc_contact as ec
from erc_contact.output import draw_error, draw_meshes, draw_sizes

ACCURACY = 0.10
PAPER = [(490, 0.2890), (2964, 0.1178)]


scene = ec.Scene(
    material=ec.Elastic(E=1.0, nu=0.3),
    supports=[ec.Displacement("left", (0.0, 0.0))],
    loads=[ec.Traction("top", (0.02, lambda x: -0.02 * (2.5 - x[0])))],
    contacts=[ec.Contact("bottom", friction=0.3)],
)
block = ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(2, 7)).remeshed(0.2568)  # nearly equal triangles, 490
folder = Path("results/paper")


def measured(domain, tighten, start=None):
    """The error of a mesh."""
    return ec.constitutive_error(ec.equilibrate(ec.solve(scene, domain, start=start), tighten=tighten))


def experiment(tighten):
    """Errors of the first mesh and of optimal ones until the accuracy is reached, and the sizes between them."""
    errors, sizes = [measured(block, tighten)], []
    while not sizes or errors[-1].relative > ACCURACY:
        solution = errors[-1].solution
        sizes.append(ec.size_map(errors[-1], ec.SizeMap().aim * ACCURACY))
        errors.append(measured(solution.domain.remeshed(sizes[-1]), tighten, start=solution))
    return errors, sizes


def table(title, rows):
    """Lines of a table: elements, error, N eps^2."""
    return [title, *(f"  {cells:6d} elements  eps {eps:7.2%}  N eps^2 {cells * eps**2:6.1f}" for cells, eps in rows)]


def rows_of(errors):
    """Number of elements and relative error."""
    return [(e.domain.cells, e.relative) for e in errors]


loose, sizes = experiment(tighten=0)
tight, _ = experiment(tighten=10)
lines = [
    *table("the paper, its own loads, remeshed once to 10%", PAPER),
    *table("this demo, loads of ours, remeshed to 10%", rows_of(loose)),
    f"  predicted: {', '.join(f'{s.predicted_cells:.0f}' for s in sizes)} elements",
    *table("the same with tightened stresses (coarser than the first mesh)", rows_of(tight)),
]
comm = block.mesh.comm
if comm.rank == 0:
    print("\n".join(lines))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "table.txt").write_text("\n".join(lines) + "\n")
comm.barrier()
draw_meshes([(e.domain, e.indicators) for e in loose], folder / "meshes.png")
draw_error(loose[0], folder / "error_map.png")
draw_sizes(sizes[0], folder / "ratio_map.png")

# What must hold: the first mesh is in error as much as the paper's; one remeshing reaches the accuracy (the paper's
# missed it by 18%) with half of the paper's 2964 elements, as many as predicted; N eps^2 stays below the paper's 41; a
# tightened stress needs less than half of the elements.
(first, eps), (cells, reached) = rows_of(loose)
assert abs(first - 490) <= 10
assert abs(eps - 0.29) < 0.01
assert reached <= ACCURACY
assert cells <= 1500
assert cells * reached**2 <= 41
assert abs(cells / sizes[0].predicted_cells - 1) < 0.05
assert tight[-1].relative <= ACCURACY
assert tight[-1].domain.cells < cells / 2
