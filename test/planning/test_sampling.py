"""Samples cover what they should, seeded; neighbourhoods hold every point once, close together."""

import numpy as np
import pytest

from flightdyn.planning import sampling


def test_a_grid_has_every_combination_the_last_fastest() -> None:
    assert sampling.grid([2, 3]).tolist() == [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1], [1, 2]]


def test_a_latin_hypercube_has_one_point_in_each_part_of_each_axis() -> None:
    points = sampling.latin_hypercube(50, 3, seed=4)
    for axis in points.T:
        assert sorted(np.floor(50 * axis).astype(int)) == list(range(50))
    assert np.unique(np.floor(50 * points), axis=0).shape == (50, 3)
    # of random points hardly one in a thousand sets does so even along one axis
    drawn = sampling.random(50, 3, seed=4)
    assert all(np.unique(np.floor(50 * axis)).size < 50 for axis in drawn.T)


@pytest.mark.parametrize('draw', [sampling.random, sampling.latin_hypercube])
def test_samples_depend_on_their_seed_alone(draw: object) -> None:
    assert callable(draw)
    np.testing.assert_array_equal(draw(20, 2, 7), draw(20, 2, 7))
    assert not np.array_equal(draw(20, 2, 7), draw(20, 2, 8))
    assert draw(20, 2, 7).min() >= 0 and draw(20, 2, 7).max() < 1


@pytest.mark.parametrize('counts', [[20, 20], [5, 5], [400], [1, 7, 6], [3]])
def test_neighbourhoods_of_a_grid_are_blocks_of_it(counts: list[int]) -> None:
    places = sampling.grid(counts).astype(float)
    groups = sampling.neighbourhoods(places, 16)
    assert sorted(n for group in groups for n in group) == list(range(len(places)))
    for group in groups:
        assert len(group) <= 16
        block = places[group]
        # every point of its box: none is cut out of a line
        assert np.prod(np.ptp(block, axis=0) + 1) == len(group)
        centre = (block.min(axis=0) + block.max(axis=0)) / 2
        far = np.linalg.norm(block - centre, axis=1)
        assert (np.diff(far) >= -1e-9).all()
    assert len(groups) <= max(1, len(places) // 6)


def test_neighbourhoods_of_samples_lie_apart() -> None:
    places = 20 * sampling.random(400, 2, seed=1)
    groups = sampling.neighbourhoods(places, 16)
    assert sorted(n for group in groups for n in group) == list(range(400))
    # a quarter of 20 x 20 for a group of 12 to 13 would be 5 x 20; they are far more compact
    widths = np.array([np.ptp(places[group], axis=0) for group in groups])
    assert widths.max() < 8


def test_points_at_one_place_are_split_by_number() -> None:
    groups = sampling.neighbourhoods(np.zeros((5, 2)), 2)
    assert sorted(map(sorted, groups)) == [[0, 1], [2], [3, 4]]
    assert sampling.neighbourhoods(np.zeros((0, 2)), 2) == []
