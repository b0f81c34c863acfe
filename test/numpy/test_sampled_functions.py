"""Rows of points, and differences, slopes, integrals and values of what is sampled at them."""

from typing import Any

import numpy
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from symbols import KINDS, each_kind, on_symbols

import flightdyn.numpy as np
from flightdyn.errors import InputError

COUNTS = st.integers(2, 12)
quick = settings(derandomize=True, deadline=None, max_examples=25)


def samples(count: int, seed: int) -> tuple[Any, Any]:
    """Return ascending, uneven coordinates and values at them."""
    random = numpy.random.default_rng(seed)
    return numpy.cumsum(random.uniform(0.1, 1, count)), random.normal(size=count)


@pytest.mark.parametrize('space', [np.linspace, np.cosspace, np.sinspace])
@pytest.mark.parametrize('ends', [(0.1, 0.7), (3, -1), (0, 6 * 3600)])
def test_rows_of_points_have_exact_ends(space: Any, ends: tuple[float, float]) -> None:
    for num in (2, 3, 50, 101):
        points = space(*ends, num)
        assert points.shape == (num,)
        assert (points[0], points[-1]) == ends
        for kind in KINDS:
            # alone and beside a number, as in `cosspace(0, final_time, num)`
            assert numpy.allclose(on_symbols(kind, lambda a, b: space(a, b, num), *ends), points)  # noqa: B023
            mixed = on_symbols(kind, lambda b: space(ends[0], b, num), ends[1])  # noqa: B023
            assert (mixed[0], mixed[-1]) == ends


def test_cosine_spacing_is_dense_at_both_ends() -> None:
    s = numpy.linspace(0, 1, 21)
    assert numpy.allclose(np.cosspace(2, 5, 21), 2 + 3 * (1 - numpy.cos(numpy.pi * s)) / 2)
    steps = numpy.diff(np.cosspace(0, 1, 21))
    assert numpy.allclose(steps, steps[::-1])
    assert steps[0] < steps[5] < steps[10]


def test_sine_spacing_is_dense_at_one_end() -> None:
    # AeroSandbox 4.2.10's numbers
    there = [2, 2.07612047, 2.29289322, 2.61731657, 3]
    assert numpy.allclose(np.sinspace(2, 3, 5), there, atol=1e-8)
    back = [2, 2.38268343, 2.70710678, 2.92387953, 3]
    assert numpy.allclose(np.sinspace(2, 3, 5, reverse_spacing=True), back, atol=1e-8)


def test_spacing_options_are_for_numbers() -> None:
    assert np.linspace(0, 1, 4, endpoint=False).tolist() == [0, 0.25, 0.5, 0.75]
    with pytest.raises(InputError, match='endpoint cannot go with CasADi'):
        np.linspace(0, KINDS[0].sym('x'), 4, endpoint=False)


@quick
@given(COUNTS, st.integers(0, 2**16), st.sampled_from([1, 2]))
def test_slopes_of_any_number_of_samples_are_numpys(count: int, seed: int, order: int) -> None:
    x, f = samples(max(count, order + 1), seed)
    for kind in KINDS:
        ours = on_symbols(kind, lambda f, x: np.gradient(f, x, edge_order=order), f, x)
        assert numpy.allclose(ours, numpy.gradient(f, x, edge_order=order), rtol=1e-10, atol=1e-10)


@quick
@given(COUNTS, st.integers(0, 2**16), st.integers(1, 3))
def test_differences_of_any_order_are_numpys(count: int, seed: int, n: int) -> None:
    _, f = samples(count + n, seed)
    for kind in KINDS:
        ours = on_symbols(kind, lambda f: np.diff(f, n), f)
        assert numpy.allclose(ours, numpy.diff(f, n))


@quick
@given(COUNTS, st.integers(0, 2**16))
def test_interpolation_in_any_table_is_numpys(count: int, seed: int) -> None:
    xp, fp = samples(count, seed)
    x = numpy.concatenate((xp, numpy.random.default_rng(seed).uniform(-1, xp[-1] + 1, 9)))
    for kind in KINDS:
        ours = on_symbols(kind, lambda x: np.interp(x, xp, fp), x)
        # rises are added up from the left: a rounding for each
        assert numpy.allclose(ours, numpy.interp(x, xp, fp), rtol=1e-12, atol=1e-13)


@each_kind
def test_interpolation_refuses_unfit_tables(kind: Any) -> None:
    x = kind.sym('x')
    with pytest.raises(InputError, match='must ascend'):
        np.interp(x, [0, 2, 1], [0, 1, 2])
    with pytest.raises(InputError, match='do not match'):
        np.interp(x, [0, 1, 2], [0, 1])
    with pytest.raises(InputError, match='period needs numeric'):
        np.interp(x, kind.sym('xp', 2), [0, 1], period=1.0)


def test_interpolation_in_a_table_of_one_point_or_with_a_jump() -> None:
    for kind in KINDS:
        assert on_symbols(kind, lambda x: np.interp(x, [1.0], [5.0]), 3.0) == 5
        values = on_symbols(kind, lambda x: np.interp(x, [0, 1, 1, 2], [0, 0, 1, 1]), [0.5, 1.5])
        assert values.tolist() == [0, 1]


def test_differences_and_slopes_of_headings_go_the_short_way() -> None:
    heading = numpy.array([350.0, 5.0, 90.0, 120.0])
    for kind in (None, *KINDS):

        def run(function: Any, kind: Any = kind) -> Any:
            return function(heading) if kind is None else on_symbols(kind, function, heading)

        assert numpy.allclose(run(lambda h: np.diff(h, period=360)), [15, 85, 30])
        assert numpy.allclose(run(lambda h: np.diff(h, 2, period=360)), [70, -55])
        slopes = run(lambda h: np.gradient(h, 2.0, period=360))
        assert numpy.allclose(slopes, [7.5, 25, 28.75, 15])


def test_slopes_along_an_axis_with_a_period() -> None:
    angles = numpy.array([[350.0, 5.0, 20.0], [10.0, 355.0, 340.0]])
    assert numpy.allclose(np.gradient(angles, axis=1, period=360), [[15] * 3, [-15] * 3])
    assert numpy.allclose(np.gradient(angles.T, [0, 1, 2], axis=0, period=360).T[1], -15)


def test_slopes_refuse_what_only_numpy_does() -> None:
    for kind in KINDS:
        with pytest.raises(InputError, match='axis of a matrix'):
            np.gradient(kind.sym('f', 2, 3))
        with pytest.raises(InputError, match='needs 3 samples'):
            np.gradient(kind.sym('f', 2), edge_order=2)
        with pytest.raises(InputError, match='4 samples, but 3 coordinates'):
            np.gradient(kind.sym('f', 4), [0, 1, 2])


def test_slopes_of_a_parabola_are_exact_with_second_order_ends() -> None:
    x, _ = samples(9, 1)
    for kind in KINDS:
        ours = on_symbols(kind, lambda x: np.gradient(x * x, x, edge_order=2), x)
        assert numpy.allclose(ours, 2 * x, rtol=1e-12)


@pytest.mark.parametrize('name', ['trapezoid', 'trapz'])
def test_integrals_are_numpys(name: str) -> None:
    reference = numpy.trapezoid if hasattr(numpy, 'trapezoid') else numpy.trapz
    x, f = samples(8, 5)
    table = numpy.random.default_rng(1).normal(size=(3, 8))
    function = getattr(np, name)
    cases = [
        (lambda f, x: function(f, x), (f, x), reference(f, x)),
        (lambda f, _: function(f), (f, x), reference(f)),
        (lambda f, _: function(f, dx=0.5), (f, x), reference(f, dx=0.5)),
        (lambda f, x: function(f, x), (table, x), reference(table, x)),
        (lambda f, x: function(f, x, axis=0), (table.T.copy(), x), reference(table.T, x, axis=0)),
        (lambda _, x: function(f, x), (f, x), reference(f, x)),
    ]
    for case, arrays, expected in cases:
        assert numpy.allclose(case(*arrays), expected, rtol=1e-13)
        for kind in KINDS:
            assert numpy.allclose(on_symbols(kind, case, *arrays), expected, rtol=1e-13)


def test_running_integrals_end_at_the_integral() -> None:
    x, f = samples(8, 5)
    table = numpy.array([f, 2 * f])
    for kind in (None, *KINDS):

        def run(function: Any, *arrays: Any, kind: Any = kind) -> Any:
            return function(*arrays) if kind is None else on_symbols(kind, function, *arrays)

        sums = run(lambda f, x: np.cumulative_trapezoid(f, x), f, x)
        assert sums.shape == (7,)
        assert sums[-1] == pytest.approx(np.trapezoid(f, x), rel=1e-12)
        assert numpy.allclose(numpy.diff(sums), 0.5 * (f[2:] + f[1:-1]) * numpy.diff(x)[1:])
        started = run(lambda f, x: np.cumulative_trapezoid(f, x, initial=0), table, x)
        assert numpy.allclose(started, [[0, *sums], [0, *(2 * sums)]])


def test_integrals_refuse_coordinates_of_another_length() -> None:
    with pytest.raises(InputError, match='3 samples, but 2 coordinates'):
        np.trapezoid([1, 2, 3], [0, 1])
