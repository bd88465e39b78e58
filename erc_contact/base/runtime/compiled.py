"""Forms that were compiled once are found again, on later meshes and in later runs.

A form is made anew on each mesh. DOLFINx then asks UFL for its signature, and FFCx
looks for it in the folder of compiled forms, where it reads the list of all files. With
some thousand files this takes 10 to 15 ms a form, half of the time of a small solve,
and the signature takes more than to assemble the form on some hundred cells. Here what
was compiled or loaded is remembered, by a key that costs a fifth of the signature.

UFL sorts the factors of a product by the text of the numbers of its Constants, in which
"9" comes after "10". So forms would be others, and would be compiled again, on the mesh
on which the number of Constants made so far passes a power of ten. Here the numbers of
the package's own Constants have ten digits.

Half of the time that a form takes to be compiled goes into calling the compiler. Forms
and expressions that are needed together are therefore compiled together, as a plain C
library (:mod:`erc_contact.base.runtime.form_library`).

The numbers of boundary parts are in the code of a form. Here the parts of a form have
the numbers 1, 2, ... (:mod:`erc_contact.base.runtime.parts`). So a load on the right
side is the same form as one on the top.

FFCx compares a node of an expression with all nodes to find its number. For a plastic
law this takes half a second; here the numbers are looked up.

DOLFINx, UFL and FFCx have no door for these. So :func:`form`, :func:`expression` and
:func:`constant` change a name of theirs while they call them
(:mod:`erc_contact.base.runtime.patches`), and everything in the package is compiled by
these.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from itertools import count
from operator import methodcaller
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx import jit as dolfinx_jit
from dolfinx import mesh as dmesh
from ffcx.ir.analysis.valuenumbering import ValueNumberer
from mpi4py import MPI

from erc_contact.base.runtime.form_library import compile_objects
from erc_contact.base.runtime.parts import renumber
from erc_contact.base.runtime.patches import method_caches_off, refused, replaced
from erc_contact.base.ufl_types import Ufl
from namedmesh.base.communicators import lasting
from namedmesh.base.releases import c_code, other_domains

FIRST_NUMBER = 10**9
"""Number of the package's first Constant; the user's Constants begin with 0."""
_numbers = count(FIRST_NUMBER)
"""Numbers of the Constants of the package."""
_known: dict[Any, tuple[Any, Any, Any]] = {}
"""What this process has compiled or loaded: key -> object, module, source as DOLFINx.

There is one for each form and each expression.
"""


def constants_with_ten_digits() -> AbstractContextManager[None]:
    """Give new Constants numbers of ten digits within a context."""
    if refused():
        return nullcontext()
    return replaced(ufl.Constant, "_counter", _numbers)


def constant(mesh: dmesh.Mesh, value: npt.ArrayLike) -> fem.Constant:
    """Make a Constant whose number does not change the code of a form."""
    with constants_with_ten_digits():
        return fem.Constant(mesh, value)


def form(integrals: ufl.Form) -> fem.Form:
    """Compile a form, or find it among the forms of this process; collective."""
    with _remembering():
        return fem.form(renumber(integrals))


def expression(value: Ufl, points: np.ndarray, comm: MPI.Comm, key: Any = None) -> fem.Expression:
    """Compile an expression at reference points, or find it; collective.

    Args:
        value: The expression.
        points: Reference points, shape (q, d).
        comm: The ranks that compile together.
        key: Its key, where that is known.
    """
    with _remembering(key):
        return fem.Expression(value, points, comm=comm, dtype=np.float64)


@contextmanager
def _remembering(key: Any = None) -> Iterator[None]:
    """Set DOLFINx to compile or load each form once in a process, within a context."""
    with method_caches_off():
        if refused():
            yield
            return
        with replaced(dolfinx_jit, "ffcx_jit", partial(_find_or_compile, key)):
            yield


def _find_or_compile(
    key: Any,
    comm: MPI.Comm,
    source: Any,
    form_compiler_options: Any = None,
    jit_options: Any = None,
) -> tuple[Any, Any, Any]:
    """Do what ``dolfinx.jit.ffcx_jit`` does, once for each key; collective.

    Args:
        key: The key of the source, None if it is to be made.
        comm: The ranks that compile together.
        source: A form, or an expression with its reference points.
        form_compiler_options: Options of FFCx.
        jit_options: Options of DOLFINx.
    """
    key = key or _key(source, form_compiler_options, jit_options)
    ranks = lasting(comm)
    if not _all_known(ranks, [key]):
        _compile({key: source}, ranks, form_compiler_options)
    return _known[key]


def together(
    comm: MPI.Comm,
    forms: Sequence[ufl.Form],
    expressions: Sequence[tuple[Ufl, np.ndarray]] = (),
) -> tuple[list[fem.Form], list[fem.Expression]]:
    """Compile forms and expressions in one module, or find them; collective.

    Args:
        comm: The ranks that compile together.
        forms: The forms.
        expressions: Expressions with their reference points, shape (q, d).
    """
    options = {"scalar_type": np.float64}
    sources = [*(renumber(form) for form in forms), *expressions]
    keys = [_key(source, options, None) for source in sources]
    if not refused() and not _all_known(comm, keys):
        with method_caches_off():
            _compile(dict(zip(keys, sources, strict=True)), comm, options)
    of_expressions = zip(expressions, keys[len(forms) :], strict=True)
    return (
        [form(integrals) for integrals in forms],
        [expression(value, points, comm, key) for (value, points), key in of_expressions],
    )


def _compile(sources: dict[Any, Any], comm: MPI.Comm, options: Any) -> None:
    """Compile or load forms and expressions, given by their keys; collective."""
    with _variables_by_order(), _nodes_by_number():
        objects = compile_objects(comm, list(sources.values()), options, c_code)
    for key, (compiled_object, library) in zip(sources, objects, strict=True):
        _known[key] = compiled_object, library, (None, None)


def _variables_by_order() -> AbstractContextManager[None]:
    """Sign the variables of an expression by their order within a context.

    UFL numbers its variables in each process, as they are made. FFCx counts the
    variables of a form anew, but not the variables of an expression: the same law would
    be compiled again whenever other scenes came before it.
    """
    if refused():
        return nullcontext()
    return replaced(ufl.classes.Label, "_ufl_signature_data_", _number_label)


def _number_label(label: Ufl, numbers: dict[Any, int]) -> tuple[str, int]:
    """Return what is signed of a variable: its number among all that were signed."""
    return "Label", numbers.setdefault(label, len(numbers))


def _nodes_by_number() -> AbstractContextManager[None]:
    """Find the nodes of FFCx's graphs by their numbers within a context."""
    if refused():
        return nullcontext()
    return replaced(ValueNumberer, "get_node_symbols", _symbols_of_node)


def _symbols_of_node(numberer: ValueNumberer, node: Ufl) -> list[int]:
    """Return the symbols that FFCx gives to a node of its graph."""
    return numberer.V_symbols[numberer.G.e2i[node]]


def _all_known(comm: MPI.Comm, keys: list[Any]) -> bool:
    """Tell whether all ranks know all of these keys; collective."""
    known = all(key in _known for key in keys)
    return known if comm.size == 1 else comm.allreduce(known, MPI.LAND)


# -- the key


def _key(source: Any, options: Any, settings: Any) -> Any:
    """Return what decides on the code of a form, or of an expression and its points."""
    if isinstance(source, ufl.Form):
        # UFL keeps this dictionary with a form for such things.
        if "structure" not in source._cache:
            integrals = source.integrals()
            integrands = [integral.integrand() for integral in integrals]
            source._cache["structure"] = _structure(integrands, integrals)
        return source._cache["structure"], repr(options), repr(settings)
    expression, points = source
    return (
        _structure([expression], ()),
        points.shape,
        points.tobytes(),
        repr(options),
        repr(settings),
    )


def _structure(roots: Sequence[Ufl], integrals: Sequence[Ufl]) -> Any:
    """Return expressions as tuples of numbers and words, the same on all meshes.

    They hold all that UFL's signature holds: the kind and the operands of each node,
    what UFL signs of a terminal, and the data of the integrals. Nodes of one content
    have one number, whether they are one object or several: of an expression that UFL
    has kept a part may be an object that it was not when it was made first. Only where
    such parts have free indices or labels of their own, a form has another structure
    with the same signature: it is looked for once more.

    Args:
        roots: The expressions.
        integrals: How each is integrated.
    """
    numbers = _Numbers()
    nodes: dict[tuple[Any, ...], int] = {}
    number_of: dict[int, int] = {}
    begun: set[int] = set()
    todo = list(roots)
    while todo:
        node = todo.pop()
        if id(node) in number_of:
            continue
        operands = node.ufl_operands
        if not operands:
            content = node._ufl_typecode_, numbers.signature_of(node)
        elif id(node) not in begun:
            # It comes back after its operands.
            begun.add(id(node))
            todo.append(node)
            todo += operands
            continue
        else:
            content = node._ufl_typecode_, *[number_of[id(operand)] for operand in operands]
        number_of[id(node)] = nodes.setdefault(content, len(nodes))
    of_roots = [number_of[id(root)] for root in roots]
    measures = [_measure(integral, numbers) for integral in integrals]
    return tuple(nodes), tuple(of_roots), repr(measures), numbers.in_order()


def _measure(integral: Ufl, numbers: _Numbers) -> tuple[Any, ...]:
    """Return how an integral is made: its domains, their parts, and its metadata."""
    extra = []
    for mesh, kind in other_domains(integral).items():
        extra.append((mesh._ufl_signature_data_(numbers), kind))
    domain = integral.ufl_domain()._ufl_signature_data_(numbers)
    place = (domain, integral.integral_type(), integral.subdomain_id())
    metadata = [(name, _in_full(value)) for name, value in integral.metadata().items()]
    return extra, place, sorted(metadata)


class _Numbers(dict[Any, int]):
    """Number meshes, coefficients, constants, labels and free indices in order."""

    def __missing__(self, key: Any) -> int:
        self[key] = len(self)
        return self[key]

    def signature_of(self, terminal: Ufl) -> tuple[Any, ...] | str:
        """Return what UFL's signature has of a node without operands.

        It is () of an operator. Of indices, a free one is a tuple with its number, a
        fixed one its value.
        """
        if isinstance(terminal, ufl.classes.MultiIndex):
            indices: list[Any] = []
            for index in terminal:
                fixed = isinstance(index, ufl.classes.FixedIndex)
                indices.append(int(index) if fixed else (self[index],))
            return tuple(indices)
        if isinstance(terminal, ufl.classes.Label):
            return (self[terminal],)
        if isinstance(terminal, ufl.classes.Zero):
            free = tuple(self[ufl.Index(count)] for count in terminal.ufl_free_indices)
            return terminal.ufl_shape, free, terminal.ufl_index_dimensions
        return terminal._ufl_signature_data_(self) if terminal._ufl_is_terminal_ else ()

    def in_order(self) -> tuple[Any, ...]:
        """Return numbers of coefficients, constants and meshes by their age.

        UFL numbers these in the order in which they were made.
        """
        coefficients = self._by_age(ufl.Coefficient, "count")
        constants = self._by_age(ufl.Constant, "count")
        meshes = self._by_age(ufl.AbstractDomain, "ufl_id")
        return coefficients, constants, meshes

    def _by_age(self, kind: type, age: str) -> tuple[int, ...]:
        """Return the numbers of objects of a kind, ordered by their method ``age``."""
        objects = [key for key in self if isinstance(key, kind)]
        objects.sort(key=methodcaller(age))
        return tuple(self[key] for key in objects)


def _in_full(value: Any) -> str:
    """Return a value of the metadata in full: UFL shortens the text of an array."""
    if isinstance(value, np.ndarray):
        return repr((value.shape, value.tolist()))
    return repr(value)
