"""What stands around a flight: what is refused, and JSON and back."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flightdyn.environment.surroundings import (
    Cylinder,
    Gate,
    Mark,
    Polygon,
    Surroundings,
    Terrain,
)
from flightdyn.environment.surroundings_file import read_surroundings
from flightdyn.errors import InputError

ALL = Surroundings(
    terrain=Terrain(
        np.array([0.0, 50.0]), np.array([-5.0, 5.0, 9.0]), np.arange(6.0).reshape(2, 3), 7
    ),
    keep_out=[
        Cylinder(name='mast', centre=(1.0, 2.0), radius=3.0, top=120.0),
        Polygon(name='field', corners=[(0, 0), (10, 0), (10, 10)], bottom=-5.0),
    ],
    gates=[Gate(name='first', centre=(1.0, 2.0, 3.0), heading=1.5, width=2.0, height=4.0)],
    marks=[Mark(name='village', place=(5.0, 6.0, 7.0), radius=8.0, kind='listener')],
)


def test_json_and_back() -> None:
    again = Surroundings.from_dict(json.loads(json.dumps(ALL.to_dict())))
    assert again.to_dict() == ALL.to_dict()
    assert repr(again) == repr(ALL)
    assert again.terrain is not None and again.terrain.clearance == 7
    assert Surroundings.from_dict({}) == Surroundings()


def test_yaml_has_the_same_keys_and_takes_degrees() -> None:
    gate = {'centre': [1, 2, 3], 'heading': '90 deg', 'width': 2, 'height': 4}
    found = read_surroundings({'gates': {'g': gate}}, 'here')
    assert found.gates[0].heading == pytest.approx(np.pi / 2)


def test_repr_tells_apart_terrains_that_differ_in_one_point() -> None:
    terrain = ALL.terrain
    assert terrain is not None
    other = terrain.height.copy()
    other[1, 2] += 1e-9
    assert repr(Terrain(terrain.x, terrain.y, other, 7)) != repr(terrain)


def test_only_listeners_listen() -> None:
    both = Surroundings(marks=[*ALL.marks, Mark(name='tower', place=(0, 0, 0))])
    assert [mark.name for mark in both.listeners] == ['village']


@pytest.mark.parametrize(
    ('document', 'told'),
    [
        ({'walls': {}}, "unknown 'walls'"),
        ({'keep_out': []}, 'keep_out: expected names'),
        ({'keep_out': {'a': {'centre': [0, 0]}}}, "keep_out.a: 'radius' is missing"),
        ({'keep_out': {'a': {'centre': [0], 'radius': 1}}}, r'expected \[x, y\]'),
        ({'keep_out': {'a': {'centre': [0, 0], 'radius': 0}}}, 'radius must be positive'),
        ({'keep_out': {'a': {'corners': [[0, 0], [1, 1]]}}}, 'three corners'),
        ({'keep_out': {'a': {'corners': [[0, 0], [1, 1], [1, 0], [0, 1]]}}}, 'cross or touch'),
        ({'keep_out': {'a': {'corners': [[0, 0], [1, 0], [0.5, 0], [0, 1]]}}}, 'cross or touch'),
        ({'keep_out': {'a': {'centre': [0, 0], 'radius': 1, 'bottom': 5, 'top': 5}}}, 'top 5 m'),
        ({'keep_out': {'a': {'centre': [0, 0], 'corners': []}}}, 'either corners or centre'),
        ({'gates': {'g': {'centre': [0, 0, 1]}}}, "gates.g: 'heading' is missing"),
        (
            {'gates': {'a b': {'centre': [0, 0, 1], 'heading': 0, 'width': 1, 'height': 1}}},
            "'a b'",
        ),
        ({'marks': {'m': {'place': [0, 0, 0], 'kind': 'ear'}}}, "got 'ear'"),
        ({'terrain': {}}, "'file' is missing"),
        ({'terrain': {'x': [0, 1], 'y': [0, 1], 'height': [[1, 2], [3]]}}, 'lists of numbers'),
        ({'terrain': {'x': [0, 1], 'y': [0, 1], 'height': [[1, 2, 3]]}}, r'shape \(1, 3\)'),
        (
            {'terrain': {'x': [0, 1], 'y': [0, 1], 'height': [[1, float('nan')], [1, 2]]}},
            r'height at \[0, 1\] is not a finite number',
        ),
        ({'terrain': {'file': 'nowhere.npz'}}, 'no such file'),
    ],
)
def test_what_is_wrong_is_told_with_its_place(document: Any, told: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=told) as error:
        read_surroundings(document, 'ridge.yaml', tmp_path)
    assert 'ridge.yaml' in str(error.value) or str(tmp_path) in str(error.value)


def test_two_things_of_one_name_are_refused() -> None:
    with pytest.raises(InputError, match="'mast'"):
        Surroundings(keep_out=ALL.keep_out, marks=[Mark(name='mast', place=(0, 0, 0))])
