"""North and east smoothed together, against each smoothed alone."""

import numpy as np
import pytest

from flightdyn.replay.coupled import smooth_horizontal
from flightdyn.replay.smoother import smooth

TURN = np.radians(35.0)


def flown(seed: int, size: int = 200) -> tuple[np.ndarray, np.ndarray]:
    """Return times and places along and across a way, one of them unknown."""
    rng = np.random.default_rng(seed)
    time = np.cumsum(rng.uniform(0.5, 2.0, size))
    place = 40.0 * time[:, None] + rng.normal(0.0, (20.0, 2.0), (size, 2))
    place[57] = np.nan
    return time, place


def test_noise_along_and_across_a_diagonal_is_that_of_turned_axes() -> None:
    time, place = flown(1)
    alone = smooth(
        time,
        np.append(place, place[:, :1], axis=1),
        position_std=[20.0, 2.0, 20.0],
        jerk_density=0.3,
    )
    c, s = np.cos(TURN), np.sin(TURN)
    turn = np.array([[c, s], [-s, c]])  # rows: the way, across it
    vectors, covariance = smooth_horizontal(
        time,
        place @ turn,
        along=np.tile(turn[0], (time.size, 1)),
        along_std=np.full(time.size, 20.0),
        across_std=np.full(time.size, 2.0),
        jerk_density=np.full(time.size, 0.3),
    )
    theirs = np.stack((alone.position, alone.velocity, alone.acceleration))[..., :2] @ turn
    np.testing.assert_allclose(vectors, theirs, atol=1e-6)
    turned = turn @ covariance[1] @ turn.T
    expected = alone.covariance[:, :2, 1, 1]
    np.testing.assert_allclose(turned[:, 0, 0], expected[:, 0], rtol=1e-6)
    np.testing.assert_allclose(turned[:, 1, 1], expected[:, 1], rtol=1e-6)
    # Along and across stay apart, which in north and east they do not.
    assert np.abs(turned[:, 0, 1]).max() < 1e-6 * expected.max()
    assert covariance[1, 100, 0, 1] > 0


@pytest.mark.parametrize('size', [1, 2, 5, 40])
def test_equal_noise_is_two_axes_alone(size: int) -> None:
    time, place = flown(2, 60)
    time, place = time[:size], place[:size]
    along = np.tile([0.6, 0.8], (size, 1))
    std = np.full(size, 3.0)
    vectors, covariance = smooth_horizontal(
        time,
        place,
        along=along,
        along_std=std,
        across_std=std,
        jerk_density=np.full(size, 0.1),
    )
    alone = smooth(
        time, np.append(place, place[:, :1], axis=1), position_std=3.0, jerk_density=0.1
    )
    # Digits lost where only the priors tell: 1e3^2 against 3^2.
    np.testing.assert_allclose(vectors[1], alone.velocity[:, :2], atol=1e-6)
    np.testing.assert_allclose(vectors[0], alone.position[:, :2], atol=1e-6)
    np.testing.assert_allclose(covariance[1, :, 0, 0], alone.covariance[:, 0, 1, 1], rtol=1e-6)
