"""Know cells and facets that are images of others, by the motions between copies.

See :mod:`erc_contact.admissible.surrounded`, which makes them. The cells of the body
come first, and its facets likewise; the images follow.

Symbols: n cells and F facets of the body, N nodes of a cell, m of a facet, d dimension.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from erc_contact.scene.material import mandel_basis

SAME_MATRIX = 1e-12
"""Difference of a matrix from its image that counts as none, over its entries [-]."""


class NoImages:
    """Leave cells and facets as they are: the body has no copies.

    Attributes:
        more_nodes: Number of nodes that images alone have. They come last.
        repeated: Facets whose moments follow from other facets: on the second sides of
            pairs, and of images alone; shape (r,).
    """

    def __init__(self) -> None:
        self.more_nodes = 0
        self.repeated = np.empty(0, dtype=np.int64)

    def vectors(self, values: np.ndarray) -> np.ndarray:
        """Add images to vectors at the nodes of cells, shape (n, N or 1, d)."""
        return values

    def tensors(self, values: np.ndarray) -> np.ndarray:
        """Add images to tensors at the nodes of cells, shape (n, N or 1, d, d)."""
        return values

    def matrices(self, values: np.ndarray) -> np.ndarray:
        """Add images to matrices of the material, shape (n or 1, Q or 1, s, s).

        At all Q points of an image is the mean.
        """
        return values

    def of_facets(self, values: np.ndarray) -> np.ndarray:
        """Add images to what facets have in any frame, shape (F, ...)."""
        return values

    def moments(self, values: np.ndarray) -> np.ndarray:
        """Add images to moments on the first sides of facets, shape (F, m, d)."""
        return values

    def repeat(self, values: np.ndarray) -> np.ndarray:
        """Set the moments of repeated facets, in place, and return all of them.

        Args:
            values: Moments of all facets, images among them.
        """
        return values

    def fold(self, values: np.ndarray) -> None:
        """Add what repeated facets have to the facets that they repeat, in place.

        It is the transpose of :meth:`repeat`. Repeated facets have nothing then.

        Args:
            values: As in :meth:`repeat`.
        """

    def are_own(self, centres: np.ndarray) -> np.ndarray | bool:
        """Tell which centres of patches stand for all of their images.

        Args:
            centres: Their nodes, ascending, shape (..., d-1).
        """
        return True

    def turns_about(self, centres: np.ndarray) -> np.ndarray | float:
        """Return how many motions leave centres of patches in place, shape (...)."""
        return 1.0


NO_IMAGES = NoImages()
"""A body has no copies."""


class FacetImages(NamedTuple):
    """Say of which facets some facets are the images.

    Attributes:
        source: The facets, shape (r,).
        order: Of which of their nodes each node is the image, shape (r, m, 1).
        turn: R, negative where the first side is the image of the second, (r, d, d).
    """

    source: np.ndarray
    order: np.ndarray
    turn: np.ndarray

    def moments(self, values: np.ndarray) -> np.ndarray:
        """Return the moments of the images from the moments (F, m, d) of all facets."""
        in_order = np.take_along_axis(values[self.source], self.order, axis=1)
        return np.matmul(in_order, self.turn.swapaxes(1, 2))


class CellImages(NamedTuple):
    """Say of which cells some cells are the images.

    Attributes:
        source: The cells, shape (i,).
        turn: R, shape (i, d, d).
        order: Of which of their nodes each node is the image, shape (i, N).
    """

    source: np.ndarray
    turn: np.ndarray
    order: np.ndarray

    def at_nodes(self, values: np.ndarray) -> np.ndarray:
        """Return what nodes or cells have, (n, N or 1, ...), at the images."""
        of_source = values[self.source]
        count = values.shape[1]
        if count == 1:
            return of_source
        # Vertices come first, and are alone at degree 1.
        order = self.order[:, :count].reshape(-1, count, *[1] * (values.ndim - 2))
        return np.take_along_axis(of_source, order, axis=1)


class Centres(NamedTuple):
    """Know the centres of patches that are images of others.

    Attributes:
        turns_about: How many motions leave each node in place, the identity among them,
            shape (nodes,).
        repeated: Keys of the centres for which other centres stand.
    """

    turns_about: np.ndarray
    repeated: np.ndarray

    def key(self, centres: np.ndarray) -> np.ndarray:
        """Return a number for the nodes (..., d-1), ascending, of each centre."""
        return centres[..., 0].astype(np.int64) * len(self.turns_about) + centres[..., -1]


class Images(NoImages):
    """Add what images of cells and facets have.

    Args:
        counts: Number of the cells of the body, and of its facets.
        more_nodes: See :class:`NoImages`.
        of_cells: The cells that follow the cells of the body.
        of_facets: The facets that follow its facets.
        firsts: Facets on first sides of pairs as images of those on second sides.
        seconds: Facets on second sides as images of those on first sides.
        centres: Centres of patches on the sides.
    """

    def __init__(
        self,
        counts: tuple[int, int],
        more_nodes: int,
        of_cells: CellImages,
        of_facets: FacetImages,
        firsts: FacetImages,
        seconds: FacetImages,
        centres: Centres,
    ) -> None:
        self.more_nodes = more_nodes
        self._cells, self._facets = counts
        self._of_cells = of_cells
        self._of_facets = of_facets
        self._firsts = firsts
        self._seconds = seconds
        of_images = self._facets + np.arange(len(of_facets.source))
        self.repeated = np.append(firsts.source, of_images)
        self._centres = centres

    def vectors(self, values: np.ndarray) -> np.ndarray:
        """Add images to vectors, see :meth:`NoImages.vectors`."""
        turned = np.matmul(self._of_cells.at_nodes(values), self._of_cells.turn.swapaxes(1, 2))
        return np.concatenate([values, turned])

    def tensors(self, values: np.ndarray) -> np.ndarray:
        """Add images to tensors, see :meth:`NoImages.tensors`."""
        turn = self._of_cells.turn[:, None]
        turned = np.matmul(np.matmul(turn, self._of_cells.at_nodes(values)), turn.swapaxes(2, 3))
        return np.concatenate([values, turned])

    def matrices(self, values: np.ndarray) -> np.ndarray:
        """Add images to matrices of the material, see :meth:`NoImages.matrices`."""
        of_body = np.broadcast_to(values, (self._cells, *values.shape[1:]))
        mean = of_body[self._of_cells.source].mean(axis=1)
        turn = _mandel_turns(self._of_cells.turn, values.shape[2])
        turned = np.matmul(np.matmul(turn, mean), turn.swapaxes(1, 2))
        changes = abs(turned - mean).max(initial=0.0) > SAME_MATRIX * abs(mean).max(initial=0.0)
        if len(values) == 1 and not changes:
            return values
        of_images = np.broadcast_to(turned[:, None], (len(turned), *values.shape[1:]))
        return np.concatenate([of_body, of_images])

    def of_facets(self, values: np.ndarray) -> np.ndarray:
        """Add images to what facets have, see :meth:`NoImages.of_facets`."""
        return np.concatenate([values, values[self._of_facets.source]])

    def moments(self, values: np.ndarray) -> np.ndarray:
        """Add images to moments, see :meth:`NoImages.moments`."""
        return np.concatenate([values, self._of_facets.moments(values)])

    def repeat(self, values: np.ndarray) -> np.ndarray:
        """Set the moments of repeated facets, see :meth:`NoImages.repeat`."""
        values[self._firsts.source] = self._seconds.moments(values)
        values[self._facets :] = self._of_facets.moments(values)
        return values

    def fold(self, values: np.ndarray) -> None:
        """Add what repeated facets have, see :meth:`NoImages.fold`."""
        of_images = np.matmul(values[self._facets :], self._of_facets.turn)
        np.add.at(
            values, (self._of_facets.source[:, None], self._of_facets.order[..., 0]), of_images
        )
        values[self._seconds.source] += self._firsts.moments(values)
        values[self.repeated] = 0.0

    def are_own(self, centres: np.ndarray) -> np.ndarray:
        """Tell which centres stand for their images, see :meth:`NoImages.are_own`."""
        return ~np.isin(self._centres.key(centres), self._centres.repeated)

    def turns_about(self, centres: np.ndarray) -> np.ndarray:
        """Return how many motions leave them, see :meth:`NoImages.turns_about`."""
        return self._centres.turns_about[centres].min(axis=-1)


def _mandel_turns(turn: np.ndarray, size: int) -> np.ndarray:
    """Return the matrices that turn Mandel components as R turns tensors.

    Args:
        turn: R, shape (i, d, d).
        size: Number of components; a hoop stress, which stays, is the last of rings.

    Returns:
        Shape (i, size, size).
    """
    basis = mandel_basis(turn.shape[1])
    turned = np.einsum("iab,sbc,idc->isad", turn, basis, turn, optimize=True)
    result = np.tile(np.eye(size), (len(turn), 1, 1))
    result[:, : len(basis), : len(basis)] = np.einsum("rad,isad->irs", basis, turned)
    return result
