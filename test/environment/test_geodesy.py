"""The tangent plane on WGS84, at points that are worked out by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightdyn.environment.geodesy import GeodeticPoint, geodetic_from_ned, ned_from_geodetic
from flightdyn.errors import InputError

A = 6_378_137.0  # m, WGS84
E2 = 6.694379990141e-3
B = A * np.sqrt(1 - E2)


@given(
    st.floats(-89.9, 89.9),
    st.floats(-180, 180),
    st.floats(-100, 9000),
    *[st.floats(-50e3, 50e3)] * 2,
    st.floats(-20e3, 500),
)
def test_round_trip(lat: float, lon: float, altitude: float, x: float, y: float, z: float) -> None:
    origin = GeodeticPoint(lat, lon, altitude)
    back = ned_from_geodetic(*geodetic_from_ned(x, y, z, origin), origin)
    # latitudes and longitudes round at 1e-14 rad of 6e6 m, a few times over
    np.testing.assert_allclose(back, (x, y, z), atol=1e-6)


@pytest.mark.parametrize('lat', [-60.0, 0.0, 45.0, 80.0])
def test_a_second_of_latitude_and_longitude(lat: float) -> None:
    # radii of curvature along the meridian and across it
    w = 1 - E2 * np.sin(np.radians(lat)) ** 2
    along, across = A * (1 - E2) / w**1.5, A / np.sqrt(w)
    step = 1 / 3600
    origin = GeodeticPoint(lat, 10.0, 0.0)
    x, y, _ = ned_from_geodetic(lat + step, 10.0, 0.0, origin)
    assert (x, y) == pytest.approx((along * np.radians(step), 0.0), abs=1e-3)
    x, y, z = ned_from_geodetic(lat, 10.0 + step, 0.0, origin)
    assert y == pytest.approx(across * np.cos(np.radians(lat)) * np.radians(step), abs=1e-6)
    assert abs(x) < 1e-3 and 0 <= z < 1e-3  # parallels curve, and the earth falls away


def test_altitude_is_up() -> None:
    x, y, z = ned_from_geodetic(50.0, 8.0, 150.0, GeodeticPoint(50.0, 8.0, 100.0))
    assert (x, y, z) == pytest.approx((0.0, 0.0, -50.0), abs=1e-8)


def test_the_earth_falls_away_by_distance_squared() -> None:
    _, y, z = ned_from_geodetic(0.0, 1.0, 0.0, GeodeticPoint(0.0, 0.0, 0.0))
    one = np.radians(1.0)
    assert (y, z) == pytest.approx((A * np.sin(one), A * (1 - np.cos(one))), abs=1e-6)


def test_across_the_antimeridian() -> None:
    origin = GeodeticPoint(0.0, 179.999, 0.0)
    _, y, _ = ned_from_geodetic(0.0, -179.999, 0.0, origin)
    assert y == pytest.approx(A * np.sin(np.radians(0.002)), abs=1e-6)
    lat, lon, _ = geodetic_from_ned(0.0, y, 0.0, origin)
    assert (lat, lon) == pytest.approx((0.0, -179.999), abs=1e-9)


@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_at_the_poles(sign: float) -> None:
    # Moving on from the pole along "north" goes down the opposite meridian (at the south pole,
    # up the own one), "down" is towards the centre, a polar radius away.
    origin = GeodeticPoint(sign * 90.0, 0.0, 0.0)
    lat, lon, altitude = geodetic_from_ned(1000.0, 0.0, 0.0, origin)
    assert abs(lat) == pytest.approx(90 - np.degrees(1000 / (A**2 / B)), abs=1e-6)
    assert abs(lon) == pytest.approx(180.0 if sign > 0 else 0.0, abs=1e-9)
    assert altitude == pytest.approx(1000**2 / 2 / (A**2 / B), abs=1e-3)
    x, y, z = ned_from_geodetic(sign * 90.0, 57.0, 20.0, origin)
    assert (x, y, z) == pytest.approx((0.0, 0.0, -20.0), abs=1e-8)


def test_arrays_keep_their_shape() -> None:
    origin = GeodeticPoint(50.0, 8.0, 100.0)
    lat = np.array([[50.0, 50.1], [50.2, 50.3]])
    assert all(v.shape == (2, 2) for v in ned_from_geodetic(lat, 8.0 + 0 * lat, 0 * lat, origin))


@pytest.mark.parametrize(
    ('lat', 'lon', 'altitude', 'message'),
    [
        (91.0, 0.0, 0.0, 'latitude must be within 90'),
        (0.0, 181.0, 0.0, 'longitude within 180'),
        (np.nan, 0.0, 0.0, 'not finite'),
        (0.0, 0.0, np.inf, 'not finite'),
    ],
)
def test_impossible_points_are_refused(
    lat: float, lon: float, altitude: float, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        GeodeticPoint(lat, lon, altitude)
