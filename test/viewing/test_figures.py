"""Figures: what is on their axes, and that they can be saved."""

import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip('matplotlib')

from flights import flip, soaring

from flightdyn.errors import InputError
from flightdyn.trajectory import Trajectory
from flightdyn.viewing import figures


def labels(figure):
    return [ax.get_ylabel() for ax in figure.axes] + [ax.get_xlabel() for ax in figure.axes]


def test_flip_shows_path_thrusts_and_a_vehicle_tilted_as_flown():
    plan = flip()
    figure = figures.flip_figure(plan)
    assert {'altitude [m]', 'rotor thrust [N]'} <= set(labels(figure))
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
        figures.save_figure(figures.new_figure((1, 1)), tmp_path / 'a.bmp')


def test_the_right_figure_is_picked():
    assert len(figures.figure_for(flip()).axes) == 3  # scene, thrusts, colour bar
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
    inverted = {ax.get_ylabel(): ax.yaxis_inverted() for ax in figure.axes}
    assert inverted == {'z_e [m]': True, 'w_e [m/s]': False}
