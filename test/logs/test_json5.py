"""JSON5 beside JSON: what each sentence of its grammar means."""

import contextlib
import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightdyn.logs.json5 import loads


@pytest.mark.parametrize(
    ('text', 'value'),
    [
        ('{a: 1, $b_2: 2, "c": 3}', {'a': 1, '$b_2': 2, 'c': 3}),
        ("{'a': 'it\\'s \"so\"'}", {'a': 'it\'s "so"'}),
        ('[1, 2,]', [1, 2]),
        ('{"a": [], }', {'a': []}),
        ('[0x1F, -0x10, +7, .5, 5., -1.5e3, 1E2]', [31, -16, 7, 0.5, 5.0, -1500.0, 100.0]),
        ('// one\n[1, /* two\n */ 2]', [1, 2]),
        (
            '["one \\\ntwo", "\\x41\\u0042", "a\tb", "\\v\\0", "\\q"]',
            ['one two', 'AB', 'a\tb', '\x0b\0', 'q'],
        ),
        ('[Infinity, -Infinity, +Infinity]', [math.inf, -math.inf, math.inf]),
        (
            '{NaN: 1, true: 2, x: true, y: null, Infinity: false}',
            {'NaN': 1, 'true': 2, 'x': True, 'y': None, 'Infinity': False},
        ),
    ],
)
def test_sentences(text: str, value: object) -> None:
    assert loads(text.encode()) == value


@pytest.mark.parametrize('text', ['[NaN]', '[+NaN]', "['a', NaN]"])
def test_no_number(text: str) -> None:
    assert math.isnan(loads(text.encode())[-1])


@pytest.mark.parametrize(
    'text',
    ['', '{', '[1 2]', '{a 1}', '{a: b}', "['a]", '[1,,2]', '[,]', ',}', '@', '[0xG]', '[1a]'],
)
def test_what_is_neither_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match=r'\w'):
        loads(text.encode())


@given(
    st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
        lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    )
)
def test_a_trailing_comma_changes_nothing(value: object) -> None:
    plain = json.dumps([value], ensure_ascii=False)
    assert loads(plain.encode()) == [value]
    assert loads(f'{plain[:-1]},]'.encode()) == [value]


@given(st.binary(max_size=60) | st.text(alphabet='{}[]:,"\'\\/*0x1.e-+aN\n', max_size=60))
def test_anything_is_a_value_or_refused(text: bytes | str) -> None:
    with contextlib.suppress(ValueError):
        loads(text if isinstance(text, bytes) else text.encode())
