"""Orthotropic elasticity.

- Stress and compliance are the matrices of engineering constants, turned by numpy.
- A bar of wood that is pulled at an angle to its fibres: Lekhnitskii's modulus.
- Equal axes are isotropic elasticity, also beside an elastic region.
- Intervals of energies of rings and in 3D, beside an elastic region, on any ranks.
- What is refused: no positive energy, axes that are none, an axis in the plane.
"""

import numpy as np
import pytest
from domains import refused
from mpi4py import MPI
from scenes import certified

import erc_contact as ec
from erc_contact.model.model import Model

E, NU, G = (11e3, 900.0, 500.0), (0.37, 0.42, 0.47), (690.0, 650.0, 40.0)
WOOD = ec.OrthotropicElastic(E, NU, G)


def turned(angle):
    """Axes of which the first is at an angle to x, in the plane."""
    c, s = np.cos(angle), np.sin(angle)
    return ((c, s), (-s, c))


def compliance_of_constants():
    """The compliance (3, 3, 3, 3) in the axes, entry by entry."""
    S = np.zeros((3, 3, 3, 3))
    for i in range(3):
        S[i, i, i, i] = 1 / E[i]
    for (i, j), ratio, shear in zip([(0, 1), (0, 2), (1, 2)], NU, G, strict=True):
        S[i, i, j, j] = S[j, j, i, i] = -ratio / E[i]
        for a, b, c, d in ((i, j, i, j), (i, j, j, i), (j, i, i, j), (j, i, j, i)):
            S[a, b, c, d] = 1 / (4 * shear)
    return S


@pytest.mark.serial
def test_the_metric_is_the_turned_compliance():
    Q, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))
    law = ec.OrthotropicElastic(E, NU, G, axes=Q)
    box = ec.box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells=(1, 1, 1))
    model = Model(ec.Scene(law, ec.Displacement("bottom", (0.0, 0.0, 0.0))), box, 1)
    S = np.einsum("ai,bj,ck,dl,abcd->ijkl", Q, Q, Q, Q, compliance_of_constants())
    basis = model.space.section.basis
    exact = np.einsum("mij,ijkl,nkl->mn", basis, S, basis)
    x, cells = np.zeros((1, 1, 3)), np.array([0])
    metric = model.constitution.metric(x, cells)[0, 0]
    stiffness = model.constitution.stiffness(x, cells)[0, 0]
    assert metric == pytest.approx(exact, rel=1e-9, abs=1e-12 * abs(exact).max())
    assert stiffness @ exact == pytest.approx(np.eye(6), abs=1e-9)


@pytest.mark.parametrize("hypothesis", ["plane stress", "plane strain"])
def test_a_bar_that_is_pulled_at_an_angle_to_its_fibres(hypothesis):
    """1/E_x = c^4/E_1 + s^4/E_2 + (1/G_12 - 2 nu_12/E_1) c^2 s^2, of the plane's constants."""
    angle, pull = 0.4, 2.0
    law = ec.OrthotropicElastic(E, NU, G, turned(angle), hypothesis)
    bar = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(2, 1))
    loads = [ec.Traction("right", (pull, 0.0)), ec.Traction("left", (-pull, 0.0))]
    # The loads are in balance, so that soft springs hold the bar and bear nothing.
    held = ec.Spring("left", normal=1e-3, tangential=1e-3)
    error = certified(ec.Scene(law, [], loads, springs=held), bar)
    at = error.solution.at([[0.0, 0.5], [2.0, 0.5]])
    strain = np.diff(at.displacement[:, 0])[0] / 2.0
    S = compliance_of_constants()
    plane = np.array([[S[0, 0, 0, 0], S[0, 0, 1, 1]], [S[1, 1, 0, 0], S[1, 1, 1, 1]]])
    if hypothesis == "plane strain":
        out = np.array([S[0, 0, 2, 2], S[1, 1, 2, 2]])
        plane -= np.outer(out, out) / S[2, 2, 2, 2]
    c2, s2 = np.cos(angle) ** 2, np.sin(angle) ** 2
    slope = plane[0, 0] * c2**2 + plane[1, 1] * s2**2 + (1 / G[0] + 2 * plane[0, 1]) * c2 * s2
    assert strain == pytest.approx(pull * slope, rel=1e-5)


@pytest.mark.broad
def test_equal_axes_beside_an_elastic_region():
    """An elastic slab, of which one layer is declared as orthotropic, or both are elastic."""
    layers = {"low": ec.where(y=(None, 0.5)), "high": ec.where(y=(0.5, None))}
    slab = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(4, 2)).named(regions=layers)
    steel, soft = ec.Elastic(1000.0, 0.3), ec.Elastic(300.0, 0.2)
    alike = ec.OrthotropicElastic((300.0,) * 3, (0.2,) * 3, (125.0,) * 3, axes=turned(0.7))
    push = ec.Displacement("top", (0.002, -0.01))
    found = []
    for low in (soft, alike):
        contact = ec.Contact("bottom", friction=0.3)
        error = certified(ec.Scene({"low": low, "high": steel}, push, contacts=contact), slab)
        found.append([error.relative, *error.force("bottom").force])
    assert found[1] == pytest.approx(found[0], rel=1e-6)


def layered(kind: str, comm: MPI.Comm) -> tuple[ec.Scene, ec.Domain]:
    """An orthotropic layer below an elastic one, pressed on a foundation."""
    d, hypothesis = (3, "plane strain") if kind == "space" else (2, kind)
    make = ec.box if d == 3 else ec.rectangle
    body = make((0.0,) * d, (1.0,) * d, cells=(2,) * d, comm=comm)
    height = {2: "y", 3: "z"}[d]
    layers = {"low": {height: (None, 0.5)}, "high": {height: (0.5, None)}}
    body = body.named(regions={name: ec.where(**where) for name, where in layers.items()})
    c, s = np.cos(0.5), np.sin(0.5)
    axes = ((c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0))
    laws = {
        "low": ec.OrthotropicElastic(E, NU, G, axes, hypothesis),
        "high": ec.Elastic(2000.0, 0.3, hypothesis=hypothesis),
    }
    push = (None if kind == "axisymmetric" else 0.002, *(0.0,) * (d - 2), -0.01)
    contact = ec.Contact("bottom", friction=ec.Tresca(1.0))
    return ec.Scene(laws, ec.Displacement("top", push), contacts=contact), body


@pytest.mark.broad
@pytest.mark.parametrize("kind", ["axisymmetric", "space"])
def test_energies_beside_an_elastic_region(kind):
    """The interval of a finer mesh lies in the first one; it is the same on any ranks."""
    scene, body = layered(kind, MPI.COMM_WORLD)
    bounds = [ec.potential_energy(certified(scene, domain)) for domain in (body, body.refined())]
    assert all(each.guaranteed for each in bounds)
    coarse, fine = bounds
    assert coarse.low < fine.low < fine.high < coarse.high
    alone = ec.potential_energy(certified(*layered(kind, MPI.COMM_SELF)))
    assert [coarse.low, coarse.high] == pytest.approx([alone.low, alone.high], rel=1e-9)


@pytest.mark.serial
@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: ec.OrthotropicElastic(E, (4.0, 0.4, 0.4), G), "no positive energy"),
        (lambda: ec.OrthotropicElastic((1.0, -1.0, 1.0), NU, G), "E2 is -1"),
        (lambda: ec.OrthotropicElastic(E, NU, (1.0, 0.0, 1.0)), "G13 is 0"),
        (lambda: ec.OrthotropicElastic(1.0, NU, G), "give three values"),
        (lambda: ec.OrthotropicElastic(E, NU, G, ((1.0, 0.0), (1.0, 1.0))), "unit vectors"),
        (lambda: ec.OrthotropicElastic(E, NU, G, hypothesis="thin"), "hypothesis is 'thin'"),
    ],
)
def test_what_is_no_orthotropic_material(make, words):
    refused(make, words)


def test_an_axis_in_the_plane():
    law = ec.OrthotropicElastic(E, NU, G, ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)))
    slab = ec.rectangle((0.0, 0.0), (2.0, 1.0), cells=(2, 1))
    scene = ec.Scene(law, ec.Displacement("bottom", (0.0, 0.0)))
    refused(lambda: ec.solve(scene, slab), "the third axis is")
