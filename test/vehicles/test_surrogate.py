"""Functions through samples: exact where they can be, smooth, and harmless out of range."""

from typing import Any

import casadi as cas
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import CubicSpline

from flightdyn.errors import InputError
from flightdyn.vehicles.surrogate import Axis, Surrogate, TensorSums, evaluated, smooth_clip


def chebyshev_points(n: int, lower: float, upper: float) -> Any:
    return lower + (upper - lower) * (1 - np.cos(np.pi * np.arange(n) / (n - 1))) / 2


@given(st.floats(-1e3, 1e3))
def test_clipping_changes_nothing_inside_and_never_leaves(x: float) -> None:
    clipped = smooth_clip(x, -2.0, 5.0, 0.1)
    assert -2.0 - 1e-12 <= clipped <= 5.0 + 1e-12
    if -1.9 <= x <= 4.9:
        assert clipped == pytest.approx(x, rel=1e-12, abs=1e-12)
    if x <= -2.1:
        assert clipped == pytest.approx(-2.0)
    if x >= 5.1:
        assert clipped == pytest.approx(5.0)


def test_clipping_has_two_continuous_derivatives() -> None:
    x = cas.SX.sym('x')
    clipped = smooth_clip(x, -2.0, 5.0, 0.1)
    slope = cas.gradient(clipped, x)
    both = cas.Function('f', [x], [slope, cas.gradient(slope, x)])
    for joint in (-2.1, -1.9, 4.9, 5.1):
        left, right = (np.array(both(joint + d)).ravel() for d in (-1e-7, 1e-7))
        # the third derivative is of the order of 1/margin^2 = 100
        np.testing.assert_allclose(left, right, atol=1e-4)


def test_chebyshev_points_give_polynomials_exactly() -> None:
    axis = Axis('x', chebyshev_points(7, -3.0, 11.0))
    assert axis.is_polynomial

    def exact(x: Any) -> Any:
        return 0.1 * x**6 - 3 * x**3 + x - 40

    fit = Surrogate.fit([axis], exact(axis.nodes))
    x = np.linspace(*axis.box, 50)
    np.testing.assert_allclose(fit({'x': x}), exact(x), rtol=1e-4 * 7)  # what pruning may cost


@pytest.mark.parametrize('n', [4, 5, 6, 31])
def test_other_points_give_the_cubic_spline_through_them(n: int) -> None:
    nodes = np.linspace(0.0, 5.0, n) ** 1.4 + 3.0
    axis = Axis('x', nodes)
    assert not axis.is_polynomial
    values = np.sin(nodes) - 0.3
    x = np.linspace(*axis.box, 101)
    # not-a-knot, SciPy's default; truncated powers lose some digits
    expected = CubicSpline(nodes, values)(x)
    np.testing.assert_allclose(Surrogate.fit([axis], values)({'x': x}), expected, atol=1e-8)


def test_axes_multiply_and_may_be_logarithmic() -> None:
    a = Axis('a', np.linspace(-1.0, 2.0, 25))
    b = Axis('b', np.exp(chebyshev_points(9, np.log(10.0), np.log(90.0))), logarithmic=True)
    c = Axis('c', np.array([0.0, 1000.0]))
    assert (a.is_polynomial, b.is_polynomial, c.is_polynomial) == (False, True, True)

    def exact(a: Any, b: Any, c: Any) -> Any:
        return np.exp(0.5 * a) * (1 + 0.2 * np.log(b)) * (2 + 1e-3 * c)

    grid = np.meshgrid(a.nodes, b.nodes, c.nodes, indexing='ij')
    fit = Surrogate.fit([a, b, c], exact(*grid))
    rng = np.random.default_rng(1)
    points = {axis.name: rng.uniform(*axis.box, 200) for axis in (a, b, c)}
    assert fit.logarithmic
    # two nodes of c interpolate ln(2 + c/1000) linearly: ln(2.5) - ln(2 * 3)/2 = 0.02 off half-way
    np.testing.assert_allclose(fit(points), exact(**points), rtol=0.025)
    points['c'] = np.where(rng.uniform(size=200) < 0.5, c.box[0], c.box[1])
    np.testing.assert_allclose(fit(points), exact(**points), rtol=2e-3)


def test_positive_values_stay_positive_and_symbols_agree_with_numbers() -> None:
    axis = Axis('x', np.linspace(0.0, 1.0, 6))
    fit = Surrogate.fit([axis], np.array([1.0, 1e-3, 1.0, 1e-3, 1.0, 1e-3]))
    x = np.linspace(-1.0, 2.0, 400)
    assert np.all(np.asarray(fit({'x': x})) > 0)
    for kind in (cas.SX, cas.MX):
        symbol = kind.sym('x')
        function = cas.Function('f', [symbol], [fit({'x': symbol})])
        np.testing.assert_allclose(function.map(400)(x).full().ravel(), fit({'x': x}), rtol=1e-9)


def two_of_three_axes() -> list[Surrogate]:
    axes = [
        Axis('a', np.array([0.0, 2.0])),
        Axis('b', np.linspace(-1.0, 1.0, 9)),
        Axis('c', np.exp(chebyshev_points(5, 0.0, 1.0)), logarithmic=True),
    ]
    a, b, c = np.meshgrid(*(axis.nodes for axis in axes), indexing='ij')
    return [Surrogate.fit(axes, np.exp(a * b) * c), Surrogate.fit(axes, np.sin(a + b) - c)]


def test_arrays_numbers_and_vectors_of_symbols_mix() -> None:
    fits = two_of_three_axes()
    a, b, c = np.array([0.3, 1.1, 1.7]), 0.2, np.array([[1.5], [2.5]])
    points = np.array([[[a_i, b, float(c_i)] for a_i in a] for c_i in c.ravel()])
    exact = [
        [[fit(dict(zip('abc', p, strict=True))) for p in row] for row in points] for fit in fits
    ]
    assert np.shape(exact) == (2, 2, 3)
    np.testing.assert_allclose(evaluated(fits, {'a': a, 'b': b, 'c': c}), exact, rtol=1e-13)
    for kind in (cas.SX, cas.MX):
        symbol = kind.sym('a', 3)
        found = evaluated(fits, {'a': symbol, 'b': b, 'c': 2.5})
        assert [part.shape for part in found] == [(3, 1), (3, 1)]
        values = cas.Function('f', [symbol], found)(a)
        for part, row in zip(values, exact, strict=True):
            np.testing.assert_allclose(part.full().ravel(), row[1], rtol=1e-13)


def test_partial_derivatives_are_casadis_of_the_sums() -> None:
    fits = two_of_three_axes()
    sums = TensorSums(fits[0].axes, np.stack([fit.coefficients for fit in fits]))
    s = cas.SX.sym('s', 3)
    found = sums.partials(cas.vertsplit(s), 2)
    assert sorted(found) == [
        *[(0, 0, 0), (0, 0, 1), (0, 0, 2), (0, 1, 0), (0, 1, 1), (0, 2, 0)],
        *[(1, 0, 0), (1, 0, 1), (1, 1, 0), (2, 0, 0)],
    ]
    for k, value in enumerate(found[(0, 0, 0)]):
        gradient, hessian = cas.gradient(value, s), cas.hessian(value, s)[0]
        for orders, parts in found.items():
            expected = value
            if sum(orders) == 1:
                expected = gradient[orders.index(1)]
            elif sum(orders) == 2:
                i, j = np.repeat(range(3), orders).tolist()
                expected = hessian[i, j]
            both = cas.Function('f', [s], [parts[k], expected])
            for point in ([0.3, -0.4, 0.9], [-0.9, 0.99, -0.2]):
                one, two = (float(part) for part in both(point))
                assert one == pytest.approx(two, rel=1e-12, abs=1e-12), orders


def test_far_outside_value_and_derivatives_are_finite() -> None:
    axis = Axis('x', np.exp(chebyshev_points(33, 2.0, 4.0)), logarithmic=True)
    fit = Surrogate.fit([axis], np.cos(axis.nodes))
    x = cas.SX.sym('x')
    value = fit({'x': x})
    function = cas.Function('f', [x], [value, cas.gradient(value, x), cas.hessian(value, x)[0]])
    for far in (-1e6, 0.0, 1e6):
        found, slope, bend = (float(v) for v in function(far))
        assert found == pytest.approx(np.cos(axis.nodes[0 if far <= 0 else -1]), abs=2e-3)
        assert (slope, bend) == (0.0, 0.0)


def test_bad_nodes_are_refused() -> None:
    with pytest.raises(InputError, match='must be finite and ascend'):
        Axis('x', np.array([0.0, 1.0, 1.0]))
    with pytest.raises(InputError, match='logarithmic axis must be positive'):
        Axis('x', np.array([0.0, 1.0]), logarithmic=True)
