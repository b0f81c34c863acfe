"""The trajectory: what it refuses, how it is cut and sampled."""

import numpy as np
import pytest

from flightdyn.environment.geodesy import (
    GeodeticPoint,
    geodetic_from_ned,
    ned_from_geodetic,
)
from flightdyn.errors import InputError
from flightdyn.trajectory import Trajectory


def make(**changes: object) -> Trajectory:
    values: dict[str, object] = {
        'time': [0.0, 1.0, 2.0, 12.0, 13.0],
        'states': {'x_e': [0.0, 1.0, 4.0, 20.0, 30.0]},
        'controls': {'thrust': [1.0, 2.0, 3.0, 4.0, 5.0]},
        'segment': [0, 0, 0, 1, 1],
        'start_ns': 1_700_000_000_000_000_001,
    }
    return Trajectory(**{**values, **changes})  # type: ignore[arg-type]


def test_segments_are_the_unbroken_stretches() -> None:
    assert list(make().segments()) == [slice(0, 3), slice(3, 5)]


def test_unix_time_is_exact_to_the_nanosecond() -> None:
    assert make().unix_ns.tolist()[-1] == 1_700_000_013_000_000_001


def test_controls_run_as_said() -> None:
    linear, held = make(), make(control_interpolation='previous')
    assert linear.sample('thrust', [0.5, 99]).tolist() == [1.5, 5.0]
    assert held.sample('thrust', [-1, 0.5, 1.0, 99]).tolist() == [1.0, 1.0, 2.0, 5.0]


def test_between_keeps_both_ends() -> None:
    part = make().between(1, 12)
    assert part.time.tolist() == [1.0, 2.0, 12.0]
    assert part.segment is not None
    assert part.segment.tolist() == [0, 0, 1]


@pytest.mark.parametrize(
    ('changes', 'message'),
    [
        ({'time': [0.0, 1.0, 1.0, 12.0, 13.0]}, 'not increasing at sample 2'),
        ({'states': {'x_e': [0.0, 1.0]}}, r"states\['x_e'\] has shape \(2,\)"),
        ({'states': {'x_e': [0.0, np.nan, 1, 2, 3]}}, 'is nan at sample 1'),
        ({'control_interpolation': 'cubic'}, 'linear or previous'),
        ({'time': []}, 'non-empty'),
    ],
)
def test_refuses(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        make(**changes)


def test_unknown_column_lists_the_known() -> None:
    with pytest.raises(KeyError, match='it has x_e, thrust'):
        make()['speed']


def test_geodetic_point_refuses_latitude_beyond_the_pole() -> None:
    with pytest.raises(InputError, match='latitude'):
        GeodeticPoint(90.1, 0)


def test_one_arc_minute_north_is_a_nautical_mile() -> None:
    # at 45 degrees the meridian's radius is 6367.38 km, so that a minute is 1852.2 m
    origin = GeodeticPoint(45.0, 7.0, 300.0)
    x, y, z = ned_from_geodetic(45 + 1 / 60, 7.0, 300.0, origin)
    assert float(x) == pytest.approx(1852.2, abs=0.5)
    assert (float(y), float(z)) == pytest.approx((0, 0.27), abs=0.01)


def test_geodetic_round_trip() -> None:
    origin = GeodeticPoint(-38.66, 176.14, 458.0)
    lat, lon, altitude = geodetic_from_ned(1e4, -2e4, -3e3, origin)
    back = [float(v) for v in ned_from_geodetic(lat, lon, altitude, origin)]
    assert back == pytest.approx([1e4, -2e4, -3e3], abs=1e-6)
