"""Surroundings from the keys of a YAML or JSON file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..config import bounds, check_keys, number, text
from ..errors import InputError
from .geodesy import GeodeticPoint
from .surroundings import Cylinder, Gate, Mark, Polygon, Surroundings, Terrain
from .terrain_map import read_terrain_map

KEYS = ('terrain', 'keep_out', 'gates', 'marks')
TERRAIN_KEYS = ('file', 'x', 'y', 'height', 'clearance')
KEEP_OUT_KEYS = ('centre', 'radius', 'corners', 'bottom', 'top')
GATE_KEYS = ('centre', 'heading', 'width', 'height')
MARK_KEYS = ('place', 'radius', 'kind')


def read_surroundings(
    document: Any,
    where: str,
    folder: str | Path = '.',
    origin: GeodeticPoint | None = None,
) -> Surroundings:
    """Return surroundings of a mapping with `KEYS`.

    Parameters
    ----------
    where : str
        Place of the mapping, for messages.
    folder : path
        That a terrain's file is named from.
    origin : GeodeticPoint or None
        Of the earth axes; needed by maps in latitude and longitude.

    Raises
    ------
    InputError
        If a key is missing, unknown or wrong, or a map cannot be read.
    """
    given = check_keys(document, KEYS, where)
    try:
        terrain = None
        if 'terrain' in given:
            terrain = _terrain(given['terrain'], f'{where}: terrain', Path(folder), origin)
        return Surroundings(
            terrain=terrain,
            keep_out=[_keep_out(*each) for each in _named(given, 'keep_out', where)],
            gates=[_gate(*each) for each in _named(given, 'gates', where)],
            marks=[_mark(*each) for each in _named(given, 'marks', where)],
        )
    except InputError as error:
        told = str(error)
        raise InputError(told if told.startswith(where) else f'{where}: {told}') from None


def _named(given: Mapping[str, Any], key: str, where: str) -> list[tuple[str, Any, str]]:
    """Return (name, value, place) of each entry."""
    value = given.get(key, {})
    if not isinstance(value, Mapping):
        raise InputError(f'{where}: {key}: expected names and what they stand for, got {value!r}')
    return [(str(name), each, f'{where}: {key}.{name}') for name, each in value.items()]


def _terrain(value: Any, where: str, folder: Path, origin: GeodeticPoint | None) -> Terrain:
    given = check_keys(value, TERRAIN_KEYS, where)
    clearance = number(given.get('clearance', 0.0), f'{where}.clearance')
    inline = ('x', 'y', 'height')
    if 'file' in given:
        for key in inline:
            if key in given:
                raise InputError(f'{where}: give either file or x, y and height')
        path = folder / text(given['file'], f'{where}.file')
        return read_terrain_map(path, clearance, origin)
    for key in inline:
        if key not in given:
            raise InputError(f"{where}: 'file' is missing (or x, y and height)")
    try:
        return Terrain(given['x'], given['y'], given['height'], clearance)
    except (TypeError, ValueError):
        raise InputError(f'{where}: x, y and height must be lists of numbers') from None


def _keep_out(name: str, value: Any, where: str) -> Cylinder | Polygon:
    given = check_keys(value, KEEP_OUT_KEYS, where)
    bottom, top = bounds([given.get('bottom'), given.get('top')], f'{where}: bottom, top')
    if 'corners' in given:
        for key in ('centre', 'radius'):
            if key in given:
                raise InputError(f'{where}: give either corners or centre and radius')
        corners = given['corners']
        if not isinstance(corners, list):
            raise InputError(f'{where}.corners: expected [[x, y], ...], got {corners!r}')
        points = [_numbers(each, 2, f'{where}.corners[{i}]') for i, each in enumerate(corners)]
        return Polygon(name=name, corners=[(x, y) for x, y in points], bottom=bottom, top=top)
    _need(given, ('centre', 'radius'), where)
    x, y = _numbers(given['centre'], 2, f'{where}.centre')
    radius = number(given['radius'], f'{where}.radius')
    return Cylinder(name=name, centre=(x, y), radius=radius, bottom=bottom, top=top)


def _gate(name: str, value: Any, where: str) -> Gate:
    given = check_keys(value, GATE_KEYS, where)
    _need(given, GATE_KEYS, where)
    x, y, altitude = _numbers(given['centre'], 3, f'{where}.centre')
    heading, width, height = (number(given[key], f'{where}.{key}') for key in GATE_KEYS[1:])
    return Gate(name=name, centre=(x, y, altitude), heading=heading, width=width, height=height)


def _mark(name: str, value: Any, where: str) -> Mark:
    given = check_keys(value, MARK_KEYS, where)
    _need(given, ('place',), where)
    x, y, altitude = _numbers(given['place'], 3, f'{where}.place')
    radius = number(given.get('radius', 0.0), f'{where}.radius')
    kind = text(given.get('kind', 'place'), f'{where}.kind')
    return Mark(name=name, place=(x, y, altitude), radius=radius, kind=kind)


def _need(given: Mapping[str, Any], keys: tuple[str, ...], where: str) -> None:
    for key in keys:
        if key not in given:
            raise InputError(f"{where}: '{key}' is missing")


def _numbers(value: Any, count: int, where: str) -> list[float]:
    names = ('x', 'y', 'altitude')[:count]
    if not isinstance(value, list) or len(value) != count:
        raise InputError(f'{where}: expected [{", ".join(names)}], got {value!r}')
    return [number(each, where) for each in value]
