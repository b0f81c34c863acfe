"""Sweeps from YAML files: a problem, what is varied, and what to make of the plans."""

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..config import check_keys, load_yaml, number, suggestion, text, whole_number
from ..environment.geodesy import GeodeticPoint
from ..errors import InputError
from ..resources import find_config
from ..vehicles.fields import IN_DEGREES, in_degrees
from .expression import Expression
from .plan_values import REPORTED
from .problem_file import KEYS as PROBLEM_KEYS
from .sweep import (
    COLUMNS,
    ENDS,
    PLACEHOLDER,
    SAMPLINGS,
    STARTS,
    Footprint,
    Parameter,
    Picture,
    Sweep,
    entry_of,
    is_number,
)

KEYS = (
    *('description', 'problem', 'settings', 'over', 'sampling', 'samples', 'seed'),
    *('start', 'value', 'picture', 'footprint', 'plans'),
)
RANGE_KEYS = ('from', 'to', 'steps')
PICTURE_KEYS = ('over', 'value', 'title', 'units', 'labels')
FOOTPRINT_KEYS = ('around', 'place')
PLANS = ('.parquet', '.csv', '.json', '.mcap', '.rrd')
MAX_CASES = 100_000


def load_sweep(name: str, config_dir: str | Path | None = None) -> Sweep:
    """Return a sweep by the path of its YAML file or its name in config/sweeps.

    Raises
    ------
    InputError
        If it is not there, or has an unknown key or a value that cannot be; the message names
        file and key.
    """
    path = (
        Path(name) if name.endswith(('.yaml', '.yml')) else find_config('sweeps', name, config_dir)
    )
    where = str(path)
    document = check_keys(load_yaml(path), KEYS, where)
    for key in ('problem', 'over'):
        if key not in document:
            raise InputError(f"{where}: '{key}' is missing")
    chosen = {
        key: _choice(document.get(key, known[0]), known, f'{where}: {key}')
        for key, known in (('sampling', SAMPLINGS), ('start', STARTS), ('plans', PLANS))
    }
    settings = _mapping(document.get('settings', {}), f'{where}: settings')
    parameters = _parameters(document['over'], f'{where}: over', chosen['sampling'] == 'grid')
    _check_names(settings, parameters, where)
    values = _values(document.get('value', []), parameters, f'{where}: value')
    footprint = _footprint(document.get('footprint'), parameters, f'{where}: footprint')
    if footprint is not None:
        values |= {name: Expression(name) for name in ENDS}
    return Sweep(
        name=path.stem,
        description=text(document.get('description', ''), f'{where}: description'),
        problem=_problem_of(document['problem'], path, where),
        settings=settings,
        parameters=parameters,
        samples=_samples(document, parameters, chosen['sampling'], where),
        seed=whole_number(document.get('seed', 0), f'{where}: seed', lower=0, upper=2**32 - 1),
        values=values,
        picture=_picture(document.get('picture', {}), parameters, values, f'{where}: picture'),
        footprint=footprint,
        config_dir=None if config_dir is None else str(Path(config_dir).absolute()),
        **chosen,
    )


def _problem_of(value: Any, path: Path, where: str) -> str:
    """Return a problem's name, or its path: beside the sweep's file, unless absolute."""
    problem = text(value, f'{where}: problem')
    if problem.endswith(('.yaml', '.yml')):
        return str((path.parent / problem).absolute())
    return problem


def _choice(value: Any, known: Sequence[str], where: str) -> str:
    if value not in known:
        raise InputError(f'{where}: must be {" or ".join(known)}, got {value!r}')
    return str(value)


def _mapping(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        raise InputError(f'{where}: expected names and values, got {value!r}')
    return {str(key): item for key, item in value.items()}


def _parameters(value: Any, where: str, grid: bool) -> tuple[Parameter, ...]:
    given = _mapping(value, where)
    if not given:
        raise InputError(f'{where}: nothing is varied: expected KEY: [values] or a range')
    return tuple(_parameter(key, item, f'{where}.{key}', grid) for key, item in given.items())


def _parameter(key: str, value: Any, where: str, grid: bool) -> Parameter:
    read = in_degrees if re.sub(r'\[.*', '', key).rpartition('.')[2] in IN_DEGREES else number
    if isinstance(value, list):
        if not value:
            raise InputError(f'{where}: expected one or more values')
        values = tuple(
            read(v, where) if isinstance(v, str) and v.endswith('deg') else v for v in value
        )
        twice = [v for i, v in enumerate(values) if v in values[:i]]
        if twice:
            raise InputError(f'{where}: {twice[0]!r} stands there twice')
        for v in values:
            if is_number(v):
                number(v, where)
        return Parameter(key, values)
    if not isinstance(value, Mapping):
        raise InputError(f'{where}: expected [values] or {{from, to, steps}}, got {value!r}')
    check_keys(value, RANGE_KEYS, where)
    for each in ('from', 'to', *(('steps',) if grid else ())):
        if each not in value:
            raise InputError(f"{where}: '{each}' is missing")
    lower, upper = (read(value[each], f'{where}.{each}') for each in ('from', 'to'))
    if lower == upper:
        raise InputError(f'{where}: from {lower:g} to {upper:g} nothing varies')
    if 'steps' not in value:
        return Parameter(key, lower=lower, upper=upper)
    steps = whole_number(value['steps'], f'{where}.steps', lower=2, upper=MAX_CASES)
    return Parameter(key, tuple(np.linspace(lower, upper, steps).tolist()))


def _samples(
    document: Mapping[str, Any], parameters: Sequence[Parameter], method: str, where: str
) -> int:
    if method != 'grid':
        if 'samples' not in document:
            raise InputError(f"{where}: 'samples' is missing: how many cases?")
        return whole_number(document['samples'], f'{where}: samples', lower=1, upper=MAX_CASES)
    for key in ('samples', 'seed'):
        if key in document:
            raise InputError(
                f'{where}: {key}: a grid has none: sampling: random or latin_hypercube do'
            )
    count = 1
    for parameter in parameters:
        count *= len(parameter.values)
    if count > MAX_CASES:
        raise InputError(f'{where}: over: {count} cases: at most {MAX_CASES} are allowed')
    return count


def _check_names(settings: Mapping[str, Any], parameters: Sequence[Parameter], where: str) -> None:
    own = [p.key for p in parameters if p.is_own]
    for key in settings:
        if entry_of(key) not in PROBLEM_KEYS:
            near = suggestion(entry_of(key), PROBLEM_KEYS)
            raise InputError(f"{where}: settings: unknown '{key}'{near}")
    written = ' '.join(PLACEHOLDER.findall(json.dumps(settings, default=str)))
    for key in own:
        if not key.isidentifier():
            near = suggestion(entry_of(key), PROBLEM_KEYS)
            raise InputError(f"{where}: over: '{key}' is no entry of a problem{near}")
        if not re.search(rf'\b{key}\b', written):
            near = suggestion(key, PROBLEM_KEYS)
            raise InputError(
                f"{where}: over: '{key}' is no entry of a problem{near}; as a name of your own it "
                f'has to stand in settings as {{{key}}}'
            )


def _values(value: Any, parameters: Sequence[Parameter], where: str) -> dict[str, Expression]:
    if isinstance(value, str):
        value = [value]
    if isinstance(value, list):
        value = {text(each, where): each for each in value}
    found = {}
    for name, formula in _mapping(value, where).items():
        if name == formula and name in REPORTED:
            continue  # every table has it
        if name in COLUMNS or name in [p.key for p in parameters]:
            raise InputError(f"{where}: the table has another column '{name}': give it a name")
        found[name] = Expression(text(formula, f'{where}.{name}'), f'{where}.{name}')
    return found


def _picture(
    value: Any, parameters: Sequence[Parameter], values: Mapping[str, Any], where: str
) -> Picture | None:
    if value is False:
        return None
    given = check_keys(value, PICTURE_KEYS, where)
    known = [p.key for p in parameters]
    over = given.get('over', known)
    over = [over] if isinstance(over, str) else over
    if not isinstance(over, list) or not over:
        raise InputError(f'{where}.over: expected names of parameters, got {over!r}')
    for name in over:
        if name not in known:
            raise InputError(f"{where}.over: unknown '{name}'{suggestion(str(name), known)}")
    columns = (*values, *REPORTED)
    shown = given.get('value', columns[0])
    if shown not in columns:
        raise InputError(f"{where}.value: unknown '{shown}'{suggestion(str(shown), columns)}")
    words = {
        group: {
            k: text(v, f'{where}.{group}.{k}')
            for k, v in check_keys(
                given.get(group, {}), (*known, *columns), f'{where}.{group}'
            ).items()
        }
        for group in ('units', 'labels')
    }
    title = text(given.get('title', ''), f'{where}.title')
    return Picture(over=tuple(over), value=shown, title=title, **words)


def _footprint(value: Any, parameters: Sequence[Parameter], where: str) -> Footprint | None:
    if value is None:
        return None
    given = check_keys(value, FOOTPRINT_KEYS, where)
    known = [p.key for p in parameters]
    around = given.get('around', known[0])
    if around not in known:
        raise InputError(f"{where}.around: unknown '{around}'{suggestion(str(around), known)}")
    if 'place' not in given:
        return Footprint(around, None)
    place = check_keys(given['place'], ('lat', 'lon'), f'{where}.place')
    for key in ('lat', 'lon'):
        if key not in place:
            raise InputError(f"{where}.place: '{key}' is missing")
    lat, lon = (number(place[key], f'{where}.place.{key}') for key in ('lat', 'lon'))
    try:
        return Footprint(around, GeodeticPoint(lat, lon))
    except InputError as error:
        raise InputError(f'{where}.place: {error}') from None
