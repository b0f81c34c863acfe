"""Messages of ROS in JSON with a JSON schema, as bridges write them."""

import contextlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from log_making import START_NS, fixes
from numpy.testing import assert_allclose, assert_array_equal

from flightdyn.errors import LogError
from flightdyn.logs import list_sources, read_track
from flightdyn.logs.json_columns import JsonDecoder, field_names
from flightdyn.logs.mcap_container import Schema

Write = Callable[..., Path]
FIX, TWIST = 'sensor_msgs/msg/NavSatFix', 'geometry_msgs/msg/TwistStamped'


def schema_of(value: Any) -> dict[str, Any]:
    """As recorders infer it from a message."""
    if isinstance(value, dict):
        return {'type': 'object', 'properties': {k: schema_of(v) for k, v in value.items()}}
    if isinstance(value, list):
        return {'type': 'array', 'items': {'type': 'number'}}
    return {'type': 'string' if isinstance(value, str) else 'number'}


def header(i: int, sec: str, nanosec: str) -> dict[str, Any]:
    return {'stamp': {sec: START_NS // 10**9 + i, nanosec: 250}, 'frame_id': 'gps'}


def fix(i: int, sec: str = 'sec', nanosec: str = 'nanosec', **changes: Any) -> dict[str, Any]:
    return {
        'header': header(i, sec, nanosec),
        'status': {'status': 0, 'service': 1},
        'latitude': 48 + 1e-4 * i,
        'longitude': 9 + 2e-4 * i,
        'altitude': 500 + 3 * i,
        'position_covariance': [4, 0, 0, 0, 9, 0, 0, 0, 25],
        'position_covariance_type': 2,
        **changes,
    }


def written(write_log: Write, messages: list[Any], **options: Any) -> Path:
    text = json.dumps(schema_of(fix(0, **options))).encode()
    return write_log(
        [
            ('/fix', START_NS + i * 10**9, m if isinstance(m, bytes) else json.dumps(m).encode())
            for i, m in enumerate(messages)
        ],
        texts={FIX: text},
        encoding='json',
        schema_encoding='jsonschema',
    )


@pytest.mark.parametrize('names', [('sec', 'nanosec'), ('secs', 'nsecs'), ('sec', 'nsec')])
def test_a_fix_in_json_is_that_in_cdr(write_log: Write, names: tuple[str, str]) -> None:
    options = dict(zip(('sec', 'nanosec'), names, strict=True))
    track = read_track(written(write_log, [fix(i, **options) for i in range(9)], **options))
    plain = read_track(write_log(fixes(9), name='cdr.mcap'))
    assert_array_equal(track.time_ns, plain.time_ns + 250)
    for name in ('lat', 'lon', 'altitude'):
        assert_array_equal(getattr(track, name), getattr(plain, name))
    assert_allclose(track.position_std, np.tile([3, 2, 5], (9, 1)))


def test_what_is_not_as_described_is_counted(write_log: Write) -> None:
    messages: list[Any] = [fix(i) for i in range(12)]
    messages[2] = b'{"latitude": 4'
    messages[3] = {'latitude': 48}
    messages[4] = fix(4, position_covariance=[1, 2])
    messages[5] = fix(5, latitude='north')
    messages[6] = fix(6, latitude=None)
    messages[7] = fix(7, status={'status': -1})
    messages[8] = fix(8, altitude=float('nan'))
    track = read_track(written(write_log, messages))
    assert track.dropped == {
        'not as its schema says': 4,
        'position not finite': 1,
        'no fix': 1,
        'no altitude': 1,
    }
    assert len(track) == 5


@pytest.mark.parametrize(
    ('schema', 'says'),
    [(b'{}', 'has no field'), (b'[]', 'no JSON schema'), (b'{', 'no JSON schema')],
)
def test_a_schema_that_does_not_tell_is_named(write_log: Write, schema: bytes, says: str) -> None:
    path = write_log(
        [('/fix', START_NS, b'{}')],
        texts={FIX: schema},
        encoding='json',
        schema_encoding='jsonschema',
    )
    (source,) = list_sources(path)
    assert (source.usable, source.kind) == (False, 'fix')
    assert says in source.note


def test_names_of_fields() -> None:
    text = json.dumps(schema_of(fix(0, 'secs', 'nsecs'))).encode()
    known = field_names(Schema(1, FIX, 'jsonschema', text))
    assert {'header.stamp.sec', 'header.stamp.nanosec', 'status.status', 'latitude'} <= known
    with pytest.raises(LogError, match='has no field speed; it has altitude'):
        JsonDecoder(Schema(1, FIX, 'jsonschema', text), ['speed'])


@given(
    st.recursive(
        st.none() | st.integers() | st.text(max_size=3),
        lambda inner: (
            st.lists(inner) | st.dictionaries(st.sampled_from(['properties', 'a']), inner)
        ),
    )
)
def test_any_schema_has_names_or_is_refused(value: Any) -> None:
    schema = Schema(1, 'any', 'jsonschema', json.dumps(value).encode())
    with contextlib.suppress(LogError):
        assert all(isinstance(name, str) for name in field_names(schema))
