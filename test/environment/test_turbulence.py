"""Dryden gusts: the filters exactly, the sampled gusts within their statistics."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightdyn.environment.turbulence import (
    DrydenGusts,
    intensities,
    scale_lengths,
    shaping_step,
)
from flightdyn.errors import InputError

FOOT = 0.3048
LONG_RUN = np.array([[2.0, 1.0], [1.0, 1.0]]) / 4
OUTPUT = np.array([math.sqrt(3), 1 - math.sqrt(3)])
STEP = st.floats(1e-4, 20.0)


def matrices(theta: float) -> tuple[np.ndarray, np.ndarray]:
    return tuple(np.array([[a, 0.0], [b, c]]) for a, b, c in shaping_step(theta))


@given(STEP)
def test_variance_is_one_and_stays_so_at_any_step(theta: float) -> None:
    a, noise = matrices(theta)
    np.testing.assert_allclose(a @ LONG_RUN @ a.T + noise @ noise.T, LONG_RUN, atol=1e-14)
    assert pytest.approx(1) == OUTPUT @ LONG_RUN @ OUTPUT


@given(STEP)
def test_two_half_steps_are_one_step(theta: float) -> None:
    a, noise = matrices(theta)
    half, half_noise = matrices(theta / 2)
    np.testing.assert_allclose(half @ half, a, atol=1e-15)
    spread = half @ half_noise @ half_noise.T @ half.T + half_noise @ half_noise.T
    np.testing.assert_allclose(spread, noise @ noise.T, atol=1e-15)


@given(st.floats(0.0, 20.0))
def test_correlation_of_the_lateral_spectrum(theta: float) -> None:
    # the transform of (1 + 3 x^2) / (1 + x^2)^2
    a, _ = matrices(theta)
    assert OUTPUT @ a @ LONG_RUN @ OUTPUT == pytest.approx(
        math.exp(-theta) * (1 - theta / 2), abs=1e-14
    )


def flown(gusts: DrydenGusts, n: int, dt: float, airspeed: float, height: float) -> np.ndarray:
    return np.array([gusts.advance(dt, airspeed, height) for _ in range(n)])


@pytest.mark.parametrize('dt', [0.5, 2.0, 20.0])
@pytest.mark.parametrize('height', [60.0, 3000.0])
def test_variance_does_not_depend_on_the_step(dt: float, height: float) -> None:
    # The mean of x^2 over a time T has a relative deviation of about sqrt(2 L / (V T)); five of
    # those. Few independent samples make wide bounds for short steps.
    n, airspeed = 20_000, 100.0
    gusts = flown(DrydenGusts('moderate', seed=3), n, dt, airspeed, height)
    lengths = np.array(scale_lengths(height))
    independent = np.minimum(n, n * dt * airspeed / lengths)
    ratio = (gusts**2).mean(axis=0) / np.square(intensities(height, 'moderate'))
    assert (np.abs(ratio - 1) < 5 * np.sqrt(2 / independent)).all()


def test_sampled_correlation_follows_the_closed_form() -> None:
    dt, airspeed, height = 1.0, 60.0, 3000.0
    gusts = flown(DrydenGusts('severe', seed=5), 40_000, dt, airspeed, height)
    gusts /= intensities(height, 'severe')
    theta = airspeed * dt / scale_lengths(height)[0]
    for lag in (2, 9, 25):
        x = lag * theta
        expected = np.exp(-x) * np.array([1.0, 1 - x / 2, 1 - x / 2])
        found = (gusts[lag:] * gusts[:-lag]).mean(axis=0)
        # 40 000 steps are 4500 correlation lengths: 0.02 a deviation at most
        np.testing.assert_allclose(found, expected, atol=0.08)
    across = np.corrcoef(gusts.T)
    assert np.abs(across - np.eye(3)).max() < 0.08


def test_low_altitude_scales_and_intensities_by_hand() -> None:
    # 100 ft: 0.177 + 0.0823 = 0.2593; 0.2593^1.2 = 0.19796; 0.2593^0.4 = 0.58282
    along, across, vertical = scale_lengths(100 * FOOT)
    assert (along / FOOT, across / FOOT) == pytest.approx((505.2, 505.2), abs=0.2)
    assert vertical == pytest.approx(100 * FOOT)
    u, v, w = intensities(100 * FOOT, 'light', wind_at_20_ft=10.0)
    assert w == pytest.approx(1.0)
    assert (u, v) == pytest.approx((1.7158, 1.7158), abs=2e-4)


def test_aloft_gusts_are_isotropic_as_the_standards_figure() -> None:
    height = 15_000 * FOOT
    assert scale_lengths(height) == pytest.approx((533.4, 533.4, 533.4))
    assert intensities(height, 'moderate') == pytest.approx((8 * FOOT,) * 3)
    assert intensities(height, 'light')[0] < intensities(height, 'moderate')[0]
    assert intensities(height, 'severe')[2] == pytest.approx(22.1 * FOOT)


def test_scales_and_intensities_have_no_step_between_the_models() -> None:
    heights = np.arange(0.0, 1000.0, 0.5)
    lengths = np.array([scale_lengths(h) for h in heights])
    sigmas = np.array([intensities(h, 'severe') for h in heights])
    assert np.abs(np.diff(lengths, axis=0)).max() < 5
    assert np.abs(np.diff(sigmas, axis=0)).max() < 0.1
    assert scale_lengths(-5.0) == scale_lengths(0.0) == scale_lengths(3.048)


def test_same_seed_same_gusts() -> None:
    first, second, other = (flown(DrydenGusts(seed=s), 20, 0.1, 50.0, 100.0) for s in (7, 7, 8))
    np.testing.assert_array_equal(first, second)
    assert (first != other).all()
    generator = np.random.default_rng(7)
    np.testing.assert_array_equal(flown(DrydenGusts(seed=generator), 20, 0.1, 50.0, 100.0), first)


def test_no_severity_no_gusts() -> None:
    assert not flown(DrydenGusts('none'), 10, 1.0, 50.0, 30.0).any()
    assert not flown(DrydenGusts('none'), 10, 1.0, 50.0, 3000.0).any()
    assert not flown(DrydenGusts('severe', wind_at_20_ft=0.0), 10, 1.0, 50.0, 30.0).any()


def test_gusts_stand_still_without_motion() -> None:
    gusts = DrydenGusts(seed=1)
    now = gusts.advance(0.0, 50.0, 100.0)
    assert gusts.advance(0.0, 50.0, 100.0) == now == gusts.advance(3.0, 0.0, 100.0)


def test_small_steps_make_small_changes() -> None:
    gusts = DrydenGusts(seed=2)
    now = np.array(gusts.advance(0.0, 50.0, 100.0))
    # a change is of the order sigma sqrt(3 V dt / L), at 1 micrometre here
    assert np.abs(gusts.advance(2e-8, 50.0, 100.0) - now).max() < 1e-2


@pytest.mark.parametrize(
    ('dt', 'airspeed', 'height'),
    [(-1.0, 50.0, 10.0), (1.0, -5.0, 10.0), (1.0, 50.0, math.nan), (math.inf, 5.0, 10.0)],
)
def test_impossible_steps_are_refused(dt: float, airspeed: float, height: float) -> None:
    with pytest.raises(InputError, match='must be from 0'):
        DrydenGusts().advance(dt, airspeed, height)


def test_unknown_severity_is_refused() -> None:
    with pytest.raises(InputError, match="'mild' is unknown; known: none, light"):
        DrydenGusts('mild')
    with pytest.raises(InputError, match='wind_at_20_ft is -1'):
        DrydenGusts(wind_at_20_ft=-1.0)
