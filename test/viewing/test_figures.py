"""Figures: what is on their axes, and that they can be saved."""

import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip('matplotlib')

from flights import by_label, flip, soaring

from flightdyn.errors import InputError
from flightdyn.planning.solver import Iteration
from flightdyn.trajectory import Trajectory
from flightdyn.viewing import figures


def labels(figure):
    return [*by_label(figure), *(ax.get_xlabel() for ax in figure.axes)]


def test_flip_shows_path_thrusts_and_a_vehicle_tilted_as_flown():
    plan = flip()
    figure = figures.flip_figure(plan)
    assert {'altitude [m]', 'rotor thrust [N]', 'thrust_left [N]'} <= set(labels(figure))
    scene = figure.axes[0]
    bodies = [p for p in scene.patches if getattr(p, 'get_width', lambda: 0)() == 1.0]
    assert len(bodies) == 13
    # A quarter turn nose down after a quarter of the flip: the nose, at +x_b, is lowest.
    tail, nose = (
        (bodies[4].get_transform() - scene.transData).transform((end, 0.0)) for end in (0.0, 1.0)
    )
    assert nose[1] < tail[1]
    np.testing.assert_allclose(np.hypot(*(nose - tail)), 0.1, rtol=1e-6)
    with pytest.raises(InputError, match='theta'):
        figures.flip_figure(soaring())


def test_history_has_units_steps_and_only_what_was_asked():
    figure = figures.history_figure(flip())
    text = labels(figure)
    assert {'theta [deg]', 'q [deg/s]', 'time [s]'} <= set(text)
    thrust = next(ax for ax in figure.axes if 'thrust' in ax.get_ylabel())
    assert thrust.lines[0].get_drawstyle() == 'steps-post'
    assert '[N]' in thrust.get_ylabel()
    only = figures.history_figure(flip(), ['theta'])
    assert len(only.axes) == 1
    np.testing.assert_allclose(only.axes[0].lines[0].get_ydata()[-1], -360)
    with pytest.raises(InputError, match='nonsense'):
        figures.history_figure(flip(), ['nonsense'])


def test_lines_break_at_gaps():
    figure = figures.history_figure(soaring(), ['speed'])
    assert [line.get_xdata().size for line in figure.axes[0].lines] == [300, 300]
    assert len(figure.axes[0].collections) == 2  # 1-sigma bands


def test_comparison_shows_the_distance_between_plan_and_flight():
    plan, flown = flip(160), flip(160, wobble=0.05)
    figure = figures.comparison_figure(plan, flown)
    apart = next(ax for ax in figure.axes if ax.get_ylabel().startswith('flown less'))
    drawn = apart.lines[0].get_ydata()
    np.testing.assert_allclose(drawn, np.abs(flown['x_e'] - plan['x_e']), atol=1e-12)
    three = figures.comparison_figure(plan, flown, flip(40, wobble=0.04))
    assert 'distance from plan [m]' in labels(three)


@pytest.mark.parametrize('suffix', ['png', 'svg', 'pdf'])
def test_figures_are_saved_by_suffix(tmp_path, suffix):
    path = tmp_path / f'a.{suffix}'
    figures.save_figure(figures.history_figure(flip(), ['theta']), path)
    magic = {'png': b'\x89PNG', 'svg': b'<?xml', 'pdf': b'%PDF'}[suffix]
    assert path.read_bytes().startswith(magic)
    assert len(list(tmp_path.iterdir())) == 1


def test_unknown_suffix_is_refused(tmp_path):
    with pytest.raises(InputError, match=r'\.png'):
        figures.save_figure(figures.history_figure(flip()), tmp_path / 'a.bmp')


def test_the_right_figure_is_picked():
    assert len(figures.figure_for(flip()).axes) == 4  # scene, two thrusts, colour bar
    track = figures.figure_for(soaring())
    assert {'y_e, east [m]', 'bank [deg]'} <= set(labels(track))
    assert len(figures.figure_for(flip(), planned=flip()).axes) == 4


def test_drawing_needs_neither_screen_nor_pyplot():
    code = (
        'import sys, flightdyn.viewing; assert "matplotlib" not in sys.modules;'
        'import flightdyn.viewing.figures; assert "matplotlib.pyplot" not in sys.modules'
    )
    subprocess.run([sys.executable, '-c', code], check=True)


def test_a_climb_is_drawn_upward_though_z_points_down() -> None:
    t = np.linspace(0, 10, 11)
    climb = Trajectory(time=t, states={'z_e': -3 * t, 'w_e': np.full(11, -3.0)})
    figure = figures.history_figure(climb)
    shown = {label: ax.lines[0].get_ydata()[-1] for label, ax in by_label(figure).items()}
    assert shown == {'altitude [m]': 30.0, 'w_e [m/s]': -3.0}
    straight_up = figures.figure_for(climb)
    shown = {label: ax.lines[0].get_ydata()[-1] for label, ax in by_label(straight_up).items()}
    assert shown == {'altitude [m]': 30.0, 'climb_rate [m/s]': 3.0}


def test_a_climb_shows_controls_and_the_states_that_change_in_large_units() -> None:
    t = np.linspace(0, 10, 11)
    rocket = Trajectory(
        time=t,
        states={'z_e': -3000 * t, 'w_e': 0 * t - 3000, 'mass': 5e5 - 2e4 * t},
        controls={'thrust': 4e6 + 0 * t},
        outputs={'speed': 0 * t + 3000},
    )
    figure = figures.climb_figure(rocket)
    shown = {label: ax.lines[0].get_ydata()[-1] for label, ax in by_label(figure).items()}
    assert shown == pytest.approx(
        {'altitude [km]': 30, 'climb_rate [m/s]': 3000, 'thrust [MN]': 4, 'mass [t]': 300}
    )


def test_limits_are_dashed_where_the_flight_comes_near_them() -> None:
    t = np.linspace(0, 10, 11)
    flight = Trajectory(time=t, states={'gamma': 0.1 * np.sin(t)}, controls={'thrust': t / 10})
    limits = {'thrust': (0.0, 1.0), 'gamma': (-1.5, 0.12)}
    about = figures.About(limits=limits)
    axes = by_label(figures.history_figure(flight, about=about))
    dashed = {label: [line.get_ydata()[0] for line in ax.lines[1:]] for label, ax in axes.items()}
    assert dashed == {'thrust [N]': [0, 1], 'gamma [deg]': [pytest.approx(np.degrees(0.12))]}


def test_every_other_arc_of_a_bang_bang_plan_is_shaded() -> None:
    arcs = [
        {'start': a, 'end': a + 0.2, 'limits': {'thrust_left': 'upper', 'thrust_right': 'lower'}}
        for a in (0.0, 0.2, 0.4, 0.6)
    ]
    figure = figures.flip_figure(flip(), figures.About(document={'arcs': arcs}))
    history = by_label(figure)['thrust_left [N]']
    spans = [(p.get_x(), p.get_x() + p.get_width()) for p in history.patches]
    np.testing.assert_allclose(spans, [(0.2, 0.4), (0.6, 0.8)])


def test_a_heading_says_what_came_of_a_plan_and_alarms_if_it_is_none() -> None:
    document = {
        'verified': True, 'converged': True, 'objective': 0.8, 'message': 'solved and verified: x',
        'warnings': ['theta is high'],
    }  # fmt: skip
    good = figures.flip_figure(flip(), figures.About(document=document))._suptitle
    text = good.get_text()
    assert text.startswith('quadcopter_flip (quadcopter)\n')
    assert 'objective 0.8, 0.8 s: solved and verified: x; warning: theta is high' in text
    blown = figures.flip_figure(
        flip(), figures.About(document={**document, 'wind_ned': [0.0, 5.0, 0.0]})
    )
    assert 'wind 5 m/s from 270 deg' in blown.get_suptitle()  # it blows to the east
    assert 'wind' not in text
    failed = {**document, 'verified': False, 'converged': False, 'message': 'Infeasible: x_e'}
    bad = figures.flip_figure(flip(), figures.About(document=failed))._suptitle
    assert 'Infeasible: x_e' in bad.get_text() and 'objective' not in bad.get_text()
    assert bad.get_color() != good.get_color()


def test_tiny_deviations_are_shown_in_small_units() -> None:
    apart = figures.comparison_figure(flip(), flip(wobble=1e-4)).axes[2]
    assert apart.get_ylabel() == 'flown less planned [mm]'
    assert 0.05 < apart.lines[0].get_ydata().max() < 0.1  # 0.1 mm times the largest s sin(2 pi s)


def test_a_solve_history_shows_where_a_new_solve_begins() -> None:
    def iteration(number: int) -> Iteration:
        return Iteration(number, 10.0 - number, 10.0**-number, 0.0, 0.1 * number)

    figure = figures.convergence_figure([iteration(k) for k in (0, 1, 2, 3, 0, 1)], title='climb')
    cost, apart = figure.axes
    assert [len(line.get_xdata()) for line in cost.lines] == [4, 2, 2]  # two solves, their border
    assert cost.lines[2].get_xdata()[0] == 3.5
    assert apart.get_yscale() == 'log' and apart.lines[0].get_ydata()[2] == 1e-2
    assert '6 iterations in 2 solves, 0.4 s' in figure.get_suptitle()
    with pytest.raises(InputError, match='no iterations'):
        figures.convergence_figure([])
