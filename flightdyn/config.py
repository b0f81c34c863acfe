"""Reading YAML configuration strictly: unknown keys and wrong types are refused by name."""

import copy
import difflib
import math
import re
from collections.abc import Collection, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from .errors import InputError


def load_yaml(path: Path) -> dict[str, Any]:
    """Return the mapping in a YAML file.

    Raises
    ------
    InputError
        If the file cannot be read, is not YAML or is not a mapping; the message has the line.
    """
    try:
        text = path.read_text(encoding='utf-8')
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f'cannot read {path}: {error}') from error
    document = parse_yaml(text, str(path))
    if not isinstance(document, dict):
        raise InputError(f'{path}: expected a mapping of names to values')
    return document


def parse_yaml(text: str, where: str) -> Any:
    """Return a YAML document; errors name `where` it stands."""
    return copy.deepcopy(_parsed(text, where))


@lru_cache(maxsize=64)
def _parsed(text: str, where: str) -> Any:
    import yaml

    # libyaml's, several times as fast, is not in every build
    loader = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)
    try:
        return yaml.load(text, Loader=loader)  # noqa: S506 - both are safe
    except yaml.YAMLError as error:
        raise InputError(f'{where}: {" ".join(str(error).split())}') from error


def check_keys(mapping: Any, known: Collection[str], where: str) -> dict[str, Any]:
    """Return the mapping if all its keys are known.

    Raises
    ------
    InputError
        If it is no mapping or has an unknown key; the message names the nearest known one.
    """
    if not isinstance(mapping, Mapping):
        raise InputError(f'{where}: expected a mapping, got {mapping!r}')
    for key in mapping:
        if key not in known:
            raise InputError(f"{where}: unknown '{key}'{suggestion(str(key), known)}")
    return dict(mapping)


def apply_setting(
    document: dict[str, Any], setting: str, defaults: Mapping[str, Any] | None = None
) -> None:
    """Override an entry of a document by 'KEY=VALUE'.

    KEY may go down with dots (`final.x_e=2`) and into lists (`wind_ned[0]=3`), VALUE is YAML.

    Parameters
    ----------
    defaults : mapping
        What to go down into where the document has no such entry; an empty mapping else.

    Raises
    ------
    InputError
        If it is not of this form, or KEY goes down into what is no mapping or list.
    """
    key, equals, value = setting.partition('=')
    if not equals or not re.fullmatch(r'[^.\[\]]+(\.[^.\[\]]+|\[\d+\])*', key):
        raise InputError(f"--set {setting}: expected KEY=VALUE, such as 'final.x_e=2'")
    *parents, last = re.findall(r'[^.\[\]]+', key)
    node: Any = document
    for parent, below in zip(parents, [*parents, last][1:], strict=True):
        if isinstance(node, list):
            node = node[_index(node, parent, setting)]
        else:
            node = node.setdefault(parent, copy.deepcopy((defaults or {}).get(parent, {})))
        if not isinstance(node, dict | list):
            raise InputError(f'--set {setting}: {parent} is a value, and has no {below}')
    place = _index(node, last, setting) if isinstance(node, list) else last
    node[place] = parse_yaml(value, f'--set {setting}')


def _index(items: list[Any], text: str, setting: str) -> int:
    if not text.isdecimal() or int(text) >= len(items):
        raise InputError(f'--set {setting}: expected [0] to [{len(items) - 1}], got [{text}]')
    return int(text)


def suggestion(name: str, known: Collection[str]) -> str:
    """Return words that name the nearest known name, or all of them."""
    near = difflib.get_close_matches(name, list(known), n=1)
    return f", did you mean '{near[0]}'?" if near else f'; known: {", ".join(known)}'


def number(value: Any, where: str, *, finite: bool = True) -> float:
    """Return a number; a string such as '-360 deg' is taken as an angle.

    Raises
    ------
    InputError
        If the value is not a number, is NaN, or is infinite where that is not allowed.
    """
    factor = 1.0
    if isinstance(value, str) and value.endswith('deg'):
        value, factor = value.removesuffix('deg').strip(), math.pi / 180
    try:
        if isinstance(value, bool):
            raise TypeError
        result = float(value) * factor
    except (TypeError, ValueError):
        raise InputError(f'{where}: expected a number, got {value!r}') from None
    if math.isnan(result) or (finite and math.isinf(result)):
        raise InputError(f'{where}: must be finite, got {value!r}')
    return result


def bounds(value: Any, where: str) -> tuple[float, float]:
    """Return (lower, upper) of a number, or of a pair whose ends may be null for 'none'.

    Raises
    ------
    InputError
        If the value is neither, or lower is above upper.
    """
    if not isinstance(value, list | tuple):
        fixed = number(value, where)
        return fixed, fixed
    if len(value) != 2:
        raise InputError(f'{where}: expected a number or [lower, upper], got {value!r}')
    lower = -math.inf if value[0] is None else number(value[0], where, finite=False)
    upper = math.inf if value[1] is None else number(value[1], where, finite=False)
    if lower > upper or lower == math.inf or upper == -math.inf:
        raise InputError(f'{where}: lower bound {lower:g} is above the upper bound {upper:g}')
    return lower, upper


def whole_number(value: Any, where: str, *, lower: int, upper: int) -> int:
    """Return a whole number within limits.

    Raises
    ------
    InputError
        If it is not whole or outside.
    """
    result = number(value, where)
    if result != int(result) or not lower <= result <= upper:
        raise InputError(f'{where}: must be a whole number from {lower} to {upper}, got {value!r}')
    return int(result)


def text(value: Any, where: str) -> str:
    """Return a string.

    Raises
    ------
    InputError
        If the value is something else.
    """
    if not isinstance(value, str):
        raise InputError(f'{where}: expected text, got {value!r}')
    return value
