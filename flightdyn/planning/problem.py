"""What is to be planned: vehicle, conditions, objective, duration, wind, guess."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..config import (
    bounds,
    check_keys,
    load_yaml,
    number,
    parse_yaml,
    suggestion,
    text,
    whole_number,
)
from ..errors import InputError
from ..resources import find_config
from ..trajectory import Interpolation, Trajectory
from ..vehicles.vehicle import Vehicle, load_vehicle

Bounds = Mapping[str, tuple[float, float]]

OBJECTIVES = ('time',)
MAX_NODES = 5000
KEYS = (
    *('description', 'vehicle', 'objective', 'duration', 'initial', 'final', 'path', 'guess'),
    *('wind_ned', 'nodes', 'control_interpolation', 'tolerance', 'max_wall_time'),
)


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A trajectory-optimization problem, apart from the method that solves it.

    Parameters
    ----------
    duration : lower, upper [s]
    duration_guess : float [s]
    initial, final : mapping of state name to (lower, upper)
        States that are not named are free.
    path : mapping of state or control name to (lower, upper)
        Hold at every node, beside the vehicle's own limits.
    guess : mapping of state or control name to values
        A storyboard: points in equal steps over the duration, linear between.
    guess_trajectory : Trajectory or None
        A guess instead of the storyboard, stretched to the guessed duration.
    wind_ned : x, y, z [m/s]
        Where the air moves to.
    nodes : int
        Intervals of the first mesh.
    control_interpolation : 'previous' or 'linear'
        Controls are held over an interval or run linearly through it.
    tolerance : float
        Largest allowed error of the plan when flown again, as a fraction of each state's range
        (of 1, in SI units, for states that move less).
    max_wall_time : float [s]

    Raises
    ------
    InputError
        If a name is unknown or a value is out of range.
    """

    name: str
    vehicle: Vehicle
    description: str = ''
    objective: str = 'time'
    duration: tuple[float, float]
    duration_guess: float
    initial: Bounds
    final: Bounds
    path: Bounds = field(default_factory=dict)
    guess: Mapping[str, Sequence[float]] = field(default_factory=dict)
    guess_trajectory: Trajectory | None = None
    wind_ned: Sequence[float] = (0.0, 0.0, 0.0)
    nodes: int = 80
    control_interpolation: Interpolation = 'previous'
    tolerance: float = 1e-4
    max_wall_time: float = 60.0

    def __post_init__(self) -> None:
        model = self.vehicle.model()
        states, controls = model.states, tuple(model.controls)
        self._check_bounds('initial', self.initial, states)
        self._check_bounds('final', self.final, states)
        self._check_bounds('path', self.path, (*states, *controls))
        for name in self.path:
            self.limits(name)  # raises where a bound asks for what the vehicle cannot do
        for name, value in self.guess.items():
            self._check_name('guess', name, (*states, *controls))
            if len(value) == 0 or not all(math.isfinite(v) for v in value):
                raise InputError(f'{self.name}: guess.{name}: must be finite numbers, got {value}')
        lower, upper = self.duration
        if not (0 < lower <= upper < math.inf):
            raise InputError(
                f'{self.name}: duration [{lower:g}, {upper:g}] s must be positive, finite and in '
                'order'
            )
        if len(self.wind_ned) != 3 or not all(math.isfinite(w) for w in self.wind_ned):
            raise InputError(
                f'{self.name}: wind_ned must be three finite numbers, got {list(self.wind_ned)}'
            )
        if self.objective not in OBJECTIVES:
            raise InputError(
                f"{self.name}: unknown objective '{self.objective}'"
                f'{suggestion(self.objective, OBJECTIVES)}'
            )
        if self.control_interpolation not in ('previous', 'linear'):
            raise InputError(f'{self.name}: control_interpolation: must be previous or linear')
        if not 2 <= self.nodes <= MAX_NODES:
            raise InputError(f'{self.name}: nodes must be 2 to {MAX_NODES}, got {self.nodes}')
        if not 1e-12 <= self.tolerance <= 1:
            raise InputError(f'{self.name}: tolerance must be 1e-12 to 1, got {self.tolerance:g}')
        if not 0 < self.max_wall_time < math.inf:
            raise InputError(
                f'{self.name}: max_wall_time must be positive, got {self.max_wall_time:g} s'
            )

    def _check_name(self, group: str, name: str, known: Collection[str]) -> None:
        if name not in known:
            raise InputError(f"{self.name}: {group}: unknown '{name}'{suggestion(name, known)}")

    def _check_bounds(self, group: str, given: Bounds, known: Collection[str]) -> None:
        for name, (lower, upper) in given.items():
            self._check_name(group, name, known)
            if math.isnan(lower) or math.isnan(upper) or lower > upper:
                raise InputError(
                    f'{self.name}: {group}.{name}: [{lower:g}, {upper:g}] is not a range '
                    'from lower to upper'
                )
            singular = self.vehicle.model().dynamics.singular_at.get(name)
            if singular is not None and lower == upper == singular:
                raise InputError(
                    f'{self.name}: {group}.{name}: {self.vehicle.model_name} is singular at '
                    f'{name} = {singular:g}: keep away from it, if only by a little'
                )
            path_lower, path_upper = self.path.get(name, (-math.inf, math.inf))
            if lower > path_upper or upper < path_lower:
                raise InputError(
                    f'{self.name}: {group}.{name}: [{lower:g}, {upper:g}] lies outside the path '
                    f'bounds [{path_lower:g}, {path_upper:g}]'
                )

    def limits(self, name: str) -> tuple[float, float]:
        """Return the bounds of a state or control along the path, the vehicle's own included.

        Raises
        ------
        InputError
            If the two leave nothing.
        """
        lower, upper = self.path.get(name, (-math.inf, math.inf))
        own_lower, own_upper = self.vehicle.model().controls.get(name, (-math.inf, math.inf))
        if max(lower, own_lower) > min(upper, own_upper):
            raise InputError(
                f'{self.name}: path.{name}: [{lower:g}, {upper:g}] lies outside what '
                f'{self.vehicle.name} can do, [{own_lower:g}, {own_upper:g}]'
            )
        return max(lower, own_lower), min(upper, own_upper)

    def with_changes(
        self,
        *,
        initial: Bounds | None = None,
        final: Bounds | None = None,
        path: Bounds | None = None,
        **changes: Any,
    ) -> 'Problem':
        """Return the problem with named bounds and other fields replaced, checked again."""
        return replace(
            self,
            initial={**self.initial, **(initial or {})},
            final={**self.final, **(final or {})},
            path={**self.path, **(path or {})},
            **changes,
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
        _apply(document, setting)
    return _problem(path, check_keys(document, KEYS, str(path)), config_dir)


def _apply(document: dict[str, Any], setting: str) -> None:
    key, equals, value = setting.partition('=')
    if not equals or not key:
        raise InputError(f"--set {setting}: expected KEY=VALUE, such as 'final.x_e=2'")
    *parents, last = key.split('.')
    node: Any = document
    for parent in parents:
        node = node.setdefault(parent, {})
        if not isinstance(node, dict):
            raise InputError(f'--set {setting}: {parent} is not a mapping')
    node[last] = parse_yaml(value, f'--set {setting}')


def _problem(path: Path, document: dict[str, Any], config_dir: str | Path | None) -> Problem:
    for key in ('vehicle', 'duration'):
        if key not in document:
            raise InputError(f"{path}: '{key}' is missing")

    def named(key: str) -> dict[str, Any]:
        value = document.get(key, {})
        if not isinstance(value, Mapping):
            raise InputError(f'{path}: {key}: expected names and values, got {value!r}')
        return {str(k): v for k, v in value.items()}

    duration_keys = ('lower', 'upper', 'guess')
    duration = check_keys(document['duration'], duration_keys, f'{path}: duration')
    for key in duration_keys:
        if key not in duration:
            raise InputError(f"{path}: duration: '{key}' is missing")
    times = {k: number(v, f'{path}: duration.{k}') for k, v in duration.items()}
    defaults = Problem.__dataclass_fields__
    wind = document.get('wind_ned', [0, 0, 0])
    if not isinstance(wind, list):
        raise InputError(f'{path}: wind_ned: expected [north, east, down], got {wind!r}')
    return Problem(
        name=path.stem,
        vehicle=load_vehicle(text(document['vehicle'], f'{path}: vehicle'), config_dir),
        description=text(document.get('description', ''), f'{path}: description'),
        objective=text(document.get('objective', 'time'), f'{path}: objective'),
        duration=(times['lower'], times['upper']),
        duration_guess=times['guess'],
        initial={k: bounds(v, f'{path}: initial.{k}') for k, v in named('initial').items()},
        final={k: bounds(v, f'{path}: final.{k}') for k, v in named('final').items()},
        path={k: bounds(v, f'{path}: path.{k}') for k, v in named('path').items()},
        guess={k: _points(v, f'{path}: guess.{k}') for k, v in named('guess').items()},
        wind_ned=tuple(number(w, f'{path}: wind_ned') for w in wind),
        nodes=whole_number(
            document.get('nodes', defaults['nodes'].default),
            f'{path}: nodes',
            lower=2,
            upper=MAX_NODES,
        ),
        control_interpolation=document.get('control_interpolation', 'previous'),
        tolerance=number(
            document.get('tolerance', defaults['tolerance'].default), f'{path}: tolerance'
        ),
        max_wall_time=number(
            document.get('max_wall_time', defaults['max_wall_time'].default),
            f'{path}: max_wall_time',
        ),
    )


def _points(value: Any, where: str) -> tuple[float, ...]:
    values = value if isinstance(value, list) else [value]
    return tuple(number(v, where) for v in values)
