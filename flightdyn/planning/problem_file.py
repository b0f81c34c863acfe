"""Problems from YAML files and settings of the command line."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..config import apply_setting, bounds, check_keys, load_yaml, number, text, whole_number
from ..environment.geodesy import GeodeticPoint
from ..environment.surroundings_file import KEYS as SURROUNDINGS
from ..environment.surroundings_file import read_surroundings
from ..environment.wind_file import read_wind
from ..errors import InputError
from ..resources import find_config, list_configs
from ..vehicles.fields import IN_DEGREES, in_degrees, named_bounds
from ..vehicles.vehicle import Vehicle, load_vehicle
from .objective import parse_objective
from .problem import CHOICES, MAX_NODES, MAX_STARTS, MAX_SUBSTEPS, Phase, Problem

CONDITIONS = ('duration', 'initial', 'final', 'path', 'guess', 'nodes')
KEYS = (
    *('description', 'vehicle', 'model', 'objective', 'phases', *CONDITIONS),
    *('change', 'wind_ned', 'wind', 'wind_strength', 'control_interpolation', 'transcription'),
    *('spacing', 'substeps', 'refine', 'sharpen', 'multistart', 'tolerance', 'max_wall_time'),
    *(*SURROUNDINGS, 'origin', 'alternatives'),
)


ALTERNATIVE = ('objective', *CONDITIONS)


def load_problem(
    name: str, settings: Sequence[str] = (), config_dir: str | Path | None = None
) -> Problem:
    """Return a problem by the path of its YAML file or its name in config/problems.

    Parameters
    ----------
    settings : sequence of 'KEY=VALUE'
        Override entries of the file; KEY may go down with dots (`final.x_e=2`) and to one of
        several values (`wind_ned[0]=-5`), VALUE is YAML.

    Raises
    ------
    InputError
        If it is not there, or has an unknown key or a value out of range; the message names file
        and key.
    """
    path = (
        Path(name)
        if name.endswith(('.yaml', '.yml'))
        else find_config('problems', name, config_dir)
    )
    document = load_yaml(path)
    for setting in settings:
        apply_setting(document, setting, {'wind_ned': [0, 0, 0]})
    return _problem(path, check_keys(document, KEYS, str(path)), config_dir)


def list_problems(config_dir: str | Path | None = None) -> tuple[list[Problem], list[InputError]]:
    """Return every configured problem, by name, and what is wrong with those that are none."""
    problems, wrong = [], []
    for name in list_configs('problems', config_dir):
        try:
            problems.append(load_problem(name, (), config_dir))
        except InputError as error:
            wrong.append(error)
    return problems, wrong


def _problem(path: Path, document: dict[str, Any], config_dir: str | Path | None) -> Problem:
    """Return a problem, with those that its alternatives make of it."""
    given = document.pop('alternatives', {})
    if not isinstance(given, Mapping):
        raise InputError(f'{path}: alternatives: expected names and keys of each, got {given!r}')
    found = []
    for name, keys in given.items():
        where = f'{path}: alternatives.{name}'
        changes = check_keys(keys, ALTERNATIVE, where)
        try:
            found.append((str(name), _single(path, _merged(document, changes), config_dir)))
        except InputError as error:
            raise InputError(f'{error} (in alternatives.{name})') from None
    if not found:
        return _single(path, document, config_dir)
    return replace(found[0][1], alternatives=tuple(found))


def _merged(document: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a document with entries changed, those of conditions name by name."""
    merged = dict(document)
    for key, value in changes.items():
        old = merged.get(key)
        both = isinstance(old, Mapping) and isinstance(value, Mapping) and key != 'objective'
        merged[key] = {**old, **value} if both else value  # type: ignore[dict-item]
    return merged


def _single(path: Path, document: dict[str, Any], config_dir: str | Path | None) -> Problem:
    phases = tuple(_phases(document.get('phases', {}), f'{path}: phases'))
    for key in ('vehicle',) if phases else ('vehicle', 'duration'):
        if key not in document:
            raise InputError(f"{path}: '{key}' is missing")
    if phases and document.get('gates'):
        raise InputError(f'{path}: give either phases or gates: each gate is the end of a phase')
    if phases and 'nodes' in document:
        raise InputError(f'{path}: nodes: give each phase its own')
    wind = document.get('wind_ned', [0, 0, 0])
    if not isinstance(wind, list):
        raise InputError(f'{path}: wind_ned: expected [north, east, down], got {wind!r}')
    conditions = _conditions(document, str(path), phases)
    defaults = Problem.__dataclass_fields__
    chosen = {
        key: document[key] for key in (*CHOICES, 'spacing', 'refine', 'sharpen') if key in document
    }
    for key, most in (('substeps', MAX_SUBSTEPS), ('multistart', MAX_STARTS)):
        if key in document:
            chosen[key] = whole_number(document[key], f'{path}: {key}', lower=1, upper=most)
    for key in ('tolerance', 'max_wall_time'):
        chosen[key] = number(document.get(key, defaults[key].default), f'{path}: {key}')
    if 'wind' in document:
        chosen['wind'] = read_wind(document['wind'], f'{path}: wind')
    if 'wind_strength' in document:
        chosen['wind_strength'] = bounds(document['wind_strength'], f'{path}: wind_strength')
    return Problem(
        name=path.stem,
        vehicle=_vehicle(path, document, config_dir),
        description=text(document.get('description', ''), f'{path}: description'),
        objective=parse_objective(document.get('objective', 'time'), f'{path}: objective'),
        phases=phases,
        wind_ned=tuple(number(w, f'{path}: wind_ned') for w in wind),
        change=_bounds(document, 'change', str(path)),
        surroundings=read_surroundings(
            {key: document[key] for key in SURROUNDINGS if key in document},
            str(path),
            path.parent,
            _origin(document, f'{path}: origin'),
        ),
        **conditions,
        **chosen,
    )


def _conditions(
    document: Mapping[str, Any], where: str, phases: Sequence[Phase] = ()
) -> dict[str, Any]:
    """Return what a problem and a phase have in common, as arguments of either."""
    groups = ('initial', 'final', 'path')
    found: dict[str, Any] = {group: _bounds(document, group, where) for group in groups}
    story = _named(document, 'guess', where)
    found['guess'] = {k: _points(k, v, f'{where}: guess.{k}') for k, v in story.items()}
    if 'nodes' in document:
        found['nodes'] = whole_number(
            document['nodes'], f'{where}: nodes', lower=1, upper=MAX_NODES
        )
    if 'duration' in document or not phases:
        if 'duration' not in document:
            raise InputError(f"{where}: 'duration' is missing")
        lower, upper, guess = _duration(document['duration'], f'{where}: duration')
    else:
        lower, upper = (sum(phase.duration[i] for phase in phases) for i in range(2))
        guess = sum(phase.duration_guess for phase in phases)
    return {**found, 'duration': (lower, upper), 'duration_guess': guess}


def _named(document: Mapping[str, Any], key: str, where: str) -> dict[str, Any]:
    value = document.get(key, {})
    if not isinstance(value, Mapping):
        raise InputError(f'{where}: {key}: expected names and values, got {value!r}')
    return {str(k): v for k, v in value.items()}


def _bounds(document: Mapping[str, Any], key: str, where: str) -> dict[str, Any]:
    given = _named(document, key, where)
    return {k: named_bounds(k, v, f'{where}: {key}.{k}') for k, v in given.items()}


def _phases(value: Any, where: str) -> list[Phase]:
    """Return phases of a mapping of names to conditions, in its order."""
    if not isinstance(value, Mapping):
        raise InputError(f'{where}: expected names and conditions of phases, got {value!r}')
    return [
        Phase(
            name=str(name),
            **_conditions(check_keys(given, CONDITIONS, f'{where}.{name}'), f'{where}.{name}'),
        )
        for name, given in value.items()
    ]


def _origin(document: Mapping[str, Any], where: str) -> GeodeticPoint | None:
    if 'origin' not in document:
        return None
    given = check_keys(document['origin'], ('lat', 'lon', 'altitude'), where)
    for key in ('lat', 'lon'):
        if key not in given:
            raise InputError(f"{where}: '{key}' is missing")
    values = {key: number(value, f'{where}.{key}') for key, value in given.items()}
    try:
        return GeodeticPoint(**values)
    except InputError as error:
        raise InputError(f'{where}: {error}') from None


def _vehicle(path: Path, document: dict[str, Any], config_dir: str | Path | None) -> Vehicle:
    vehicle = load_vehicle(text(document['vehicle'], f'{path}: vehicle'), config_dir)
    if 'model' not in document:
        return vehicle
    return vehicle.with_model(text(document['model'], f'{path}: model'))


def _duration(value: Any, where: str) -> tuple[float, float, float]:
    """Return (lower, upper, guess) [s] of a number, or of a mapping that has the three."""
    if not isinstance(value, Mapping):
        fixed = number(value, where)
        return fixed, fixed, fixed
    keys = ('lower', 'upper', 'guess')
    given = check_keys(value, keys, where)
    for key in keys:
        if key not in given:
            raise InputError(f"{where}: '{key}' is missing")
    lower, upper, guess = (number(given[key], f'{where}.{key}') for key in keys)
    return lower, upper, guess


def _points(name: str, value: Any, where: str) -> tuple[float, ...]:
    values = value if isinstance(value, list) else [value]
    read = in_degrees if name in IN_DEGREES else number
    return tuple(read(v, where) for v in values)
