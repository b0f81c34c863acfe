"""Figures of studies: what is drawn where, with units."""

import numpy as np
import pytest

pytest.importorskip('matplotlib')

from flights import flip, soaring

from flightdyn.errors import InputError
from flightdyn.trajectory import Trajectory
from flightdyn.viewing import figures


def glide(duration: float = 100.0) -> Trajectory:
    t = np.linspace(0, duration, 101)
    return Trajectory(
        time=t,
        states={
            'x_e': 60 * t,
            'z_e': 3 * t - 1000,
            'speed': 60 - 0.01 * t,
            'gamma': -0.05 + 0 * t,
        },
        controls={'alpha': 3 + 0 * t},
        outputs={'airspeed': 62 - 0.01 * t},
        model='DynamicsPointMass2DSpeedGamma',
    )


def test_a_polar_marks_its_best_ratio():
    alpha = np.linspace(-5, 15, 201)
    lift = 0.2 + 0.1 * alpha
    polar = {'alpha': alpha, 'CL': lift, 'CD': 0.02 + 0.05 * lift**2}
    draggy = {**polar, 'CD': polar['CD'] + 0.02}
    figure = figures.polar_figure({'clean': polar, 'draggy': draggy})
    assert [ax.get_ylabel() for ax in figure.axes] == ['CL [-]', 'CD [-]', 'CL/CD [-]']
    assert {ax.get_xlabel() for ax in figure.axes} == {'alpha [deg]'}
    ratio = figure.axes[2]
    marks = [line.get_xydata()[0] for line in ratio.lines if line.get_marker() == 'o']
    # closed form: CL = sqrt(CD0 / k), ratio 1 / (2 sqrt(CD0 k)); alpha in steps of 0.1 deg
    for mark, zero in zip(marks, (0.02, 0.04), strict=True):
        best = (np.sqrt(zero / 0.05) - 0.2) / 0.1
        np.testing.assert_allclose(mark[0], best, atol=0.05 + 1e-9)
        np.testing.assert_allclose(mark[1], 0.5 / np.sqrt(zero * 0.05), rtol=1e-4)
    with pytest.raises(InputError, match='no polar of odd: it lacks CD'):
        figures.polar_figure({'odd': {'alpha': alpha, 'CL': lift}})


def test_a_profile_is_coloured_by_airspeed_and_marks_what_it_is_told():
    figure = figures.profile_figure(glide(), marked={'alpha': 3.1})
    labels = {ax.get_ylabel() for ax in figure.axes}
    assert labels >= {
        *('altitude [m]', 'airspeed [m/s]', 'alpha [deg]', 'gamma [deg]'),
    }
    scene = figure.axes[0]
    assert scene.get_xlabel() == 'x_e [km]'  # 6 km
    colours = scene.collections[0].get_array()
    assert len(colours) == 100 and colours[0] == 62
    alpha = next(ax for ax in figure.axes if ax.get_ylabel() == 'alpha [deg]')
    assert [line.get_ydata()[0] for line in alpha.lines] == [3.0, 3.1]
    assert figure.axes[3].get_xlabel() == 'time [s]'
    with pytest.raises(InputError, match='nothing to mark bank in'):
        figures.profile_figure(glide(), marked={'bank': 0})


def test_a_profile_does_not_cross_gaps_and_needs_no_airspeed():
    flight = soaring()
    lines = figures.profile_figure(flight).axes[0].collections[0]
    assert len(lines.get_segments()) == len(flight) - 2  # two stretches


def test_long_flights_are_shown_in_minutes():
    figure = figures.profile_figure(glide(3000.0))
    assert figure.axes[3].get_xlabel() == 'time [min]'
    np.testing.assert_allclose(figure.axes[3].lines[0].get_xdata()[-1], 50)
    history = figures.history_figure(glide(3000.0), ['altitude'])
    assert history.axes[0].get_xlabel() == 'time [min]'
    np.testing.assert_allclose(history.axes[0].lines[0].get_xydata()[-1], [50, -8000])


def test_tracks_and_altitudes_of_several_flights():
    figure = figures.tracks_figure({'there': soaring(), 'flip': flip()})
    track, high = figure.axes
    assert (track.get_xlabel(), track.get_ylabel()) == ('y_e, east [m]', 'x_e, north [m]')
    assert (high.get_xlabel(), high.get_ylabel()) == ('time [s]', 'altitude [m]')
    assert [text.get_text() for text in high.get_legend().get_texts()] == ['there', 'flip']
    assert len(track.lines) == 3  # two stretches and one


def test_a_plan_in_a_vertical_plane_is_seen_from_the_side():
    assert figures.figure_for(glide()).axes[0].get_xlabel() == 'x_e [km]'
    t = np.linspace(0, 10, 11)
    states = {'x_e': t, 'y_e': t, 'z_e': 0 * t, 'speed': 2 + 0 * t, 'gamma': 0 * t}
    turning = Trajectory(
        time=t, states={**states, 'track': 0.785 + 0 * t},
        model='DynamicsPointMass3DSpeedGammaTrack',
    )  # fmt: skip
    assert figures.figure_for(turning).axes[0].get_xlabel() == 'y_e, east [m]'
