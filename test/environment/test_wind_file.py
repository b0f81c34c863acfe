"""Winds in files: read, written and read again, refused where they are wrong."""

import re
from typing import Any

import pytest

from flightdyn.config import parse_yaml
from flightdyn.environment.thermals import Thermal
from flightdyn.environment.wind import (
    ConstantWind,
    LogWind,
    PowerLawWind,
    ShearWind,
    SumOfWinds,
    TableWind,
)
from flightdyn.environment.wind_file import KEYS, read_wind, wind_document
from flightdyn.errors import InputError

GIVEN = {
    'shear': '{kind: shear, gradient: 0.1, from: 270 deg}',
    'power_law': '{kind: power_law, speed: 8, from: 90 deg, exponent: 0.2}',
    'logarithmic': '{kind: logarithmic, speed: 8, from: 0, reference_height: 20, roughness: 0.1}',
    'table': '{kind: table, heights: [0, 100, 300], north: [0, 5, 7], east: [0, 0, 2]}',
    'thermal': '{kind: thermal, x: 1000, y: 0, updraft: 3, radius: 120, top: 1500}',
}
MADE = {
    'shear': ShearWind(0.1, 270.0),
    'power_law': PowerLawWind(8.0, 90.0, exponent=0.2),
    'logarithmic': LogWind(8.0, 0.0, reference_height=20.0, roughness=0.1),
    'table': TableWind([0, 100, 300], [0, 5, 7], [0, 0, 2]),
    'thermal': Thermal(1000.0, 0.0, 3.0, 120.0, top=1500.0),
}
PLACE = (960.0, 40.0, -120.0, 0.0)


def read(text: str) -> Any:
    return read_wind(parse_yaml(text, 'there'), 'there')


@pytest.mark.parametrize('kind', KEYS)
def test_each_kind_is_read_and_written_and_read_again(kind: str) -> None:
    wind = read(GIVEN[kind])
    assert type(wind) is type(MADE[kind])
    assert wind(*PLACE) == pytest.approx(MADE[kind](*PLACE), rel=1e-14)
    document = wind_document(wind)
    again = read_wind(document, 'plan')
    assert again is not None
    assert again(*PLACE) == pytest.approx(wind(*PLACE), rel=1e-14)  # degrees there and back
    assert wind_document(again) == document


def test_several_add_up_and_none_is_none() -> None:
    wind = read(f'[{", ".join(GIVEN.values())}]')
    assert isinstance(wind, SumOfWinds)
    expected = [sum(each) for each in zip(*(part(*PLACE) for part in MADE.values()), strict=True)]
    assert wind(*PLACE) == pytest.approx(expected)
    assert [each['kind'] for each in wind_document(wind)] == list(GIVEN)
    assert read('[]') is None
    assert wind_document(None) == []


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('5', 'there: expected a mapping with a kind (shear, power_law'),
        ('{speed: 5}', 'there: expected a mapping with a kind'),
        ('{kind: sheer}', "there: kind: unknown 'sheer', did you mean 'shear'?"),
        ('{kind: shear, from: 0}', "there: 'gradient' is missing"),
        ('{kind: shear, gradient: 1, from: 0, top: 3}', "there: unknown 'top'"),
        (
            '{kind: shear, gradient: much, from: 0}',
            "there.gradient: expected a number, got 'much'",
        ),
        ('{kind: table, heights: 3, north: [0], east: [0]}', 'there.heights: expected a list'),
        ('[{kind: shear, gradient: 1, from: 0}, {kind: thermal}]', "there[1]: 'x' is missing"),
        (
            '{kind: thermal, x: 0, y: 0, updraft: 3, radius: -1}',
            'there: Thermal: radius is -1.0, must be positive',
        ),
    ],
)
def test_what_is_wrong_is_told_with_its_place(text: str, message: str) -> None:
    with pytest.raises(InputError, match=f'^{re.escape(message)}'):
        read(text)


@pytest.mark.parametrize('wind', [lambda x, y, z, t: (0.0, 0.0, 0.0), ConstantWind(1.0)])
def test_a_wind_that_no_file_can_hold_is_told(wind: Any) -> None:
    with pytest.raises(InputError, match='is no wind that a file can hold: known: shear'):
        wind_document(wind)
