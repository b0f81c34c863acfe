"""Every function that takes symbols gives on them, and on numbers, what NumPy gives."""

from collections.abc import Callable
from copy import copy
from typing import Any

import numpy
import pytest
from symbols import each_kind, on_symbols

import flightdyn.numpy as np
from flightdyn.errors import InputError

RANDOM = numpy.random.default_rng(20)
V = RANDOM.normal(size=5)
W = RANDOM.normal(size=5)
P = RANDOM.uniform(0.1, 0.9, 5)  # inside the domain of every elementary function
M = RANDOM.normal(size=(2, 5))
N = RANDOM.normal(size=(5, 3))
Q = RANDOM.normal(size=(3, 3))
A = RANDOM.normal(size=3)
B = RANDOM.normal(size=3)
S = numpy.float64(0.7)
T = numpy.cumsum(RANDOM.uniform(0.1, 1, 5))  # ascending, unevenly

Case = tuple[Callable[..., Any], tuple[Any, ...]]

UNARY = (
    'sin cos tan arcsin arccos arctan sinh cosh tanh arcsinh arctanh exp expm1 log log10 log1p '
    'sqrt square sign floor ceil fabs abs absolute degrees radians rad2deg deg2rad logical_not'
).split()
BINARY = (
    'maximum minimum fmax fmin add subtract multiply divide fmod mod arctan2 hypot'
    ' logical_and logical_or'
).split()
SHAPING = {
    'reshape': [(V, 5), (V, (5, 1)), (V, (1, -1)), (M, 10), (M, (5, 2)), (M, -1)],
    'ravel': [(V,), (M,)],
    'transpose': [(V,), (M,)],
    'swapaxes': [(M, 0, 1)],
    'roll': [(V, 2), (V, -1), (M, 3), (M, 1, 1), (M, 1, 0)],
    'flip': [(V,), (M,), (M, 1)],
    'flipud': [(M,)],
    'fliplr': [(M,)],
    'rot90': [(M,)],
    'tile': [(V, 2), (V, (2, 2)), (M, 2), (M, (3, 1)), (S, 3)],
    'repeat': [(V, 2), (M, 2), (M, 2, 1), (S, 3)],
    'take': [(V, [0, 0, 3]), (M, [1], 0)],
    'delete': [(V, 1), (M, 0, 1)],
    'squeeze': [(M[:1],)],
    'atleast_1d': [(V,), (M,)],
    'expand_dims': [(V, 0), (V, 1)],
    'broadcast_to': [(V, (3, 5)), (S, (2, 2))],
    'diag': [(A,), (A, 1), (A, -2), (Q,), (M, 1)],
    'diff': [(V,), (V, 2), (M,), (M, 1, 0), (M, 2, -1), (V, 0)],
    'cumsum': [(V,), (M,), (M, 0), (M, -1)],
    'sum': [(V,), (V, 0), (V, -1), (M,), (M, 0), (M, 1), (M, -1)],
    'prod': [(V,), (M,), (M, 0), (M, 1)],
    'mean': [(V,), (M,), (M, 0), (M, 1)],
    'max': [(V,), (M,), (M, 0), (M, 1)],
    'min': [(V,), (M,), (M, 0), (M, 1)],
    'any': [(V,), (V * 0,), (M * 0, 0)],
    'all': [(V,), (V * [0, 1, 1, 1, 1],), (M, 1)],
    'trace': [(Q,)],
    'zeros_like': [(V,), (M,), (S,)],
    'ones_like': [(V,), (M,)],
    'full_like': [(V, 3.0), (M, -1.0)],
    'clip': [(V, -0.1, 0.2), (M, None, 0.2), (V, 0.0, None)],
}
CASES: dict[str, Case] = {
    **{name: (lambda np, x, name=name: getattr(np, name)(x), (P,)) for name in UNARY},
    'arccosh': (lambda np, x: np.arccosh(1 + x), (P,)),
    **{name: (lambda np, a, b, name=name: getattr(np, name)(a, b), (V, W)) for name in BINARY},
    'power': (lambda np, a, b: np.power(a, b), (P, V)),
    'power of negative': (lambda np, a: np.power(a, 3), (V,)),
    **{
        f'{name} {numpy.shape(args[0])} {args[1:]}': (
            lambda np, a, name=name, rest=args[1:]: getattr(np, name)(a, *rest),
            args[:1],
        )
        for name, many in SHAPING.items()
        for args in many
    },
    'mod of scalar': (lambda np, a: np.mod(a, 0.3), (V,)),
    'where': (lambda np, a, b: np.where(a > b, a, 2 * b), (V, W)),
    'where with scalars': (lambda np, a: np.where(a > 0, 1.0, -1.0), (V,)),
    'where of numbers': (lambda np, a: np.where(V > 0, a, 0.0), (W,)),
    'array of scalars': (lambda np, a: np.array([a, 2.0, 3 * a]), (S,)),
    'array of rows': (lambda np, a, b: np.array([a, b, V]), (V, W)),
    'array nested': (lambda np, a: np.array([[a, 1.0], [2.0, a * a]]), (S,)),
    'asarray': (lambda np, a: np.asarray([a, 1.0]), (S,)),
    'full': (lambda np, a: np.full(3, a), (S,)),
    'full matrix': (lambda np, a: np.full((2, 3), a), (S,)),
    'concatenate': (lambda np, a, b: np.concatenate((a, [1.0, 2.0], b)), (V, A)),
    'concatenate axis -1': (lambda np, a, b: np.concatenate((a, b), axis=-1), (V, A)),
    'concatenate matrices': (lambda np, a, b: np.concatenate((a, b)), (Q, N)),
    'concatenate columns': (lambda np, a, b: np.concatenate((a, b), axis=1), (M, Q[:2])),
    'concatenate flat': (lambda np, a, b: np.concatenate((a, b), axis=None), (M, Q)),
    'stack': (lambda np, a, b: np.stack((a, b)), (V, W)),
    'stack columns': (lambda np, a, b: np.stack((a, b), axis=1), (V, W)),
    'stack last': (lambda np, a, b: np.stack((a, b), axis=-1), (V, W)),
    'stack scalars': (lambda np, a, b: np.stack((a, b, a)), (S, S)),
    'vstack': (lambda np, a, b: np.vstack((a, b)), (M, V)),
    'hstack': (lambda np, a, b: np.hstack((a, b)), (V, A)),
    'hstack matrices': (lambda np, a, b: np.hstack((a, b)), (N, N)),
    'append': (lambda np, a: np.append(a, 3.0), (V,)),
    'append rows': (lambda np, a, b: np.append(a, b, axis=0), (N, Q)),
    'dot': (lambda np, a, b: np.dot(a, b), (V, W)),
    'dot matrix': (lambda np, a, b: np.dot(a, b), (M, V)),
    'dot from left': (lambda np, a, b: np.dot(a, b), (V, N)),
    'dot matrices': (lambda np, a, b: np.dot(a, b), (M, N)),
    'dot scalar': (lambda np, a, b: np.dot(a, b), (S, N)),
    'matmul': (lambda np, a, b: np.matmul(a, b), (M, N)),
    'inner': (lambda np, a, b: np.inner(a, b), (V, W)),
    'inner matrices': (lambda np, a, b: np.inner(a, b), (Q, N)),
    'inner with vector': (lambda np, a, b: np.inner(a, b), (Q, A)),
    'outer': (lambda np, a, b: np.outer(a, b), (V, A)),
    'outer of matrices': (lambda np, a, b: np.outer(a, b), (M, A)),
    'cross': (lambda np, a, b: np.cross(a, b), (A, B)),
    'cross of rows': (lambda np, a, b: np.cross(a, b), (N, N[::-1].copy())),
    'cross of columns': (lambda np, a, b: np.cross(a, b, axis=0), (Q, Q.T.copy())),
    'norm': (lambda np, a: np.linalg.norm(a), (V,)),
    'norm 1': (lambda np, a: np.linalg.norm(a, 1), (V,)),
    'norm inf': (lambda np, a: np.linalg.norm(a, numpy.inf), (V,)),
    'norm of matrix': (lambda np, a: np.linalg.norm(a), (M,)),
    'norm of rows': (lambda np, a: np.linalg.norm(a, axis=1), (M,)),
    'norm of columns': (lambda np, a: np.linalg.norm(a, axis=0), (M,)),
    'inv': (lambda np, a: np.linalg.inv(a), (Q,)),
    'det': (lambda np, a: np.linalg.det(a), (Q,)),
    'solve': (lambda np, a, b: np.linalg.solve(a, b), (Q, A)),
    'linspace': (lambda np, a, b: np.linspace(a, b, 7), (S, -S)),
    'linspace from number': (lambda np, b: np.linspace(0, b, 7), (S,)),
    'linspace of vectors': (lambda np, a, b: np.linspace(a, b, 4), (A, B)),
    'logspace': (lambda np, a, b: np.logspace(a, b, 7), (S, -S)),
    'geomspace': (lambda np, a, b: np.geomspace(a, b, 7), (S, 3 * S)),
    'interp': (lambda np, x: np.interp(x, T, V), (1.5 * T,)),
    'interp left right': (lambda np, x: np.interp(x, T, V, left=9.0, right=8.0), (2 * T - 1,)),
    'interp tables': (lambda np, x, xp, fp: np.interp(x, xp, fp), (T[::-1] + 0.1, T, V)),
    'interp scalar': (lambda np, x: np.interp(x, T, V), (S,)),
    'interp matrix': (lambda np, x: np.interp(x, T, V), (M,)),
    'interp period': (lambda np, x: np.interp(x, T + 7, V, period=4.0), (5 * W,)),
    'interp values': (lambda np, fp: np.interp(W, T, fp, period=4.0), (V,)),
    'polyval': (lambda np, x: np.polyval([1.0, -2.0, 3.0], x), (V,)),
    'polyval coefficients': (lambda np, p, x: np.polyval(p, x), (A, V)),
    'gradient': (lambda np, f: np.gradient(f), (V,)),
    'gradient step': (lambda np, f, h: np.gradient(f, h), (V, S)),
    'gradient uneven': (lambda np, f, x: np.gradient(f, x), (V, T)),
    'gradient uneven order 2': (lambda np, f, x: np.gradient(f, x, edge_order=2), (V, T)),
    'gradient rows': (lambda np, f: np.gradient(f, T, axis=1), (M,)),
    'gradient columns': (lambda np, f, x: np.gradient(f, x, axis=0, edge_order=2), (N, T)),
    'gradient of two': (lambda np, f: np.gradient(f, 0.5), (V[:2],)),
    'gradient of numbers': (lambda np, x: np.gradient(V, x), (T,)),
    'length': (lambda np, x: np.array([x[0], len(V)]), (V,)),
}


@pytest.mark.parametrize('name', CASES)
def test_numbers_give_what_numpy_gives(name: str) -> None:
    function, arrays = CASES[name]
    ours, theirs = function(np, *arrays), function(numpy, *arrays)
    assert numpy.shape(ours) == numpy.shape(theirs)
    assert numpy.allclose(ours, theirs, rtol=1e-14, atol=1e-15)


@each_kind
@pytest.mark.parametrize('name', CASES)
def test_symbols_give_what_numpy_gives(kind: Any, name: str) -> None:
    function, arrays = CASES[name]
    ours = on_symbols(kind, lambda *s: function(np, *s), *arrays)
    theirs = numpy.asarray(function(numpy, *arrays), dtype=float)
    # what CasADi cannot tell apart: one column is a vector
    shape = theirs.shape[:1] if theirs.ndim == 2 and theirs.shape[1] == 1 else theirs.shape
    assert numpy.shape(ours) == shape
    # rounding of a 3 x 3 inverse, with room for its condition number
    assert numpy.allclose(ours, theirs.reshape(shape), rtol=1e-12, atol=1e-13)


@each_kind
def test_lists_of_symbols_are_arrays(kind: Any) -> None:
    a, b = kind.sym('a'), kind.sym('b')
    assert np.sin([a, b]).shape == (2, 1)
    assert np.sum([a, b, 1.0]).shape == (1, 1)
    assert np.maximum([a, b], 0).shape == (2, 1)
    assert np.hypot([a, b], [1, 2]).shape == (2, 1)
    assert np.length([a, b]) == 2 and np.length(a) == 1 and np.length(3.0) == 1


def test_lists_of_numbers_are_arrays() -> None:
    for function in (np.sin, np.degrees, np.square, np.softabs):
        assert isinstance(function([1.0, 2.0]), numpy.ndarray)
    assert numpy.allclose(np.hypot([3.0, 5.0], [4.0, 12.0]), [5, 13])


def test_every_function_listed_is_tried_on_symbols() -> None:
    tried = {name.split()[0] for name in CASES}
    elsewhere = set(
        'arcsind arccosd arctan2d sind cosd tand blend sigmoid softabs softmax softmin softplus '
        'centered_mod cosspace sinspace trapezoid trapz cumulative_trapezoid amax amin '
        'empty_like linalg.det linalg.inv linalg.norm linalg.solve'.split()
    )
    assert set(np.symbolic_functions()) - tried - elsewhere == set()


def test_what_takes_symbols_is_listed_live() -> None:
    listed = np.symbolic_functions()
    assert {'sin', 'where', 'softmax', 'interp', 'linalg.norm'} <= set(listed)
    assert not {'is_symbolic', 'pi', 'symbolic_functions', 'median'} & set(listed)


@each_kind
@pytest.mark.parametrize('name', ['median', 'convolve', 'isclose', 'einsum', 'arange'])
def test_other_functions_refuse_symbols_by_name(kind: Any, name: str) -> None:
    x = kind.sym('x', 3)
    for arguments in ([x], [[1.0, x]], [1.0, x]):
        with pytest.raises(InputError, match=rf'numpy\.{name} takes numbers only.*symbolic_func'):
            getattr(np, name)(*arguments)
    with pytest.raises(InputError, match='eigvalsh takes numbers only'):
        np.linalg.eigvalsh(x)


def test_other_names_are_numpys() -> None:
    assert np.median([1, 2, 4]) == 2
    assert np.float64 is numpy.float64 and np.ndarray is numpy.ndarray
    assert np.inf == numpy.inf and np.newaxis is None and np.random is numpy.random
    assert np.heaviside.accumulate([1.0, 2.0], 0).tolist() == [1, 1]
    assert np.linalg.LinAlgError is numpy.linalg.LinAlgError
    assert np.linalg.eigvalsh(numpy.eye(2)).tolist() == [1, 1]
    assert np.median is np.median, 'looked up once'
    assert copy(np.median)([1, 2, 4]) == 2
    with pytest.raises(AttributeError, match=r'neither flightdyn.numpy nor NumPy has .nonsense'):
        _ = np.nonsense


@each_kind
def test_more_than_two_dimensions_are_refused(kind: Any) -> None:
    x = kind.sym('x', 4)
    with pytest.raises(InputError, match='matrices at most'):
        np.reshape(x, (2, 1, 2))
    with pytest.raises(InputError, match='of one length'):
        np.array([x, x[:2]])
    with pytest.raises(InputError, match='no axis 2'):
        np.sum(x, axis=2)


@each_kind
def test_elements_of_zeros_like_symbols_take_symbols(kind: Any) -> None:
    x = kind.sym('x', 3)
    out = np.zeros_like(x)
    out[1] = x[2]
    assert isinstance(out, kind)
    assert numpy.array_equal(on_symbols(kind, lambda y: np.empty_like(y) * 0 + 1, V), V * 0 + 1)
