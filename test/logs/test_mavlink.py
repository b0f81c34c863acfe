"""MAVLink in MCAP: frames of both versions, JSON of mavlink-server, several systems, damage."""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from log_making import START_NS, Message
from numpy.testing import assert_allclose
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from flightdyn import frames
from flightdyn.errors import LogError
from flightdyn.logs import list_sources, read_track
from flightdyn.logs.mavlink import ATTITUDE, FIX_TYPES, MESSAGES, checksum
from flightdyn.logs.mavlink_topics import MAX_SENDERS

Write = Callable[..., Path]

FRAME = 'mavros_msgs/msg/Mavlink'
TEXT = """
std_msgs/Header header
uint8 framing_status
uint8 magic
uint8 len
uint8 incompat_flags
uint8 compat_flags
uint8 seq
uint8 sysid
uint8 compid
uint32 msgid
uint16 checksum
uint64[] payload64
uint8[] signature
"""
OLD_TEXT = """
std_msgs/Header header
uint8 len
uint8 seq
uint8 sysid
uint8 compid
uint8 msgid
uint64[] payload64
"""
HEADER = """
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
"""
RAW, LOCAL, GLOBAL = 24, 32, 33
KNOWN = MESSAGES | {ATTITUDE.number: ATTITUDE}
TOPIC = '/uas1/mavlink_source'


def store(text: str = TEXT) -> Any:
    made = get_typestore(Stores.ROS2_KILTED)
    made.register(get_types_from_msg(text, FRAME))
    return made


STORE, OLD_STORE = store(), store(OLD_TEXT)


def global_position(i: int, lat: float = 48.0) -> bytes:
    """1 m/s east, -2 north and 3 down, 10 m north of `lat` each second."""
    place = (round((lat + 1e-4 * i) * 1e7), 90000000 + i, 500_000 - 3000 * i, 20_000)
    return struct.pack('<Iiiii3hH', 5000 + 1000 * i, *place, 100, -200, 300, 9000)


def raw_position(i: int, fix: int = 3) -> bytes:
    numbers = (10**6 * (5 + i), 480000000 + 1000 * i, 90000000, 500_000, 120, 150, 10, 0, fix, 9)
    return struct.pack('<QiiiHHHHBB', *numbers)


def frame(
    i: float,
    number: int,
    payload: bytes,
    *,
    system: int = 1,
    component: int = 1,
    version: int = 1,
    signed: bool = False,
    **changes: Any,
) -> bytes:
    seed = KNOWN[number].seed if number in KNOWN else 50  # HEARTBEAT
    seq = int(i) % 256
    ids = bytes([seq, system, component])
    if version == 2:
        payload = payload.rstrip(b'\0') or b'\0'
        checked = bytes([len(payload), int(signed), 0]) + ids + number.to_bytes(3, 'little')
    else:
        checked = bytes([len(payload)]) + ids + bytes([number])
    words = np.frombuffer(payload + bytes(-len(payload) % 8), '<u8')
    types = STORE.types
    ns = START_NS + round(i * 1e9)
    time = types['builtin_interfaces/msg/Time'](ns // 10**9, ns % 10**9)
    values = {
        'header': types['std_msgs/msg/Header'](time, f'{system}.{component}'),
        'framing_status': 1,
        'magic': 0xFD if version == 2 else 0xFE,
        'len': len(payload),
        'incompat_flags': int(signed),
        'compat_flags': 0,
        'seq': seq,
        'sysid': system,
        'compid': component,
        'msgid': number,
        'checksum': checksum(checked + payload + bytes([seed])),
        'payload64': words,
        'signature': np.arange(13 if signed else 0, dtype=np.uint8),
        **changes,
    }
    return bytes(STORE.serialize_cdr(types[FRAME](**values), FRAME))


def stream(number: int = 20, **options: Any) -> list[Message]:
    return [
        (TOPIC, START_NS + i * 10**9, frame(i, GLOBAL, global_position(i), **options))
        for i in range(number)
    ]


@pytest.fixture
def write_frames(write_log: Write) -> Write:
    def write(
        messages: list[Message], topics: tuple[str, ...] = (TOPIC,), text: str = TEXT
    ) -> Path:
        return write_log(
            messages, dict.fromkeys(topics, FRAME), texts={FRAME: (text + HEADER).encode()}
        )

    return write


@pytest.mark.parametrize('version', [1, 2])
@pytest.mark.parametrize('signed', [False, True])
def test_frames_of_both_versions(write_frames: Write, version: int, signed: bool) -> None:
    track = read_track(write_frames(stream(version=version, signed=signed)))
    assert track.source == f'{TOPIC}/1/1/GLOBAL_POSITION_INT'
    assert (track.schema, track.altitude_datum, len(track)) == (FRAME, 'msl', 20)
    assert_allclose(track.lat, 48 + 1e-4 * np.arange(20), rtol=0, atol=1e-9)
    assert_allclose(track.altitude, 500 - 3.0 * np.arange(20))
    assert_allclose(np.diff(track.time_ns), 1e9)
    assert abs(track.time_ns[0] - START_NS) < 1000


def test_a_payload_without_its_trailing_zeros_is_filled_up(write_frames: Write) -> None:
    def still(i: int) -> bytes:  # v2 leaves out the velocity and what follows
        return struct.pack('<Iiiii3hH', 5000 + 1000 * i, 480000000 + i, 9, 5, *(0,) * 5)

    messages = [
        (TOPIC, START_NS + i * 10**9, frame(i, GLOBAL, still(i), version=2)) for i in range(9)
    ]
    track = read_track(write_frames(messages))
    assert_allclose(track.lat, 48 + 1e-7 * np.arange(9), rtol=0, atol=1e-12)
    assert_allclose(track.altitude, 0.005)


def test_damaged_frames_are_dropped_by_reason(write_frames: Write) -> None:
    messages = stream(20)
    good = global_position(3)

    def put(i: int, **changes: Any) -> None:
        messages[i] = (TOPIC, START_NS + i * 10**9, frame(i, GLOBAL, good, **changes))

    put(3, checksum=1)
    put(4, payload64=np.zeros(4, np.uint64))  # another payload than was checked
    put(5, framing_status=2)
    put(6, framing_status=3, version=2, signed=True)
    put(7, payload64=np.zeros(2, np.uint64))
    track = read_track(write_frames(messages))
    assert track.dropped == {
        'refused by the receiver': 2,
        'payload cut short': 1,
        'wrong checksum': 2,
    }
    assert (track.messages, len(track)) == (20, 15)


def test_systems_are_kept_apart_and_ground_stations_come_last(write_frames: Write) -> None:
    messages = []
    for i in range(20):
        for system, component, lat in (
            (255, 190, 10.0),
            (2, 1, 20.0),
            (7, 25, 30.0),
            (3, 1, 40.0),
        ):
            if system == 3 and i % 2:
                continue
            data = frame(i, GLOBAL, global_position(i, lat), system=system, component=component)
            messages.append((TOPIC, START_NS + i * 10**9, data))
        messages.append((TOPIC, START_NS + i * 10**9, frame(i, 0, bytes(9), system=51)))
    path = write_frames(messages)
    sources = list_sources(path)
    assert [(s.topic.removeprefix(TOPIC), s.kind, s.messages) for s in sources] == [
        ('/2/1/GLOBAL_POSITION_INT', 'global', 20),
        ('/3/1/GLOBAL_POSITION_INT', 'global', 10),
        ('/7/25/GLOBAL_POSITION_INT', 'global', 20),
        ('/255/190/GLOBAL_POSITION_INT', 'global', 20),
        ('', '', 90),
    ]
    assert 'source of its own' in sources[-1].note
    track = read_track(path)
    assert_allclose(track.lat[0], 20.0)
    assert 'was taken of 4 usable sources' in track.warnings[0]
    chosen = read_track(path, f'{TOPIC}/255/190/GLOBAL_POSITION_INT')
    assert_allclose(chosen.lat[0], 10.0)
    assert read_track(path, TOPIC).source == f'{TOPIC}/2/1/GLOBAL_POSITION_INT'


def test_the_estimator_comes_before_the_receiver_without_vertical_speed(
    write_frames: Write,
) -> None:
    messages = stream(20)
    for i in range(20):
        data = frame(i, RAW, raw_position(i, fix=1 if i < 5 else 3))
        messages.append((TOPIC, START_NS + i * 10**9, data))
    path = write_frames(messages)
    assert read_track(path).velocity_ned is None  # 2 m/s southwards contradict its positions
    raw = read_track(path, f'{TOPIC}/1/1/GPS_RAW_INT')
    assert (raw.dropped, raw.velocity_ned, raw.altitude_datum) == ({'no 3D fix': 5}, None, 'msl')
    assert list_sources(path)[0].kind == 'global'


def test_local_positions_where_there_is_no_gps(write_frames: Write) -> None:
    messages = [
        (
            TOPIC,
            START_NS + i * 10**9,
            frame(i, LOCAL, struct.pack('<I6f', 1000 * i, i, 2 * i, -3 * i, 1, 2, -3)),
        )
        for i in range(20)
    ]
    track = read_track(write_frames(messages))
    i = np.arange(20.0)
    assert_allclose(track.position_ned, np.stack([i, 2 * i, -3 * i], axis=1))
    assert_allclose(track.velocity_ned, np.tile([1, 2, -3], (20, 1)))
    assert track.altitude_datum == 'local'


def test_frames_without_a_checksum_of_old_mavros(write_frames: Write) -> None:
    types = OLD_STORE.types
    messages = []
    for i in range(9):
        payload = global_position(i)
        time = types['builtin_interfaces/msg/Time'](i, 0)
        message = types[FRAME](
            header=types['std_msgs/msg/Header'](time, ''),
            len=len(payload),
            seq=i,
            sysid=1,
            compid=1,
            msgid=GLOBAL,
            payload64=np.frombuffer(payload + bytes(-len(payload) % 8), '<u8'),
        )
        data = bytes(OLD_STORE.serialize_cdr(message, FRAME))
        messages.append((TOPIC, START_NS + i * 10**9, data))
    track = read_track(write_frames(messages, text=OLD_TEXT))
    assert_allclose(track.lat, 48 + 1e-4 * np.arange(9), rtol=0, atol=1e-9)


TURN = 0.02  # rad/s; in 100 s the nose does not get behind


def attitude(t: float) -> tuple[float, ...]:
    """Roll, pitch, yaw and their rates."""
    return 0.4, -0.1, (TURN * t + np.pi) % (2 * np.pi) - np.pi, 0.0, 0.0, TURN


def assert_turn(track: Any, seconds: Any) -> None:
    r_eb = frames.rotation_from_quaternion(tuple(track.attitude.T))
    phi, theta, psi = frames.euler_from_rotation(r_eb)
    # single precision; interpolation over 0.2 s is right to (TURN 0.2)^2 / 8 rad
    assert_allclose(phi, 0.4, atol=1e-4)
    assert_allclose(theta, -0.1, atol=1e-4)
    difference = (psi - TURN * seconds + np.pi) % (2 * np.pi) - np.pi
    assert_allclose(difference, 0, atol=1e-4)


def test_the_attitude_of_the_same_sender_is_taken(write_frames: Write) -> None:
    rng = np.random.default_rng(1)
    messages = []
    for k in range(-2, 500):
        t = 0.2 * k
        late = round(rng.exponential(0.2) * 1e9)  # arrival says little of the time
        angles = struct.pack('<I6f', round(1000 * t) + 5000, *attitude(t))
        data = frame(t, ATTITUDE.number, angles)
        messages.append((TOPIC, START_NS + round(t * 1e9) + late, data))
        other = struct.pack('<I6f', round(1000 * t) + 5000, 1.0, *attitude(-t)[1:])
        messages.append((TOPIC, START_NS + round(t * 1e9), frame(t, 30, other, system=2)))
        if k >= 0 and k % 5 == 0:
            data = frame(t, GLOBAL, global_position(k // 5))
            messages.append((TOPIC, START_NS + round(t * 1e9) + late, data))
    track = read_track(write_frames(sorted(messages, key=lambda message: message[1])))
    assert track.warnings[-1] == 'attitude is that of system 1 in ATTITUDE'
    assert_turn(track, np.arange(100.0))


def test_frames_without_a_position_say_so(write_frames: Write) -> None:
    path = write_frames([(TOPIC, START_NS + i, frame(i, 0, bytes(9))) for i in range(5)])
    (source,) = list_sources(path)
    assert (source.usable, source.note) == (False, 'MAVLink without a message of position')
    with pytest.raises(LogError, match='no usable position source'):
        read_track(path)


def test_noise_is_no_multitude_of_senders(write_frames: Write) -> None:
    messages = stream(20)
    for i in range(100):
        data = frame(i, GLOBAL, global_position(i), system=2 + i)
        messages.append((TOPIC, START_NS + i * 10**9, data))
    usable = [s for s in list_sources(write_frames(messages)) if s.usable]
    assert len(usable) == MAX_SENDERS
    assert usable[0].topic == f'{TOPIC}/1/1/GLOBAL_POSITION_INT'


def test_the_messages_are_those_of_pymavlink() -> None:
    dialect = pytest.importorskip('pymavlink.dialects.v20.ardupilotmega')
    for number, message in KNOWN.items():
        theirs = dialect.mavlink_map[number]
        assert (theirs.msgname, theirs.crc_extra) == (message.name, message.seed)
        assert message.fields == tuple(theirs.ordered_fieldnames[: len(message.fields)])
        letters = theirs.unpacker.format[1 : len(message.fields) + 1]
        assert message.layout == np.dtype(
            [(name, f'<{letter}') for name, letter in zip(message.fields, letters, strict=True)]
        )
    names = {entry.name: value for value, entry in dialect.enums['GPS_FIX_TYPE'].items()}
    assert FIX_TYPES.items() <= names.items()


def document(i: int, name: str, system: int = 1, **fields: Any) -> bytes:
    head = {'system_id': system, 'component_id': 1, 'sequence': i % 256, 'message_id': 0}
    return json.dumps({'header': head, 'message': {'type': name, **fields}}).encode()


def global_document(i: int, system: int = 1, **changes: Any) -> bytes:
    values = struct.unpack('<Iiiii3hH', global_position(i, 40 + 0.1 * system))
    names = ('time_boot_ms', 'lat', 'lon', 'alt', 'relative_alt', 'vx', 'vy', 'vz', 'hdg')
    fields = dict(zip(names, values, strict=True)) | changes
    return document(i, 'GLOBAL_POSITION_INT', system, **fields)


@pytest.fixture
def write_json(write_log: Write) -> Write:
    def write(messages: list[Message], schema: bytes = b'{}') -> Path:
        names = {topic: topic.replace('/', '.') for topic, _, _ in messages}
        return write_log(
            messages,
            names,
            texts=dict.fromkeys(names.values(), schema),
            encoding='json',
            schema_encoding='jsonschema',
        )

    return write


SCHEMA = b'{"type":"object","properties":{"header":{"type":"object"},"message":{"type":"object"}}}'


@pytest.mark.parametrize('schema', [b'{}', b'', SCHEMA])
def test_json_of_a_message_each_and_of_all_together(write_json: Write, schema: bytes) -> None:
    each, out = 'mavlink/1/1/GLOBAL_POSITION_INT', 'mavlink/out'
    messages: list[Message] = []
    for i in range(20):
        ns = START_NS + i * 10**9
        messages.append((each, ns, global_document(i)))
        for system in (1, 255):
            messages.append((out, ns, global_document(i, system)))
            messages.append((out, ns, document(i, 'HEARTBEAT', system, custom_mode=4)))
    path = write_json(messages, schema)
    assert [s.topic for s in list_sources(path)] == [
        each,
        f'{out}/1/1/GLOBAL_POSITION_INT',
        f'{out}/255/1/GLOBAL_POSITION_INT',
        out,
    ]
    track = read_track(path)
    assert (track.source, track.schema) == (each, each.replace('/', '.'))
    assert_allclose(track.lat, 40.1 + 1e-4 * np.arange(20), rtol=0, atol=1e-9)
    assert read_track(path, out).source == f'{out}/1/1/GLOBAL_POSITION_INT'
    assert_allclose(read_track(path, f'{out}/255/1/GLOBAL_POSITION_INT').lat[0], 65.5)


def test_what_is_not_as_defined_is_counted(write_json: Write) -> None:
    topic = 'mavlink/1/1/GLOBAL_POSITION_INT'
    bad = {
        3: b'{"header": GLOBAL_POSITION_INT',
        4: global_document(4, lat='north'),
        5: global_document(5).replace(b'"lon"', b'"lo"'),
        6: global_document(6, lat=None),
        7: global_document(7, time_boot_ms=float('nan')),
    }
    messages = [(topic, START_NS + i * 10**9, bad.get(i, global_document(i))) for i in range(20)]
    path = write_json(messages, SCHEMA)
    (source,) = [s for s in list_sources(path) if s.usable]
    track = read_track(path, source.topic)
    assert track.dropped == {'not as the message is defined': 4, 'position not finite': 1}
    assert len(track) == 15


@pytest.mark.parametrize('told', [{'type': 'GPS_FIX_TYPE_2D_FIX'}, 2])
def test_fix_type_by_name_and_by_number(write_json: Write, told: Any) -> None:
    names = ('time_usec', 'lat', 'lon', 'alt', 'eph', 'epv', 'vel', 'cog', 'fix_type')
    messages = []
    for i in range(9):
        values = struct.unpack('<QiiiHHHHBB', raw_position(i))
        fields = dict(zip((*names, 'satellites_visible'), values, strict=True))
        fields['fix_type'] = {'type': 'GPS_FIX_TYPE_RTK_FIXED'} if i else told
        data = document(i, 'GPS_RAW_INT', **fields, alt_ellipsoid=548_000, h_acc=1500, v_acc=2500)
        messages.append(('mavlink/1/1/GPS_RAW_INT', START_NS + i * 10**9, data))
    track = read_track(write_json(messages))
    assert track.dropped == {'no 3D fix': 1}
    assert (track.altitude_datum, track.altitude[0]) == ('ellipsoid', 548)
    assert_allclose(track.position_std[0], [1.5, 1.5, 2.5])


def test_the_attitude_in_a_topic_of_its_own_is_taken(write_json: Write) -> None:
    messages = []
    names = ('roll', 'pitch', 'yaw', 'rollspeed', 'pitchspeed', 'yawspeed')
    for k in range(-1, 100):
        ns = START_NS + k * 200_000_000
        fields = dict(zip(names, attitude(0.2 * k), strict=True))
        data = document(k, 'ATTITUDE', time_boot_ms=5000 + 200 * k, **fields)
        messages.append(('mavlink/1/1/ATTITUDE', ns, data))
        messages.append(('mavlink/out', ns, data))
        if k >= 0 and k % 5 == 0:
            messages.append(('mavlink/1/1/GLOBAL_POSITION_INT', ns, global_document(k // 5)))
    track = read_track(write_json(messages, SCHEMA))
    assert track.warnings[-1] == 'attitude is that of system 1 in ATTITUDE'
    assert_turn(track, np.arange(20.0))


def test_json5_is_read_as_json(write_json: Write) -> None:
    topic = 'mavlink/1/1/GLOBAL_POSITION_INT'
    messages = [(topic, START_NS + i * 10**9, global_document(i)) for i in range(9)]
    # NaN where the autopilot knows nothing, no quotes round names, a comma too many
    text = messages[4][2].replace(b'"hdg": 9000', b'hdg: NaN,').replace(b'"vx"', b'vx')
    messages[4] = (topic, messages[4][1], text)
    assert b'hdg: NaN,' in text
    track = read_track(write_json(messages))
    assert (len(track), track.dropped) == (9, {})
    assert_allclose(track.lat, 40.1 + 1e-4 * np.arange(9), rtol=0, atol=1e-9)


def test_json_without_mavlink_is_no_source(write_json: Write) -> None:
    said = b'{"says": "GPS_RAW_INT"}', document(1, 'ATTITUDE', by='GPS_RAW_INT'), b'"GPS_RAW_INT"'
    path = write_json([('chat', START_NS + i, message) for i, message in enumerate(said)])
    (source,) = list_sources(path)
    assert (source.usable, source.note) == (False, 'not a position')


def test_a_damaged_chunk_does_not_hide_what_else_there_is(write_frames: Write) -> None:
    path = write_frames(stream(40))
    data = bytearray(path.read_bytes())
    data[len(data) // 3] ^= 0xFF
    path.write_bytes(data)
    (source,) = list_sources(path)
    assert (source.topic, source.usable) == (TOPIC, False)
    assert 'byte' in source.note


def test_frames_of_ros_1(write_log: Write) -> None:
    old = get_typestore(Stores.ROS1_NOETIC)
    old.register(get_types_from_msg(TEXT, FRAME))
    text = old.generate_msgdef(FRAME, ros_version=1)[0].encode()
    messages = []
    for topic, ns, data in stream(20, version=2):
        message = STORE.deserialize_cdr(data, FRAME)
        values = {name: getattr(message, name) for name, _ in STORE.fielddefs[FRAME][1]}
        time = old.types['builtin_interfaces/msg/Time'](ns // 10**9, ns % 10**9)
        values['header'] = old.types['std_msgs/msg/Header'](7, time, '1.1')
        made = old.types[FRAME](**values)
        messages.append((topic, ns, bytes(old.serialize_ros1(made, FRAME))))
    name = 'mavros_msgs/Mavlink'
    path = write_log(
        messages, {TOPIC: name}, texts={name: text}, encoding='ros1', schema_encoding='ros1msg'
    )
    track = read_track(path)
    assert (track.source, track.dropped) == (f'{TOPIC}/1/1/GLOBAL_POSITION_INT', {})
    assert_allclose(track.lat, 48 + 1e-4 * np.arange(20), rtol=0, atol=1e-9)
