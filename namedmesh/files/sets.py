"""Make of the sets of a file parts and regions that share nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from namedmesh.tags import NO_TAG


@dataclass(frozen=True, eq=False)
class Named:
    """Hold members of a set by their numbers.

    Attributes:
        name: Its name.
        tag: Number by which the file calls it, or None.
        members: Numbers of its facets or cells, in order, without repetition.
        weak: Whether other sets go before it.
    """

    name: str
    tag: int | None
    members: np.ndarray
    weak: bool = False


def disjoint(
    sets: Sequence[Named], count: int, kind: str
) -> tuple[np.ndarray, dict[str, int], list[str]]:
    """Give each facet or cell the tag of the smallest set that has it.

    Weak sets come last. Sets that others fill are left out: "all" beside "left" and
    "right".

    Args:
        sets: The sets. Sets of the same name are one.
        count: How many facets or cells there are.
        kind: The word for a set, "part" or "region".

    Returns:
        The tag of each, the tags by name in the order of the sets, and what was
        changed, in words.
    """
    sets = _one_of_each_name(sets)
    owner = np.full(count, -1)
    notes = []
    kept = []
    order = sorted(range(len(sets)), key=lambda i: (sets[i].weak, len(sets[i].members)))
    for index in order:
        members = sets[index].members
        taken = owner[members]
        free = members[taken < 0]
        smaller = [sets[i].name for i in np.unique(taken[taken >= 0])]
        name = sets[index].name
        if not len(free):
            if smaller:
                notes.append(f"{kind} {name!r} is {list_names(smaller)}, and is left out")
            continue
        if smaller:
            notes.append(f"{kind} {name!r} is without what is in {list_names(smaller)}")
        owner[free] = index
        kept.append(index)
    tags, names = _tags(sets, sorted(kept))
    numbers = np.full(len(sets) + 1, NO_TAG)
    for index, tag in zip(sorted(kept), tags, strict=True):
        numbers[index] = tag
    # The last entry stands for facets or cells that no set has.
    return numbers[owner], names, notes


def _one_of_each_name(sets: Sequence[Named]) -> list[Named]:
    """Return sets, of which equal names are put together, without empty sets."""
    of_name: dict[str, list[Named]] = {}
    for named in sets:
        of_name.setdefault(named.name, []).append(named)
    result = []
    for name, group in of_name.items():
        members = np.unique(np.concatenate([named.members for named in group]))
        if len(members):
            is_weak = all(named.weak for named in group)
            result.append(Named(name, group[0].tag, members, is_weak))
    return result


def _tags(sets: Sequence[Named], kept: Sequence[int]) -> tuple[list[int], dict[str, int]]:
    """Return different tags of the sets that are kept, tags of the file if any."""
    given = [sets[index].tag for index in kept]
    next_tag = max((tag for tag in given if tag is not None), default=0) + 1
    tags: list[int] = []
    for tag in given:
        if tag is not None and tag not in tags:
            tags.append(tag)
        else:
            tags.append(next_tag)
            next_tag += 1
    return tags, {sets[index].name: tag for index, tag in zip(kept, tags, strict=True)}


def list_names(names: Sequence[str]) -> str:
    """Return names in words, not too many."""
    shown = [repr(name) for name in names[:4]]
    if len(names) > 4:
        shown.append(f"{len(names) - 4} more")
    return " and ".join([", ".join(shown[:-1]), shown[-1]] if len(shown) > 1 else shown)
