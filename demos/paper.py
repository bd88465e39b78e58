r"""
The paper's experiment: one optimal mesh
========================================

Coorevits, Hild and Hjiaj solved a block of 2 m x 7 m with friction 0.3 on 490
triangles, found it in error by 29%, asked for 10%, and made one new mesh, which was to
be optimal.

Which mesh has a prescribed error with the fewest elements? Let :math:`\varepsilon_E` be
the share of an element E in the error, :math:`\varepsilon^2 = \sum_E \varepsilon_E^2`.
Multiply its size by :math:`r_E`. In the plane E becomes :math:`r_E^{-2}` elements, and
with elements of degree 1 its share becomes :math:`r_E \varepsilon_E`. The fewest
elements with :math:`\sum r_E^2 \varepsilon_E^2 = \varepsilon_0^2` have

.. math::

    r_E = \frac{\varepsilon_0}{\sqrt{\varepsilon_E \sum_{E'} \varepsilon_{E'}}}, \qquad
    N = \frac{1}{\varepsilon_0^2} \Big(\sum_E \varepsilon_E\Big)^2 .

Each new element then has the same share. Where :math:`r_E > 1` the mesh becomes
coarser.

The loads, the supports and the material of the paper are in a figure that is lost, so
**these are ours**: the left side is held, the top is pressed down, more on the left,
and pushed to the right; chosen so that 490 triangles are in error by 29% as in the
paper. What can be compared is how near one remeshing comes to the 10% asked for, and
:math:`N \varepsilon^2`, which stays as it is where the error falls like
:math:`N^{-1/2}`.
"""

from pathlib import Path

import erc_contact as ec
from erc_contact.output import draw_error, draw_meshes, draw_sizes

ACCURACY = 0.10
PAPER = [(490, 0.2890), (2964, 0.1178)]

# %%
# The scene, and a first mesh of nearly equal triangles.

scene = ec.Scene(
    material=ec.Elastic(E=1.0, nu=0.3),
    supports=[ec.Displacement("left", (0.0, 0.0))],
    loads=[ec.Traction("top", (0.02, lambda x: -0.02 * (2.5 - x[0])))],
    contacts=[ec.Contact("bottom", friction=0.3)],
)
block = ec.rectangle((0.0, 0.0), (2.0, 7.0), cells=(2, 7)).remeshed(
    0.2568
)  # nearly equal triangles, 490
folder = Path("results/paper")

# %%
# Solve, measure, mesh anew; until the accuracy is reached.


def measured(domain, tighten, start=None):
    """The error of a mesh."""
    return ec.constitutive_error(
        ec.equilibrate(ec.solve(scene, domain, start=start), tighten=tighten)
    )


def experiment(tighten):
    """Errors of the first mesh and of optimal ones, and the sizes between them."""
    errors, sizes = [measured(block, tighten)], []
    while not sizes or errors[-1].relative > ACCURACY:
        solution = errors[-1].solution
        sizes.append(ec.size_map(errors[-1], ec.SizeMap().aim * ACCURACY))
        errors.append(
            measured(solution.domain.remeshed(sizes[-1]), tighten, start=solution)
        )
    return errors, sizes


def table(title, rows):
    """Lines of a table: elements, error, N eps^2."""
    return [
        title,
        *(
            f"  {cells:6d} elements  eps {eps:7.2%}  N eps^2 {cells * eps**2:6.1f}"
            for cells, eps in rows
        ),
    ]


def rows_of(errors):
    """Number of elements and relative error."""
    return [(e.domain.cells, e.relative) for e in errors]


# %%
# Once as in the paper, once with a tightened stress, which makes the same error on far
# fewer elements.

loose, sizes = experiment(tighten=0)
tight, _ = experiment(tighten=10)
lines = [
    *table("the paper, its own loads, remeshed once to 10%", PAPER),
    *table("this demo, loads of ours, remeshed to 10%", rows_of(loose)),
    f"  predicted: {', '.join(f'{s.predicted_cells:.0f}' for s in sizes)} elements",
    *table(
        "the same with tightened stresses (coarser than the first mesh)", rows_of(tight)
    ),
]
comm = block.comm
if comm.rank == 0:
    print("\n".join(lines))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "table.txt").write_text("\n".join(lines) + "\n")
comm.barrier()

# %%
# The meshes, the map of :math:`\varepsilon_E`, and the map of :math:`r_E`.

draw_meshes([(e.domain, e.indicators) for e in loose], folder / "meshes.png")
draw_error(loose[0], folder / "error_map.png")
draw_sizes(sizes[0], folder / "ratio_map.png")

# %%
# What must hold: the first mesh is in error as much as the paper's; one remeshing
# reaches the accuracy (the paper's missed it by 18%) with half of the paper's 2964
# elements, as many as predicted; N eps^2 stays below the paper's 41; a tightened stress
# needs less than half of the elements.

(first, eps), (cells, reached) = rows_of(loose)
assert abs(first - 490) <= 10
assert abs(eps - 0.29) < 0.01
assert reached <= ACCURACY
assert cells <= 1500
assert cells * reached**2 <= 41
assert abs(cells / sizes[0].predicted_cells - 1) < 0.05
assert tight[-1].relative <= ACCURACY
assert tight[-1].domain.cells < cells / 2
