"""Winds as they stand in YAML files and plans: mappings with a kind, and back."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..config import check_keys, number, suggestion
from ..errors import InputError
from .thermals import Thermal
from .wind import LogWind, PowerLawWind, ShearWind, SumOfWinds, TableWind, Wind


@dataclass(frozen=True)
class _Kind:
    """A class of winds; which of its numbers a mapping must have, which it may have."""

    made: Callable[..., Wind]
    needed: tuple[str, ...]
    optional: tuple[str, ...] = ()
    columns: tuple[str, ...] = ()
    """Those that are lists of numbers."""

    @property
    def keys(self) -> tuple[str, ...]:
        return tuple(_KEYS.get(name, name) for name in (*self.needed, *self.optional))


_KEYS = {'from_deg': 'from'}
"""Keys that are not called like what the class calls them; this one is an angle."""

_KINDS = {
    'shear': _Kind(ShearWind, ('gradient', 'from_deg')),
    'power_law': _Kind(PowerLawWind, ('speed', 'from_deg'), ('reference_height', 'exponent')),
    'logarithmic': _Kind(LogWind, ('speed', 'from_deg'), ('reference_height', 'roughness')),
    'table': _Kind(
        TableWind, ('heights', 'north', 'east'), ('down',), ('heights', 'north', 'east', 'down')
    ),
    'thermal': _Kind(Thermal, ('x', 'y', 'updraft', 'radius'), ('top', 'fade')),
}
KEYS: Mapping[str, tuple[str, ...]] = {name: ('kind', *k.keys) for name, k in _KINDS.items()}
"""What a mapping of each kind may have."""


def read_wind(value: Any, where: str) -> Wind | None:
    """Return the wind that a mapping, or a list of them, describes; several add up.

    An empty list is no wind.

    Parameters
    ----------
    value : mapping or list
        As it stands in YAML: `{kind: shear, gradient: 0.1, from: 270 deg}`; see `KEYS`.
    where : str
        For messages.

    Raises
    ------
    InputError
        If a kind or key is unknown, a key is missing or a number out of range.
    """
    parts = value if isinstance(value, list) else [value]
    several = len(parts) > 1
    winds = [_read(part, f'{where}[{i}]' if several else where) for i, part in enumerate(parts)]
    if len(winds) > 1:
        return SumOfWinds(tuple(winds))
    return winds[0] if winds else None


def _read(value: Any, where: str) -> Wind:
    if not isinstance(value, Mapping) or 'kind' not in value:
        raise InputError(
            f'{where}: expected a mapping with a kind ({", ".join(_KINDS)}), got {value!r}'
        )
    name = value['kind']
    if name not in _KINDS:
        raise InputError(f"{where}: kind: unknown '{name}'{suggestion(str(name), _KINDS)}")
    kind = _KINDS[name]
    given = check_keys(value, KEYS[name], where)
    arguments: dict[str, Any] = {}
    for attribute in (*kind.needed, *kind.optional):
        key = _KEYS.get(attribute, attribute)
        if key in given:
            at = f'{where}.{key}'
            if attribute in kind.columns:
                arguments[attribute] = _column(given[key], at)
            else:
                found = number(given[key], at)
                arguments[attribute] = math.degrees(found) if key == 'from' else found
        elif attribute in kind.needed:
            raise InputError(f"{where}: '{key}' is missing")
    try:
        return kind.made(**arguments)
    except InputError as error:
        raise InputError(f'{where}: {error}') from None


def _column(value: Any, where: str) -> list[float]:
    if not isinstance(value, list):
        raise InputError(f'{where}: expected a list of numbers, got {value!r}')
    return [number(each, where) for each in value]


def wind_document(wind: Wind | None) -> list[dict[str, Any]]:
    """Return the mappings that `read_wind` makes a wind of; none for no wind.

    Raises
    ------
    InputError
        If it is of no kind that files have, such as a function.
    """
    if wind is None:
        return []
    if isinstance(wind, SumOfWinds):
        return [each for part in wind.winds for each in wind_document(part)]
    for name, kind in _KINDS.items():
        if type(wind) is kind.made:
            return [{'kind': name, **_numbers(wind, (*kind.needed, *kind.optional))}]
    raise InputError(f'{wind!r} is no wind that a file can hold: known: {", ".join(_KINDS)}')


def _numbers(wind: Wind, attributes: Sequence[str]) -> dict[str, Any]:
    found = {}
    for attribute in attributes:
        value = getattr(wind, attribute)
        if value is None or (attribute == 'top' and value == math.inf):
            continue
        key = _KEYS.get(attribute, attribute)
        found[key] = np.asarray(np.radians(value) if key == 'from' else value, float).tolist()
    return found
