"""Noise levels told from data against those it was made with."""

import numpy as np
import pytest
from numpy.typing import NDArray

from flightdyn.replay.noise import MIN_STD, estimate_noise
from flightdyn.replay.reconstruct import _step

Array = NDArray[np.float64]


def wander(n: int, dt: float, q: float, seed: int = 0) -> tuple[Array, Array, Array]:
    """Return time, position and velocity of motion driven by white jerk, finely integrated."""
    rng = np.random.default_rng(seed)
    fine = 20
    h = dt / fine
    jerk = rng.normal(size=(n * fine, 3)) * np.sqrt(q / h)
    a = np.cumsum(jerk * h, axis=0)
    v = np.cumsum(a * h, axis=0)
    p = np.cumsum(v * h, axis=0)
    return np.arange(n) * dt, p[::fine], v[::fine]


@pytest.mark.parametrize(
    ('r', 'rv', 'q'), [(1.5, 0.15, 4.0), (0.02, 0.5, 100.0), (5.0, 1.0, 0.01)]
)
def test_levels_of_simulated_motion_are_found(r: float, rv: float, q: float) -> None:
    t, p, v = wander(2000, 0.2, q)
    rng = np.random.default_rng(1)
    p = p + r * rng.normal(size=p.shape)
    v = v + rv * rng.normal(size=v.shape)
    found = estimate_noise(t, p, v, segment=np.zeros(t.size, np.int64))
    # The grid's last step is a quarter decade, a factor of 1.8; the density is the least certain.
    np.testing.assert_allclose(np.log10(found.position_std / r), 0, atol=0.25)
    np.testing.assert_allclose(np.log10(found.velocity_std / rv), 0, atol=0.25)
    np.testing.assert_allclose(np.log10(found.jerk_density / q), 0, atol=0.6)


def test_what_is_given_is_kept_and_limits_hold() -> None:
    t, p, _ = wander(300, 1.0, 1.0)
    segment = np.zeros(t.size, np.int64)
    kept = estimate_noise(t, p, segment=segment, position_std=0.123, jerk_density=[1.0, 2.0, 3.0])
    np.testing.assert_array_equal(kept.position_std, 0.123)
    np.testing.assert_array_equal(kept.jerk_density, [1.0, 2.0, 3.0])
    limited = estimate_noise(t, p, segment=segment, position_std_limits=(0.5, 0.5))
    np.testing.assert_allclose(limited.position_std, 0.5)


def test_noise_free_motion_has_the_least_noise() -> None:
    t, p, v = wander(500, 0.01, 50.0)
    found = estimate_noise(t, p, v, segment=np.zeros(t.size, np.int64))
    assert found.position_std.max() <= 10 * MIN_STD


def test_a_long_wait_on_the_ground_does_not_hide_the_flight() -> None:
    _, p, _ = wander(600, 1.0, 1.0)
    waiting = np.zeros((20_000, 3))
    joined = np.concatenate((waiting, p - p[0]))
    joined += 1.0 * np.random.default_rng(0).normal(size=joined.shape)
    time = np.arange(joined.shape[0]) * 1.0
    found = estimate_noise(time, joined, segment=np.zeros(time.size, np.int64))
    assert found.jerk_density.min() > 0.1


def test_a_circle_sampled_three_times_a_turn_is_no_noise() -> None:
    """A thermal recorded every 8 s once came out as a straight line through 100 m of noise."""
    rng = np.random.default_rng(0)
    t = np.arange(600) * 8.0
    turn = 2 * np.pi / 24.7 * t
    p = np.stack((90 * np.sin(turn), 90 * np.cos(turn), -1.5 * t), axis=1)
    found = estimate_noise(
        t, p + 0.5 * rng.normal(size=p.shape), segment=np.zeros(t.size, np.int64)
    )
    assert found.position_std.max() <= 5.0
    assert found.jerk_density[0] > 0.3


def test_positions_that_jump_to_and_fro_are_noise() -> None:
    """At 1 Hz no vehicle goes 60 m back and forth between samples: the log is faulty."""
    rng = np.random.default_rng(0)
    t = np.arange(600.0)
    p = np.stack((200 * t, 0 * t, 0 * t), axis=1) + 60 * rng.normal(size=(600, 3))
    found = estimate_noise(t, p, segment=np.zeros(t.size, np.int64))
    assert found.position_std.min() > 20
    assert found.jerk_density.max() < 10


def test_the_step_of_rounded_values_is_seen_and_no_other() -> None:
    rng = np.random.default_rng(0)
    wave = 3 * np.sin(np.arange(500) / 7) + rng.normal(size=500)
    assert _step(np.round(wave / 0.25) * 0.25) == pytest.approx(0.25)
    assert _step(wave) < 1e-2
    assert _step(5.0 * np.arange(500)) == 0.0  # a steady climb is not rounding
    assert _step(np.tile(np.sin(np.arange(20.0)), 30)) == 0.0  # nor is a circle flown again
    assert _step(np.ones(500)) == 0.0


def test_fixes_seconds_late_or_early_are_noise_between_circles_too() -> None:
    """A glider's fixes with stamps off by a second: noise of 40 m, in a log with thermals in it.

    It once was taken for manoeuvres, as no noise beyond 5 m was believed.
    """
    rng = np.random.default_rng(2)
    t = np.arange(1920) * 10.0
    straight = (np.arange(t.size) // 96) % 4 != 0
    course = np.cumsum(np.where(straight, 0.0, 2 * np.pi * 10 / 25))
    rate = np.where(straight, 40.0, 25.0) * np.exp(1j * course)
    place = np.cumsum(rate * 10) + 40 * (rng.normal(size=t.size) + 1j * rng.normal(size=t.size))
    p = np.stack((place.real, place.imag, -1500 + 0 * t), axis=1)
    found = estimate_noise(t, p, segment=np.zeros(t.size, np.int64))
    assert 20 < found.position_std[0] < 80
