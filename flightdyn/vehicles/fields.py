"""Reading a mapping of a vehicle's file, key by key, with errors that name file and key."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, overload

from ..config import bounds, check_keys, number, suggestion, text
from ..errors import InputError

IN_DEGREES = ('alpha', 'beta')
"""What is in degrees inside too; every other angle is in radians."""


@dataclass(frozen=True)
class Context:
    """What a part of a vehicle may need to know of the rest of its file.

    Parameters
    ----------
    folder : Path
        Of the file; other files are named from there.
    gravity : float [m/s^2]
    controls : names
        That the file defines under `controls`.
    geometry : mapping
        As the file has it.
    """

    folder: Path
    gravity: float
    controls: Collection[str]
    geometry: Mapping[str, Any]


class Fields:
    """A mapping whose keys are checked at once and whose values are checked as they are taken.

    Raises
    ------
    InputError
        If it is no mapping or has an unknown key; the message names the nearest known one.
    """

    def __init__(self, mapping: Any, known: Collection[str], where: str) -> None:
        self.values = check_keys(mapping, known, where)
        self.where = where

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def at(self, key: str) -> str:
        """Return the place of a key, for messages."""
        return f'{self.where}: {key}'

    def need(self, key: str) -> Any:
        """Return a value as it stands.

        Raises
        ------
        InputError
            If the key is missing.
        """
        if key not in self.values:
            raise InputError(f"{self.where}: '{key}' is missing")
        return self.values[key]

    @overload
    def number(self, key: str, default: None = None) -> float: ...
    @overload
    def number(self, key: str, default: float) -> float: ...
    def number(self, key: str, default: float | None = None) -> float:
        """Return a number; one that has no default must be there."""
        if default is not None and key not in self.values:
            return default
        return number(self.need(key), self.at(key))

    def positive(self, key: str, default: float | None = None) -> float:
        """Return a number above 0; one that has no default must be there."""
        return positive(default if default and key not in self else self.need(key), self.at(key))

    def bounds(self, key: str) -> tuple[float, float]:
        """Return (lower, upper)."""
        return bounds(self.need(key), self.at(key))

    def numbers(self, key: str, default: list[float] | None = None) -> tuple[float, ...]:
        """Return a list of numbers."""
        value = self.values.get(key, default) if default is not None else self.need(key)
        if not isinstance(value, list) or not value:
            raise InputError(f'{self.at(key)}: expected a list of numbers, got {value!r}')
        return tuple(number(v, self.at(key)) for v in value)

    def named(self, key: str) -> dict[str, Any]:
        """Return a mapping of names, empty if the key is missing."""
        value = self.values.get(key, {})
        if not isinstance(value, Mapping):
            raise InputError(f'{self.at(key)}: expected names and values, got {value!r}')
        return {str(name): part for name, part in value.items()}

    def choice(self, key: str, known: Collection[str], default: str | None = None) -> str:
        """Return one of the known words."""
        value = text(default if default and key not in self else self.need(key), self.at(key))
        if value not in known:
            raise InputError(f"{self.at(key)}: unknown '{value}'{suggestion(value, known)}")
        return value

    def vector(self, key: str, default: list[float] | None = None) -> tuple[float, float, float]:
        """Return three numbers."""
        return vector(self.values.get(key, default), self.at(key))

    def unit_vector(
        self, key: str, default: list[float] | None = None
    ) -> tuple[float, float, float]:
        """Return three numbers of length 1."""
        x, y, z = self.vector(key, default)
        if abs(x * x + y * y + z * z - 1) > 1e-6:
            raise InputError(f'{self.at(key)}: must be a unit vector, got {(x, y, z)}')
        return x, y, z


def positive(value: Any, where: str) -> float:
    """Return a number above 0.

    Raises
    ------
    InputError
        If it is none.
    """
    result = number(value, where)
    if result <= 0:
        raise InputError(f'{where}: must be positive, got {result:g}')
    return result


def vector(value: Any, where: str) -> tuple[float, float, float]:
    """Return three numbers.

    Raises
    ------
    InputError
        If they are not.
    """
    if not isinstance(value, list) or len(value) != 3:
        raise InputError(f'{where}: expected [x, y, z], got {value!r}')
    x, y, z = (number(component, where) for component in value)
    return x, y, z


def in_degrees(value: Any, where: str) -> float:
    """Return an angle in degrees, with or without the unit behind it."""
    if isinstance(value, str):
        value = value.removesuffix('deg').strip()
    return number(value, where, finite=False)


def named_bounds(name: str, value: Any, where: str) -> tuple[float, float]:
    """Return (lower, upper) of a quantity: degrees of alpha and beta, SI units of all else."""
    if name not in IN_DEGREES:
        return bounds(value, where)
    pair = value if isinstance(value, list | tuple) else [value, value]
    return bounds([v if v is None else in_degrees(v, where) for v in pair], where)


def check_controls(names: Collection[str], controls: Collection[str], where: str) -> None:
    """Refuse names that are not among the controls.

    Raises
    ------
    InputError
        Naming the nearest control.
    """
    for name in names:
        if name not in controls:
            raise InputError(
                f"{where}: '{name}' is not among the vehicle's controls"
                + (suggestion(name, controls) if controls else '')
            )
