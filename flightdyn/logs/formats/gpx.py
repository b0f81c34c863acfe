"""GPX 1.0 and 1.1: every `trk` is a source, every `trkseg` a segment.

The file is parsed as it is read, without document type, entities or network.

References
----------
.. [1] GPX 1.1 schema, https://www.topografix.com/GPX/1/1/
"""

import re
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from xml.parsers import expat

from ...errors import LogError
from ..sources import Source
from ..track import Datum
from .reading import FixTable, OpenedLog, Reading, check_size, tracks_of

NAME = 'GPX'

_NAMESPACES = ('http://www.topografix.com/GPX/1/0', 'http://www.topografix.com/GPX/1/1', '')
_READ = ('ele', 'time', 'fix', 'geoidheight')
_MAX_DEPTH = 32
_MAX_TEXT = 256  # characters of a value
_MAX_TRACKS = 1000
_BLOCK = 1 << 16
_FIXES = ('2d', 'none')
_TIME = re.compile(
    r'(\d{4}-\d\d-\d\d)[Tt ](\d\d:\d\d:\d\d)(?:[.,](\d{1,9})\d*)?(Z|z|[+-]\d\d:?\d\d)?'
)


def recognises(head: bytes, path: Path) -> bool:
    """Return whether a file that begins like this is a GPX file."""
    if re.search(rb'<(\w+:)?gpx[\s>]', head):
        return True
    return path.suffix.lower() == '.gpx' and head.lstrip(b'\xef\xbb\xbf \r\n\t').startswith(b'<')


def open_log(path: Path) -> OpenedLog:
    """Read a GPX file.

    Raises
    ------
    LogError
        If it is no well-formed XML, has a document type, or has no points of a track. A file that
        just ends is read as far as it goes, with a warning.
    """
    check_size(path)
    points = _Points()
    parser = expat.ParserCreate(namespace_separator=' ')
    parser.buffer_text = True
    parser.StartElementHandler = points.begin
    parser.EndElementHandler = points.end
    parser.CharacterDataHandler = points.text
    parser.StartDoctypeDeclHandler = _no_document_type
    points.line = lambda: parser.CurrentLineNumber
    with path.open('rb') as stream:
        try:
            while block := stream.read(_BLOCK):
                parser.Parse(block, False)
            try:
                parser.Parse(b'', True)
            except expat.ExpatError as error:
                points.warnings.append(
                    f'line {error.lineno}: the file is cut short: read up to there'
                )
        except expat.ExpatError as error:
            reason = expat.ErrorString(error.code)
            raise LogError(f'{path}: line {error.lineno}: not well-formed: {reason}') from None
        except ValueError as error:
            raise LogError(f'{path}: line {parser.CurrentLineNumber}: {error}') from None
    if not points.root:
        raise LogError(f'{path}: not a GPX file: it has no element gpx')
    if not any(len(table) for table in points.tables):
        raise LogError(f'{path}: no points of a track (trkpt) in this GPX file')
    return _opened(path, points)


def _opened(path: Path, points: '_Points') -> OpenedLog:
    datum: Datum = 'msl' if points.geoid_height else 'unknown'
    notes = []
    if datum == 'unknown':
        notes.append('GPX does not say what elevations are above; most devices mean sea level')
    readings: dict[str, Reading] = {}
    sources = []
    for number, table in enumerate(points.tables, 1):
        name = f'trk{number}'
        readings[name] = table.reading(datum, notes)
        there = len(table) > 0
        note = '' if there else 'has no points'
        sources.append(Source(name, 'GPX trk', 'gpx', 'fix', len(table), usable=there, note=note))
    return OpenedLog(
        path=path,
        format=NAME,
        sources=sources,
        track=tracks_of(path, lambda source: readings[source.topic], points.warnings),
        library=points.creator,
        warnings=points.warnings,
    )


def _no_document_type(*_: object) -> None:
    raise ValueError('a document type is not accepted in a GPX file')


class _Points:
    """Takes elements and text as the parser meets them."""

    def __init__(self) -> None:
        self.tables: list[FixTable] = []
        self.warnings: list[str] = []
        self.creator = ''
        self.root = self.geoid_height = False
        self.line: Callable[[], int] = int
        self._open: list[str] = []
        self._piece = 0
        self._place: dict[str, str] = {}
        self._values: dict[str, str] = {}
        self._number = 0

    def begin(self, name: str, attributes: dict[str, str]) -> None:
        space, _, local = name.rpartition(' ')
        if len(self._open) >= _MAX_DEPTH:
            raise ValueError(f'elements are nested deeper than {_MAX_DEPTH}')
        if not self._open:
            if local != 'gpx' or space not in _NAMESPACES:
                raise ValueError(f'not a GPX 1.0 or 1.1 file: it begins with {name[:80]!r}')
            self.root = True
            self.creator = attributes.get('creator', '')[:_MAX_TEXT]
        # Extensions may use the same names for something else.
        local = local if space in _NAMESPACES else f' {local}'
        self._open.append(local)
        if self._open[1:] == ['trk']:
            if len(self.tables) == _MAX_TRACKS:
                raise ValueError(f'more than {_MAX_TRACKS} tracks')
            self.tables.append(FixTable())
        elif self._open[1:] == ['trk', 'trkseg']:
            self._piece += 1
        elif self._open[1:] == ['trk', 'trkseg', 'trkpt']:
            self._place, self._values, self._number = attributes, {}, self.line()

    def text(self, text: str) -> None:
        if len(self._open) == 5 and self._open[3] == 'trkpt' and self._open[4] in _READ:
            value = self._values.get(self._open[4], '') + text
            if len(value) > _MAX_TEXT:
                raise ValueError(f'{self._open[4]} is longer than {_MAX_TEXT} characters')
            self._values[self._open[4]] = value

    def end(self, name: str) -> None:
        if self._open[1:] == ['trk', 'trkseg', 'trkpt']:
            self._point()
        self._open.pop()

    def _point(self) -> None:
        table, where = self.tables[-1], f'line {self._number}'
        values = {name: value.strip() for name, value in self._values.items()}
        self.geoid_height |= 'geoidheight' in values
        try:
            lat, lon = float(self._place['lat']), float(self._place['lon'])
            altitude = float(values['ele']) if values.get('ele') else float('nan')
        except (KeyError, ValueError):
            return table.reject('without numbers for lat, lon, ele', where)
        if not values.get('time'):
            return table.reject('without time', where)
        time_ns = iso_time_ns(values['time'])
        if time_ns is None:
            return table.reject('with a time that is none', where)
        fix = values.get('fix', '') not in _FIXES
        table.add(time_ns, lat, lon, altitude, fix=fix, piece=self._piece)


def iso_time_ns(text: str) -> int | None:
    """Return the Unix time [ns] of an ISO 8601 date and time, None if it is none.

    Without a zone it is taken as UTC.
    """
    match = _TIME.fullmatch(text)
    if match is None:
        return None
    zone = (match[4] or 'Z').upper().replace('Z', '+00:00')
    try:
        moment = datetime.fromisoformat(f'{match[1]}T{match[2]}{zone}')
        seconds = round(moment.astimezone(UTC).timestamp())
    except (ValueError, OverflowError):
        return None
    return seconds * 10**9 + int((match[3] or '0').ljust(9, '0'))
