"""CSV tables of GPS loggers on phones and the like: one header line, one position a line.

Columns are told by their names, of which case, spaces, `_`, `-`, brackets and units do not count:

========== ======================================================================================
column     names
========== ======================================================================================
time       time, timestamp, datetime, utc, gpstime, utctime, datetimeutc, timeutc, time(s), ...;
           or `date` and `time` apart
lat, lon   lat, latitude; lon, long, lng, longitude: degrees
altitude   alt, altitude, ele, elevation, height; with msl or ellipsoid/hae/wgs84 for the datum
velocity   vn, ve, vd (north, east, down) or speed, bearing (course, heading, track) and climb
           (vspeed, verticalspeed): m/s; speeds named kmh, km/h, knots, kt, mph are converted
accuracy   accuracy, horizontalaccuracy, hacc with verticalaccuracy, vacc: m, 68 % of all fixes
========== ======================================================================================

Times are ISO 8601 (UTC if no zone is given) or seconds, milliseconds, microseconds or nanoseconds
since 1970: the size of the first one tells which.
"""

import csv
import math
import re
from collections.abc import Callable
from pathlib import Path

from ...errors import LogError
from ..sources import Source
from ..track import Datum
from .gpx import iso_time_ns
from .reading import FixTable, OpenedLog, text_lines, tracks_of

NAME = 'CSV'

SOURCE = 'positions'

_TIMES = 'time timestamp datetime utc utctime gpstime timeutc datetimeutc unixtime epoch'.split()
_TIMES += ['epochtime', 'loggingtime', 'locationtimestamp', 'locationtime', 'fixtime']
_UNITS = {  # to SI; of units that are not here, such as deg, nothing is converted
    'kmh': 1 / 3.6,
    'km/h': 1 / 3.6,
    'kph': 1 / 3.6,
    'kt': 1852 / 3600,
    'kts': 1852 / 3600,
    'kn': 1852 / 3600,
    'knots': 1852 / 3600,
    'mph': 0.44704,
    'ft': 0.3048,
    'feet': 0.3048,
}
_TAIL = re.compile(rf'(.*)[ _]({"|".join(_UNITS)}|mps|m/s|m|s|ms|us|ns|deg|utc)')
_NAMES: dict[str, tuple[str, ...]] = {
    'lat': ('lat', 'latitude', 'locationlatitude', 'gpslat', 'gpslatitude'),
    'lon': ('lon', 'long', 'lng', 'longitude', 'locationlongitude', 'gpslon', 'gpslongitude'),
    'altitude': ('alt', 'altitude', 'ele', 'elevation', 'height', 'locationaltitude', 'gpsalt'),
    'speed': ('speed', 'groundspeed', 'locationspeed', 'gpsspeed', 'velocity'),
    'bearing': ('bearing', 'course', 'heading', 'track', 'direction', 'locationcourse', 'cog'),
    'climb': ('climb', 'vspeed', 'verticalspeed', 'climbrate', 'vario'),
    'vn': ('vn', 'veln', 'velnorth', 'velocitynorth'),
    've': ('ve', 'vele', 'veleast', 'velocityeast'),
    'vd': ('vd', 'veld', 'veldown', 'velocitydown'),
    'accuracy': (
        'accuracy',
        'horizontalaccuracy',
        'hacc',
        'locationhorizontalaccuracy',
        'accuracyhorizontal',
    ),
    'vertical_accuracy': (
        'verticalaccuracy',
        'vacc',
        'locationverticalaccuracy',
        'accuracyvertical',
    ),
}
_DATUMS: tuple[tuple[str, Datum], ...] = (
    ('msl', 'msl'),
    ('amsl', 'msl'),
    ('orthometric', 'msl'),
    ('abovemeansealevel', 'msl'),
    ('ellipsoidal', 'ellipsoid'),
    ('ellipsoid', 'ellipsoid'),
    ('wgs84', 'ellipsoid'),
    ('hae', 'ellipsoid'),
)
_NEEDED = ('lat', 'lon', 'altitude')
_DELIMITERS = ',;\t|'
_MAX_COLUMNS = 1000
_SUFFIXES = ('.csv', '.tsv', '.txt')
_PLAUSIBLE_NS = 10**17  # 1973
_EPOCH_UNITS = ((1e8, 1e11, 10**9), (1e11, 1e14, 10**6), (1e14, 1e17, 10**3), (1e17, 1e19, 1))


def recognises(head: bytes, path: Path) -> bool:
    """Return whether a file that begins like this may be a table of positions."""
    if path.suffix.lower() in _SUFFIXES:
        return head.strip() != b'' and b'\0' not in head
    line = head.removeprefix(b'\xef\xbb\xbf').split(b'\n', 1)[0].decode('utf-8', 'replace')
    names = {_plain(name)[0] for name in line.split(_delimiter(line))}
    return bool(names.intersection(_NAMES['lat']) and names.intersection(_NAMES['lon']))


def open_log(path: Path) -> OpenedLog:
    """Read a table of positions.

    Raises
    ------
    LogError
        If columns that are needed are not there, or no line follows the header.
    """
    table = FixTable()
    columns: _Header | None = None
    for number, line in text_lines(path):
        if not line.strip() or (columns is None and line.startswith('#')):
            continue
        where = f'line {number}'
        if columns is None:
            columns = _Header(path, number, line)
            continue
        try:
            (cells,) = csv.reader([line], delimiter=columns.delimiter, strict=True)
        except (csv.Error, ValueError):
            table.reject('with quotes that do not match', where)
            continue
        columns.take(cells, table, where)
    if columns is None or len(table) == 0:
        raise LogError(f'{path}: no positions in this table: no line after the header')
    warnings = []
    if columns.datum == 'unknown':
        warnings.append('the table does not say what altitudes are above')
    if 'speed' in columns.at and not columns.velocity:
        warnings.append('speed is not used: there is no bearing and climb beside it')
    if columns.earliest < _PLAUSIBLE_NS:
        warnings.append('times count from an unknown start, taken as 1970-01-01')
    reading = table.reading(columns.datum, warnings)
    source = Source(SOURCE, 'CSV line', 'csv', 'fix', len(table), usable=True)
    metadata = {name: columns.names[at] for name, at in columns.at.items()}
    return OpenedLog(
        path=path,
        format=NAME,
        sources=[source],
        track=tracks_of(path, lambda _: reading, []),
        metadata=metadata,
    )


class _Header:
    """Which column is what."""

    def __init__(self, path: Path, number: int, line: str) -> None:
        self.delimiter = _delimiter(line)
        try:
            (self.names,) = csv.reader([line], delimiter=self.delimiter, strict=True)
        except (csv.Error, ValueError):
            raise LogError(f'{path}: line {number}: a header whose quotes do not match') from None
        if len(self.names) > _MAX_COLUMNS:
            raise LogError(f'{path}: line {number}: more than {_MAX_COLUMNS} columns')
        self.at: dict[str, int] = {}
        self.factor: dict[str, float] = {}
        self.datum: Datum = 'unknown'
        self.earliest = 2**63
        self._time_ns: Callable[[str], int | None] | None = None
        plain = [_plain(name) for name in self.names]
        for index, (name, factor) in enumerate(plain):
            if name in _TIMES and 'time' not in self.at:
                self.at['time'] = index
            elif name == 'date':
                self.at['date'] = index
            else:
                self._assign(index, name, factor)
        missing = [name for name in ('time', *_NEEDED) if name not in self.at]
        if missing:
            found = ', '.join(name.strip() for name in self.names[:20]) or 'none'
            known = {'time': _TIMES[:4], **_NAMES}
            wanted = '; '.join(f'{name} ({", ".join(known[name][:4])})' for name in missing)
            raise LogError(
                f'{path}: line {number}: no column for {wanted}; columns found: {found[:300]}'
            )
        self.velocity = ''
        if {'vn', 've', 'vd'} <= set(self.at):
            self.velocity = 'components'
        elif {'speed', 'bearing', 'climb'} <= set(self.at):
            self.velocity = 'polar'

    def _assign(self, index: int, name: str, factor: float) -> None:
        datum: Datum = 'unknown'
        for word, meaning in _DATUMS:
            bare = name.replace(word, '')
            if bare != name and bare in _NAMES['altitude']:
                name, datum = bare, meaning
                break
        for key, known in _NAMES.items():
            if name in known and key not in self.at:
                self.at[key], self.factor[key] = index, factor
                if key == 'altitude':
                    self.datum = datum

    def take(self, cells: list[str], table: FixTable, where: str) -> None:
        """Put a line's position into the table."""
        if len(cells) < len(self.names) and len(cells) <= max(self.at.values()):
            return table.reject('shorter than the header', where)
        text = cells[self.at['time']].strip()
        if 'date' in self.at and '-' not in text:
            text = f'{cells[self.at["date"]].strip().replace("/", "-")}T{text}'
        time_ns = self._time(text)
        if time_ns is None:
            return table.reject('with a time neither ISO 8601 nor counted since 1970', where)
        value = {}
        for name in self.factor:
            try:
                value[name] = self._number(cells[self.at[name]], name)
            except ValueError:
                return table.reject(f'where {name} is no number', where)
        velocity = None
        if self.velocity == 'components':
            velocity = (value['vn'], value['ve'], value['vd'])
        elif self.velocity == 'polar':
            along, course = value['speed'], math.radians(value['bearing'])
            velocity = (along * math.cos(course), along * math.sin(course), -value['climb'])
        # The radius that 68 of 100 fixes are in, as Android defines accuracy, is 1.5 sigma of
        # each axis.
        accuracy = value.get('accuracy', math.nan) / 1.5
        vertical = value.get('vertical_accuracy', math.nan)
        self.earliest = min(self.earliest, time_ns)
        table.add(
            time_ns,
            value['lat'],
            value['lon'],
            value['altitude'],
            std=(accuracy, vertical),
            velocity=velocity,
        )

    def _number(self, text: str, name: str) -> float:
        text = text.strip()
        if not text:
            return math.nan
        if self.delimiter != ',':  # where the comma is the decimal sign
            text = text.replace(',', '.')
        if '_' in text:  # Python's own way to write numbers, nobody else's
            raise ValueError
        return float(text) * self.factor[name]

    def _time(self, text: str) -> int | None:
        if self._time_ns is None:
            unit = _epoch_unit(text)
            self._time_ns = iso_time_ns if unit is None else lambda t: _epoch_ns(t, unit)
        return self._time_ns(text)


def _plain(name: str) -> tuple[str, float]:
    """Return a column's name without ornament, and the factor of the unit in it to SI."""
    name = name.strip().strip('"').lower()
    factor = 1.0
    if match := re.fullmatch(r'(.*?)\s*[\[(]\s*(.*?)\s*[\])]', name):
        name, unit = match[1], match[2]
        factor = _UNITS.get(unit, 1.0)
        if unit in dict(_DATUMS):
            name += unit
    elif match := _TAIL.fullmatch(name):
        name, factor = match[1], _UNITS.get(match[2], 1.0)
    return re.sub(r'[^a-z0-9]', '', name), factor


def _delimiter(line: str) -> str:
    return max(_DELIMITERS, key=line.count)


def _epoch_unit(text: str) -> int | None:
    """Return the nanoseconds in the unit of a number since 1970, None if it is no number."""
    try:
        size = float(text)
    except ValueError:
        return None
    return next((ns for low, high, ns in _EPOCH_UNITS if low <= size < high), 10**9)


def _epoch_ns(text: str, unit: int) -> int | None:
    whole, _, part = text.partition('.')
    if not (whole.isdecimal() and (not part or part.isdecimal()) and len(whole) < 20):
        try:
            value = float(text) * unit  # as 1.7225E+09
        except ValueError:
            return None
        return round(value) if 0 <= value < 2**63 else None
    ns = int(whole) * unit + int(part[:9].ljust(9, '0') or 0) * unit // 10**9
    return ns if ns < 2**63 else None
