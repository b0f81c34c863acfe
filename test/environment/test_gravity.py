"""Inverse-square gravity against its potential and a published figure."""

import casadi as cas
import numpy as np
import pytest

from flightdyn.environment.atmosphere import geopotential_altitude
from flightdyn.environment.gravity import inverse_square, potential_inverse_square


def test_printed_gravity_of_the_standard() -> None:
    # NOAA-S/T 76-1562, table I by geometric altitude
    assert inverse_square(0.0) == 9.80665
    assert inverse_square(10_000.0) == pytest.approx(9.7759, abs=5e-5)
    assert inverse_square(80_000.0) == pytest.approx(9.5644, abs=5e-5)


def test_gravity_is_the_slope_of_the_potential() -> None:
    h = cas.SX.sym('h')
    slope = cas.Function('g', [h], [cas.jacobian(potential_inverse_square(h, 9.81), h)])
    for altitude in (-400.0, 0.0, 30_000.0, 2e6):
        assert float(slope(altitude)) == pytest.approx(inverse_square(altitude, 9.81), rel=1e-14)


def test_potential_is_g0_times_geopotential_altitude() -> None:
    altitude = np.array([0.0, 5000.0, 86_000.0])
    np.testing.assert_allclose(
        potential_inverse_square(altitude), 9.80665 * geopotential_altitude(altitude)
    )
