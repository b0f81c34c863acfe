"""IGC files of gliders' and paragliders' flight recorders.

Two sources: `gnss`, and `pressure` with the same places at the altitude in the standard
atmosphere. Latitudes and longitudes have a resolution of 1/1000 minute unless the I record adds
digits (LAD, LOD); TDS adds digits to the time, TAS a true airspeed.

References
----------
.. [1] FAI/IGC, *Technical Specification for GNSS Flight Recorders*, appendix A.
"""

import re
from datetime import UTC, datetime
from pathlib import Path

from ...errors import LogError
from ..sources import Source
from ..track import Datum
from .reading import FixTable, OpenedLog, text_lines, tracks_of

NAME = 'IGC'

_B = re.compile(
    r'B(\d{2})([0-5]\d)([0-5]\d)(\d{2})([0-5]\d)(\d{3})([NS])(\d{3})([0-5]\d)(\d{3})([EW])'
    r'([AV])(\d{5}|-\d{4})(\d{5}|-\d{4})'
)
_DATE = re.compile(r'H[FOP]DTE(?:DATE)?:? *(\d{2})(\d{2})(\d{2})', re.IGNORECASE)
_DATUM = re.compile(r'H[FOP]DTM(?:\d{3})?[^:]*:(.*)', re.IGNORECASE)
_ALTITUDE_DATUM = re.compile(r'H[FOP]ALG[^:]*: *(ELL|GEO|NIL)', re.IGNORECASE)
_ALTITUDE_DATUMS: dict[str, Datum] = {'ELL': 'ellipsoid', 'GEO': 'msl', 'NIL': 'unknown'}
_DAY = 86400
_MAX_HEADERS = 40  # kept, for `info`


def recognises(head: bytes, path: Path) -> bool:
    """Return whether a file that begins like this is an IGC file."""
    text = head.removeprefix(b'\xef\xbb\xbf').lstrip()
    begins = re.match(rb'A[A-Za-z0-9]{3}', text) is not None
    return begins and (path.suffix.lower() == '.igc' or b'\nHFDTE' in head)


def open_log(path: Path) -> OpenedLog:
    """Read an IGC file.

    Raises
    ------
    LogError
        If it has no B records.
    """
    records = _Records()
    for number, line in text_lines(path):
        try:
            records.take(number, line)
        except ValueError as error:
            raise LogError(f'{path}: line {number}: {error}: {line[:40]!r}') from None
    if len(records.gnss) == 0:
        raise LogError(f'{path}: no B records (positions) in this IGC file')
    if not records.dated:
        records.warnings.append('no date (HFDTE): times of day are on 1970-01-01')
    notes = []
    if records.datum is None:
        notes.append(
            'GNSS altitude is taken as above the WGS84 ellipsoid, as IGC wants it; '
            'many recorders write it above mean sea level'
        )
    isa = 'altitude is that of the pressure in the standard atmosphere (ISA)'
    readings = {
        'gnss': records.gnss.reading(records.datum or 'ellipsoid', notes),
        'pressure': records.pressure.reading('baro', [isa]),
    }
    sources = [
        Source(
            name,
            'IGC B record',
            'igc',
            'fix',
            len(readings[name].columns),
            usable=there,
            note='' if there else f'{name} altitude is 0 throughout',
        )
        for name, there in (('gnss', records.has_gnss), ('pressure', records.has_pressure))
    ]
    return OpenedLog(
        path=path,
        format=NAME,
        sources=sources,
        track=tracks_of(path, lambda source: readings[source.topic], records.warnings),
        library=records.metadata.get('recorder', ''),
        metadata=records.metadata,
        warnings=records.warnings,
    )


class _Records:
    """What the lines so far have told."""

    def __init__(self) -> None:
        self.gnss, self.pressure = FixTable(), FixTable()
        self.has_gnss = self.has_pressure = False
        self.metadata: dict[str, str] = {}
        self.warnings: list[str] = []
        self.datum: Datum | None = None
        self.dated = False
        self._midnight = 0  # Unix seconds
        self._last = -1
        self._extra: dict[str, slice] = {}

    def take(self, number: int, line: str) -> None:
        """Read a line; ValueError if it is a header that cannot be understood."""
        if line.startswith('B'):
            self._position(number, line)
        elif line.startswith('I'):
            self._extra = _extensions(line, number, self.warnings)
        elif line.startswith('H'):
            self._header(number, line)
        elif line.startswith('A') and number == 1:
            self.metadata['recorder'] = line[1:].strip()

    def _position(self, number: int, line: str) -> None:
        match = _B.match(line)
        if match is None or int(match[1]) > 23:
            return self._reject('not a whole B record', number)
        try:
            more = {
                name: _digits(line, where) for name, where in self._extra.items() if name != 'TAS'
            }
        except ValueError:
            return self._reject('without the digits that the I record tells', number)
        second = 3600 * int(match[1]) + 60 * int(match[2]) + int(match[3])
        if self._last >= 0 and second < self._last - _DAY // 2:
            self._midnight += _DAY
        self._last = second
        ns = (self._midnight + second) * 10**9 + round(more.get('TDS', 0.0) * 1e9)
        lat = int(match[4]) + (int(match[5] + match[6]) + more.get('LAD', 0.0)) / 60_000
        lon = int(match[8]) + (int(match[9] + match[10]) + more.get('LOD', 0.0)) / 60_000
        lat, lon = (-lat if match[7] == 'S' else lat), (-lon if match[11] == 'W' else lon)
        fix, pressure, gnss = match[12] == 'A', int(match[13]), int(match[14])
        self.has_gnss |= gnss != 0
        self.has_pressure |= pressure != 0
        airspeed = _airspeed(line, self._extra.get('TAS'))
        self.gnss.add(ns, lat, lon, gnss, fix=fix, airspeed=airspeed)
        self.pressure.add(ns, lat, lon, pressure, fix=fix, airspeed=airspeed)

    def _reject(self, why: str, number: int) -> None:
        for table in (self.gnss, self.pressure):
            table.reject(why, f'line {number}')

    def _header(self, number: int, line: str) -> None:
        if found := _DATE.match(line):
            self._midnight = int(_date(*(int(part) for part in found.groups())).timestamp())
            self.dated, self._last = True, -1
        elif found := _ALTITUDE_DATUM.match(line):
            self.datum = _ALTITUDE_DATUMS[found[1].upper()]
        elif found := _DATUM.match(line):
            if not re.search('WGS.?(19)?84', found[1].upper()):
                name = found[1].strip()[:40]
                self.warnings.append(f'line {number}: geodetic datum {name!r}, read as WGS84')
        elif ':' in line and len(self.metadata) < _MAX_HEADERS:
            key, _, value = line[2:].partition(':')
            self.metadata[key.strip()] = value.strip()


def _extensions(line: str, number: int, warnings: list[str]) -> dict[str, slice]:
    """Return where in a B record the extensions are that are read: I, count, (SS FF CCC)..."""
    found: dict[str, slice] = {}
    body = line[3:].strip()
    if not line[1:3].isdigit() or len(body) < 7 * int(line[1:3]):
        warnings.append(f'line {number}: a damaged I record: extensions are not read')
        return found
    for at in range(0, 7 * int(line[1:3]), 7):
        first, last, name = body[at : at + 2], body[at + 2 : at + 4], body[at + 4 : at + 7]
        if name in ('LAD', 'LOD', 'TDS', 'TAS') and first.isdigit() and last.isdigit():
            found[name] = slice(int(first) - 1, int(last))
    return found


def _digits(line: str, where: slice) -> float:
    """Return the fraction that some further digits make."""
    digits = line[where]
    if len(digits) != where.stop - where.start or not digits.isdecimal():
        raise ValueError
    return float(f'0.{digits}')


def _airspeed(line: str, where: slice | None) -> float:
    """Return the true airspeed [m/s], NaN if there is none.

    Three digits are whole km/h; recorders that write more add decimals.
    """
    digits = '' if where is None else line[where]
    if where is None or len(digits) != where.stop - where.start or not digits.isdecimal():
        return float('nan')
    return int(digits) / 10.0 ** max(len(digits) - 3, 0) / 3.6


def _date(day: int, month: int, year: int) -> datetime:
    # Two digits of the year; recorders of this kind came up in 1995.
    return datetime(year + (1900 if year >= 80 else 2000), month, day, tzinfo=UTC)
