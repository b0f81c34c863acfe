"""Errors of sensors: their size, how long they last, and that a seed repeats them."""

import numpy as np
import pytest

from flightdyn.errors import InputError
from flightdyn.simulation.sensors import DRIFTING, FixErrors, FixNoise, InertialErrors

STD = (1.5, 0.5, 3.0)
N = 40_000


def test_fixes_are_off_as_much_as_said_and_for_as_long() -> None:
    """10,000 s of errors that last 5 s are 1,000 independent ones: 15 % is six of their sigmas."""
    errors = FixErrors(FixNoise(STD, 5.0), (7, 1))
    drawn = np.array([errors.next(0.25 * k) for k in range(N)])
    np.testing.assert_allclose(drawn.std(axis=0), STD, rtol=0.15)
    np.testing.assert_allclose(drawn.mean(axis=0), 0, atol=0.15 * max(STD))
    scaled = drawn / STD
    for lag in (4, 20):  # 1 and 5 s
        found = np.mean(scaled[lag:] * scaled[:-lag])
        assert found == pytest.approx(DRIFTING * np.exp(-0.25 * lag / 5.0), abs=0.06)


def test_the_size_of_errors_does_not_depend_on_the_rate() -> None:
    for step in (0.001, 100.0):
        errors = FixErrors(FixNoise((1.0, 1.0, 1.0), 0.01), (3,))
        drawn = np.array([errors.next(step * k) for k in range(N // 4)])
        np.testing.assert_allclose(drawn.std(axis=0), 1.0, rtol=0.06)


def test_the_same_seed_makes_the_same_errors() -> None:
    times = [0.0, 0.1, 0.5]
    draws = [
        [errors.next(t) for t in times]
        for errors in (FixErrors(FixNoise(STD), seed) for seed in ((1, 1), (1, 1), (2, 1)))
    ]
    assert draws[0] == draws[1] != draws[2]


def test_without_noise_fixes_and_imus_are_exact() -> None:
    assert FixErrors(FixNoise(), (0,)).next(1.0) == (0, 0, 0)
    force, rate = InertialErrors(0.0, 0.0, (0,)).next()
    assert not force.any()
    assert not rate.any()


def test_an_imu_is_off_as_much_as_said() -> None:
    """The standard deviation of 40,000 samples is known to 0.35 %."""
    errors = InertialErrors(0.2, 0.01, (4,))
    drawn = np.array([np.concatenate(errors.next()) for _ in range(N)])
    np.testing.assert_allclose(drawn.std(axis=0), np.repeat([0.2, 0.01], 3), rtol=0.02)


@pytest.mark.parametrize(
    ('std', 'time'), [((-1.0, 0, 0), 60.0), ((0, 0, float('nan')), 60.0), ((1, 1, 1), 0.0)]
)
def test_impossible_noise_of_fixes_is_refused(
    std: tuple[float, float, float], time: float
) -> None:
    with pytest.raises(InputError, match='noise of fixes'):
        FixNoise(std, time)


def test_impossible_noise_of_an_imu_is_refused() -> None:
    with pytest.raises(InputError, match='noise of an IMU'):
        InertialErrors(0.1, -0.1, (0,))
