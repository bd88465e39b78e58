"""Forms that were compiled once are found again, on later meshes and in later runs, and stay at hand in the process.

A form is made anew on each mesh. DOLFINx then asks UFL for its signature, and FFCx
looks for it in the folder of compiled forms, where it reads the list of all files. With
some thousand files this takes 10 to 15 ms a form, half of the time of a small solve,
and the signature takes more than to assemble the form on some hundred cells. Here what
was compiled or loaded is remembered, by a key that costs a fifth of the signature.

UFL sorts the factors of a product by the text of the numbers of its Constants, in which
"9" comes after "10". So forms would be others, and would be compiled again, on the mesh
on which the number of Constants made so far passes a power of ten. Here the numbers of
the package's own Constants have ten digits.

Half of the time that a form takes to be compiled is that of calling the compiler. Forms
that are needed together are therefore compiled together.

DOLFINx and UFL have no door for either. So :func:`form`, :func:`expression` and
:func:`constant` change a name of theirs while they call them
(:mod:`erc_contact.base.runtime.patches`), and everything in the package is compiled by
these.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import partial
from itertools import count
from operator import methodcaller
from typing import Any

import ffcx
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx import jit as dolfinx_jit
from dolfinx import mesh as dmesh
from ffcx.codegeneration import jit
from mpi4py import MPI

from erc_contact.base.runtime.patches import forms_freed, refused, replaced

FIRST = 10**9
"""Number of the first Constant of the package; those of the user's begin with 0."""
_numbers = count(FIRST)
"""Numbers of the Constants of the package."""
_known: dict[Any, tuple[Any, Any, Any]] = {}
"""What DOLFINx needs of each form and each expression that this process has compiled or loaded: object and module."""


def numbers_alike() -> AbstractContextManager[None]:
    """Give new Constants numbers of ten digits within a context."""
    if refused():
        return nullcontext()
    return replaced(ufl.Constant, "_counter", _numbers)


def constant(mesh: dmesh.Mesh, value: npt.ArrayLike) -> fem.Constant:
    """Make a Constant whose number does not change the code of a form."""
    with numbers_alike():
        return fem.Constant(mesh, value)


def form(integrals: ufl.Form) -> fem.Form:
    """Compile a form, or find it among those that this process knows; collective."""
    with _remembering():
        return fem.form(integrals)


def expression(value: Any, points: np.ndarray, comm: MPI.Comm) -> fem.Expression:
    """Compile an expression at reference points, or find it among those that this process knows; collective."""
    with _remembering():
        return fem.Expression(value, points, comm=comm, dtype=np.float64)


@contextmanager
def _remembering() -> Iterator[None]:
    """Let DOLFINx compile or load each form and each expression once in a process, within a context."""
    with forms_freed():
        if refused():
            yield
            return
        with replaced(dolfinx_jit, "ffcx_jit", partial(_remembered, dolfinx_jit.ffcx_jit)):
            yield


def _remembered(
    compile_one: Callable[..., Any],
    comm: MPI.Comm,
    one: Any,
    form_compiler_options: Any = None,
    jit_options: Any = None,
) -> tuple[Any, Any, Any]:
    """Do what ``dolfinx.jit.ffcx_jit`` does, once for each key; collective."""
    key = _key(one, form_compiler_options, jit_options)
    if not _all_known(comm, [key]):
        made, module = compile_one(comm, one, form_compiler_options, jit_options)[:2]
        _known[key] = made, module, (None, None)
    return _known[key]


def compile_together(comm: MPI.Comm, forms: Sequence[ufl.Form]) -> None:
    """Compile forms in one module, in which :func:`form` then finds each of them; collective."""
    if refused():
        return
    options = {"scalar_type": np.float64}
    keys = [_key(form, options, None) for form in forms]
    if not _all_known(comm, keys):
        with forms_freed():
            made, module = _compiled(comm, list(forms), options)
        _known.update(
            {key: (one, module, (None, None)) for key, one in zip(keys, made, strict=True)}
        )


@dolfinx_jit.mpi_jit_decorator
def _compiled(forms: list[ufl.Form], options: dict[str, Any]) -> tuple[list[Any], Any]:
    """FFCx's objects for forms and their module; the ranks, which come first in a call, make them together."""
    return jit.compile_forms(forms, options=ffcx.get_options(options), **dolfinx_jit.get_options())[
        :2
    ]


def _all_known(comm: MPI.Comm, keys: list[Any]) -> bool:
    """Whether all ranks know all of these keys; collective."""
    known = all(key in _known for key in keys)
    return known if comm.size == 1 else comm.allreduce(known, MPI.LAND)


# -- the key
# --------------------------------------------------------------------------------------------------


def _key(one: Any, options: Any, settings: Any) -> Any:
    """What decides on the code of a form, or of an expression and its points, with these options."""
    if isinstance(one, ufl.Form):
        if "structure" not in one._cache:  # UFL keeps this dictionary with a form for such things
            integrals = one.integrals()
            one._cache["structure"] = _structure(
                [part.integrand() for part in integrals], integrals
            )
        return one._cache["structure"], repr(options), repr(settings)
    expression, points = one
    return (
        _structure([expression], ()),
        points.shape,
        points.tobytes(),
        repr(options),
        repr(settings),
    )


def _structure(roots: Sequence[Any], integrals: Sequence[Any]) -> Any:
    """Expressions, and how each is integrated, as tuples of numbers and words that are the same on all meshes.

    They hold all that UFL's signature holds: the kind and the operands of each node,
    what UFL signs of a terminal, and the data of the integrals. A node is followed by
    its operands; one that was met before is its place, below zero. Nodes are known by
    their identity here, not by their content, which is quick. So a form that is built
    in another way may have another structure with the same signature: it is looked for
    once more.
    """
    numbers = _Numbers()
    nodes: list[Any] = []
    places: dict[int, int] = {}
    todo = list(roots)
    while todo:
        node = todo.pop()
        if id(node) in places:
            nodes.append(~places[id(node)])
            continue
        places[id(node)] = len(places)
        operands = node.ufl_operands
        nodes += node._ufl_typecode_, len(operands) or numbers.signed(node)
        todo += operands
    measures = [
        (
            [
                (mesh._ufl_signature_data_(numbers), kind)
                for mesh, kind in one.extra_domain_integral_type_map().items()
            ],
            (
                one.ufl_domain()._ufl_signature_data_(numbers),
                one.integral_type(),
                one.subdomain_id(),
            ),
            sorted((name, _told(value)) for name, value in one.metadata().items()),
        )
        for one in integrals
    ]
    return tuple(nodes), repr(measures), numbers.in_order()


class _Numbers(dict[Any, int]):
    """Numbers of meshes, coefficients, constants, labels and free indices, in the order in which they are met."""

    def __missing__(self, one: Any) -> int:
        self[one] = len(self)
        return self[one]

    def signed(self, terminal: Any) -> tuple[Any, ...] | str:
        """What UFL signs of a terminal; of an operator without operands it is nothing."""
        if isinstance(terminal, ufl.classes.MultiIndex):
            return tuple(
                int(i) if isinstance(i, ufl.classes.FixedIndex) else (self[i],) for i in terminal
            )
        if isinstance(terminal, ufl.classes.Label):
            return (self[terminal],)
        if isinstance(terminal, ufl.classes.Zero):
            free = tuple(self[ufl.Index(count)] for count in terminal.ufl_free_indices)
            return terminal.ufl_shape, free, terminal.ufl_index_dimensions
        return terminal._ufl_signature_data_(self) if terminal._ufl_is_terminal_ else ()

    def in_order(self) -> tuple[Any, ...]:
        """Numbers of coefficients, constants and meshes in the order in which these were made, as UFL numbers them."""
        kinds = (ufl.Coefficient, "count"), (ufl.Constant, "count"), (ufl.AbstractDomain, "ufl_id")
        some = ([one for one in self if isinstance(one, kind)] for kind, _ in kinds)
        return tuple(
            tuple(self[one] for one in sorted(of, key=methodcaller(age)))
            for of, (_, age) in zip(some, kinds, strict=True)
        )


def _told(value: Any) -> str:
    """A value of the metadata in full: UFL shortens the text of an array."""
    return repr((value.shape, value.tolist()) if isinstance(value, np.ndarray) else value)
