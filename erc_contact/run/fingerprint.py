"""What a run is, in words that can be compared: its scene, first mesh, method, strategy, numbers and versions.

Numbers and names are compared by value, objects by their class and attributes.
Callables cannot be compared, but what they return can: their UFL at the position on the
mesh, with all numbers in it. So are the formulas of materials, laws and loads. A
fingerprint does not depend on the ranks, on the process, or on where a mesh is in a
run.
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
from erc_contact.base.versions import versions
from erc_contact.mesh.domain import Domain
from erc_contact.model.users import vector
from erc_contact.model.values import parameter
from erc_contact.scene.material import mandel_matrix
from erc_contact.scene.scene import Scene

DIGITS = 9
"""Digits of the coordinates that make a first mesh the same [-], of the extent of the body."""
SHORT = 60
"""Longest expression that is told in full."""
NOTHING = "nothing of the kind"
"""Told where one of two runs has something that the other one lacks."""
COUNTED = re.compile(r"_\{?\d")
"""A name with a number in an expression, which is another one in each process."""

Fingerprint = dict[str, str]
"""What is compared -> its value in words."""


def fingerprint(scene: Scene, domain: Domain, numbers: Mapping[str, Any]) -> Fingerprint:
    """The fingerprint of a run; collective.

    Args:
        scene: The problem.
        domain: The first mesh.
        numbers: The other arguments that decide on the meshes of the run, by their
            names.
    """
    mesh = _of_mesh(domain)
    kind = ("triangle", "tetrahedron")[domain.dim - 2]
    symbols = ufl.Mesh(
        basix.ufl.element("Lagrange", kind, 1, shape=(domain.dim,))
    )  # that of a mesh has variants
    x, n = ufl.SpatialCoordinate(symbols), ufl.FacetNormal(symbols)
    entries = list(_of_object("material", scene.material, x))
    entries += _formulas("material", scene.material, x, domain.dim)
    for name in ("supports", "loads", "contacts"):
        for number, one in enumerate(getattr(scene, name)):
            entries += _of_object(f"{name}[{number}]", one, x)
    for number, load in enumerate(scene.loads):
        entries.append((f"loads[{number}]: its density", _in_ufl(partial(_density, load, x, n))))
    for number, contact in enumerate(scene.contacts):
        if contact.law is not None:
            entries += _formulas(
                f"contacts[{number}]: its friction law", contact.law, x, domain.dim
            )
    for name, value in numbers.items():
        entries += _of_object(name, value, x)
    made_by = versions()
    return (
        mesh
        | dict(entries)
        | {f"version of {name}": made_by[name] for name in ("DOLFINx", "erc_contact")}
    )


def of_history(
    scene_at: Callable[[float], Scene],
    domain: Domain,
    times: Sequence[float],
    numbers: Mapping[str, Any],
) -> Fingerprint:
    """The fingerprint of a loading history: that of its first time, and what differs from it later; collective."""
    every = [fingerprint(together(domain.mesh.comm, scene_at, t), domain, numbers) for t in times]
    found = dict(every[0])
    for t, later in zip(times, every, strict=True):
        for name in sorted(every[0].keys() | later.keys()):
            if later.get(name) != every[0].get(name):
                found[f"{name} at t = {t!r}"] = later.get(name, NOTHING)
    return found


def differences(given: Fingerprint, kept: Fingerprint) -> list[str]:
    """What differs between this call and a folder, in words."""
    names = [*given, *(name for name in kept if name not in given)]
    return [
        f"{name} is {given.get(name, NOTHING)}, in the folder {kept.get(name, NOTHING)}"
        for name in names
        if given.get(name) != kept.get(name)
    ]


def _of_mesh(domain: Domain) -> Fingerprint:
    mesh, comm = domain.mesh, domain.mesh.comm
    own = mesh.geometry.x[: mesh.geometry.index_map().size_local]
    parts = comm.gather(np.round(own / domain.extent, DIGITS) + 0.0)
    x = np.concatenate(parts) if parts else np.empty((0, 3))
    digest = hashlib.sha256(x[np.lexsort(x.T)].tobytes()).hexdigest()[:16]
    facets = {name: len(domain.owned_facets(name)) for name in domain.outer}
    regions = {
        name: int((domain.region(name) < domain.owned_cells).sum()) for name in domain.regions
    }
    own_parts = [
        *(("part", *item) for item in facets.items()),
        *(("region", *item) for item in regions.items()),
    ]
    sizes = [
        f"{what} {name!r} of {comm.allreduce(n, MPI.SUM)}" for what, name, n in sorted(own_parts)
    ]
    shape = f"true shape {type(domain.geometry).__name__}"
    mesh_words = f"{domain.cells} cells in {domain.dim}D, {domain.vertices} vertices {digest}"
    return {"the first mesh": ", ".join([mesh_words, *sizes, shape])}


def _of_object(what: str, value: Any, x: Any) -> Iterator[tuple[str, str]]:
    """Entries for a value, or for an object and each of its attributes."""
    plain = _in_words(value, x)
    if plain is not None:
        yield what, plain
        return
    yield what, type(value).__qualname__
    known = (
        {f.name for f in fields(value)}
        if is_dataclass(value)
        else set(getattr(value, "__dict__", ()))
    )
    for name in sorted(known):
        yield from _of_object(f"{what}.{name}", getattr(value, name), x)


def _in_words(value: Any, x: Any) -> str | None:
    """A value in words, None if it is an object with attributes."""
    words = literal(value)
    if words is not None:
        return words
    if isinstance(value, tuple | list | np.ndarray):
        return f"({', '.join(str(_in_words(v, x)) for v in value)})"
    if isinstance(value, Mapping):
        return (
            f"{{{', '.join(f'{k!r}: {_in_words(value[k], x)}' for k in sorted(value, key=repr))}}}"
        )
    if callable(value) and not isinstance(value, type):
        return _in_ufl(lambda: value(x)) or getattr(value, "__qualname__", type(value).__qualname__)
    return None


def _formulas(what: str, owner: Any, x: Any, d: int) -> Iterator[tuple[str, str]]:
    """Entries for the formulas of a material or a friction law, with symbols for its parameters."""
    symbols = {name: ufl.Constant(extract_unique_domain(x)) for name in owner.parameters}
    if hasattr(owner, "friction_bound"):
        pressure = ufl.Constant(extract_unique_domain(x))
        yield (
            f"{what}: its friction bound",
            _in_ufl(lambda: owner.friction_bound(pressure, **symbols)),
        )
        return
    for name in ("stress", "compliance"):
        yield (
            f"{what}: its {name}",
            _in_ufl(partial(mandel_matrix, getattr(owner, name), d, **symbols)),
        )
    yield f"{what}: its modulus", _in_ufl(lambda: owner.modulus(**symbols))


def _density(load: Any, x: Any, n: Any) -> Any:
    values = {name: _value(parameter(load, name), x) for name in load.parameters}
    return load.density(x, None if load.facets is None else n, **values)


def _value(value: Any, x: Any) -> Any:
    if callable(value):
        value = value(x)
    return (
        ufl.as_vector([_value(v, x) for v in value])
        if isinstance(value, tuple | list)
        else ufl.as_ufl(value)
    )


def _in_ufl(make: Callable[[], Any]) -> str:
    """An expression in words: how it begins, and its signature; empty if it cannot be had (the solver will say why).

    Constants of the user's count by their values. Symbols and functions count by their
    order.
    """
    try:
        made = make()
        expression = ufl.as_ufl(float(made)) if isinstance(made, Real) else vector(made)
        given = [c for c in extract_constants(expression) if isinstance(c, fem.Constant)]
        values = [
            ufl.as_tensor(c.value.tolist()) if c.ufl_shape else ufl.as_ufl(float(c.value))
            for c in given
        ]
        expression = ufl.replace(expression, dict(zip(given, values, strict=True)))
        terminals = [*extract_constants(expression), *extract_coefficients(expression)]
        numbers: dict[Any, int] = {one: number for number, one in enumerate(terminals)}
        numbers |= {domain: number for number, domain in enumerate(extract_domains(expression))}
        signature = compute_expression_signature(expression, numbers)
    except Exception:
        return ""
    told = str(expression)
    return (
        f"{told if len(told) <= SHORT and not COUNTED.search(told) else 'UFL'} [{signature[:16]}]"
    )
