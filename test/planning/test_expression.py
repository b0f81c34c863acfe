"""Formulas: the same values as Python's, and nothing else gets through."""

import contextlib
import math

import casadi as cas
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from flightdyn.errors import InputError
from flightdyn.planning.expression import FUNCTIONS, MAX_LENGTH, Expression

VALUES = {'a': 1.5, 'b': -0.25, 'final.x': 3.0}


def value(source: str) -> float:
    def named(name: str) -> cas.SX:
        if name not in VALUES:
            raise InputError(f"unknown '{name}'")
        return cas.SX(VALUES[name])

    return float(Expression(source).evaluate(named))


@pytest.mark.parametrize(
    ('source', 'expected'),
    [
        ('1', 1),
        ('  2 - 3 - 4 ', -5),
        ('2**3**2', 512),
        ('-2**2', -4),
        ('2**-1', 0.5),
        ('7/2/2', 1.75),
        ('1e3 + .5', 1000.5),
        ('a*b + final.x', 2.625),
        ('+a', 1.5),
        ('sqrt(16) + abs(b) + max(a, b, 2) + min(a, b)', 6),
        ('sin(90*deg) + cos(pi) + log(exp(2))', 2),
        ('(final.x)', 3),
        ('final . x', 3),
    ],
)
def test_values(source: str, expected: float) -> None:
    assert value(source) == pytest.approx(expected, rel=1e-14)


numbers = st.floats(0.01, 100, allow_nan=False).map(lambda v: repr(round(v, 6)))
formulas = st.recursive(
    st.one_of(numbers, st.sampled_from(['a', 'b', 'pi'])),
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(['+', '-', '*']), inner).map(
            lambda t: f'({" ".join(t)})'
        ),
        inner.map(lambda s: f'-{s}'),
        inner.map(lambda s: f'sin({s})'),
        inner.map(lambda s: f'abs({s})'),
        st.tuples(inner, inner).map(lambda t: f'max({t[0]}, {t[1]})'),
    ),
    max_leaves=12,
)


@given(formulas)
def test_formulas_mean_what_they_mean_in_python(source: str) -> None:
    names = {'a': 1.5, 'b': -0.25, 'pi': math.pi, 'sin': math.sin, 'abs': abs, 'max': max}
    expected = eval(source, {'__builtins__': {}}, names)  # noqa: S307 - made of the parts above
    assert value(source) == pytest.approx(expected, rel=1e-12, abs=1e-12)


alphabet = st.sampled_from(
    [
        *'+-*/()., 0123456789ab_[]{}<>=:;!@%&|^~\'"\\\n\t',
        '**',
        'lambda ',
        'if ',
        ' else ',
        'final.',
    ]
    + [f'{name}(' for name in (*FUNCTIONS, 'integral', '__import__', 'eval', 'open')]
)


@given(st.one_of(st.text(max_size=60), st.lists(alphabet, max_size=40).map(''.join)))
@settings(max_examples=600)
def test_any_text_is_a_number_or_an_input_error(source: str) -> None:
    with contextlib.suppress(InputError):
        assert math.isfinite(value(source))


@pytest.mark.parametrize(
    ('source', 'message', 'column'),
    [
        ('', 'expected a formula', 1),
        ('   ', 'expected a formula', 1),
        ('1 +', 'not a formula', 4),
        ('a + unknown', "unknown 'unknown'", 5),
        ('  a + unknown', "unknown 'unknown'", 7),
        ('a < b', "'<' is not allowed", 3),
        ('a and b', "'and' is not allowed", 3),
        ('1if 2else 3', "'if' is not allowed", 2),
        ('1 + (lambda: 1)', "':' is not allowed", 12),
        ('a[0]', 'not allowed', 2),
        ('[a]', 'not allowed', 1),
        ('(a := 3)', 'not allowed', 4),
        ('a, b', 'not allowed', 1),
        ('a = 3', 'not allowed', 3),
        ('a; b', 'not allowed', 2),
        ('1\n+1', 'not allowed', 2),
        ("'text'", 'not allowed', 1),
        ('f"{a}"', 'not allowed', 2),
        ('b"x"', 'not allowed', 2),
        ('True', "'True' is not", 1),
        ('lambda', "'lambda' is not", 1),
        ('...', 'a finite number', 1),
        ('2j', 'a finite number', 1),
        ('1e999', 'a finite number', 1),
        ('9' * 400, 'a finite number', 1),
        ('7 % 2', 'not allowed', 3),
        ('7 // 2', 'this operation', 1),
        ('~7', 'not allowed', 1),
        ('not a', "'not'", 1),
        ('1/0', 'is not a finite number', 1),
        ('a + sqrt(-1)', 'is not a finite number', 5),
        ('log(0)', 'is not a finite number', 1),
        ('9**9**9**9', 'is not a finite number', 4),
        ('a.__class__', "unknown 'a.__class__'", 1),
        ('a.x.y', 'a second dot', 1),
        ('().__class__.__bases__', 'a second dot', 1),
        ('(1).real', 'a second dot', 1),
        ('__import__(os)', "unknown function '__import__'", 1),
        ('__import__(os).system(a)', 'this call', 1),
        ('a.sin(1)', 'this call', 1),
        ('sin()', 'takes one value', 1),
        ('sin(1, 2)', 'takes one value', 1),
        ('sin(*a)', 'not allowed', 5),
        ('max(1)', 'two or more', 1),
        ('sin(x=1)', 'not allowed', 6),
        ('sinn(1)', "did you mean 'sin'", 1),
        ('integral(a)', 'integral is not allowed here', 1),
        ('5 deg', r'5\*deg', 3),
        ('５', 'is not allowed', 1),
        ('ａ', 'is not allowed', 1),
        ('a\x00', 'is not allowed', 2),
        ('#', 'not allowed', 1),
        ('a \\', 'not allowed', 3),
        ('await a', "'await'", 1),
    ],
)
def test_what_is_refused_is_named_with_its_column(source: str, message: str, column: int) -> None:
    with pytest.raises(InputError, match=message) as caught:
        value(source)
    assert f'(column {column} of ' in str(caught.value)


@pytest.mark.parametrize(
    'source',
    [
        '(' * 400 + 'a' + ')' * 400,
        '-' * 900 + 'a',
        'sin(' * 150 + 'a' + ')' * 150,
        '**'.join(['a'] * 200),
        '+'.join(['a'] * 400),
        '(' * MAX_LENGTH,
        'a' * (MAX_LENGTH + 1),
        'a+' * 10_000_000 + 'a',
    ],
)
def test_oversized_formulas_are_refused(source: str) -> None:
    with pytest.raises(InputError, match=r'expression: ') as caught:
        value(source)
    assert len(str(caught.value)) < 400


def test_errors_name_the_place() -> None:
    with pytest.raises(InputError, match=r'flip\.yaml: objective\.minimize: not a formula'):
        Expression('1 +', 'flip.yaml: objective.minimize')
