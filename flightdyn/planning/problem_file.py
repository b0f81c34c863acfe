"""Problems from YAML files and settings of the command line."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..config import apply_setting, check_keys, load_yaml, number, text, whole_number
from ..errors import InputError
from ..resources import find_config
from ..vehicles.fields import IN_DEGREES, in_degrees, named_bounds
from ..vehicles.vehicle import Vehicle, load_vehicle
from .objective import parse_objective
from .problem import CHOICES, MAX_NODES, MAX_STARTS, Phase, Problem

CONDITIONS = ('duration', 'initial', 'final', 'path', 'guess', 'nodes')
KEYS = (
    *('description', 'vehicle', 'model', 'objective', 'phases', *CONDITIONS),
    *('wind_ned', 'control_interpolation', 'transcription', 'spacing', 'refine', 'sharpen'),
    'multistart',
    *('tolerance', 'max_wall_time'),
)


def load_problem(
    name: str, settings: Sequence[str] = (), config_dir: str | Path | None = None
) -> Problem:
    """Return a problem by the path of its YAML file or its name in config/problems.

    Parameters
    ----------
    settings : sequence of 'KEY=VALUE'
        Override entries of the file; KEY may go down with dots (`final.x_e=2`), VALUE is YAML.

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
        apply_setting(document, setting)
    return _problem(path, check_keys(document, KEYS, str(path)), config_dir)


def _problem(path: Path, document: dict[str, Any], config_dir: str | Path | None) -> Problem:
    phases = tuple(_phases(document.get('phases', {}), f'{path}: phases'))
    for key in ('vehicle',) if phases else ('vehicle', 'duration'):
        if key not in document:
            raise InputError(f"{path}: '{key}' is missing")
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
    if 'multistart' in document:
        chosen['multistart'] = whole_number(
            document['multistart'], f'{path}: multistart', lower=1, upper=MAX_STARTS
        )
    for key in ('tolerance', 'max_wall_time'):
        chosen[key] = number(document.get(key, defaults[key].default), f'{path}: {key}')
    return Problem(
        name=path.stem,
        vehicle=_vehicle(path, document, config_dir),
        description=text(document.get('description', ''), f'{path}: description'),
        objective=parse_objective(document.get('objective', 'time'), f'{path}: objective'),
        phases=phases,
        wind_ned=tuple(number(w, f'{path}: wind_ned') for w in wind),
        **conditions,
        **chosen,
    )


def _conditions(
    document: Mapping[str, Any], where: str, phases: Sequence[Phase] = ()
) -> dict[str, Any]:
    """Return what a problem and a phase have in common, as arguments of either."""

    def named(key: str) -> dict[str, Any]:
        value = document.get(key, {})
        if not isinstance(value, Mapping):
            raise InputError(f'{where}: {key}: expected names and values, got {value!r}')
        return {str(k): v for k, v in value.items()}

    found: dict[str, Any] = {
        group: {k: named_bounds(k, v, f'{where}: {group}.{k}') for k, v in named(group).items()}
        for group in ('initial', 'final', 'path')
    }
    found['guess'] = {k: _points(k, v, f'{where}: guess.{k}') for k, v in named('guess').items()}
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
