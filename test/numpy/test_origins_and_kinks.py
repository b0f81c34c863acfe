"""Values and gradients where plain formulas have none, and scalars against arrays."""

from math import pi, sqrt
from typing import Any

import casadi as cas
import numpy
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from symbols import each_kind, on_symbols, slopes

import flightdyn.numpy as np
from flightdyn.errors import InputError

FINITE = st.floats(-1e6, 1e6)


@each_kind
def test_norms_have_value_and_gradient_zero_at_the_origin(kind: Any) -> None:
    def norm(*components: Any) -> Any:
        return np.linalg.norm(np.array(list(components)))

    for function in (np.hypot, norm):
        assert on_symbols(kind, function, 0.0, 0.0, 0.0) == 0
        assert slopes(kind, function, 0.0, 0.0, 0.0).tolist() == [0, 0, 0]
        assert numpy.allclose(slopes(kind, function, 1.0, 2.0, -2.0), [1 / 3, 2 / 3, -2 / 3])
    assert np.hypot(0.0, 0.0) == 0
    assert np.hypot([0.0, 3.0], [0.0, 4.0]).tolist() == [0, 5]


@each_kind
def test_the_norm_has_a_finite_hessian_at_the_origin(kind: Any) -> None:
    x = kind.sym('x', 2)
    hessian, _ = cas.hessian(np.hypot(x[0], x[1]), x)
    assert numpy.all(numpy.isfinite(cas.Function('h', [x], [hessian])([0, 0]).full()))


@each_kind
def test_the_angle_of_the_origin_is_zero_with_a_finite_gradient(kind: Any) -> None:
    assert on_symbols(kind, np.arctan2, 0.0, 0.0) == 0
    assert slopes(kind, np.arctan2, 0.0, 0.0).tolist() == [1, 0]
    # dy, dx of the angle at (x, y) = (3, 4): x/r^2 and -y/r^2
    assert numpy.allclose(slopes(kind, np.arctan2, 4.0, 3.0), [3 / 25, -4 / 25])
    assert on_symbols(kind, np.arctan2, 0.0, -1.0) == pi


@pytest.mark.parametrize('y', [0.0, -0.0])
@pytest.mark.parametrize('x', [0.0, -0.0])
def test_signs_of_zeros_do_not_turn_the_angle_of_the_origin(x: float, y: float) -> None:
    assert np.arctan2(y, x) == 0
    assert np.arctan2(numpy.array([y]), x)[0] == 0


@each_kind
def test_where_takes_nothing_over_from_the_other_branch(kind: Any) -> None:
    def trap(x: Any) -> Any:
        return np.where(x > 0, np.sqrt(x), 0.0)

    def safe(x: Any) -> Any:
        return np.where(x > 0, np.sqrt(np.where(x > 0, x, 1.0)), 0.0)

    for x in (-1.0, 0.0):
        assert on_symbols(kind, trap, x) == on_symbols(kind, safe, x) == 0
        assert slopes(kind, safe, x) == 0
    assert slopes(kind, safe, 4.0) == 0.25


@pytest.mark.parametrize(
    'name',
    'sin cos tan arctan tanh sinh cosh exp expm1 degrees radians square absolute'.split()
    + ['hypot', 'arctan2', 'softmax', 'sigmoid', 'centered_mod'],
)
def test_scalars_and_arrays_agree_to_the_last_bit(name: str) -> None:
    many = numpy.random.default_rng(3).normal(size=(2, 257)) * 3
    function = getattr(np, name)
    inputs = many if name in ('hypot', 'arctan2', 'softmax', 'centered_mod') else many[:1]
    array = function(*inputs)
    scalars = [function(*map(float, values)) for values in inputs.T]
    assert array.tolist() == scalars


@settings(derandomize=True, deadline=None, max_examples=200)
@given(FINITE, st.floats(1e-3, 1e3))
def test_centered_mod_is_the_shortest_way_around(a: float, period: float) -> None:
    b = float(np.centered_mod(a, period))
    assert -period / 2 < b <= period / 2
    # whole periods apart, to the rounding of a
    turns = (a - b) / period
    assert abs(turns - round(turns)) <= 1e-15 * abs(a) / period + 1e-9


def test_centered_mod_keeps_small_angles_exactly() -> None:
    assert np.centered_mod(-1e-20, 2 * pi) == -1e-20
    assert np.centered_mod(numpy.array([-pi, pi]), 2 * pi).tolist() == [pi, pi]


def test_angles_in_degrees() -> None:
    assert np.sind(30.0) == pytest.approx(0.5, rel=1e-15)
    assert np.cosd(60.0) == pytest.approx(0.5, rel=1e-15)
    assert np.tand(45.0) == pytest.approx(1.0, rel=1e-15)
    assert np.arcsind(0.5) == pytest.approx(30)
    assert np.arccosd(0.5) == pytest.approx(60)
    assert np.arctan2d(-1.0, 0.0) == pytest.approx(-90)


# ---------------------------------------------------------------------- smooth stand-ins


@each_kind
def test_soft_maximum_lies_just_above_the_maximum(kind: Any) -> None:
    a, b = numpy.linspace(-3, 3, 13), numpy.linspace(4, -5, 13)
    soft = np.softmax(a, b, softness=0.1)
    over = soft - numpy.maximum(a, b)
    assert numpy.all(over >= 0) and numpy.all(over <= 0.1 * numpy.log(2))
    # the definition, which does not overflow at these values
    assert numpy.allclose(soft, 0.1 * numpy.log(numpy.exp(a / 0.1) + numpy.exp(b / 0.1)))
    assert numpy.allclose(np.softmin(a, b, hardness=10), -np.softmax(-a, -b, softness=0.1))
    assert numpy.allclose(on_symbols(kind, lambda *v: np.softmax(*v, softness=0.1), a, b), soft)


@each_kind
def test_soft_maximum_neither_overflows_nor_has_a_kink(kind: Any) -> None:
    assert np.softmax(1e4, -1e4, hardness=100.0) == 1e4
    assert np.softmax(1.0, 1.0, 1.0, softness=0.5) == pytest.approx(1 + 0.5 * numpy.log(3))
    assert slopes(kind, np.softmax, 2.0, 2.0).tolist() == [0.5, 0.5]
    assert numpy.isfinite(slopes(kind, lambda a, b: np.softmax(a, b, hardness=1e3), 1e4, 0)).all()


def test_soft_maximum_refuses_what_makes_no_sense() -> None:
    with pytest.raises(InputError, match='two or'):
        np.softmax(1.0)
    with pytest.raises(InputError, match='not both'):
        np.softmax(1.0, 2.0, softness=1, hardness=1)


def test_soft_functions_agree_with_aerosandbox() -> None:
    # AeroSandbox 4.2.10's numbers; its logistic step is the only one of another slope at 0
    assert np.softmax(1.0, 2.0, softness=0.5) == pytest.approx(2.063464005521486, rel=1e-15)
    assert np.softmax(1.0, 2.0, hardness=3) == pytest.approx(2.016195783857914, rel=1e-15)
    assert np.softmin(1.0, 2.0, softness=0.5) == pytest.approx(0.9365359944785137, rel=1e-15)
    assert np.softplus(0.3, beta=2) == pytest.approx(0.5187439752429428, rel=1e-15)
    steps = {
        'tanh': 0.8021838885585817,
        'arctan': 0.7650824138898912,
        'polynomial': 0.7867311721816641,
    }
    for kind, value in steps.items():
        assert np.sigmoid(0.7, kind) == pytest.approx(value, rel=1e-15)
    assert np.sigmoid(0.7, 'tanh', (2, 5)) == pytest.approx(4.406551665675745, rel=1e-15)
    assert np.blend(0.3, 5.0, 2.0) == pytest.approx(3.9369689186773864, rel=1e-15)


@each_kind
def test_soft_magnitude_and_steps(kind: Any) -> None:
    x = numpy.array([-3.0, 0.0, 4.0])
    assert numpy.allclose(np.softabs(x, 0.5), numpy.sqrt(x * x + 0.25) - 0.5)
    assert slopes(kind, np.softabs, 0.0) == 0
    assert np.sigmoid(0.0, 'logistic') == 0.5
    assert np.sigmoid(2.0, 'logistic') == pytest.approx(1 / (1 + numpy.exp(-2)), rel=1e-15)
    assert np.sigmoid(1.0, 'polynomial') == pytest.approx((1 + 1 / sqrt(2)) / 2)
    assert np.blend(0.0, 5.0, 2.0) == 3.5 and np.blend(50.0, 5.0, 2.0) == 5
    with pytest.raises(InputError, match='unknown type'):
        np.sigmoid(x, 'step')
