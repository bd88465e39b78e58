"""Give the sets of a file that have tags the names that a user wants."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from namedmesh.base.checks import description
from namedmesh.base.exceptions import InputError
from namedmesh.base.names import printable
from namedmesh.files.file_mesh import ElementSet, FacetSet, FileMesh, NodeSet

Key = tuple[int, int]
"""Dimension and tag of a set."""


def rename_sets(mesh: FileMesh, names: Mapping[int | Key, str]) -> FileMesh:
    """Give names to the sets of a mesh.

    Args:
        mesh: The mesh of a file.
        names: Names by the tags of sets, or by pairs (dimension, tag).

    Raises:
        InputError: If the names are no mapping to texts, no set or two sets have a tag,
            or two sets of the same dimension get the same name.
    """
    is_mapping = isinstance(names, Mapping)
    if not is_mapping or not all(isinstance(name, str) and name for name in names.values()):
        example = "names={1: 'bottom', 2: 'top'}"
        raise InputError(
            f"names is {description(names)}; give names of parts by their tags, e.g. {example}."
        )
    called: dict[Key, str] = {}
    sets: list[ElementSet | FacetSet | NodeSet] = [*mesh.element_sets, *mesh.facet_sets]
    for found in [*sets, *mesh.node_sets]:
        if found.tag is not None:
            called[_dim_of(mesh, found), found.tag] = found.name
    new = {_key_of(key, list(called)): name for key, name in names.items()}
    called.update(new)
    for (d, tag), name in called.items():
        same = [known_tag for (e, known_tag), known in called.items() if (e, known) == (d, name)]
        if len(same) > 1 and (d, tag) in new:
            first, second = sorted(same)[:2]
            raise InputError(
                f"The tags {first} and {second} would have the name {name!r}; take another name."
            )

    def name_of(found: Any) -> str:
        return called.get((_dim_of(mesh, found), found.tag), found.name)

    return _renamed(mesh, name_of)


def with_printable_names(mesh: FileMesh) -> tuple[FileMesh, list[str]]:
    """Return a mesh whose sets have names of one line that can be seen.

    Characters that cannot be seen become question marks: a terminal or another program
    may obey them.

    Returns:
        The mesh, and what was changed, in words.
    """
    sets: list[ElementSet | FacetSet | NodeSet] = [*mesh.element_sets, *mesh.facet_sets]
    names = {found.name for found in [*sets, *mesh.node_sets]}
    changed = sorted(name for name in names if printable(name) != name)
    if not changed:
        return mesh, []
    notes = [f"names with characters that cannot be seen: {', '.join(map(printable, changed))}"]
    return _renamed(mesh, lambda found: printable(found.name)), notes


def _renamed(mesh: FileMesh, name_of: Callable[[Any], str]) -> FileMesh:
    """Return a mesh with other names of its sets."""

    def rename(found: Any) -> Any:
        return replace(found, name=name_of(found))

    return replace(
        mesh,
        element_sets=tuple(map(rename, mesh.element_sets)),
        facet_sets=tuple(map(rename, mesh.facet_sets)),
        node_sets=tuple(map(rename, mesh.node_sets)),
    )


def _dim_of(mesh: FileMesh, found: ElementSet | FacetSet | NodeSet) -> int:
    """Return the dimension of a set of cells of the body, or else of its sides."""
    blocks = found.members if isinstance(found, ElementSet) else ()
    of_body = any(mesh.blocks[number].dim == mesh.dim for number in blocks)
    return mesh.dim if of_body else mesh.dim - 1


def _key_of(key: int | Key, keys: list[Key]) -> Key:
    """Find the dimension and tag of the set that a key of names means.

    Raises:
        InputError: If no set or two sets have this tag.
    """
    matching = [known for known in keys if key in (known, known[1])]
    if not matching:
        tags = ", ".join(str(tag) for _, tag in keys)
        raise InputError(
            f"names has {key!r}, and no part of the mesh has this tag; the mesh has {tags}."
        )
    if len(matching) > 1:
        kinds = " and ".join(map(str, matching))
        raise InputError(
            f"names has {key!r}, which is a boundary part and a region; give one of {kinds}."
        )
    return matching[0]
