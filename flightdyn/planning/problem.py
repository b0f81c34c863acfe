"""What is to be planned: vehicle, conditions, objective, duration, wind, guess."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from ..config import (
    check_keys,
    load_yaml,
    number,
    parse_yaml,
    suggestion,
    text,
    whole_number,
)
from ..dynamics.stage import KINEMATICS, Model, Stage
from ..errors import InputError
from ..resources import find_config
from ..trajectory import Interpolation, Trajectory
from ..vehicles.fields import IN_DEGREES, in_degrees, named_bounds
from ..vehicles.vehicle import Vehicle, load_vehicle
from .objective import TIME, Objective, parse_objective, trace

Bounds = Mapping[str, tuple[float, float]]

MAX_STAGES = 16
MAX_NODES = 5000
UNBOUNDED = (-math.inf, math.inf)
KEYS = (
    *('description', 'vehicle', 'model', 'objective', 'duration'),
    *(
        'initial',
        'final',
        'path',
        'guess',
        'wind_ned',
        'nodes',
        'control_interpolation',
        'tolerance',
        'max_wall_time',
    ),
)


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A trajectory-optimization problem, apart from the method that solves it.

    Parameters
    ----------
    objective : Objective
        Least duration unless given: `minimize('final.mass')`, `maximize('final.x_e')`.
    duration : lower, upper [s]
        The same twice fixes it.
    duration_guess : float [s]
    initial, final : mapping of state, control or output name to (lower, upper)
        What is not named is free. `altitude` stands for -z_e here and below, and is kept as z_e.
    path : mapping of state, control or output name to (lower, upper)
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
    objective: Objective = TIME
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
        for group in ('initial', 'final', 'path'):
            object.__setattr__(self, group, self._down(group, getattr(self, group)))
        for group in ('path', 'initial', 'final'):
            self._check_bounds(group)
        self._check_guess()
        if self.objective != TIME:
            trace(self.objective, self.stage, [1.0] * len(self.stage.controls))
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

    @cached_property
    def model(self) -> Model:
        """The vehicle's physics."""
        return self.vehicle.model()

    @property
    def stage(self) -> Stage:
        """The vehicle's traced physics."""
        return _stage(self.vehicle)

    def _check_name(self, group: str, name: str, known: Collection[str]) -> None:
        if name not in known:
            raise InputError(f"{self.name}: {group}: unknown '{name}'{suggestion(name, known)}")

    def _down(self, group: str, given: Bounds) -> dict[str, tuple[float, float]]:
        """Return bounds with those of `altitude` as bounds of z_e."""
        if 'altitude' not in given:
            return dict(given)
        if 'z_e' in given:
            raise InputError(
                f'{self.name}: {group}: give altitude or z_e: the one is minus the other'
            )
        lower, upper = given['altitude']
        rest = {name: value for name, value in given.items() if name != 'altitude'}
        return {**rest, 'z_e': (0.0 - upper, 0.0 - lower)}

    def _check_guess(self) -> None:
        if 'altitude' in self.guess:
            if 'z_e' in self.guess:
                raise InputError(
                    f'{self.name}: guess: give altitude or z_e: the one is minus the other'
                )
            rest = {name: value for name, value in self.guess.items() if name != 'altitude'}
            down = tuple(0.0 - v for v in self.guess['altitude'])
            object.__setattr__(self, 'guess', {**rest, 'z_e': down})
        for name, value in self.guess.items():
            self._check_name('guess', name, (*self.model.states, *self.model.controls))
            if len(value) == 0 or not all(math.isfinite(v) for v in value):
                raise InputError(f'{self.name}: guess.{name}: must be finite numbers, got {value}')

    def _check_bounds(self, group: str) -> None:
        model = self.model
        for name, (lower, upper) in getattr(self, group).items():
            # what a vehicle puts out is known after tracing it, which may take a while
            if name not in (*model.states, *model.controls, *KINEMATICS):
                self._check_name(group, name, self._quantities)
            if math.isnan(lower) or math.isnan(upper) or lower > upper:
                raise InputError(
                    f'{self.name}: {group}.{name}: [{lower:g}, {upper:g}] is not a range '
                    'from lower to upper'
                )
            singular = model.dynamics.singular_at.get(name)
            if singular is not None and lower == upper == singular:
                raise InputError(
                    f'{self.name}: {group}.{name}: {self.vehicle.model_name} is singular at '
                    f'{name} = {singular:g}: keep away from it, if only by a little'
                )
            for bounds, whose in (
                (self.path.get(name, UNBOUNDED), 'the path bounds'),
                (self._own.get(name, UNBOUNDED), f'what {self.vehicle.name} can do,'),
            ):
                if lower > bounds[1] or upper < bounds[0]:
                    raise InputError(
                        f'{self.name}: {group}.{name}: [{lower:g}, {upper:g}] lies outside '
                        f'{whose} [{bounds[0]:g}, {bounds[1]:g}]'
                    )

    @property
    def _quantities(self) -> tuple[str, ...]:
        stage = self.stage
        return (*stage.states, *stage.controls, *stage.outputs)

    @cached_property
    def _own(self) -> dict[str, tuple[float, float]]:
        """What the vehicle can do and stand, and where its aerodynamics are known."""
        found: dict[str, tuple[float, float]] = {}
        for group in (self.model.controls, self.vehicle.limits, self.vehicle.box):
            for name, given in self._down('limits', group).items():
                found[name] = _common(found.get(name, UNBOUNDED), given)
        return found

    @property
    def bounded(self) -> dict[str, tuple[float, float]]:
        """Bounds along the path of every quantity that has some, the vehicle's own included."""
        names = {**self.path, **self._own}
        known = self._quantities if set(names) - set(self.model.states) else self.model.states
        every = {name: self.limits(name) for name in names if name in known}
        return {name: limits for name, limits in every.items() if limits != UNBOUNDED}

    def limits(self, name: str) -> tuple[float, float]:
        """Return the bounds of a quantity along the path, the vehicle's own included."""
        return _common(self.path.get(name, UNBOUNDED), self._own.get(name, UNBOUNDED))

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
            initial={**self.initial, **self._down('initial', initial or {})},
            final={**self.final, **self._down('final', final or {})},
            path={**self.path, **self._down('path', path or {})},
            **changes,
        )


def _common(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    return max(a[0], b[0]), min(a[1], b[1])


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

    defaults = Problem.__dataclass_fields__
    wind = document.get('wind_ned', [0, 0, 0])
    if not isinstance(wind, list):
        raise InputError(f'{path}: wind_ned: expected [north, east, down], got {wind!r}')
    lower, upper, guess = _duration(document['duration'], f'{path}: duration')
    return Problem(
        name=path.stem,
        vehicle=_vehicle(path, document, config_dir),
        description=text(document.get('description', ''), f'{path}: description'),
        objective=parse_objective(document.get('objective', 'time'), f'{path}: objective'),
        duration=(lower, upper),
        duration_guess=guess,
        initial={
            k: named_bounds(k, v, f'{path}: initial.{k}') for k, v in named('initial').items()
        },
        final={k: named_bounds(k, v, f'{path}: final.{k}') for k, v in named('final').items()},
        path={k: named_bounds(k, v, f'{path}: path.{k}') for k, v in named('path').items()},
        guess={k: _points(k, v, f'{path}: guess.{k}') for k, v in named('guess').items()},
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


_stages: dict[str, Stage] = {}


def _stage(vehicle: Vehicle) -> Stage:
    """Return the traced model; traced again only when the vehicle has changed."""
    key = repr(vehicle)
    stage = _stages.get(key)
    if stage is None:
        stage = vehicle.model().stage()
        while len(_stages) >= MAX_STAGES:
            _stages.pop(next(iter(_stages)), None)
        _stages[key] = stage
    return stage
