"""Flights in a vertical plane, from the side."""

import numpy as np
import pytest

pytest.importorskip('matplotlib')

from flights import by_label, soaring

from flightdyn.errors import InputError
from flightdyn.trajectory import Trajectory
from flightdyn.viewing import figures
from flightdyn.viewing.profile_figure import energy_height


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


def bottom(figure):
    return next(ax for ax in figure.axes if ax.get_xlabel().startswith('time'))


def test_a_profile_is_coloured_by_airspeed_and_marks_what_it_is_told():
    figure = figures.profile_figure(glide(), marked={'alpha': 3.1})
    labels = set(by_label(figure))
    assert labels >= {
        *('altitude [m]', 'airspeed [m/s]', 'alpha [deg]', 'gamma [deg]'),
    }
    scene = figure.axes[0]
    assert scene.get_xlabel() == 'x_e [km]'  # 6 km
    colours = scene.collections[0].get_array()
    assert len(colours) == 100 and colours[0] == 62
    alpha = by_label(figure)['alpha [deg]']
    assert [line.get_ydata()[0] for line in alpha.lines] == [3.0, 3.1]
    assert bottom(figure).get_xlabel() == 'time [s]'
    with pytest.raises(InputError, match='nothing to mark bank in'):
        figures.profile_figure(glide(), marked={'bank': 0})


def test_a_profile_does_not_cross_gaps_and_needs_no_airspeed():
    flight = soaring()
    lines = figures.profile_figure(flight).axes[0].collections[0]
    assert len(lines.get_segments()) == len(flight) - 2  # two stretches


def test_long_flights_are_shown_in_minutes():
    figure = figures.profile_figure(glide(3000.0))
    assert bottom(figure).get_xlabel() == 'time [min]'
    np.testing.assert_allclose(bottom(figure).lines[0].get_xdata()[-1], 50)
    history = figures.history_figure(glide(3000.0), ['altitude'])
    assert history.axes[0].get_xlabel() == 'time [min]'
    np.testing.assert_allclose(history.axes[0].lines[0].get_xydata()[-1], [50, -8000])


def test_a_plan_in_a_vertical_plane_is_seen_from_the_side():
    assert figures.figure_for(glide()).axes[0].get_xlabel() == 'x_e [km]'
    t = np.linspace(0, 10, 11)
    states = {'x_e': t, 'y_e': t, 'z_e': 0 * t, 'speed': 2 + 0 * t, 'gamma': 0 * t}
    turning = Trajectory(
        time=t, states={**states, 'track': 0.785 + 0 * t},
        model='DynamicsPointMass3DSpeedGammaTrack',
    )  # fmt: skip
    assert figures.figure_for(turning).axes[0].get_xlabel() == 'y_e, east [m]'


def test_the_energy_of_a_glide_is_told() -> None:
    flight = glide()
    energy = energy_height(flight.__class__(
        time=flight.time, states=flight.states,
        outputs={**flight.outputs, 'altitude': -flight['z_e']},
    ))  # fmt: skip
    # by hand: 1000 m and 62 m/s at the start, 700 m and 61 m/s at the end
    np.testing.assert_allclose(energy[[0, -1]], [1195.989, 889.719], atol=1e-3)
    figure = figures.profile_figure(flight)
    audit = by_label(figure)['height [m]']
    np.testing.assert_allclose(audit.lines[0].get_ydata(), energy)
    said = figure.get_suptitle().replace('\n', ' ')
    assert '6 km on 306.3 m of energy height, 19.6 to 1' in said
    # the same heights with a speed that grows were not a glide
    speed = flight['speed'] + 0.9 * flight.time
    pushed = Trajectory(time=flight.time, states={**flight.states, 'speed': speed})
    assert 'to 1' not in figures.profile_figure(pushed).get_suptitle()


def test_a_flat_profile_says_how_much_larger_its_heights_are() -> None:
    figure = figures.profile_figure(glide())
    said = figure.get_suptitle().replace('\n', ' ')
    told = float(said.partition('heights drawn ')[2].split()[0])
    scene = figure.axes[0]
    figure.draw_without_rendering()
    one = scene.transData.transform([(0, 0), (0.1, 100.0)])  # 100 m each way
    across, up = one[1] - one[0]
    assert told == pytest.approx(up / across, rel=0.06)  # two digits, and room for the heading
    t = np.linspace(0, 10, 11)
    loop = Trajectory(
        time=t, states={'x_e': 100 * np.sin(t), 'z_e': 100 * np.cos(t), 'speed': 100 + 0 * t}
    )
    figure = figures.profile_figure(loop)
    assert 'heights drawn' not in figure.get_suptitle()
    assert figure.axes[0].get_aspect() == 1
