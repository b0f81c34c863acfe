"""Cases that cover ranges of parameters: grids, seeded samples, and which are neighbours."""

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def grid(counts: Sequence[int]) -> Index:
    """Return every combination of 0 .. count - 1 (product of counts, d), the last fastest."""
    every = itertools.product(*(range(count) for count in counts))
    return np.array(list(every), dtype=np.int64).reshape(-1, len(counts))


def random(n: int, d: int, seed: int) -> Array:
    """Return n points (n, d) of the unit cube, each drawn for itself."""
    return np.random.default_rng(seed).random((n, d))


def latin_hypercube(n: int, d: int, seed: int) -> Array:
    """Return n points (n, d) of the unit cube, one in each n-th of every axis.

    References
    ----------
    .. [1] McKay, Beckman, Conover, *Technometrics* 21 (1979) 239: their means vary less from
       seed to seed than those of points that are each drawn for themselves.
    """
    generator = np.random.default_rng(seed)
    strata = np.column_stack([generator.permutation(n) for _ in range(d)])
    points: Array = (strata + generator.random((n, d))) / n
    return points


def neighbourhoods(places: Array, most: int) -> list[list[int]]:
    """Return points in groups that lie together, each from its middle outwards.

    Parameters
    ----------
    places : (n, d)
        In steps: points one apart are next to each other.
    most : int
        Points in a group.

    Returns
    -------
    list of list of int
        Every point once. The same places give the same groups.
    """
    if places.shape[0] == 0:
        return []
    groups = _halved(places, np.arange(places.shape[0]), most)
    return [_from_the_middle(places, group) for group in groups]


def _halved(places: Array, group: Index, most: int) -> list[Index]:
    if group.size <= most:
        return [group]
    axis = int(np.argmax(np.ptp(places[group], axis=0)))
    ordered = group[np.argsort(places[group, axis], kind='stable')]
    # a cut between lines of a grid, if there are any, leaves neighbours together
    cuts = 1 + np.flatnonzero(np.diff(places[ordered, axis]) > 0)
    middle = group.size // 2
    cut = int(cuts[np.argmin(np.abs(cuts - middle))]) if cuts.size else middle
    return [*_halved(places, ordered[:cut], most), *_halved(places, ordered[cut:], most)]


def _from_the_middle(places: Array, group: Index) -> list[int]:
    centre = (places[group].min(axis=0) + places[group].max(axis=0)) / 2
    # rounded: points that are equally far are in their order, on every machine
    far = np.round(np.linalg.norm(places[group] - centre, axis=1), 9)
    return [int(member) for member in group[np.lexsort((group, far))]]
