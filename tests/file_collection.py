"""Small files of every kind, made by gmsh, meshio, VTK, DOLFINx and by hand.

All are a body 2 x 1, in 3D 2 x 1 x 1, cut into two halves at x = 1. Its lowest side
is "foot" and its highest one "roof", of measure 2 each. A maker writes a file on rank 0.
"""

from dataclasses import dataclass, field
from itertools import product

import numpy as np

HALVES = {"left": 1.0, "right": 1.0}
SIDES = {"foot": 2.0, "roof": 2.0}
WHOLE = {"body": 2.0}


@dataclass(frozen=True)
class Case:
    """Say how a file is made, and what must come out."""

    name: str
    make: object
    dim: int = 3
    parts: dict = field(default_factory=lambda: SIDES)
    regions: dict = field(default_factory=lambda: HALVES)
    cells: int | None = None
    collective: bool = False


# -- meshes as arrays
# ---------------------------------------------------------------------------------


def grid(n, dim):
    """Points of a grid of cells with n along each unit, and its cubes or squares."""
    counts = (2 * n, n, n)[:dim]
    axes = [np.linspace(0.0, count / n, count + 1) for count in counts]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, dim)
    number = np.arange(len(x)).reshape([count + 1 for count in counts])
    low, high = slice(None, -1), slice(1, None)
    square = [(low, low), (high, low), (high, high), (low, high)]
    corners = square if dim == 2 else [(*c, z) for z in (low, high) for c in square]
    cells = np.stack([number[corner].ravel() for corner in corners], axis=1)
    return np.pad(x, ((0, 0), (0, 3 - dim))), cells


def prisms(cubes):
    return np.concatenate([cubes[:, [0, 1, 2, 4, 5, 6]], cubes[:, [0, 2, 3, 4, 6, 7]]])


FACES_OF_CUBE = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]


def pyramids(x, cubes):
    """Six pyramids of each cube, with a new point in its middle."""
    middles = x[cubes].mean(axis=1)
    apex = len(x) + np.arange(len(cubes))
    cells = [np.column_stack([cubes[:, face], apex]) for face in FACES_OF_CUBE]
    return np.vstack([x, middles]), np.concatenate(cells)


def tetrahedra(cubes):
    paths = [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)]
    place = {(0, 0, 0): 0, (1, 0, 0): 1, (1, 1, 0): 2, (0, 1, 0): 3}
    place |= {(*key[:2], 1): value + 4 for key, value in list(place.items())}
    cells = []
    for path in paths:
        at = np.zeros(3, dtype=int)
        corners = [place[tuple(at)]]
        for axis in path:
            at[axis] = 1
            corners.append(place[tuple(at)])
        cells.append(cubes[:, corners])
    return np.concatenate(cells)


def facets(kind, cells, x, up):
    """Sides of cells at the lowest and the highest place, by their shape."""
    tables = {
        "tetra": {"triangle": [(1, 2, 3), (0, 2, 3), (0, 1, 3), (0, 1, 2)]},
        "hexahedron": {"quad": FACES_OF_CUBE},
        "wedge": {
            "triangle": [(0, 1, 2), (3, 4, 5)],
            "quad": [(0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)],
        },
        "pyramid": {
            "triangle": [(0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)],
            "quad": [(0, 1, 2, 3)],
        },
        "triangle": {"line": [(0, 1), (1, 2), (2, 0)]},
        "quad": {"line": [(0, 1), (1, 2), (2, 3), (3, 0)]},
    }
    found = {}
    for shape, faces in tables[kind].items():
        rows = np.concatenate([cells[:, face] for face in faces])
        for tag, height in ((1, 0.0), (2, 1.0)):
            on = rows[np.all(abs(x[rows][..., up] - height) < 1e-9, axis=1)]
            if len(on):
                found.setdefault(shape, []).append((on, np.full(len(on), tag)))
    return {
        shape: tuple(map(np.concatenate, zip(*parts, strict=True)))
        for shape, parts in found.items()
    }


def arrays(kind, n=2):
    """Points, and cells with tags by kind: 1 foot, 2 roof, 7 left half, 8 right half."""
    dim = 2 if kind in ("triangle", "quad") else 3
    x, cubes = grid(n, dim)
    if kind == "pyramid":
        x, cells = pyramids(x, cubes)
    else:
        cells = {
            "hexahedron": cubes,
            "quad": cubes,
            "wedge": prisms(cubes) if dim == 3 else None,
            "tetra": tetrahedra(cubes) if dim == 3 else None,
            "triangle": np.concatenate([cubes[:, [0, 1, 2]], cubes[:, [0, 2, 3]]]),
        }[kind]
    half = np.where(x[cells][..., 0].mean(axis=1) < 1, 7, 8)
    return x, {kind: (cells, half), **facets(kind, cells, x, dim - 1)}


MIDDLES = {
    "line": [(0, 1)],
    "triangle": [(0, 1), (1, 2), (2, 0)],
    "quad": [(0, 1), (1, 2), (2, 3), (3, 0)],
    "tetra": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
    "hexahedron": [
        *[(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)],
        *[(0, 4), (1, 5), (2, 6), (3, 7)],
    ],
    "wedge": [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)],
    "pyramid": [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4)],
}
"""Ends of the edges with a node, in VTK's order."""
SECOND = {
    "line": "line3",
    "triangle": "triangle6",
    "quad": "quad8",
    "tetra": "tetra10",
    "hexahedron": "hexahedron20",
    "wedge": "wedge15",
    "pyramid": "pyramid13",
}


def second_order(x, cells):
    """The same with nodes amid the edges."""
    known = {}
    points = list(x)

    def middle(a, b):
        key = (min(a, b), max(a, b))
        if key not in known:
            known[key] = len(points)
            points.append((x[a] + x[b]) / 2)
        return known[key]

    new = {}
    for kind, (rows, tags) in cells.items():
        more = [[middle(row[a], row[b]) for a, b in MIDDLES[kind]] for row in rows]
        new[SECOND[kind]] = (np.hstack([rows, np.array(more)]), tags)
    return np.array(points), new


# -- by meshio
# ---------------------------------------------------------------------------------


def by_meshio(kind, ending, *, order=1, key="tag", file_format=None, sets=False, **options):
    """A file of meshio with tags at cells, or with its cell sets."""

    def make(folder):
        import meshio

        x, cells = arrays(kind)
        if order == 2:
            x, cells = second_order(x, cells)
        dim = 2 if kind in ("triangle", "quad") else 3
        blocks = [(name, rows) for name, (rows, _) in cells.items()]
        tags = [tags for _, tags in cells.values()]
        data = {} if sets else {key: tags}
        if key == "gmsh:physical":
            data["gmsh:geometrical"] = tags
        if sets:
            names = {1: "foot", 2: "roof", 7: "left", 8: "right"}
            options["cell_sets"] = {
                name: [np.flatnonzero(block == tag) for block in tags]
                for tag, name in names.items()
            }
        points = x[:, :2] if dim == 2 and ending in (".xdmf", ".su2") else x
        mesh = meshio.Mesh(points, blocks, cell_data=data, **options)
        if ending == ".med":
            mesh.cell_data = {"cell_tags": [-block for block in tags]}
            mesh.cell_tags = {-1: ["foot"], -2: ["roof"], -7: ["left"], -8: ["right"]}
        path = folder / f"body{ending}"
        mesh.write(path, file_format=file_format) if file_format else mesh.write(path)
        return path

    return make


TAGGED = {"1": 2.0, "2": 2.0}, {"7": 1.0, "8": 1.0}
NAMES_OF_GMSH = {
    "foot": np.array([1, 2]),
    "roof": np.array([2, 2]),
    "left": np.array([7, 3]),
    "right": np.array([8, 3]),
}


def cases_of_meshio():
    kinds = ("triangle", "quad", "tetra", "hexahedron", "wedge", "pyramid")
    for kind in kinds:
        dim = 2 if kind in ("triangle", "quad") else 3
        tagged = {"dim": dim, "parts": TAGGED[0], "regions": TAGGED[1]}
        orders = (1,) if kind in ("wedge", "pyramid") else (1, 2)
        for ending, order in product((".vtu", ".vtk"), orders):
            name = f"meshio {kind} of order {order}, {ending}"
            yield Case(name, by_meshio(kind, ending, order=order), **tagged)
        yield Case(f"meshio {kind}, .xdmf", by_meshio(kind, ".xdmf"), **tagged)
        yield Case(f"meshio {kind}, .med", by_meshio(kind, ".med"), dim=dim)
        names = {name: np.array([tag, d - (3 - dim)]) for name, (tag, d) in NAMES_OF_GMSH.items()}
        make = by_meshio(kind, ".msh", key="gmsh:physical", file_format="gmsh22", field_data=names)
        yield Case(f"meshio {kind}, .msh", make, dim=dim)
    for kind in ("triangle", "tetra", "quad", "hexahedron"):
        dim = 2 if kind in ("triangle", "quad") else 3
        tagged = {"dim": dim, "parts": TAGGED[0], "regions": TAGGED[1]}
        yield Case(f"meshio {kind}, .mesh", by_meshio(kind, ".mesh", key="medit:ref"), **tagged)
    yield Case("meshio hexahedron, .inp with cell sets", by_meshio("hexahedron", ".inp", sets=True))
    tagged = {"parts": TAGGED[0], "regions": TAGGED[1]}
    make = by_meshio("hexahedron", ".inp", file_format="avsucd", key="avsucd:material")
    yield Case("meshio hexahedron, .inp of AVS", make, **tagged)
    yield Case("meshio with float tags", by_floats, **tagged)
    yield Case("meshio with tags of one column", by_columns, **tagged)


def by_floats(folder):
    import meshio

    x, cells = arrays("hexahedron")
    blocks = [(name, rows) for name, (rows, _) in cells.items()]
    data = {
        "stress": [np.linspace(0.1, 0.7, len(rows)) for _, rows in blocks],
        "part": [tags.astype(float) for _, tags in cells.values()],
    }
    path = folder / "body.vtu"
    meshio.Mesh(x, blocks, cell_data=data).write(path)
    return path


def by_columns(folder):
    import meshio

    x, cells = arrays("tetra")
    blocks = [(name, rows) for name, (rows, _) in cells.items()]
    path = folder / "body.vtu"
    data = {"mat_id": [tags[:, None] for _, tags in cells.values()]}
    meshio.Mesh(x, blocks, cell_data=data).write(path)
    return path


# -- by gmsh
# ---------------------------------------------------------------------------------


def by_gmsh(ending, *, dim=3, kind="simplices", **options):
    """A file that gmsh writes of a body with named groups."""

    def make(folder):
        import gmsh

        gmsh.initialize(interruptible=False)
        try:
            gmsh.option.setNumber("General.Terminal", 0)
            gmsh.model.add("body")
            _drawn(gmsh, dim, kind)
            gmsh.model.mesh.generate(dim)
            if kind == "second order":
                gmsh.model.mesh.setOrder(2)
            for name, value in options.items():
                gmsh.option.setNumber(f"Mesh.{name}", value)
            path = folder / f"body{ending}"
            gmsh.write(str(path))
        finally:
            gmsh.finalize()
        return path

    return make


def _drawn(gmsh, dim, kind):
    """Draw two halves with groups, to be meshed by cells of a kind."""
    occ = gmsh.model.occ
    halves = [occ.addRectangle(x, 0, 0, 1, 1) for x in (0.0, 1.0)]
    occ.fragment([(2, halves[0])], [(2, halves[1])])
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.6)
    if dim == 3:
        layers = {"numElements": [2]} if kind in ("hexahedra", "prisms") else {}
        recombine = bool(layers)
        occ.extrude([(2, tag) for tag in halves], 0, 0, 1, recombine=recombine, **layers)
    occ.synchronize()
    if kind == "hexahedra":
        gmsh.option.setNumber("Mesh.RecombineAll", 1)
        for _, curve in gmsh.model.getEntities(1):
            gmsh.model.mesh.setTransfiniteCurve(curve, 3)
        for _, surface in gmsh.model.getEntities(2):
            gmsh.model.mesh.setTransfiniteSurface(surface)
    for name, height in (("foot", 0.0), ("roof", 1.0)):
        sides = [
            t for _, t in gmsh.model.getEntities(dim - 1) if _level(gmsh, dim - 1, t) == height
        ]
        gmsh.model.addPhysicalGroup(dim - 1, sides, name=name)
    for name, at in (("left", 0.5), ("right", 1.5)):
        bodies = [t for _, t in gmsh.model.getEntities(dim) if _middle(gmsh, dim, t) == at]
        gmsh.model.addPhysicalGroup(dim, bodies, name=name)


def _level(gmsh, dim, tag):
    box = np.round(gmsh.model.getBoundingBox(dim, tag), 5)
    up = dim
    return box[up] if box[up] == box[3 + up] else None


def _middle(gmsh, dim, tag):
    box = np.round(gmsh.model.getBoundingBox(dim, tag), 5)
    return (box[0] + box[3]) / 2


def cases_of_gmsh():
    for kind in ("simplices", "hexahedra", "second order"):
        for dim in (2, 3):
            name = f"gmsh {kind} in {dim}D"
            for version, binary in ((4.1, 0), (4.1, 1), (4.0, 0), (2.2, 0), (2.2, 1)):
                make = by_gmsh(".msh", dim=dim, kind=kind, MshFileVersion=version, Binary=binary)
                yield Case(f"{name}, msh {version} {'binary' if binary else ''}", make, dim=dim)
            if kind != "second order":
                yield Case(f"{name}, .med", by_gmsh(".med", dim=dim, kind=kind), dim=dim)
                yield Case(f"{name}, .unv", by_gmsh(".unv", dim=dim, kind=kind), dim=dim)
                yield Case(
                    f"{name}, .inp",
                    by_gmsh(".inp", dim=dim, kind=kind, SaveGroupsOfElements=1),
                    dim=dim,
                )
    yield Case("gmsh prisms, msh", by_gmsh(".msh", kind="prisms"))
    yield Case("gmsh prisms, .med", by_gmsh(".med", kind="prisms"))
    yield Case("gmsh prisms, .unv", by_gmsh(".unv", kind="prisms"))
    yield Case("gmsh simplices, .cgns", by_gmsh(".cgns"))
    numbers = {"parts": {"1": 2.0, "2": 2.0}, "regions": {"3": 1.0, "4": 1.0}}
    for ending in (".mesh", ".bdf"):
        yield Case(f"gmsh simplices, {ending}", by_gmsh(ending, SaveElementTagType=2), **numbers)


# -- by hand
# ---------------------------------------------------------------------------------

TYPES = {
    "triangle": "CPS3",
    "quad": "CPE4R",
    "tetra": "C3D4",
    "hexahedron": "C3D8R",
    "wedge": "C3D6",
    "pyramid": "C3D5",
    "triangle6": "CPS6",
    "quad8": "CPE8",
    "tetra10": "C3D10",
    "hexahedron20": "C3D20R",
    "wedge15": "C3D15",
}
FACE_NUMBERS = {  # faces S1, S2, ... of Abaqus
    "tetra": [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)],
    "hexahedron": [
        (0, 1, 2, 3),
        (4, 7, 6, 5),
        (0, 4, 5, 1),
        (1, 5, 6, 2),
        (2, 6, 7, 3),
        (3, 7, 4, 0),
    ],
    "wedge": [(0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)],
    "pyramid": [(0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)],
    "triangle": [(0, 1), (1, 2), (2, 0)],
    "quad": [(0, 1), (1, 2), (2, 3), (3, 0)],
}


def rows_of(numbers, width=8):
    numbers = list(numbers)
    return [", ".join(map(str, numbers[i : i + width])) for i in range(0, len(numbers), width)]


def inp_text(kind, order=1, first=1, shift=(0, 0, 0)):
    """Nodes and elements as text, the points, and the cells with their numbers."""
    x, cells = arrays(kind)
    rows, half = cells[kind]
    if order == 2:
        x, cells = second_order(x, {kind: (rows, half)})
        rows, half = next(iter(cells.values()))
    name = next(iter(cells)) if order == 2 else kind
    nodes = [f"{i + first}, {a:.15g}, {b:.15g}, {c:.15g}" for i, (a, b, c) in enumerate(x + shift)]
    elements = []
    for number, row in enumerate(rows, start=first):
        lines = rows_of([number, *(row + first)], 12)
        elements += [line + "," for line in lines[:-1]] + lines[-1:]
    head = ["*HEADING", "made by hand", "*NODE, NSET=Nall", *nodes]
    return [*head, f"*ELEMENT, TYPE={TYPES[name]}, ELSET=Eall", *elements], x, rows, half


def element_sets(half, first=1):
    left, right = (np.flatnonzero(half == tag) + first for tag in (7, 8))
    return ["*ELSET, ELSET=left", *rows_of(left), "*Elset, elset = right", *rows_of(right)]


def by_inp(kind, sides, order=1):
    """A file of Abaqus whose sides are sets of nodes, surfaces of faces or of nodes."""

    def make(folder):
        text, x, rows, half = inp_text(kind, order)
        up = 1 if kind in ("triangle", "quad") else 2
        lines = [*text, *element_sets(half)]
        for name, height in (("foot", 0.0), ("roof", 1.0)):
            nodes = np.flatnonzero(abs(x[:, up] - height) < 1e-9) + 1
            if sides == "nodes":
                lines += [f"*NSET, NSET={name}", *rows_of(nodes)]
            elif sides == "surface of nodes":
                lines += [f"*NSET, NSET=_n{name}", *rows_of(nodes)]
                lines += [f"*SURFACE, NAME={name}, TYPE=NODE", f"_n{name}"]
            else:
                lines += surface_of_faces(name, kind, x, rows, up, height)
        lines += [
            "*MATERIAL, NAME=steel",
            "*ELASTIC",
            "1., .3",
            "*SOLID SECTION, ELSET=Eall, MATERIAL=steel",
        ]
        path = folder / "body.inp"
        path.write_text("\n".join(lines))
        return path

    return make


def surface_of_faces(name, kind, x, rows, up, height):
    lines = []
    surface = [f"*SURFACE, NAME={name}, TYPE=ELEMENT"]
    for number, face in enumerate(FACE_NUMBERS[kind], start=1):
        on = np.all(abs(x[rows[:, face]][..., up] - height) < 1e-9, axis=1)
        if on.any():
            lines += [
                f"*ELSET, ELSET=_{name}_S{number}, INTERNAL",
                *rows_of(np.flatnonzero(on) + 1),
            ]
            surface.append(f"_{name}_S{number}, S{number}")
    return [*lines, *surface]


def inp_with_includes(folder):
    """As cgx writes it: mesh, sets and surfaces in files of their own; sets by GENERATE."""
    text, x, rows, half = inp_text("hexahedron")
    order = np.argsort(half, kind="stable")
    count = int((half == 7).sum())
    # The elements of the left half come first, so that ranges name both.
    begin = next(i for i, line in enumerate(text) if line.startswith("*ELEMENT")) + 1
    elements = [", ".join(map(str, [i + 1, *(row + 1)])) for i, row in enumerate(rows[order])]
    (folder / "all.msh").write_text("\n".join([*text[:begin], *elements]))
    foot = np.flatnonzero(abs(x[:, 2]) < 1e-9) + 1
    (folder / "foot.nam").write_text("\n".join(["*NSET,NSET=foot", *rows_of(foot, 1)]))
    sets = [
        "*ELSET,ELSET=left,GENERATE",
        f"1,{count}",
        "*ELSET,ELSET=right,GENERATE",
        f"{count + 1},{len(rows)},1",
    ]
    roof = surface_of_faces("roof", "hexahedron", x, rows[order], 2, 1.0)
    included = ["*INCLUDE,INPUT=all.msh", "*include, input=foot.nam"]
    path = folder / "solve.inp"
    path.write_text(
        "\n".join(["** the case", *included, *sets, *roof, "*STEP", "*STATIC", "*END STEP"])
    )
    return path


def inp_with_instances(folder):
    """A cube as a part of Abaqus, in two places of the assembly, beside a rigid shell."""
    _, x, rows, _ = inp_text("hexahedron")
    inside = rows[x[rows][..., 0].mean(axis=1) < 1]
    used = np.unique(inside)
    nodes = [f"{i + 1}, {x[i, 0]}, {x[i, 1]}, {x[i, 2]}" for i in used]
    elements = [", ".join(map(str, [i + 1, *(row + 1)])) for i, row in enumerate(inside)]
    low = used[x[used, 2] < 1e-9] + 1
    high = used[x[used, 2] > 1 - 1e-9] + 1
    lines = ["*Heading", "*Part, name=Cube", "*Node", *nodes, "*Element, type=C3D8", *elements]
    lines += ["*Nset, nset=low", *rows_of(low), "*Nset, nset=high", *rows_of(high), "*End Part"]
    lines += [
        "*Part, name=Tool",
        "*Node",
        "1, 0., 0., 9.",
        "2, 1., 0., 9.",
        "3, 1., 1., 9.",
        "4, 0., 1., 9.",
    ]
    lines += ["*Element, type=R3D4", "1, 1, 2, 3, 4", "*End Part", "*Assembly, name=Assembly"]
    lines += ["*Instance, name=left, part=Cube", "*End Instance"]
    # Turned about the z axis by half a turn, the cube lies at (-1, 0) x (-1, 0).
    lines += [
        "*Instance, name=right, part=Cube",
        "1., 0., 0.",
        "1.5, 0.5, 0., 1.5, 0.5, 1., 180.",
        "*End Instance",
    ]
    lines += ["*Instance, name=tool, part=Tool", "*End Instance", "*Node", "1, 5., 5., 5."]
    lines += ["*Nset, nset=foot, instance=left", "low", "*Nset, nset=foot, instance=right", "low"]
    lines += ["*Nset, nset=roof", "left.high, right.high", "*End Assembly"]
    path = folder / "body.inp"
    path.write_text("\n".join(lines))
    return path


def cases_by_hand():
    for kind in ("triangle", "quad", "tetra", "hexahedron", "wedge", "pyramid"):
        dim = 2 if kind in ("triangle", "quad") else 3
        for sides in ("nodes", "faces", "surface of nodes"):
            yield Case(f"inp of {kind}, sides by {sides}", by_inp(kind, sides), dim=dim)
        if kind != "pyramid":
            yield Case(f"inp of {kind} of order 2, faces", by_inp(kind, "faces", 2), dim=dim)
    yield Case("inp with includes", inp_with_includes)
    parts = {"foot": 2.0, "roof": 2.0}
    yield Case("inp with instances", inp_with_instances, parts=parts)
    yield Case("mdpa of hexahedra", by_kratos("hexahedron"))
    yield Case("mdpa of triangles", by_kratos("triangle"), dim=2)
    yield Case(
        "GetFEM, triangles",
        by_getfem,
        dim=2,
        parts={"1": 2.0, "2": 2.0},
        regions={"7": 1.0, "8": 1.0},
    )

    yield Case("inp with words before the first card", inp_with_words, regions=WHOLE)
    yield Case("inp with numbers behind an element", inp_with_more_numbers, regions=WHOLE)
    yield Case("inp of a part without an assembly", inp_of_part, regions=WHOLE)
    numbers = {"parts": {"1": 2.0, "2": 2.0}, "regions": {"7": 1.0, "8": 1.0}}
    for kind in ("triangle", "quad", "tetra", "hexahedron", "wedge", "pyramid"):
        dim = 2 if kind in ("triangle", "quad") else 3
        yield Case(f"MFEM, {kind}", by_mfem(kind), dim=dim, **numbers)
        yield Case(f"GiD, {kind}, materials", by_gid(kind), dim=dim, **numbers)
    yield Case("MFEM, hexahedra with names", by_mfem("hexahedron", named=True))
    for by_node in (False, True):
        name = f"MFEM, curved, {'by nodes' if by_node else 'by directions'}"
        yield Case(name, by_mfem("hexahedron", curved=True, by_node=by_node), **numbers)
    yield Case("GiD, hexahedra with names", by_gid("hexahedron", named=True))
    yield Case("med of version 2.3", by_old_med)
    for kind, order in product(
        ("triangle", "quad", "tetra", "hexahedron", "wedge", "pyramid"), (1, 2)
    ):
        dim = 2 if kind in ("triangle", "quad") else 3
        name = f"{kind} of order {order}"
        yield Case(f"ANSYS, {name}", by_ansys(kind, order), dim=dim)
        yield Case(f"FrontISTR, {name}", by_hecmw(kind, order), dim=dim)
        yield Case(f"code_aster, {name}", by_aster(kind, order), dim=dim)
        if order == 1 or kind == "tetra":
            yield Case(f"LS-DYNA, {name}", by_dyna(kind, order), dim=dim)
    yield Case("ANSYS, tetra of SOLID187", by_ansys("tetra", 2, of_ten=True))
    yield Case("ANSYS, hexahedra as Workbench writes them", by_ansys("hexahedron", workbench=True))
    yield Case("LS-DYNA, long fields", by_dyna("hexahedron", form="long"))
    yield Case("LS-DYNA, commas and a file included", by_dyna("wedge", form="commas"))


def inp_of_all(change, *, before="", after=""):
    """A file of hexahedra with two sets of nodes, whose lines of elements are changed."""
    x, cells = arrays("hexahedron")
    rows, _ = cells["hexahedron"]
    lines = ["*NODE", *(f"{i}, {a}, {b}, {c}" for i, (a, b, c) in enumerate(x, start=1))]
    lines += ["*ELEMENT, TYPE=C3D8, ELSET=body"]
    lines += [change(", ".join(map(str, (i, *(row + 1))))) for i, row in enumerate(rows, start=1)]
    for name, height in SIDES_AT.items():
        lines += [f"*NSET, NSET={name}", *rows_of(np.flatnonzero(x[:, 2] == height) + 1)]
    return before + "\n".join(lines) + "\n" + after


SIDES_AT = {"foot": 0.0, "roof": 1.0}


def inp_with_words(folder):
    path = folder / "body.inp"
    path.write_text(inp_of_all(str, before=">** an example\n"))
    return path


def inp_with_more_numbers(folder):
    """CalculiX takes as many nodes of a line as the type has."""
    path = folder / "body.inp"
    path.write_text(inp_of_all(lambda line: f"{line}, 1, 2,"))
    return path


def inp_of_part(folder):
    path = folder / "body.inp"
    path.write_text("*HEADING\n*PART, NAME=block\n*INCLUDE, INPUT=mesh.inp\n*END PART\n")
    (folder / "mesh.inp").write_text(inp_of_all(str))
    return path


MFEM_TYPES = {
    "line": 1,
    "triangle": 2,
    "quad": 3,
    "tetra": 4,
    "hexahedron": 5,
    "wedge": 6,
    "pyramid": 7,
}


def by_mfem(kind, *, named=False, curved=False, by_node=False):
    """A mesh of MFEM, with numbers or names, vertices or a field of nodes."""

    def make(folder):
        x, cells = arrays(kind)
        d = 2 if kind in ("triangle", "quad") else 3
        sides = [entry for name, entry in cells.items() if name != kind]
        names = [name for name in cells if name != kind]
        lines = [f"MFEM mesh v1.{3 if named else 0}", "", "# types", "", "dimension", str(d), ""]
        body = [
            f"{tag} {MFEM_TYPES[kind]} {' '.join(map(str, row))}"
            for row, tag in zip(*cells[kind], strict=True)
        ]
        boundary = [
            f"{tag} {MFEM_TYPES[name]} {' '.join(map(str, row))}"
            for name, side in zip(names, sides, strict=True)
            for row, tag in zip(*side, strict=True)
        ]
        lines += ["elements", str(len(body)), *body, ""]
        if named:
            lines += ["attribute_sets", "2", '"left" 1 7', '"right" 1 8', ""]
        lines += ["boundary", str(len(boundary)), *boundary, ""]
        if named:
            lines += ["bdr_attribute_sets", "2", '"foot" 1 1', '"roof" 1 2', ""]
        lines += ["vertices", str(len(x))]
        if curved:
            # Nodes amid edges come after the vertices.
            nodes = np.vstack([x, x[:1] + 0.1])
            values = nodes.ravel() if by_node else nodes.T.ravel()
            lines += ["", "nodes", "FiniteElementSpace", "FiniteElementCollection: H1_3D_P2"]
            lines += ["VDim: 3", f"Ordering: {int(by_node)}", "", *map(str, values)]
        else:
            lines += [str(d), *(" ".join(map(str, point[:d])) for point in x)]
        path = folder / "body.mesh"
        path.write_text("\n".join(lines) + "\n")
        return path

    return make


GID_KINDS = {
    "line": "Linear",
    "triangle": "Triangle",
    "quad": "Quadrilateral",
    "tetra": "Tetrahedra",
    "hexahedron": "Hexahedra",
    "wedge": "Prism",
    "pyramid": "Pyramid",
}


def by_gid(kind, *, named=False):
    """A mesh of GiD, whose sets are materials or the names of its meshes."""

    def make(folder):
        x, cells = arrays(kind)
        lines = ["# of GiD"]
        coordinates = ["Coordinates", *(f"{i} {a} {b} {c}" for i, (a, b, c) in enumerate(x, 1))]
        coordinates += ["End Coordinates"]
        names = {1: "foot", 2: "roof", 7: "left", 8: "right"}
        number = 0
        for shape, (rows, tags) in cells.items():
            for tag in np.unique(tags):
                called = f'"{names[tag]}" ' if named else ""
                lines += [
                    f"MESH {called}dimension 3 ElemType {GID_KINDS[shape]} Nnode {rows.shape[1]}",
                    *coordinates,
                    "Elements",
                ]
                coordinates = ["Coordinates", "End Coordinates"]
                for row in rows[tags == tag] + 1:
                    number += 1
                    material = "" if named else f" {tag}"
                    lines.append(f"{number} {' '.join(map(str, row))}{material}")
                lines += ["End Elements"]
        path = folder / "body.msh"
        path.write_text("\n".join(lines) + "\n")
        return path

    return make


ANSYS_SLOTS = {  # corners of a shape in the slots of a hexahedron or a quadrilateral
    "triangle": [0, 1, 2, 2],
    "quad": [0, 1, 2, 3],
    "tetra": [0, 1, 2, 2, 3, 3, 3, 3],
    "pyramid": [0, 1, 2, 3, 4, 4, 4, 4],
    "wedge": [0, 1, 2, 2, 3, 4, 5, 5],
    "hexahedron": [0, 1, 2, 3, 4, 5, 6, 7],
}


def in_slots(kind, row, order):
    """Nodes of a cell in the slots of ANSYS: a node amid a collapsed edge is its corner."""
    slots = ANSYS_SLOTS[kind]
    corners = max(slots) + 1
    nodes = [row[i] for i in slots]
    if order == 1:
        return nodes
    of_edge = {
        frozenset(ends): node for ends, node in zip(MIDDLES[kind], row[corners:], strict=True)
    }
    for a, b in MIDDLES["quad" if len(slots) == 4 else "hexahedron"]:
        ends = frozenset((slots[a], slots[b]))
        nodes.append(of_edge[ends] if len(ends) == 2 else row[slots[a]])
    return nodes


def body_of(kind, order):
    """Points, cells, sides of the foot, and tags of the halves, of an order."""
    x, cells = arrays(kind)
    if order == 2:
        x, cells = second_order(x, cells)
    name = SECOND[kind] if order == 2 else kind
    sides = [(shape, rows[tags == 1]) for shape, (rows, tags) in cells.items() if shape != name]
    return x, *cells[name], [(shape, rows) for shape, rows in sides if len(rows)]


def by_ansys(kind, order=1, *, of_ten=False, workbench=False):
    """An archive of ANSYS whose sides are components of nodes, as CDWRITE writes it."""

    def make(folder):
        x, rows, half, _ = body_of(kind, order)
        up = 1 if kind in ("triangle", "quad") else 2
        number = 182 + (order == 2) if up == 1 else 185 + (order == 2) + of_ten
        lines = [
            "/COM,ANSYS RELEASE 2023",
            "/PREP7",
            f"et,7,{'' if workbench else 'SOLID'}{number}",
        ]
        if workbench:
            lines += [f"nblock,3,,{len(x)}", "(1i9,3e20.9e3)"]
            lines += [f"{i:9d}{a:20.9e}{b:20.9e}{c:20.9e}" for i, (a, b, c) in enumerate(x, 1)]
        else:
            lines += [f"NBLOCK,6,SOLID,{len(x):10d},{len(x):10d}", "(3i8,6e20.13)"]
            for i, place in enumerate(x, 1):
                # Zeros at the end of a line are left out.
                shown = place[: 1 + max(np.flatnonzero(place), default=-1)]
                lines.append(f"{i:8d}{0:8d}{0:8d}" + "".join(f"{a:20.13E}" for a in shown))
        lines += ["-1" if workbench else "N,R5.3,LOC,       -1,"]
        lines += [f"eblock,19,solid,,{len(rows)}", "(19i8)"]
        for i, row in enumerate(rows, 1):
            nodes = list(row) if of_ten else in_slots(kind, row, order)
            fields = [1, 7, 1, 1, 0, 0, 0, 0, len(nodes), 0, i, *(n + 1 for n in nodes)]
            text = [f"{n:8d}" for n in fields]
            lines += ["".join(text[:19]), *(["".join(text[19:])] if len(text) > 19 else [])]
        lines += ["      -1"]
        for name, tag in (("left", 7), ("right", 8)):
            lines += component(name, "ELEM", np.flatnonzero(half == tag) + 1)
        for name, height in SIDES_AT.items():
            lines += component(name, "NODE", np.flatnonzero(abs(x[:, up] - height) < 1e-9) + 1)
        lines += component("_INNER", "NODE", [1, 2])
        path = folder / "body.cdb"
        path.write_text("\n".join([*lines, "/GO", "FINISH"]))
        return path

    return make


def component(name, kind, numbers):
    """A component, in which a negative number ends a range."""
    fields = []
    for number in map(int, numbers):
        if fields and abs(fields[-1]) == number - 1:
            fields = [*(fields[:-1] if fields[-1] < 0 else fields), -number]
        else:
            fields.append(number)
    rows = [fields[i : i + 8] for i in range(0, len(fields), 8)]
    lines = ["".join(f"{number:10d}" for number in row) for row in rows]
    return [f"CMBLOCK,{name:8s},{kind},{len(fields):8d}  ! users component", "(8i10)", *lines]


HECMW_TYPES = {
    **{"triangle": (231, 232), "quad": (241, 242), "tetra": (341, 342)},
    **{"wedge": (351, 352), "hexahedron": (361, 362), "pyramid": (371, 372)},
}


def by_hecmw(kind, order):
    """A mesh of FrontISTR, whose foot is a group of sides and whose roof one of nodes."""

    def make(folder):
        x, rows, half, _ = body_of(kind, order)
        up = 1 if kind in ("triangle", "quad") else 2
        lines = ["# a comment", "!HEADER", " made by hand", "!NODE, NGRP=ALL"]
        lines += [f"{i}, {a}, {b}, {c}" for i, (a, b, c) in enumerate(x, 1)]
        lines += [f"!ELEMENT, TYPE={HECMW_TYPES[kind][order - 1]}"]
        for i, row in enumerate(rows, 1):
            words = list(map(str, [i, *(row + 1)]))
            lines += [", ".join(words[:12]) + ","] * (len(words) > 12)
            lines += [", ".join(words[12 if len(words) > 12 else 0 :])]
        for name, tag in (("left", 7), ("right", 8)):
            lines += [f"!EGROUP, EGRP={name}", *rows_of(np.flatnonzero(half == tag) + 1)]
        pairs = []
        for number, face in enumerate(FACE_NUMBERS[kind], start=1):
            on = np.all(abs(x[rows[:, face]][..., up]) < 1e-9, axis=1)
            pairs += [f"{element}, {number}" for element in np.flatnonzero(on) + 1]
        lines += ["!SGROUP, SGRP=foot", *rows_of(pairs, 3)]
        roof = np.flatnonzero(abs(x[:, up] - 1.0) < 1e-9) + 1
        lines += ["!NGROUP, NGRP=roof, GENERATE", *(f"{node}, {node}, 1" for node in roof)]
        lines += ["!SECTION, TYPE=SOLID, EGRP=ALL, MATERIAL=M", "!END"]
        path = folder / "body.msh"
        path.write_text("\n".join(lines))
        return path

    return make


ASTER_WORDS = {
    **{"line": "SEG", "triangle": "TRIA", "quad": "QUAD", "tetra": "TETRA"},
    **{"pyramid": "PYRAM", "wedge": "PENTA", "hexahedron": "HEXA"},
}


def by_aster(kind, order):
    """A mesh of code_aster, whose foot is a group of cells and whose roof one of nodes."""

    def make(folder):
        x, rows, half, sides = body_of(kind, order)
        d = 2 if kind in ("triangle", "quad") else 3
        lines = ["TITRE", "A BODY = TWO HALVES % BY HAND", "FINSF", "%", f"COOR_{d}D  NOM=N"]
        for i, place in enumerate(x):
            lines.append(f" N{i}  " + " ".join(f"{a:.15E}".replace("E", "D") for a in place[:d]))
        lines += ["FINSF"]
        lines += aster_cells(kind, rows, "M")
        for number, (shape, side_rows) in enumerate(sides):
            first = next(name for name in MIDDLES if shape.startswith(name))
            lines += aster_cells(first, side_rows, f"S{number}_")
        names = [f"S{number}_{i}" for number, (_, r) in enumerate(sides) for i in range(len(r))]
        lines += ["GROUP_MA", " foot", " ".join(names), "FINSF"]
        for name, tag in (("left", 7), ("right", 8)):
            members = " ".join(f"M{i}" for i in np.flatnonzero(half == tag))
            lines += [
                f"GROUP_MA  NOM = {name}  NBOBJ=9",
                "  NUMIN=1  AUTEUR=BY/HAND",
                members,
                "FINSF",
            ]
        roof = np.flatnonzero(abs(x[:, d - 1] - 1.0) < 1e-9)
        lines += ["GROUP_NO NOM=roof", " ".join(f"N{i}" for i in roof), "FINSF", "FIN"]
        path = folder / "body.mail"
        path.write_text("\n".join(lines))
        return path

    return make


def aster_cells(kind, rows, letter):
    lines = [f"{ASTER_WORDS[kind]}{rows.shape[1]}"]
    for i, row in enumerate(rows):
        words = [f"{letter}{i}", *(f"N{node}" for node in row)]
        lines += [" ".join(words[:8]), *([" ".join(words[8:])] if len(words) > 8 else [])]
    return [*lines, "FINSF"]


DYNA_SLOTS = ANSYS_SLOTS | {
    "tetra": [0, 1, 2, 3, 3, 3, 3, 3],
    "wedge": [0, 1, 4, 3, 2, 2, 5, 5],
}


def by_dyna(kind, order=1, form="fixed"):
    """A deck of LS-DYNA, whose foot is a set of segments and whose roof one of nodes."""

    def make(folder):
        x, rows, half, sides = body_of(kind, order)
        d = 2 if kind in ("triangle", "quad") else 3

        def line(*numbers, width=8):
            if form == "commas":
                return ",".join(map(str, numbers))
            wide = 20 if form == "long" else width
            return "".join(
                f"{n:{max(wide, 16)}.8f}" if isinstance(n, float) else f"{n:{wide}d}"
                for n in numbers
            )

        keyword = "*KEYWORD LONG=Y" if form == "long" else "*KEYWORD"
        mesh = ["*NODE", "$#   nid               x               y               z"]
        mesh += [line(i, *map(float, place)) for i, place in enumerate(x, 1)]
        mesh += ["*ELEMENT_SHELL" if d == 2 else "*ELEMENT_SOLID"]
        for i, (row, tag) in enumerate(zip(rows, half, strict=True), 1):
            if order == 2:
                mesh += [line(i, tag), line(*(row + 1))]
            else:
                mesh += [line(i, tag, *(row[DYNA_SLOTS[kind]] + 1))]
        lines = ["$ by hand", keyword, "*TITLE", "two halves"]
        lines += ["*PART", "left", line(7, 1, 1, width=10), "right", line(8, 1, 1, width=10)]
        lines += ["*SET_SEGMENT_TITLE", "foot", line(1, width=10)]
        for shape, side_rows in sides:
            corners = 2 if d == 2 else 4 if shape.startswith("quad") else 3
            for row in side_rows[:, :corners] + 1:
                lines += [line(*row, *[row[-1]] * (4 - corners), width=10)]
        roof = np.flatnonzero(abs(x[:, d - 1] - 1.0) < 1e-9) + 1
        lines += ["*SET_NODE_LIST_TITLE", "roof", line(1, width=10)]
        lines += [line(*roof[i : i + 8], width=10) for i in range(0, len(roof), 8)]
        if form == "commas":
            (folder / "mesh.k").write_text("\n".join(["*KEYWORD", *mesh, "*END"]))
            mesh = ["*INCLUDE", "mesh.k"]
        path = folder / "body.k"
        path.write_text("\n".join([*lines, *mesh, "*END", "what follows is not read"]))
        return path

    return make


def by_old_med(folder):
    """A file of MED in the form of version 2.3, in which families are in the mesh."""
    import h5py

    path = by_gmsh(".med")(folder)
    with h5py.File(path, "r+") as file:
        ((name, mesh),) = file["ENS_MAA"].items()
        (step,) = mesh
        for kind in ("NOE", "MAI"):
            file.move(f"ENS_MAA/{name}/{step}/{kind}", f"ENS_MAA/{name}/{kind}")
        file.move(f"FAS/{name}", f"ENS_MAA/{name}/FAS")
        del mesh[step]
        mesh.attrs["DIM"] = mesh.attrs["ESP"]
        del mesh.attrs["ESP"]
    return path


def by_kratos(kind):
    def make(folder):
        x, cells = arrays(kind)
        rows, half = cells[kind]
        sides, tags = next(table for name, table in cells.items() if name != kind)
        d = 2 if kind == "triangle" else 3
        lines = [
            "Begin ModelPartData",
            "End ModelPartData",
            "Begin Properties 0",
            "End Properties",
            "Begin Nodes",
        ]
        lines += [f"{i} {a} {b} {c}" for i, (a, b, c) in enumerate(x, start=1)]
        lines += [
            "End Nodes",
            f"Begin Elements SmallDisplacementElement{d}D{rows.shape[1]}N // body",
        ]
        lines += [f"{i} 0 {' '.join(map(str, row + 1))}" for i, row in enumerate(rows, start=1)]
        name = "LineLoadCondition" if d == 2 else "SurfaceLoadCondition"
        lines += ["End Elements", f"Begin Conditions {name}{d}D{sides.shape[1]}N"]
        lines += [f"{i} 0 {' '.join(map(str, row + 1))}" for i, row in enumerate(sides, start=1)]
        lines += ["End Conditions"]
        for called, tag in (("left", 7), ("right", 8)):
            lines += _submodel(called, "Elements", np.flatnonzero(half == tag) + 1)
        lines += _submodel("foot", "Conditions", np.flatnonzero(tags == 1) + 1)
        lines += _submodel("roof", "Nodes", np.flatnonzero(abs(x[:, d - 1] - 1) < 1e-9) + 1)
        path = folder / "body.mdpa"
        path.write_text("\n".join(lines))
        return path

    return make


def _submodel(name, kind, numbers):
    inside = [f"  Begin SubModelPart{kind}", *map(str, numbers), f"  End SubModelPart{kind}"]
    return [f"Begin SubModelPart {name} // group", *inside, "End SubModelPart"]


def by_getfem(folder):
    x, cells = arrays("triangle")
    rows, half = cells["triangle"]
    lines = [
        "% GETFEM MESH FILE",
        "% GETFEM VERSION 5.1",
        "BEGIN POINTS LIST",
        f"  POINT COUNT {len(x)}",
    ]
    lines += [f"  POINT  {i}  {a}  {b}" for i, (a, b, _) in enumerate(x)]
    lines += ["END POINTS LIST", "BEGIN MESH STRUCTURE DESCRIPTION", f"  CONVEX COUNT {len(rows)}"]
    lines += [f"CONVEX {i}    'GT_PK(2,1)'      {a}  {b}  {c}" for i, (a, b, c) in enumerate(rows)]
    lines += ["END MESH STRUCTURE DESCRIPTION"]
    for tag in (7, 8):
        lines += [
            f"BEGIN REGION {tag}",
            " ".join(map(str, np.flatnonzero(half == tag))),
            f"END REGION {tag}",
        ]
    for tag, height in ((1, 0.0), (2, 1.0)):
        on = [
            f"{i}/{f}"
            for i, row in enumerate(rows)
            for f in range(3)
            if np.all(abs(x[np.delete(row, f), 1] - height) < 1e-9)
        ]
        lines += [f"BEGIN REGION {tag}", " ".join(on), f"END REGION {tag}"]
    path = folder / "body.mesh"
    path.write_text("\n".join(lines))
    return path


# -- Exodus
# ---------------------------------------------------------------------------------


def netcdf(path, dimensions, attributes, variables):
    """Write a file of netCDF 3: dimensions, attributes, and variables (type, dims, data)."""
    kinds = {"i4": 4, "f8": 6, "S": 2, "f4": 5}

    def name(text):
        raw = text.encode()
        return len(raw).to_bytes(4, "big") + raw + b"\0" * (-len(raw) % 4)

    def values(kind, data):
        raw = data.encode() if kind == "S" else np.asarray(data).astype(f">{kind}").tobytes()
        count = len(raw) if kind == "S" else np.asarray(data).size
        return (
            kinds[kind].to_bytes(4, "big")
            + count.to_bytes(4, "big")
            + raw
            + b"\0" * (-len(raw) % 4)
        )

    def listed(tag, entries):
        if not entries:
            return b"\0" * 8
        return tag.to_bytes(4, "big") + len(entries).to_bytes(4, "big") + b"".join(entries)

    order = list(dimensions)
    head = b"CDF\x01" + b"\0" * 4
    head += listed(10, [name(key) + size.to_bytes(4, "big") for key, size in dimensions.items()])
    head += listed(12, [name(key) + values(*value) for key, value in attributes.items()])
    raws = {}
    for key, (kind, _, data, _) in variables.items():
        raw = data if kind == "S" else np.asarray(data).astype(f">{kind}").tobytes()
        raws[key] = raw + b"\0" * (-len(raw) % 4)

    def table(begin):
        entries = []
        for key, (kind, dims, _, more) in variables.items():
            entry = name(key) + len(dims).to_bytes(4, "big")
            entry += b"".join(order.index(dim).to_bytes(4, "big") for dim in dims)
            entry += listed(12, [name(k) + values(*v) for k, v in more.items()])
            entry += kinds[kind].to_bytes(4, "big") + len(raws[key]).to_bytes(4, "big")
            entries.append(entry + begin.to_bytes(4, "big"))
            begin += len(raws[key])
        return listed(11, entries)

    size = len(head) + len(table(0))
    path.write_bytes(head + table(size) + b"".join(raws.values()))


EXODUS_FACES = {
    "hexahedron": (
        "HEX8",
        [(0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (0, 4, 7, 3), (0, 3, 2, 1), (4, 5, 6, 7)],
    ),
    "tetra": ("TETRA4", [(0, 1, 3), (1, 2, 3), (0, 3, 2), (0, 2, 1)]),
    "quad": ("QUAD4", [(0, 1), (1, 2), (2, 3), (3, 0)]),
    "triangle": ("TRI3", [(0, 1), (1, 2), (2, 0)]),
}


def by_exodus(kind, ending=".e", named=True):
    """A file of Exodus: the halves are blocks, the foot a side set, the roof a set of nodes."""

    def make(folder):
        x, cells = arrays(kind)
        rows, half = cells[kind]
        elem_type, faces = EXODUS_FACES[kind]
        up = len(faces[0]) // 2 if kind in ("quad", "triangle") else 2
        blocks = [rows[half == 7], rows[half == 8]]
        ordered = np.concatenate(blocks)
        sides = [
            (element + 1, side)
            for side, face in enumerate(faces, start=1)
            for element in np.flatnonzero(np.all(abs(x[ordered[:, face]][..., up]) < 1e-9, axis=1))
        ]
        roof = np.flatnonzero(abs(x[:, up] - 1) < 1e-9) + 1
        dims = {"len_string": 33, "len_line": 81, "len_name": 33, "four": 4, "num_dim": up + 1}
        dims |= {
            "num_nodes": len(x),
            "num_elem": len(rows),
            "num_el_blk": 2,
            "num_side_sets": 1,
            "num_node_sets": 1,
        }
        dims |= {
            "num_side_ss1": len(sides),
            "num_nod_ns1": len(roof),
            "num_nod_per_el1": rows.shape[1],
        }
        dims |= {
            "num_el_in_blk1": len(blocks[0]),
            "num_el_in_blk2": len(blocks[1]),
            "num_nod_per_el2": rows.shape[1],
        }
        attributes = {
            "api_version": ("f4", [4.98]),
            "version": ("f4", [4.98]),
            "title": ("S", "body"),
        }
        attributes |= {"floating_point_word_size": ("i4", [8]), "file_size": ("i4", [1])}

        def names(*texts):
            shown = texts if named else [""] * len(texts)
            return b"".join(text.encode().ljust(33, b"\0") for text in shown)

        ids = {"name": ("S", "ID")}
        variables = {
            "coordx": ("f8", ["num_nodes"], x[:, 0], {}),
            "coordy": ("f8", ["num_nodes"], x[:, 1], {}),
            "coordz": ("f8", ["num_nodes"], x[:, 2], {}),
            "eb_status": ("i4", ["num_el_blk"], [1, 1], {}),
            "eb_prop1": ("i4", ["num_el_blk"], [7, 8], ids),
            "eb_names": ("S", ["num_el_blk", "len_name"], names("left", "right"), {}),
            "ss_status": ("i4", ["num_side_sets"], [1], {}),
            "ss_prop1": ("i4", ["num_side_sets"], [1], ids),
            "ss_names": ("S", ["num_side_sets", "len_name"], names("foot"), {}),
            "ns_status": ("i4", ["num_node_sets"], [1], {}),
            "ns_prop1": ("i4", ["num_node_sets"], [2], ids),
            "ns_names": ("S", ["num_node_sets", "len_name"], names("roof"), {}),
            "elem_ss1": ("i4", ["num_side_ss1"], [e for e, _ in sides], {}),
            "side_ss1": ("i4", ["num_side_ss1"], [s for _, s in sides], {}),
            "node_ns1": ("i4", ["num_nod_ns1"], roof, {}),
        }
        if up == 1:
            del variables["coordz"]
        for number, block in enumerate(blocks, start=1):
            dims_of = [f"num_el_in_blk{number}", f"num_nod_per_el{number}"]
            more = {"elem_type": ("S", elem_type)}
            variables[f"connect{number}"] = ("i4", dims_of, block + 1, more)
        path = folder / f"body{ending}"
        netcdf(path, dims, attributes, variables)
        return path

    return make


def cases_of_exodus():
    for kind in EXODUS_FACES:
        dim = 2 if kind in ("quad", "triangle") else 3
        yield Case(f"exodus of {kind}", by_exodus(kind), dim=dim)
    numbers = {"parts": {"1": 2.0, "2": 2.0}, "regions": {"7": 1.0, "8": 1.0}}
    yield Case("exodus without names", by_exodus("hexahedron", ".exo", named=False), **numbers)


# -- DOLFINx
# ---------------------------------------------------------------------------------


def by_dolfinx(kind):
    """A mesh of DOLFINx with tags of cells and facets, in one file of XDMF."""

    def make(folder):
        from dolfinx import io
        from dolfinx import mesh as dmesh
        from mpi4py import MPI

        cell = dmesh.CellType[kind]
        dim = 2 if kind in ("triangle", "quadrilateral") else 3
        low, high = [0.0] * dim, [2.0, 1.0, 1.0][:dim]
        create = dmesh.create_rectangle if dim == 2 else dmesh.create_box
        mesh = create(MPI.COMM_WORLD, [low, high], [4, 2, 2][:dim], cell)
        mesh.topology.create_connectivity(dim - 1, dim)
        found = [
            dmesh.locate_entities_boundary(
                mesh, dim - 1, lambda x, at=at: abs(x[dim - 1] - at) < 1e-9
            )
            for at in (0.0, 1.0)
        ]
        facets = np.concatenate(found)
        tags = np.repeat([1, 2], [len(part) for part in found]).astype(np.int32)
        order = np.argsort(facets)
        facet_tags = dmesh.meshtags(mesh, dim - 1, facets[order], tags[order])
        facet_tags.name = "facets"
        cells = np.arange(mesh.topology.index_map(dim).size_local, dtype=np.int32)
        x = dmesh.compute_midpoints(mesh, dim, cells)
        cell_tags = dmesh.meshtags(mesh, dim, cells, np.where(x[:, 0] < 1, 7, 8).astype(np.int32))
        cell_tags.name = "cells"
        path = folder / "body.xdmf"
        with io.XDMFFile(mesh.comm, path, "w") as file:
            file.write_mesh(mesh)
            file.write_meshtags(facet_tags, mesh.geometry)
            file.write_meshtags(cell_tags, mesh.geometry)
        return path

    return make


def cases_of_dolfinx():
    for kind in ("triangle", "quadrilateral", "tetrahedron", "hexahedron"):
        dim = 2 if kind in ("triangle", "quadrilateral") else 3
        tagged = {"dim": dim, "parts": TAGGED[0], "regions": TAGGED[1]}
        yield Case(f"DOLFINx, {kind}", by_dolfinx(kind), collective=True, **tagged)


CASES = {
    case.name: case
    for cases in (
        cases_by_hand(),
        cases_of_exodus(),
        cases_of_dolfinx(),
        cases_of_meshio(),
        cases_of_gmsh(),
    )
    for case in cases
}
