"""GPX: tracks, segments, times; and what a hostile or broken file gets."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from flown_circle import CLIMB, SPEED, START_S, circle, flown_speed

from flightdyn.errors import LogError
from flightdyn.logs.any_log import describe, read_track
from flightdyn.logs.formats.gpx import iso_time_ns

HEAD = '<?xml version="1.0"?>\n<gpx version="1.1" creator="test" xmlns="{}">\n'
GPX_11 = 'http://www.topografix.com/GPX/1/1'


def point(second: float, lat: float, lon: float, ele: float, more: str = '') -> str:
    clock = np.datetime64(round((START_S + second) * 1000), 'ms')
    return (
        f'<trkpt lat="{lat:.7f}" lon="{lon:.7f}"><ele>{ele:.2f}</ele>'
        f'<time>{clock}Z</time>{more}</trkpt>\n'
    )


def gpx(path: Path, *tracks: Iterable[str], namespace: str = GPX_11, end: str = '</gpx>') -> Path:
    body = ''
    for segments in tracks:
        body += '<trk>' + ''.join(f'<trkseg>{text}</trkseg>\n' for text in segments) + '</trk>'
    path.write_text(HEAD.format(namespace) + body + end)
    return path


def points(first: int, last: int, more: str = '') -> str:
    return ''.join(point(i, 48 + 1e-4 * i, 9, 500 + i, more) for i in range(first, last))


@pytest.mark.parametrize('version', [GPX_11, GPX_11.replace('1/1', '1/0'), ''])
def test_a_circle_is_replayed_at_its_speed(tmp_path: Path, version: str) -> None:
    flown = circle(rate=4)
    rows = zip(flown.time - START_S, flown.lat, flown.lon, flown.altitude, strict=True)
    path = gpx(tmp_path / 'circle.gpx', [''.join(point(*row) for row in rows)], namespace=version)
    speed, climb = flown_speed(path)
    # Rounded to centimetres.
    assert speed == pytest.approx(SPEED, rel=0.002)
    assert climb == pytest.approx(CLIMB, abs=0.02)


def test_segments_stay_segments_however_close(tmp_path: Path) -> None:
    path = gpx(tmp_path / 'two.gpx', [points(0, 5), points(5, 12)])
    track = read_track(path)
    assert track.segment.tolist() == [0] * 5 + [1] * 7
    assert (track.source, track.altitude_datum) == ('trk1', 'unknown')
    assert any('does not say' in warning for warning in track.warnings)


def test_each_track_is_a_source_and_the_longest_comes_first(tmp_path: Path) -> None:
    path = gpx(tmp_path / 'tracks.gpx', [points(0, 5)], [points(50, 62)], [''])
    assert [(s.topic, s.messages, s.usable) for s in describe(path).sources] == [
        ('trk2', 12, True),
        ('trk1', 5, True),
        ('trk3', 0, False),
    ]
    assert len(read_track(path)) == 12
    assert len(read_track(path, 'trk1')) == 5


def test_geoid_height_says_that_elevations_are_above_sea_level(tmp_path: Path) -> None:
    more = '<geoidheight>47.5</geoidheight>'
    assert read_track(gpx(tmp_path / 'g.gpx', [points(0, 5, more)])).altitude_datum == 'msl'


def test_points_that_cannot_be_used_are_counted(tmp_path: Path) -> None:
    bad = [
        point(90, 48, 9, 5).replace('<time>', '<time>x'),
        point(91, 48, 9, 5).replace('time', 'tame'),
        point(92, 48, 9, 5).replace('lat="', 'lat="x'),
        point(93, 48, 9, 5, '<fix>none</fix>'),
        point(94, 48, 9, 5).replace('<ele>5.00</ele>', ''),
        point(95, 98, 9, 5),
    ]
    track = read_track(gpx(tmp_path / 'bad.gpx', [points(0, 5) + ''.join(bad)]))
    assert track.dropped == {
        'with a time that is none': 1,
        'without time': 1,
        'without numbers for lat, lon, ele': 1,
        'no fix': 1,
        'no altitude': 1,
        'position out of range': 1,
    }
    assert any('first: line 8' in warning for warning in track.warnings)


def test_extensions_with_the_same_names_are_not_taken_for_points(tmp_path: Path) -> None:
    more = '<extensions><x:ele xmlns:x="urn:x">9</x:ele><ele>8</ele></extensions>'
    track = read_track(gpx(tmp_path / 'ext.gpx', [points(0, 3, more)]))
    assert track.altitude.tolist() == [500, 501, 502]


def test_a_file_that_just_ends_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    path = gpx(tmp_path / 'cut.gpx', [points(0, 20)])
    path.write_bytes(path.read_bytes()[:1000])
    track = read_track(path)
    assert 5 < len(track) < 15
    assert any('cut short' in warning for warning in track.warnings)


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('<!DOCTYPE gpx [<!ENTITY a "aaaa">]><gpx>&a;</gpx>', 'document type'),
        ('<!DOCTYPE gpx SYSTEM "file:///etc/passwd"><gpx/>', 'document type'),
        ('<gpx>' + '<a>' * 100, 'nested deeper'),
        ('<gpx><trk></gpx>', 'line 1: not well-formed'),
        ('<gpx><wpt lat="1" lon="2"/></gpx>', 'no points'),
        ('<gpx xmlns="urn:other"/>', 'not a GPX 1.0 or 1.1'),
        ('<kml><gpx/></kml>', 'not a GPX 1.0 or 1.1'),
        (f'<gpx><trk><trkseg><trkpt><ele>{"1" * 5000}', 'longer than 256'),
        ('<?xml version="1.0"?>', 'no element gpx'),
    ],
)
def test_what_is_no_gpx_is_refused_in_one_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / 'bad.gpx'
    path.write_text(text)
    with pytest.raises(LogError, match=message) as caught:
        read_track(path)
    assert len(str(caught.value).splitlines()) == 1


@pytest.mark.parametrize(
    ('text', 'ns'),
    [
        ('2024-08-01T11:00:00Z', START_S * 10**9),
        ('2024-08-01T13:00:00.25+02:00', START_S * 10**9 + 250_000_000),
        ('2024-08-01 11:00:00.123456789', START_S * 10**9 + 123_456_789),
        ('2024-13-01T11:00:00Z', None),
        ('1722510000', None),
    ],
)
def test_iso_times(text: str, ns: int | None) -> None:
    assert iso_time_ns(text) == ns
