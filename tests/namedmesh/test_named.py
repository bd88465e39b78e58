"""Names by rules.

A rule names the facets at all whose vertices it holds, on any domain and any number of
ranks; the names are there after refinement, remeshing, split and joined, with the same
areas; what a part takes, another one loses; the table adds up to the whole boundary.
"""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI

import namedmesh as nm
from namedmesh.parts_table import NAMELESS

COMM = MPI.COMM_WORLD
EXACT = 1e-12


def area_of(domain):
    """The area of each part by its name."""
    table = domain.parts()
    return dict(zip(table["name"], table["area"].tolist(), strict=True))


def close(areas, **expected):
    for name, area in expected.items():
        assert areas[name] == pytest.approx(area, rel=EXACT), name


def two_layers(gmsh):
    """An upper layer (0, 3) x (0, 1), loaded on x < 1, on a lower one (0, 4) x (-2, 0)."""
    if gmsh is None:
        return None
    occ = gmsh.model.occ
    upper = [(2, occ.addRectangle(0, 0, 0, 1, 1)), (2, occ.addRectangle(1, 0, 0, 2, 1))]
    occ.fragment(upper, [(2, occ.addRectangle(0, -2, 0, 4, 2))])
    occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.7)
    return gmsh.model


LAYERS = {"upper": nm.where(y=(0.0, None)), "lower": nm.where(y=(None, 0.0))}
PARTS = {
    "load": nm.where(y=1.0, x=(None, 1.0)),
    "middle": lambda x: np.isclose(x[0], 0.0),
    "base": nm.where(normal=(0.0, -1.0), region="lower"),
}


@pytest.mark.parametrize("cells", [(1, 1), (4, 2)])
def test_functions_name_what_dolfinx_locates(cells):
    domain = nm.rectangle((0.0, 0.0), (2.0, 1.0), cells=cells)

    def foot(x):
        return np.isclose(x[1], 0.0)

    named = domain.named({"foot": foot})
    located = dmesh.locate_entities_boundary(domain.mesh, 1, foot)
    owned = domain.mesh.topology.index_map(1).size_local
    mine = named.facet_tags.find(named.tag("foot"))
    assert np.array_equal(mine[mine < owned], np.sort(located))
    assert list(named.names) == ["left", "right", "top", "foot"]  # foot has taken all of bottom
    assert list(domain.names) == ["left", "right", "bottom", "top"]


def test_a_part_takes_facets_and_the_older_one_keeps_the_rest():
    domain = nm.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2))
    pad = {"pad": nm.where(y=1.0, x=(0.5, 1.5))}
    close(area_of(domain.named(pad)), top=1.0, pad=1.0, bottom=2.0)
    # Given anew, the name leaves the facets that it had; they have none then.
    again = domain.named(pad).named({"pad": nm.where(x=2.0)})
    close(area_of(again), pad=1.0, top=1.0)
    assert area_of(again)[NAMELESS] == pytest.approx(1.0, rel=EXACT)
    assert "right" not in again.names


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_rules_know_no_unit(unit):
    body = nm.box((0.0,) * 3, (unit, 2 * unit, 3 * unit), cells=(1, 2, 3))
    named = body.named(
        {
            "foot": nm.where(z=0.0),
            "sides": [nm.where(normal=(5.0, 0.0, 0.0)), nm.where(x=0.0)],
            "corner": nm.where(z=3 * unit, y=(None, unit)),
        }
    )
    areas = area_of(named)
    for name, area in {"foot": 2.0, "sides": 12.0, "corner": 1.0, "top": 1.0}.items():
        assert areas[name] == pytest.approx(area * unit**2, rel=EXACT)


def test_gmsh_models_need_no_groups(gmsh_session):
    domain = nm.from_gmsh(two_layers(gmsh_session), parts=PARTS, regions=LAYERS)
    assert set(domain.regions) == {"upper", "lower"}
    expected = {"load": 1.0, "middle": 3.0, "base": 4.0}
    close(area_of(domain), **expected)
    pair = domain.split({"foot": "upper", "seat": "lower"})
    for body in (pair, pair.refined(), pair.remeshed(0.5), pair.remeshed(0.5).refined()):
        close(area_of(body), foot=3.0, seat=3.0, **expected)
        assert body.pairs == (("foot", "seat"),)
    # The same names, if they are given after the split.
    bare = nm.from_gmsh(gmsh_session and gmsh_session.model, regions=LAYERS)
    later = bare.split({"foot": "upper", "seat": "lower"}).named(PARTS)
    close(area_of(later.remeshed(0.4)), foot=3.0, seat=3.0, **expected)


def test_files_need_no_groups(gmsh_session, shared_tmp_path):
    path = shared_tmp_path / "plain.msh"
    model = two_layers(gmsh_session)
    if model is not None:
        model.mesh.generate(2)
        gmsh_session.write(str(path))
    COMM.barrier()
    domain = nm.read_mesh(path, parts=PARTS, regions=LAYERS)
    close(area_of(domain.refined()), load=1.0, middle=3.0, base=4.0)


def test_against_inside_a_mesh_names_the_interface():
    domain = nm.rectangle((0.0, 0.0), (2.0, 2.0), cells=(4, 4))
    halves = {"upper": nm.where(y=(1.0, None)), "lower": nm.where(y=(None, 1.0))}
    joint = nm.where(lambda x: x[0] < 1.1, region="upper", against="lower")
    whole = domain.named({"joint": joint}, regions=halves)
    table = whole.parts()
    row = table["name"].index("joint")
    assert table["area"][row] == pytest.approx(1.0, rel=EXACT)
    assert table["regions"][row] == ("upper", "lower")
    assert np.isnan(table["normal"][row]).all()
    pair = whole.split({"foot": "upper", "seat": "lower"}, on="joint")
    close(area_of(pair.refined()), foot=1.0, seat=1.0)


@pytest.mark.parametrize("dim", [2, 3])
def test_against_bodies_that_were_meshed_apart(dim):
    low, high = [-1.0] * (dim - 1), [1.0] * (dim - 1)
    cells = (3,) * dim if dim == 2 else (2, 2, 2)
    upper = (nm.rectangle if dim == 2 else nm.box)((*low, 0.0), (*high, 2.0), cells=cells)
    wide = [3 * value for value in low], [3 * value for value in high]
    counts = (11,) + (2,) * (dim - 1) if dim == 2 else (7, 6, 1)
    lower = (nm.rectangle if dim == 2 else nm.box)((*wide[0], -1.0), (*wide[1], 0.0), cells=counts)
    both = nm.assembly({"a": upper, "b": lower}).named(
        {"foot": nm.where(region="a", against="b"), "seat": nm.where(region="b", against="a")}
    )
    contact = 2.0 ** (dim - 1)
    areas = area_of(both)
    assert areas["foot"] == pytest.approx(contact, rel=EXACT)
    assert contact <= areas["seat"] < 2.5 * contact  # whole facets, some of which reach beyond
    close(area_of(both.joined("foot", "seat")), foot=contact, seat=contact)


def test_names_of_bodies_that_are_joined_and_meshed_again():
    upper = nm.rectangle((-1.0, 0.0), (1.0, 2.0), size=0.5).named({"head": nm.where(y=2.0)})
    lower = nm.rectangle((-2.0, -1.5), (2.0, 0.0), size=0.6)
    both = nm.assembly({"a": upper, "b": lower}).named({"base": nm.where(y=-1.5)})
    pair = both.joined("a bottom", "b top").named({"wall": nm.where(x=-2.0)})
    expected = {"a head": 2.0, "base": 4.0, "wall": 1.5, "a bottom": 2.0, "b top": 2.0}
    for body in (pair, pair.refined(), pair.remeshed(0.4)):
        close(area_of(body), **expected)
    with pytest.raises(nm.InputError, match=r"split already \(a bottom/b top\)"):
        pair.named(regions={"other": nm.where(x=(0.0, None))})


def test_parts_that_end_where_the_shape_has_no_edge_are_not_meshed_again():
    domain = nm.rectangle((0.0, 0.0), (2.0, 1.0), cells=(10, 5))
    pad = domain.named({"pad": nm.where(y=1.0, x=(None, 0.6))})
    close(area_of(pad.refined()), pad=0.6)
    with pytest.raises(nm.InputError, match=r"'pad'.* had the size 0\.6 .*strategy=ec\.Mark"):
        pad.remeshed(0.23)


def test_curved_bodies_keep_their_true_shape(gmsh_session):
    if gmsh_session:
        gmsh_session.model.occ.addDisk(0, 0, 0, 1, 1)
        gmsh_session.model.occ.synchronize()
        gmsh_session.option.setNumber("Mesh.MeshSizeMax", 0.5)
    ring = {"rim": nm.where(lambda x: np.hypot(x[0], x[1]) > 0.999)}
    disc = nm.from_gmsh(gmsh_session and gmsh_session.model, parts=ring)
    fine = disc.remeshed(0.1).refined()
    assert area_of(fine)["rim"] == pytest.approx(2 * np.pi, rel=1e-3)
    assert fine.offset is not None


@pytest.mark.ranks
def test_names_do_not_depend_on_the_ranks():
    def bodies(comm):
        a = nm.rectangle((0.0, 0.0), (1.0, 1.0), cells=(5, 5), comm=comm)
        b = nm.rectangle((-1.0, -1.0), (2.0, 0.0), cells=(7, 3), comm=comm)
        both = nm.assembly({"a": a, "b": b})
        return both.named({"seat": nm.where(region="b", against="a"), "wall": nm.where(x=2.0)})

    here, alone = bodies(COMM).parts(), bodies(MPI.COMM_SELF).parts()
    assert here["name"] == alone["name"]
    assert here["regions"] == alone["regions"]
    assert here["facets"].tolist() == alone["facets"].tolist()
    for column in ("area", "centre", "normal"):
        assert here[column] == pytest.approx(alone[column], rel=EXACT, abs=EXACT)


def test_the_table_adds_up_and_prints():
    domain = nm.box((0.0, 0.0, 0.0), (2.0, 1.0, 1.0), cells=(2, 2, 2))
    table = domain.named({"foot": nm.where(z=0.0)}).parts()
    assert table["area"].sum() == pytest.approx(10.0, rel=EXACT)
    vectors = table["area"][:, None] * table["normal"]
    assert abs(vectors.sum(axis=0)).max() < EXACT
    row = table["name"].index("foot")
    assert table["centre"][row] == pytest.approx([1.0, 0.5, 0.0], abs=EXACT)
    lines = str(table).splitlines()
    assert lines[0].split() == ["part", "facets", "area", "centre", "mean", "normal"]
    assert len(lines) == len(table) + 1
    assert "(0, 0, -1)" in lines[row + 1]
    assert "<th>foot</th>" in table._repr_html_()
    with pytest.raises(nm.InputError, match="no column 'size'; there are name, facets, area"):
        table["size"]


BAD = {
    "no mapping": (lambda b: b.named(["foot"]), "mapping from names to rules"),
    "nothing": (lambda b: b.named({}), "no rule is given"),
    "no rule": (lambda b: b.named({"foot": 3}), "rule of 'foot' is 3; give a function"),
    "no condition": (lambda b: nm.where(), "no condition is given"),
    "a text": (lambda b: nm.where(x="0"), "x is '0'; give a coordinate"),
    "ends in wrong order": (lambda b: nm.where(y=(2, 1)), r"y is \(2, 1\); give a coordinate"),
    "no number": (lambda b: nm.where(y=float("nan")), "y is nan; give a coordinate"),
    "no direction": (lambda b: nm.where(normal=(0.0, 0.0)), "give a direction"),
    "normal in 3D": (
        lambda b: b.named({"foot": nm.where(normal=(0, 0, 1))}),
        "in 2D it has 2 components",
    ),
    "z in the plane": (
        lambda b: b.named({"foot": nm.where(z=0.0)}),
        "z is 0.0, and the mesh is in the plane",
    ),
    "z of a region in the plane": (
        lambda b: b.named(regions={"steel": nm.where(z=(0.0, 1.0))}),
        "the mesh is in the plane",
    ),
    "no region": (
        lambda b: b.named({"foot": nm.where(region="steel")}),
        "no cell region is called 'steel'; this domain has none",
    ),
    "nowhere": (
        lambda b: b.named({"foot": nm.where(y=7.0)}),
        r"'foot' holds on no facet.* from \(0, 0\) to \(1, 1\)",
    ),
    "twice": (
        lambda b: b.named({"foot": nm.where(y=0.0), "leg": nm.where(y=(None, 0.5))}),
        "'foot' and 'leg' have 4 facets in common",
    ),
    "no truth": (lambda b: b.named({"foot": lambda x: x[1]}), "of type float64 .* truth value"),
    "one truth for another": (
        lambda b: b.named({"foot": lambda x: np.array([True, False, True])}),
        r"shape \(3,\), for",
    ),
    "region by facets": (
        lambda b: b.named(regions={"steel": nm.where(normal=(0.0, 1.0))}),
        "region 'steel' has a rule about facets",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_no_rule_is_refused(case, block):
    call, words = BAD[case]
    with pytest.raises(nm.InputError, match=words):
        call(block)


def test_what_fails_on_one_rank_fails_on_all(block):
    def rule(x):
        if COMM.rank == COMM.size - 1:
            raise ZeroDivisionError("no such place")
        return x[1] == 0.0

    with pytest.raises(ZeroDivisionError, match="no such place"):
        block.named({"foot": rule})
