"""Figures of sweeps: each case is where it belongs, and the failed ones are seen."""

import numpy as np
import pytest

pytest.importorskip('matplotlib')

from flightdyn.errors import InputError
from flightdyn.viewing import figures


def grid(*sizes: int) -> list[np.ndarray]:
    return [g.ravel() for g in np.meshgrid(*(np.arange(n, dtype=float) for n in sizes))]


def texts(figure) -> list[str]:
    return [t.get_text() for legend in figure.legends for t in legend.get_texts()]


def test_over_one_parameter_is_a_line_that_breaks_at_the_failed() -> None:
    order = [3, 0, 4, 1, 2]  # rows of a table come in any order
    speed = np.array([10.0, 20, 30, 40, 50])[order]
    value = np.array([1.0, 2, np.nan, 4, 5])[order]
    figure = figures.sweep_figure({'initial.speed': speed, 'h': value}, ['initial.speed'], 'h')
    (ax,) = figure.axes
    assert ax.get_xlabel() == 'initial.speed [m/s]'
    line, crosses = ax.lines[:2]
    np.testing.assert_array_equal(line.get_xdata(), [10, 20, 30, 40, 50])
    np.testing.assert_array_equal(line.get_ydata(), [1, 2, np.nan, 4, 5])
    np.testing.assert_array_equal(crosses.get_xdata(), [30])
    assert crosses.get_marker() == 'x'
    assert texts(figure) == ['failed']
    assert figure.get_suptitle() == '5 cases, 1 failed'


def test_a_case_that_was_not_verified_failed_whatever_its_value() -> None:
    table = {'speed': [1.0, 2.0], 'h': [3.0, 4.0], 'verified': [True, False]}
    (ax,) = figures.sweep_figure(table, ['speed'], 'h').axes
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), [3, np.nan])


def test_angles_are_shown_in_degrees_unless_their_unit_is_given() -> None:
    table = {'gamma': [0.0, np.pi / 2], 'h': [3.0, 4.0]}
    (ax,) = figures.sweep_figure(table, ['gamma'], 'h').axes
    np.testing.assert_allclose(ax.lines[0].get_xdata(), [0, 90])
    assert ax.get_xlabel() == 'gamma [deg]'
    told = {'units': {'gamma': 'rad', 'h': 'm'}, 'labels': {'h': 'height lost'}}
    (ax,) = figures.sweep_figure(table, ['gamma'], 'h', **told).axes
    np.testing.assert_allclose(ax.lines[0].get_xdata(), [0, np.pi / 2])
    assert (ax.get_xlabel(), ax.get_ylabel()) == ('gamma [rad]', 'height lost [m]')


def test_over_a_number_and_words_is_a_line_for_each_word() -> None:
    speed, which = grid(3, 2)
    words = np.array(['head', 'tail'])[which.astype(int)]
    table = {'wind': speed, 'case': words, 'h': 10 * which + speed}
    for over in (['wind', 'case'], ['case', 'wind']):
        figure = figures.sweep_figure(table, over, 'h', units={'wind': 'm/s'})
        (ax,) = figure.axes
        assert texts(figure) == ['head', 'tail']
        drawn = [line for line in ax.lines if line.get_marker() == 'o']
        np.testing.assert_array_equal(
            [line.get_ydata() for line in drawn], [[0, 1, 2], [10, 11, 12]]
        )
        assert len({(line.get_color(), line.get_linestyle()) for line in drawn}) == 2
        assert ax.get_xlabel() == 'wind [m/s]'


def test_over_two_is_a_map_with_the_failed_hatched() -> None:
    x, y = grid(4, 3)
    value = 10 * y + x
    value[[5, 11]] = np.nan  # x, y = 1, 1 and 3, 2
    figure = figures.sweep_figure({'x_e': x, 'mass': y, 'h': value}, ['x_e', 'mass'], 'h')
    ax = figure.axes[0]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ('x_e [m]', 'mass [kg]')
    cells, hatched = ax.collections[:2]
    drawn = cells.get_array().reshape(3, 4)
    assert drawn[2, 1] == 21 and drawn[0, 3] == 3
    assert np.argwhere(np.ma.getmaskarray(drawn)).tolist() == [[1, 1], [2, 3]]
    assert hatched.get_hatch() == '////'
    corners = [path.vertices.min(axis=0).tolist() for path in hatched.get_paths()]
    assert corners == [[0.5, 0.5], [2.5, 1.5]]
    assert {t.get_text() for t in ax.texts} >= {'0', '21', '22'} and len(ax.texts) == 10
    assert texts(figure) == ['failed']


def test_over_three_is_a_map_for_each_value_of_the_third() -> None:
    x, y, z = grid(4, 3, 2)
    table = {'x_e': x, 'mass': y, 'wind': z, 'h': x + 10 * y + 100 * z}
    figure = figures.sweep_figure(table, ['x_e', 'mass', 'wind'], 'h')
    maps = [ax for ax in figure.axes if ax.get_title()]
    assert [ax.get_title() for ax in maps] == ['wind 0', 'wind 1']
    assert [ax.collections[0].get_array().ravel()[-1] for ax in maps] == [23, 123]
    limits = {ax.collections[0].get_clim() for ax in maps}
    assert limits == {(0, 123)}  # one scale for all


def test_cases_that_lie_on_no_grid_are_points() -> None:
    random = np.random.default_rng(3)
    table = {name: random.random(40) for name in ('mass', 'speed', 'x_e', 'h')}
    table['h'][:4] = np.nan
    two = figures.sweep_figure(table, ['mass', 'speed'], 'h').axes[0]
    assert len(two.collections[0].get_offsets()) == 36
    np.testing.assert_array_equal(two.lines[0].get_ydata(), table['speed'][:4])
    three = figures.sweep_figure(table, ['mass', 'speed', 'x_e'], 'h')
    assert [ax.get_xlabel() for ax in three.axes] == ['mass [kg]', 'speed [m/s]', 'x_e [m]']
    for ax, name in zip(three.axes, ('mass', 'speed', 'x_e'), strict=True):
        np.testing.assert_array_equal(ax.lines[0].get_xdata(), table[name][:4])


def test_repeated_cases_are_not_joined() -> None:
    table = {'speed': [1.0, 1.0, 2.0], 'h': [3.0, 5.0, 4.0]}
    (ax,) = figures.sweep_figure(table, ['speed'], 'h').axes
    assert ax.lines[0].get_linestyle() == 'None'


@pytest.mark.parametrize('over', [['a'], ['a', 'b'], ['a', 'b', 'c'], ['a', 'b', 'c', 'd']])
def test_a_sweep_of_which_all_failed_is_drawn(over: list[str], tmp_path) -> None:
    columns = dict(zip('abcd', grid(2, 2, 2, 2), strict=True))
    keep = {'a': slice(0, 2), 'b': slice(0, 4), 'c': slice(0, 8), 'd': slice(None)}[over[-1]]
    table = {
        name: np.unique(columns[name]) if len(over) == 1 else columns[name][keep] for name in over
    }
    size = table['a'].size
    figure = figures.sweep_figure({**table, 'h': np.full(size, np.nan)}, over, 'h')
    assert 'failed' in figure.get_suptitle()
    figures.save_figure(figure, tmp_path / 'a.png', dpi=40)


@pytest.mark.parametrize(
    ('table', 'over', 'said'),
    [
        ({'a': [1.0], 'h': [1.0]}, [], 'empty'),
        ({'a': [1.0], 'h': [1.0]}, ['b'], 'lacks b; it has a, h'),
        ({'a': [1.0, 2.0], 'h': [1.0]}, ['a'], r'a has shape \(2,\)'),
        ({'a': [], 'h': []}, ['a'], 'one or more cases'),
        ({'a': [1.0, np.nan], 'h': [1.0, 1.0]}, ['a'], 'a is nan in case 1'),
        ({'a': [1.0], 'h': ['x']}, ['a'], 'h holds no numbers'),
    ],
)
def test_what_cannot_be_drawn_is_said(table, over, said) -> None:
    with pytest.raises(InputError, match=said):
        figures.sweep_figure(table, over, 'h')


def test_logarithmic_axes_and_colours() -> None:
    nodes = np.array([10.0, 20, 40])
    table = {'nodes': nodes, 'error': 100 / nodes**2}
    (ax,) = figures.sweep_figure(table, ['nodes'], 'error', log=['nodes', 'error']).axes
    assert (ax.get_xscale(), ax.get_yscale()) == ('log', 'log')
    x, y = grid(3, 3)
    table = {'a': 10**x, 'b': y, 'error': 10 ** (x + y)}
    ax = figures.sweep_figure(table, ['a', 'b'], 'error', log=['a', 'error']).axes[0]
    assert (ax.get_xscale(), ax.get_yscale()) == ('log', 'linear')
    cells = ax.collections[0]
    assert cells.norm(10.0**2) == pytest.approx(0.5)
    # edges lie half way in the exponent
    np.testing.assert_allclose(cells.get_coordinates()[0, :, 0], 10 ** np.arange(-0.5, 3))
    with pytest.raises(InputError, match='b is not positive everywhere'):
        figures.sweep_figure(table, ['a', 'b'], 'error', log=['b'])
