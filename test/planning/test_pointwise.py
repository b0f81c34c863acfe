"""Functions at many points, compiled or not: the very numbers of CasADi's interpreter."""

import shutil
import subprocess
from pathlib import Path

import casadi as cas
import numpy as np
import pytest

from flightdyn.errors import InputError
from flightdyn.planning import compiled as compiling
from flightdyn.planning import wide_code
from flightdyn.planning.compiled import compiled_wide
from flightdyn.planning.increments import increments
from flightdyn.planning.pointwise import pointwise
from flightdyn.planning.problem_file import load_problem
from flightdyn.planning.spread import MANY, can_be_spread, spread
from flightdyn.planning.wide_code import can_be_wide, wide_source

needs_compiler = pytest.mark.skipif(
    not any(map(shutil.which, compiling.COMPILERS)), reason='needs a C compiler'
)
SPECIAL = [0.0, -0.0, 1.0, -1.0, np.inf, -np.inf, np.nan, 5e-324, 1e308, 0.5]


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv('XDG_CACHE_HOME', str(tmp_path))
    monkeypatch.setattr(compiling, 'WORTHWHILE', 0)
    return tmp_path / 'flightdyn' / 'compiled'


def instructions(function: cas.Function) -> set[int]:
    return {function.instruction_id(k) for k in range(function.n_instructions())}


def every_operation() -> cas.Function:
    """Return a function with every operation of one or two numbers that CasADi has."""
    a, b = cas.SX.sym('a'), cas.SX.sym('b')
    one = [
        *(-a, a * a, a + a, 1 / a, a**1.5, a**3, cas.sqrt(a), cas.exp(a), cas.log(a)),
        *(cas.sin(a), cas.cos(a), cas.tan(a), cas.asin(a), cas.acos(a), cas.atan(a)),
        *(cas.sinh(a), cas.cosh(a), cas.tanh(a), cas.asinh(a), cas.acosh(a), cas.atanh(a)),
        *(cas.log1p(a), cas.expm1(a), cas.erf(a), cas.floor(a), cas.ceil(a)),
        *(cas.fabs(a), cas.sign(a), cas.logic_not(a)),
    ]
    two = [
        *(a + b, a - b, a * b, a / b, a**b, cas.fmod(a, b), cas.remainder(a, b)),
        *(cas.fmin(a, b), cas.fmax(a, b), cas.atan2(a, b), cas.copysign(a, b), cas.hypot(a, b)),
        *(a < b, a <= b, a == b, a != b, cas.logic_and(a, b), cas.logic_or(a, b)),
        *(cas.if_else(a < b, a, b), cas.if_else(a > 0, cas.SX.inf(), b)),
    ]
    return cas.Function('every', [a, b], [cas.vertcat(*one), cas.vertcat(*two)])


def test_every_operation_with_a_vector_form_is_tried() -> None:
    tried = instructions(every_operation())
    rest = {code for code in wide_code.OPERATIONS if code not in tried}
    assert rest <= {cas.OP_ASSIGN}


@needs_compiler
def test_every_operation_gives_the_numbers_of_the_interpreter() -> None:
    function = every_operation()
    (wide,) = compiled_wide([function]) or []
    rng = np.random.default_rng(1)
    pairs = np.array(np.meshgrid(SPECIAL, SPECIAL)).reshape(2, -1)
    points = np.hstack([pairs, 3 * rng.standard_normal((2, 1000))])
    lanes = wide.size2_in(0)
    points = points[:, : points.shape[1] // lanes * lanes]
    columns = [points[:1], points[1:]]
    found = wide.map(points.shape[1] // lanes)(*columns)
    expected = function.map(points.shape[1])(*columns)
    for ours, theirs in zip(found, expected, strict=True):
        # equal, and not-a-number where they are; the smaller of 0 and -0 may be either
        np.testing.assert_array_equal(ours.full(), theirs.full())


def test_every_operation_on_vectors_gives_the_numbers_of_the_interpreter() -> None:
    function = every_operation()
    a, b = (values.reshape(1, -1) for values in np.meshgrid(SPECIAL, SPECIAL))
    for ours, theirs in zip(
        spread(function, a.size)(a, b), function.map(a.size)(a, b), strict=True
    ):
        np.testing.assert_array_equal(ours.full(), theirs.full())


@pytest.mark.parametrize('kind', [pytest.param('wide', marks=needs_compiler), 'interpreted'])
@pytest.mark.parametrize('n', [1, 2, 7, 8, 9, 31])
def test_any_number_of_points_and_sparse_values(n: int, kind: str) -> None:
    x, p = cas.SX.sym('x', 3), cas.SX.sym('p')
    value = cas.vertcat(cas.sin(x[0]) * p, x[1] * x[2], 2)
    function = cas.Function('f', [x, p], [value, cas.jacobian(value, x)])
    wide = compiled_wide([function]) if kind == 'wide' else None
    (at_points,) = pointwise([function], wide or [])
    assert (at_points.wide is not None) == (kind == 'wide')
    xs, ps = cas.MX.sym('xs', 3, n), cas.MX.sym('ps', 1, n)
    both = cas.Function('both', [xs, ps], at_points.at([xs, ps]))
    rng = np.random.default_rng(n)
    given = rng.standard_normal((3, n)), rng.standard_normal((1, n))
    for ours, theirs in zip(both(*given), function.map(n)(*given), strict=True):
        assert ours.sparsity() == theirs.sparsity()
        np.testing.assert_array_equal(ours.full(), theirs.full())


@needs_compiler
def test_motion_of_a_table_gives_the_numbers_of_the_interpreter() -> None:
    functions = increments(load_problem('cessna152_turnback').stage)
    wide = compiled_wide(functions)
    assert wide is not None
    rng = np.random.default_rng(2)
    lanes = wide[0].size2_in(0)
    typical = [-100.0, 50.0, -100.0, 30.0, -0.1, 0.5, 5.0, 0.5, 3.0, 1.0]
    assert len(typical) == functions[0].size1_in(0)
    z = np.array(typical)[:, None] * (1 + 0.2 * rng.standard_normal((len(typical), lanes)))
    given = [z, np.zeros((3, lanes)), rng.standard_normal((functions[2].size1_in(2), lanes))]
    for plain, several in zip(functions, wide, strict=True):
        arguments = given[: plain.n_in()]
        expected = plain.map(lanes).call(arguments)
        for ours in (several.call(arguments), spread(plain, lanes).call(arguments)):
            for one, other in zip(ours, expected, strict=True):
                assert one.sparsity() == other.sparsity()
                np.testing.assert_array_equal(one.full(), other.full())


def test_what_has_no_vector_form_is_left() -> None:
    x = cas.SX.sym('x')
    matrices = cas.Function('g', [cas.MX.sym('x')], [cas.MX.sym('x')], {'allow_free': True})
    assert not can_be_wide(matrices)
    inverse = cas.Function('h', [x], [cas.erfinv(x)])
    assert not can_be_wide(inverse)
    assert compiled_wide([inverse]) is None
    with pytest.raises(InputError, match='h: has operations'):
        wide_source(inverse, 4)
    called = cas.Function('h', [x], [cas.erfinv(x)], {'never_inline': True})
    calling = cas.Function('c', [x], [2 * called(x)])
    assert not can_be_spread(matrices)
    assert not can_be_spread(calling) and not can_be_wide(calling)
    xs = cas.MX.sym('xs', 1, MANY)
    for function in (inverse, calling):
        (values,) = pointwise([function])[0].at([xs])
        points = np.linspace(-0.9, 0.9, MANY)[None]
        found = cas.Function('found', [xs], [values])(points)
        np.testing.assert_array_equal(found.full(), function.map(MANY)(points).full())


@needs_compiler
@pytest.mark.parametrize('lanes', [2, 4, 8])
def test_sources_compile_without_a_warning(lanes: int, tmp_path: Path) -> None:
    source = tmp_path / 'f.c'
    source.write_text(wide_source(every_operation(), lanes))
    compiler = next(filter(None, map(shutil.which, compiling.COMPILERS)))
    flags = [*compiling.WIDE_FLAGS, '-Wall', '-Wno-unused', '-Wno-psabi', '-Werror']
    subprocess.run([compiler, *flags, source, '-o', tmp_path / 'f.so', '-lm'], check=True)


def test_very_long_functions_are_not_optimised(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiling, 'WIDEST', 10)
    assert compiled_wide([every_operation()]) is None
