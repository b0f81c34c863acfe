"""The density of the jerk over time, against motion that is calm and then is not."""

import numpy as np
from numpy.typing import NDArray

from flightdyn.replay.manoeuvres import REACH, local_jerk_density
from flightdyn.replay.smoother import smooth

Array = NDArray[np.float64]

STD = 0.5


def calm_then_turning(n: int, seed: int = 0) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return time, position and when it turns: level at 50 m/s, a circle of 20 s in the middle."""
    t = np.arange(float(n))
    turning = (t > n / 3) & (t <= 2 * n / 3)
    course = np.cumsum(np.where(turning, 2 * np.pi / 20, 0.0))
    velocity = 50 * np.stack((np.cos(course), np.sin(course), 0 * t), axis=1)
    return t, np.cumsum(velocity, axis=0), turning


def density_of(t: Array, p: Array, **more: object) -> Array:
    given: dict[str, object] = {
        'position_std': np.full(p.shape, STD),
        'velocity_std': np.ones(p.shape),
        'jerk_density': np.full(3, 0.5),
    }
    segment = more.pop('segment', np.zeros(t.size, np.int64))
    velocity = more.pop('velocity', None)
    return local_jerk_density(t, p, velocity, segment, **(given | more))  # type: ignore[arg-type]


def test_a_circle_is_sharper_than_the_straight_lines_about_it() -> None:
    t, p, turning = calm_then_turning(600)
    p = p + STD * np.random.default_rng(0).normal(size=p.shape)
    found = density_of(t, p)
    assert found.shape == p.shape
    np.testing.assert_array_equal(found[:, 0], found[:, 1])
    calm = ~turning
    # Half a decade of margin: the middle of each third is at one end of what is looked at.
    assert np.median(found[turning, 0]) > 10 * np.median(found[calm, 0])
    assert (found[:, 2] < 0.5).all()
    assert found.min() >= 0.5 * 10**-REACH * 0.999
    assert found.max() <= 0.5 * 10**REACH * 1.001


def test_a_local_density_smooths_calm_flight_better_than_one_for_the_whole_log() -> None:
    t, p, _ = calm_then_turning(600)
    z = p + STD * np.random.default_rng(1).normal(size=p.shape)
    local = density_of(t, z)
    errors = [
        smooth(t, z, position_std=STD, jerk_density=q).velocity - np.gradient(p, t, axis=0)
        for q in (0.5, local)
    ]
    middle = np.abs(t - 100) < 80  # of the first straight line
    whole, own = (float(np.sqrt(np.mean(e[middle, :2] ** 2))) for e in errors)
    # The 1-sigma of velocity goes as the sixth root of the density: ten times less is 0.68.
    assert own < 0.85 * whole


def test_one_density_throughout_is_found_everywhere() -> None:
    rng = np.random.default_rng(3)
    fine, n, q = 20, 2000, 4.0
    jerk = rng.normal(size=(n * fine, 3)) * np.sqrt(q * fine)
    steps = [np.cumsum(jerk / fine, axis=0)]
    for _ in range(2):
        steps.append(np.cumsum(steps[-1] / fine, axis=0))
    z = steps[-1][::fine] + STD * rng.normal(size=(n, 3))
    found = density_of(np.arange(float(n)), z, jerk_density=np.full(3, 1.3 * q))
    # A block of 8 samples tells a density to a factor of about 1 + sqrt(2 / 8).
    assert abs(np.mean(np.log10(found / q))) < 0.2
    assert np.std(np.log10(found)) < 0.3


def test_segments_and_samples_without_a_position_do_not_disturb() -> None:
    t, p, turning = calm_then_turning(600)
    p = p + STD * np.random.default_rng(0).normal(size=p.shape)
    p[::7] = np.nan
    segment = (t > 300).astype(np.int64)
    velocity = np.full(p.shape, np.nan)
    found = density_of(t, p, segment=segment, velocity=velocity)
    assert np.isfinite(found).all()
    assert np.median(found[turning, 0]) > 10 * np.median(found[~turning, 0])
    lonely = density_of(t[:2], p[:2], segment=np.array([0, 1]))
    # Nothing known: any within a decade of that of the log, and the mean of them.
    any_of_them = 0.5 * np.mean(10.0 ** np.linspace(-1, 1, 5))
    np.testing.assert_allclose(lonely, any_of_them, rtol=0.01)
