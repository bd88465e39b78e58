"""Describe a run in words, to be compared with the words of another run.

They are about its scene, first mesh, method, strategy, numbers and versions. Numbers
and names are compared by value, objects by their class and attributes. Callables cannot
be compared, but what they return can: their UFL at the position on the mesh, with all
numbers in it. So are the formulas of materials, laws and loads. A fingerprint does not
depend on the ranks, on the process, or on where a mesh is in a run.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import partial
from numbers import Real
from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from ufl.algorithms.analysis import extract_coefficients, extract_constants
from ufl.algorithms.signature import compute_expression_signature
from ufl.domain import extract_domains, extract_unique_domain

from erc_contact.base.code import literal
from erc_contact.base.exceptions import together
from erc_contact.base.runtime.compiled import constants_with_ten_digits
from erc_contact.base.traced import field_of
from erc_contact.base.ufl_types import Ufl
from erc_contact.base.versions import versions
from erc_contact.model.data.users import vector
from erc_contact.scene.material import mandel_matrix, parameter, tensor_basis
from erc_contact.scene.potential import has_potential
from erc_contact.scene.scene import Scene
from namedmesh import Domain
from namedmesh.base.communicators import lasting

DIGITS = 9
"""Digits that make coordinates the same [-], relative to the extent of the body."""
LONGEST = 60
"""Number of characters of the longest expression that is written in full."""
NOTHING = "nothing of the kind"
"""Words for what one of two runs has and the other one lacks."""
COUNTED = re.compile(r"_\{?\d")
"""Pattern of a name with a number, which is another one in each process."""

Fingerprint = dict[str, str]
"""What is compared -> its value in words."""


def fingerprint(scene: Scene, domain: Domain, numbers: Mapping[str, Any]) -> Fingerprint:
    """Describe an adaptive run; collective.

    Args:
        scene: The problem.
        domain: The first mesh.
        numbers: The other arguments that decide on the meshes of the run, by their
            names.
    """
    mesh = _of_mesh(domain)
    kind = ("triangle", "tetrahedron")[domain.dim - 2]
    # a mesh of symbols alone: the element of a real mesh has variants
    symbols = ufl.Mesh(basix.ufl.element("Lagrange", kind, 1, shape=(domain.dim,)))
    x = ufl.SpatialCoordinate(symbols)
    n = ufl.FacetNormal(symbols)
    entries = list(_of_object("material", scene.material, x))
    entries += _formulas("material", scene.material, x, domain.dim)
    for name in ("supports", "loads", "contacts", "strains", "springs", "ties"):
        for number, part in enumerate(getattr(scene, name)):
            entries += _of_object(f"{name}[{number}]", part, x)
    for number, load in enumerate(scene.loads):
        density = _in_ufl(partial(_density, load, x, n))
        entries.append((f"loads[{number}]: its density", density))
    for number, strain in enumerate(scene.strains):
        entries.append((f"strains[{number}]: its formula", _in_ufl(partial(_strain, strain, x))))
    for number, contact in enumerate(scene.contacts):
        if contact.law is not None:
            name = f"contacts[{number}]: its friction law"
            entries += _formulas(name, contact.law, x, domain.dim)
    for name, value in numbers.items():
        entries += _of_object(name, value, x)
    made_by = versions()
    for name in ("DOLFINx", "erc_contact"):
        entries.append((f"version of {name}", made_by[name]))
    return mesh | dict(entries)


def fingerprint_of_history(
    scene_at: Callable[[float], Scene],
    domain: Domain,
    times: Sequence[float],
    numbers: Mapping[str, Any],
) -> Fingerprint:
    """Describe a loading history: its first time, and later changes; collective."""
    comm = domain.comm
    prints = [fingerprint(together(comm, scene_at, t), domain, numbers) for t in times]
    first = prints[0]
    history = dict(first)
    for t, later in zip(times, prints, strict=True):
        for name in sorted(first.keys() | later.keys()):
            if later.get(name) != first.get(name):
                history[f"{name} at t = {t!r}"] = later.get(name, NOTHING)
    return history


def differences(this: Fingerprint, kept: Fingerprint) -> list[str]:
    """Say in words what differs between this call and the run that a folder keeps."""
    words = []
    for name in this | kept:
        here = this.get(name, NOTHING)
        there = kept.get(name, NOTHING)
        if this.get(name) != kept.get(name):
            words.append(f"{name} is {here}, in the folder {there}")
    return words


def _of_mesh(domain: Domain) -> Fingerprint:
    """Describe the first mesh: vertices, sizes of parts, true shape; collective."""
    mesh = domain.mesh
    comm = lasting(mesh.comm)
    vertices = mesh.geometry.x[: mesh.geometry.index_map().size_local]
    rounded = np.round(vertices / domain.extent, DIGITS) + 0.0  # no -0.0
    parts = comm.gather(rounded)
    # only rank 0 has coordinates; their order must not depend on the number of ranks
    x = np.concatenate(parts) if parts else np.empty((0, 3))
    digest = hashlib.sha256(x[np.lexsort(x.T)].tobytes()).hexdigest()[:16]
    counts = []
    for name in domain.outer:
        counts.append(("part", name, len(domain.owned_facets(name))))
    for name in domain.regions:
        owned = domain.region(name) < domain.owned_cells
        counts.append(("region", name, int(owned.sum())))
    words = [f"{domain.cells} cells in {domain.dim}D, {domain.vertices} vertices {digest}"]
    for kind, name, count in sorted(counts):
        words.append(f"{kind} {name!r} of {comm.allreduce(count, MPI.SUM)}")
    for interface in domain.interfaces:
        names = " and ".join(map(repr, interface.names))
        words.append(f"{names} at the regions of tags {interface.regions}")
    words.append(f"true shape {type(domain.geometry).__name__}")
    return {"the first mesh": ", ".join(words)}


def _of_object(name: str, value: Any, x: Ufl) -> Iterator[tuple[str, str]]:
    """Return entries for a value, or for an object and each of its attributes."""
    plain = _in_words(value, x)
    if plain is not None:
        yield name, plain
        return
    yield name, type(value).__qualname__
    if is_dataclass(value):
        attributes = {attribute.name for attribute in fields(value)}
    else:
        attributes = set(getattr(value, "__dict__", ()))
    for attribute in sorted(attributes):
        yield from _of_object(f"{name}.{attribute}", getattr(value, attribute), x)


def _in_words(value: Any, x: Ufl) -> str | None:
    """Write a value in words; None if it is an object with attributes."""
    words = literal(value)
    if words is not None:
        return words
    if isinstance(value, tuple | list | np.ndarray):
        entries = [str(_in_words(entry, x)) for entry in value]
        return f"({', '.join(entries)})"
    if isinstance(value, Mapping):
        entries = [f"{key!r}: {_in_words(value[key], x)}" for key in sorted(value, key=repr)]
        return f"{{{', '.join(entries)}}}"
    if callable(value) and not isinstance(value, type):
        # a callable may return rows of a tensor; one that is no field has only its name
        words = _in_ufl(lambda: field_of(value, x)) or _in_ufl(lambda: _value(value, x))
        return words or getattr(value, "__qualname__", type(value).__qualname__)
    return None


def _formulas(name: str, owner: Any, x: Ufl, d: int) -> Iterator[tuple[str, str]]:
    """Return entries for the formulas of a material or a friction law.

    Symbols stand for their parameters, whose values are entries of their own.
    """
    mesh = extract_unique_domain(x)
    # UFL sorts factors by the text of these numbers, in which "10" comes before "9".
    with constants_with_ten_digits():
        symbols = {symbol: ufl.Constant(mesh) for symbol in owner.parameters}
        pressure = ufl.Constant(mesh)
    if hasattr(owner, "friction_bound"):
        bound = _in_ufl(lambda: owner.friction_bound(pressure, **symbols))
        yield f"{name}: its friction bound", bound
        return
    if has_potential(owner):
        tensor = ufl.Constant(mesh, shape=(3, 3))
        for formula in ("potential", "conjugate"):
            density = _in_ufl(partial(getattr(owner, formula), tensor, **symbols))
            yield f"{name}: its {formula}", density
        yield f"{name}: its modulus", _in_ufl(lambda: owner.modulus(**symbols))
        return
    for formula in ("stress", "compliance"):
        matrix = partial(mandel_matrix, getattr(owner, formula), tensor_basis(owner, d), **symbols)
        yield f"{name}: its {formula}", _in_ufl(matrix)
    yield f"{name}: its modulus", _in_ufl(lambda: owner.modulus(**symbols))


def _density(load: Any, x: Ufl, n: Ufl) -> Ufl:
    """Evaluate the density of a load [force/area] or [force/volume] at x."""
    values = {name: _value(parameter(load, name), x) for name in load.parameters}
    return load.density(x, None if load.facets is None else n, **values)


def _strain(strain: Any, x: Ufl) -> Ufl:
    """Return a given strain at x, with symbols for what is given by regions."""
    values = {}
    for name in strain.parameters:
        value = parameter(strain, name)
        # The values of a mapping are entries of their own.
        with constants_with_ten_digits():
            values[name] = ufl.Constant(extract_unique_domain(x))
        if not isinstance(value, Mapping):
            values[name] = _value(value, x)
    return strain.strain(x, **values)


def _value(value: Any, x: Ufl) -> Ufl:
    """Evaluate a parameter at x: a number, a vector, a tensor, or a callable of x."""
    # UFL is callable, too.
    if callable(value) and not isinstance(value, ufl.core.expr.Expr):
        value = field_of(value, x)
    if isinstance(value, tuple | list | np.ndarray):
        return ufl.as_tensor([_value(component, x) for component in value])
    return ufl.as_ufl(value)


def _in_ufl(make: Callable[[], Any]) -> str:
    """Write an expression in words: how it begins, and its signature.

    Constants of the user's count by their values. Symbols and functions count by their
    order. The words are empty if the expression cannot be had: the solver will say why.
    """
    try:
        made = make()
        expression = ufl.as_ufl(float(made)) if isinstance(made, Real) else vector(made)
        values = {}
        for constant in extract_constants(expression):
            if isinstance(constant, fem.Constant):
                values[constant] = _value_of(constant)
        expression = ufl.replace(expression, values)
        # the signature takes numbers instead of the names that count in each process
        terminals = [*extract_constants(expression), *extract_coefficients(expression)]
        numbers: dict[Any, int] = {}
        for number, terminal in enumerate(terminals):
            numbers[terminal] = number
        for number, domain in enumerate(extract_domains(expression)):
            numbers[domain] = number
        signature = compute_expression_signature(expression, numbers)
    except Exception:
        return ""
    words = str(expression)
    if len(words) > LONGEST or COUNTED.search(words):
        words = "UFL"
    return f"{words} [{signature[:16]}]"


def _value_of(constant: fem.Constant) -> Ufl:
    """Return the value of a constant as UFL."""
    if constant.ufl_shape:
        return ufl.as_tensor(constant.value.tolist())
    return ufl.as_ufl(float(constant.value))
