"""Derivatives chained around functions that know their own."""

from collections.abc import Sequence
from typing import Any

import casadi as cas
import numpy as np
import pytest

import flightdyn.numpy as fnp
from flightdyn.dynamics import opaque


class Product:
    """(b sin a, a b^2), with derivatives worked out by hand."""

    def partials(self, inputs: Sequence[Any], order: int) -> dict[opaque.Orders, list[Any]]:
        a, b = inputs
        sin, cos = fnp.sin(a), fnp.cos(a)
        every = {
            (0, 0): [b * sin, a * b * b],
            (1, 0): [b * cos, b * b],
            (0, 1): [sin, 2.0 * a * b],
            (2, 0): [-b * sin, 0.0 * a],
            (1, 1): [cos, 2.0 * b],
            (0, 2): [0.0 * a, 2.0 * a],
        }
        return {orders: found for orders, found in every.items() if sum(orders) <= order}


def product(a: Any, b: Any) -> Sequence[Any]:
    return opaque.values(Product(), [a, b], 2)


def test_calls_of_calls_are_chained() -> None:
    w, mu = cas.SX.sym('w', 3), cas.SX.sym('mu', 2)

    def composed() -> cas.SX:
        c = product(w[0], w[1] * w[2])
        d = product(c[0] + w[0], c[1] * w[2])
        e = product(d[0], w[1])
        return cas.vertcat(c[1] * d[0] * w[0], cas.exp(e[1]) * d[1])

    with opaque.recorded() as calls:
        traced = composed()
    plain = composed()
    assert len(calls) == 3
    assert cas.symvar(plain) == cas.symvar(w)
    expected = [plain, cas.jacobian(plain, w), cas.hessian(cas.dot(mu, plain), w)[0]]
    found = [*opaque.written_out([traced], calls), *opaque.differentiated(traced, w, mu, calls)]
    function = cas.Function('f', [w, mu], [*found, *expected])
    rng = np.random.default_rng(5)
    for _ in range(10):
        values = [part.full() for part in function(rng.normal(size=3), rng.normal(size=2))]
        for one, two in zip(values[:4], [values[4], *values[4:]], strict=True):
            np.testing.assert_allclose(one, two, rtol=1e-12, atol=1e-12 * (1 + abs(two).max()))


def test_calls_that_do_not_matter_are_left_out() -> None:
    w = cas.SX.sym('w', 2)
    with opaque.recorded() as calls:
        product(w[0], w[1])
    value, slope, bend = opaque.differentiated(w[0] ** 2, w, cas.SX(1.0), calls)
    assert (str(value), slope.nnz(), bend.nnz()) == ('sq(w_0)', 1, 1)


def test_only_scalar_symbols_are_stood_for() -> None:
    with opaque.recorded() as calls:
        assert product(0.5, 2.0)[1] == pytest.approx(2.0)
        np.testing.assert_allclose(product(np.array([0.5, 1.0]), 2.0)[1], [2.0, 4.0])
        assert isinstance(product(cas.MX.sym('a'), 2.0)[0], cas.MX)
        assert product(cas.SX.sym('a', 3), 2.0)[0].shape == (3, 1)
        assert not calls
        product(cas.SX.sym('a'), 2.0)
        assert len(calls) == 1
    product(cas.SX.sym('a'), 2.0)
    assert len(calls) == 1
