"""Several flights in one recording, aligned."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip('rerun')
pytest.importorskip('pyarrow')

from flights import flip, soaring
from recordings import read, rows

from flightdyn.errors import InputError
from flightdyn.viewing.flights_view import MOMENTS, save_flights
from flightdyn.viewing.kinematics import motion_of


def seconds(entity):
    return np.array(entity['flight_time']) / 1e9


def test_flights_are_aligned_by_date_with_common_plots_and_tracks(tmp_path):
    first = soaring(300, gap=False)
    second = replace(soaring(200, gap=False), start_ns=first.start_ns + 50 * 10**9)
    save_flights(tmp_path / 'a.rrd', {'one': first, 'number two': second})
    data = read(tmp_path / 'a.rrd')
    np.testing.assert_allclose(seconds(data['/world/flights/one']), first.time)
    np.testing.assert_allclose(seconds(data['/world/flights/number_two']), second.time + 50)
    assert data['/world/flights/number_two']['utc'] == second.unix_ns.tolist()
    for name, flight in (('one', first), ('number_two', second)):
        speed = np.ravel(rows(data[f'/plots/speed/{name}'], 'scalars'))
        np.testing.assert_allclose(speed, flight['speed'])
        assert len(rows(data[f'/map/track/{name}'], 'line_strings')) == 1
    assert rows(data['/world/flights/number_two/marker'], ':labels') == [['number two']]
    colors = [rows(data[f'/world/path/{n}'], 'colors')[0][0] for n in ('one', 'number_two')]
    assert colors[0] != colors[1]
    assert rows(data['/__properties/number_two'], 'samples') == [[200]]


def test_flights_are_drawn_in_one_frame(tmp_path):
    flight = soaring(100, gap=False)
    moved = replace(flight.origin, lat=flight.origin.lat + 0.01)  # 1112 m north
    save_flights(tmp_path / 'a.rrd', {'a': flight, 'b': replace(flight, origin=moved)})
    data = read(tmp_path / 'a.rrd')
    a, b = (
        np.array(rows(data[f'/world/flights/{n}'], 'translation')).reshape(-1, 3) for n in 'ab'
    )
    np.testing.assert_allclose((b - a)[:, 0], 1112.4, atol=0.5)  # WGS84 at 50 deg, and float32


@pytest.mark.parametrize('event', ['start', 'highest', 'fastest', 'end'])
def test_flights_are_aligned_by_an_event(tmp_path, event):
    flights = {'a': flip(80), 'b': replace(flip(40, wobble=0.1), time=flip(40).time + 7)}
    save_flights(tmp_path / 'a.rrd', flights, align=event)
    data = read(tmp_path / 'a.rrd')
    for name, flight in flights.items():
        moment = MOMENTS[event](flight, motion_of(flight))
        at = seconds(data[f'/world/flights/{name}'])
        np.testing.assert_allclose(at, flight.time - moment, atol=1e-9)
        assert 'utc' not in data[f'/world/flights/{name}']


def test_take_offs_are_found_to_align_by():
    climb = np.concatenate([np.zeros(60), np.arange(1, 121) * 3.0])
    speed = np.where(climb > 0, 30.0, 0.0)
    x = np.cumsum(speed)
    flight = replace(
        soaring(180, gap=False),
        states={'x_e': x, 'y_e': 0 * x, 'z_e': -climb, 'speed': speed, 'gamma': 0 * x,
                'track': 0 * x},
        outputs={'altitude': climb},
    )  # fmt: skip
    found = MOMENTS['take-off'](flight, motion_of(flight))
    assert found == pytest.approx(60, abs=3)
    assert MOMENTS['landing'](flight, motion_of(flight)) is None


@pytest.mark.parametrize(
    ('flights', 'align', 'said'),
    [
        ({}, 'time', '1 to 100 flights'),
        ({'a': flip(), 'b': soaring()}, 'start', 'a place on earth, but not a'),
        ({'a': flip(), 'b': replace(flip(), start_ns=1)}, 'time', 'align by start instead'),
        ({'a': flip(), 'b': flip()}, 'hihgest', "did you mean 'highest'"),
        ({'a': flip(), 'b': flip()}, 'landing', 'cannot align by landing: a has none'),
    ],
)
def test_what_cannot_be_aligned_is_refused(tmp_path, flights, align, said):
    with pytest.raises(InputError, match=said):
        save_flights(tmp_path / 'a.rrd', flights, align=align)
    assert not list(tmp_path.iterdir())
