"""Flights out of logs: bands, gaps, and what was left out."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('matplotlib')

from flights import by_label, flip, soaring

from flightdyn.environment.geodesy import geodetic_from_ned
from flightdyn.logs.track import Track
from flightdyn.replay import replay_log
from flightdyn.viewing import figures

DATA = Path(__file__).parents[1] / 'data'
DOCUMENT = {
    'file': 'logs/a.mcap', 'source': '/fix', 'messages': 605, 'used': 600,
    'dropped': {'no fix': 3, 'position outlier': 2}, 'altitude_datum': 'ellipsoid',
    'flights': [{'start': 10.0, 'end': 600.0, 'takeoff': True, 'landing': False}],
    'wind': {'speed': 6.0, 'from_deg': 180.0, 'std': 0.5},
}  # fmt: skip


def track_of(flight, extra: dict[float, tuple[float, float, float]]) -> Track:
    """Return what was measured for a flight, with more samples at times: x_e, y_e, z_e."""
    t = np.concatenate([flight.time, list(extra)])
    places = np.column_stack([flight[n] for n in ('x_e', 'y_e', 'z_e')])
    order = np.argsort(t)
    x, y, z = np.vstack([places, list(extra.values())])[order].T
    lat, lon, altitude = geodetic_from_ned(x, y, z, flight.origin)
    ns = flight.start_ns + np.round(t[order] * 1e9).astype(np.int64)
    return Track(
        time_ns=ns, segment=np.zeros(ns.size, np.int64), lat=lat, lon=lon, altitude=altitude
    )


def test_a_replay_has_its_histories_with_bands_and_gaps() -> None:
    figure = figures.figure_for(soaring(), about=figures.About(document=DOCUMENT))
    axes = by_label(figure)
    assert {
        'altitude [m], ellipsoid', 'speed [m/s]', 'gamma [deg]', 'track [deg]', 'bank [deg]',
        'load_factor [-]',
    } <= set(axes)  # fmt: skip
    assert [len(line.get_xdata()) for line in axes['speed [m/s]'].lines[:2]] == [300, 300]
    assert len(axes['speed [m/s]'].collections) == 2
    band = axes['altitude [m], ellipsoid'].collections[0].get_paths()[0].vertices
    assert band[:, 1].min() == pytest.approx(soaring()['altitude'][0] - 3.0)
    said = figure.get_suptitle().replace('\n', ' ')
    assert said.startswith('a.mcap (glider) /fix: 600 of 605 samples, 5 dropped')
    assert 'from 2018-07-29 11:52:58 UTC' in said
    assert 'wind 6 m/s from 180 deg' in said
    takeoff = [line for line in axes['bank [deg]'].lines if line.get_linestyle() == ':']
    assert [line.get_xdata()[0] for line in takeoff] == [10.0]  # a landing that is not known, none


def test_no_date_is_told_of_a_clock_that_counts_from_the_start() -> None:
    flight = replace(soaring(), start_ns=5_000_000_000)
    assert '1970' not in figures.replay_figure(flight).get_suptitle()


def test_a_compass_does_not_jump_from_360_degrees_to_0() -> None:
    axes = by_label(figures.replay_figure(soaring()))
    drawn = axes['track [deg]'].lines[0].get_ydata()
    assert np.nanmin(drawn) >= 0 and np.nanmax(drawn) < 360
    assert np.nanmax(np.abs(np.diff(drawn))) < 180
    assert np.isnan(drawn).sum() == 9  # turns in 300 s at 0.2 rad/s


def test_samples_that_were_left_out_are_marked_where_they_were() -> None:
    flight = soaring(gap=False)
    near, far = (500.0, -50.0, -900.0), (55e3, 0.0, -900.0)
    track = track_of(flight, {100.5: near, 200.5: far})
    figure = figures.replay_figure(flight, track=track)
    ground = figure.axes[0]
    (marks,) = (line for line in ground.lines if line.get_marker() == 'x')
    assert marks.get_label() == '2 left out, 1 of them farther off'
    np.testing.assert_allclose(marks.get_xydata()[0], near[1::-1], atol=1e-3)
    assert marks.get_ydata()[1] < 6000  # at the edge: the flight stays readable
    heights = figure.axes[2] if figure.axes[1].get_label() == '<colorbar>' else figure.axes[1]
    (crosses,) = (line for line in heights.lines if line.get_marker() == 'x')
    np.testing.assert_allclose(crosses.get_xdata(), [100.5, 200.5])
    # nothing is marked where all was used
    whole = figures.replay_figure(flight, track=track_of(flight, {0.0: near}).__class__(
        time_ns=flight.unix_ns, segment=np.zeros(len(flight), np.int64), lat=flight['lat'],
        lon=flight['lon'], altitude=flight['altitude'],
    ))  # fmt: skip
    assert not any(line.get_marker() == 'x' for line in whole.axes[0].lines)


def test_lone_peaks_do_not_flatten_the_rest_and_are_counted() -> None:
    flight = soaring(gap=False)
    flight.states['speed'][300] = 900.0
    axes = by_label(figures.replay_figure(flight))
    assert axes['speed [m/s]'].get_ylim()[1] < 40
    said = axes['speed [m/s]'].texts[0].get_text()
    assert said.endswith('samples beyond')
    low, high = axes['speed [m/s]'].get_ylim()
    assert low < 29 and high > 31  # of 30 +- 1


def test_a_log_is_drawn_with_what_its_replay_says() -> None:
    replay = replay_log(DATA / 'px4_zurich_navsatfix.mcap')
    about = figures.About(document=replay.summary())
    figure = figures.figure_for(replay.trajectory, about=about, track=replay.track)
    assert 'px4_zurich_navsatfix.mcap' in figure.get_suptitle()
    # a flight without date or place that has a track is one, too
    track = Track(
        time_ns=flip().unix_ns, segment=np.zeros(80, np.int64), position_ned=np.zeros((80, 3))
    )
    assert figures.figure_for(flip(), track=track).axes[0].get_xlabel() == 'y_e, east [m]'
