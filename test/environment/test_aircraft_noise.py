"""Noise: levels by hand, and what a flight past a listener adds up to in closed form."""

import numpy as np
import pytest

from flightdyn.environment.noise import propeller_level, received_level, sound_exposure_level


def test_levels_fall_by_six_decibels_a_doubling_and_by_absorption() -> None:
    near, far = received_level(130.0, 500.0), received_level(130.0, 1000.0)
    assert near == pytest.approx(130 - 20 * np.log10(500) - 1.9e-3 * 500, abs=1e-4)
    assert near - far == pytest.approx(20 * np.log10(2) + 0.95, abs=1e-4)


def test_propeller_level_by_hand() -> None:
    # 100 kW: 83.4 + 30.6 - 6.0206 + 30.8 - 3 + 3.0103
    found = propeller_level(100e3, 2.0, 0.8, 3, propellers=2)
    assert found == pytest.approx(138.7897, abs=1e-4)


def test_exposure_of_a_steady_level_is_that_of_its_seconds() -> None:
    assert sound_exposure_level([0, 4, 10], [70, 70, 70]) == pytest.approx(80.0)


def test_exposure_of_a_flyover_is_that_of_the_closed_form() -> None:
    # straight past at distance d and speed V: the integral of d^2 / (d^2 + V^2 t^2) is pi d / V
    distance, speed, source = 300.0, 50.0, 140.0
    time = np.linspace(-2000, 2000, 80001)
    level = received_level(source, np.hypot(distance, speed * time), absorption=0.0)
    expected = source - 20 * np.log10(distance) + 10 * np.log10(np.pi * distance / speed)
    # beyond 2000 s lies 2 d / (pi V t) = 0.2 % of it: 0.008 dB
    assert sound_exposure_level(time, level) == pytest.approx(expected, abs=0.01)
