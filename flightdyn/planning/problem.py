"""What is to be planned: vehicle, conditions, objective, duration, wind, guess."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, Literal

import numpy as np

from ..config import (
    suggestion,
)
from ..dynamics.stage import KINEMATICS, WIND_STRENGTH, Model, Stage
from ..environment.surroundings import NOTHING, Surroundings
from ..environment.wind import Wind
from ..environment.wind_file import wind_document
from ..errors import InputError
from ..trajectory import Trajectory
from ..vehicles.vehicle import Vehicle
from .gates import gate_phases
from .keep_clear import check_surroundings, clear_bounds
from .mesh import (
    CONTROL_INTERPOLATIONS,
    METHODS,
    ControlInterpolation,
    Method,
    Spacing,
    check_spacing,
)
from .objective import TIME, Objective, trace
from .phase import Bounds as Bounds
from .phase import Phase as Phase

MAX_STAGES = 16
MAX_NODES = 5000
UNBOUNDED = (-math.inf, math.inf)
QUATERNION = ('qw', 'qx', 'qy', 'qz')
MAX_PHASES = 50
MAX_STARTS = 1000
MAX_SUBSTEPS = 16
CHOICES: Mapping[str, tuple[str, ...]] = {
    'control_interpolation': CONTROL_INTERPOLATIONS,
    'transcription': ('auto', *METHODS),
}


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A trajectory-optimization problem, apart from the method that solves it.

    Parameters
    ----------
    objective : Objective
        Least duration unless given: `minimize('final.mass')`, `maximize('final.x_e')`.
    phases : sequence of Phase
        Flown in order, each from where the one before ends; none for a flight in one.
    duration : lower, upper [s]
        Of the whole; the same twice fixes it.
    duration_guess : float [s]
        Of a flight in one phase.
    initial, final : mapping of state, control or output name to (lower, upper)
        What is not named is free. `altitude` stands for -z_e here and below, and is kept as z_e.
    path : mapping of state, control or output name to (lower, upper)
        Hold at every node, beside the vehicle's own limits.
    change : mapping of state or control name to (lower, upper)
        By how much the end is off the beginning: 0 for what is periodic. That of `altitude` is up.
    guess : mapping of state or control name to values
        A storyboard: points in equal steps over the duration, linear between.
    guess_trajectory : Trajectory or None
        A guess instead of the storyboard, stretched to the guessed duration.
    wind_ned : x, y, z [m/s]
        Where the air moves to everywhere.
    wind : Wind or None
        What it does beside, by place; one that `environment.wind_file` can write.
    wind_strength : lower, upper, or None
        A factor on `wind`, then a state named like this, to be found within the range.
    surroundings : Surroundings
        Terrain and volumes are kept clear of; gates are flown through in their order, each the
        end of a phase that is made for it, see `gates`.
    nodes : int
        Intervals of the first mesh.
        Of several phases each has its own.
    control_interpolation : 'previous', 'linear' or 'polynomial', see `mesh.Mesh`
        The plan's controls are straight between its samples all the same: polynomials are cut
        into as many lines as they need.
    transcription : 'auto' or a method, see `mesh.Mesh`
        By itself multiple shooting for held controls, Radau collocation for linear ones.
    spacing : 'uniform', 'cosine', or pairs, see `mesh.spaced`
        Of the first mesh.
    substeps : int
        Steps of RK4 in each interval of the first mesh, if it is of multiple shooting.
    multistart : int
        How many guesses plans start from, see `Planner.plan`.
    refine : bool
        Whether the mesh is refined until the plan, flown again, is within the tolerance.
    sharpen : bool
        Whether switches of controls from limit to limit are moved to where they belong: the
        arcs between are planned again with their durations free.
    tolerance : float
        Largest allowed error of the plan when flown again, as a fraction of each state's range
        (of 1, in SI units, for states that move less).
    max_wall_time : float [s]
    alternatives : pairs of name and Problem
        To be planned instead, the best of which is wanted: then this problem itself is not. They
        are minimized or maximized alike.
    aside : names
        Outputs whose bounds are left out, see `without_limits`.

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
    change: Bounds = field(default_factory=dict)
    guess: Mapping[str, Sequence[float]] = field(default_factory=dict)
    guess_trajectory: Trajectory | None = None
    wind_ned: Sequence[float] = (0.0, 0.0, 0.0)
    wind: Wind | None = None
    wind_strength: tuple[float, float] | None = None
    surroundings: Surroundings = NOTHING
    phases: Sequence[Phase] = ()
    nodes: int = 80
    control_interpolation: ControlInterpolation = 'previous'
    transcription: Method | Literal['auto'] = 'auto'
    spacing: Spacing = 'uniform'
    substeps: int = 1
    multistart: int = 1
    refine: bool = True
    sharpen: bool = True
    tolerance: float = 1e-4
    max_wall_time: float = 60.0
    alternatives: Sequence[tuple[str, 'Problem']] = ()
    aside: frozenset[str] = frozenset()

    def __post_init__(self) -> None:
        for group in ('initial', 'final', 'path', 'change'):
            object.__setattr__(self, group, self._down(group, getattr(self, group)))
        self._check_wind()
        object.__setattr__(self, 'guess', self._down_guess('guess', self.guess))
        if self.surroundings:
            self._enter_surroundings()
        self._check_phases()
        self._check_change()
        for where, leg in zip(self._places, self.legs, strict=True):
            for group in ('path', 'initial', 'final'):
                self._check_bounds(f'{where}{group}', getattr(leg, group), leg)
        if self.objective != TIME:
            _check_objective(self.objective, self.stage, self.phase_names)
        lower, upper = self.duration
        if not (0 < lower <= upper < math.inf):
            raise InputError(
                f'{self.name}: duration [{lower:g}, {upper:g}] s must be positive, finite and in '
                'order'
            )
        for key, known in CHOICES.items():
            if getattr(self, key) not in known:
                raise InputError(
                    f'{self.name}: {key}: must be {" or ".join(known)}, got {getattr(self, key)!r}'
                )
        object.__setattr__(self, 'spacing', check_spacing(self.spacing, f'{self.name}: spacing'))
        for key in ('refine', 'sharpen'):
            if not isinstance(getattr(self, key), bool):
                raise InputError(f'{self.name}: {key}: must be true or false')
        if not 1 <= self.nodes <= MAX_NODES:
            raise InputError(f'{self.name}: nodes must be 1 to {MAX_NODES}, got {self.nodes}')
        if not 1 <= self.substeps <= MAX_SUBSTEPS:
            raise InputError(
                f'{self.name}: substeps must be 1 to {MAX_SUBSTEPS}, got {self.substeps}'
            )
        if not 1 <= self.multistart <= MAX_STARTS:
            raise InputError(
                f'{self.name}: multistart must be 1 to {MAX_STARTS}, got {self.multistart}'
            )
        if not 1e-12 <= self.tolerance <= 1:
            raise InputError(f'{self.name}: tolerance must be 1e-12 to 1, got {self.tolerance:g}')
        for name, each in self.alternatives:
            if each.objective.sign != self.objective.sign or each.alternatives:
                raise InputError(
                    f'{self.name}: alternatives.{name}: must be minimized or maximized as the '
                    'problem is, and have no alternatives of its own'
                )
        if not 0 < self.max_wall_time < math.inf:
            raise InputError(
                f'{self.name}: max_wall_time must be positive, got {self.max_wall_time:g} s'
            )

    @cached_property
    def model(self) -> Model:
        """The vehicle's physics, in the wind and the surroundings of the problem."""
        model = self.vehicle.model(self.wind, free_wind=self.wind_strength is not None)
        return replace(model, surroundings=self.surroundings)

    @cached_property
    def stage(self) -> Stage:
        """The vehicle's traced physics."""
        return _stage(self.physics, self.model)

    @cached_property
    def physics(self) -> str:
        """What tells this problem's stage from others."""
        wind = wind_document(self.wind), self.wind_strength is not None
        return f'{self.vehicle!r} {wind} {self.surroundings!r}'

    def _check_wind(self) -> None:
        if len(self.wind_ned) != 3 or not all(math.isfinite(w) for w in self.wind_ned):
            raise InputError(
                f'{self.name}: wind_ned must be three finite numbers, got {list(self.wind_ned)}'
            )
        wind_document(self.wind)
        if self.wind_strength is not None:
            if self.wind is None:
                raise InputError(f'{self.name}: wind_strength: there is no wind to multiply')
            lower, upper = self.wind_strength
            if not lower <= upper:
                raise InputError(
                    f'{self.name}: wind_strength: [{lower:g}, {upper:g}] is not a range'
                )

    def _check_change(self) -> None:
        model = self.model
        for name, (lower, upper) in self.change.items():
            self._check_name('change', name, (*model.states, *model.controls))
            if not lower <= upper:
                raise InputError(
                    f'{self.name}: change.{name}: [{lower:g}, {upper:g}] is not a range'
                )

    def _enter_surroundings(self) -> None:
        """Check the problem against its surroundings, and make phases of gates."""
        for axis in ('x_e', 'y_e', 'z_e'):
            if self.surroundings.gates and axis not in self.model.states:
                raise InputError(
                    f'{self.name}: gates: {self.vehicle.model_name} has no state {axis}: fly '
                    'through gates by a model in three dimensions'
                )
        ends = {'initial': self.initial, 'final': self.final}
        check_surroundings(self.name, self.surroundings, ends, self.path)
        if self.surroundings.gates and not self.phases:
            phases = gate_phases(
                self.surroundings.gates,
                self.initial,
                self.final,
                self.duration,
                self.duration_guess,
                self.nodes,
                self.guess,
            )
            object.__setattr__(self, 'phases', phases)

    @cached_property
    def _clear(self) -> Bounds:
        """What the surroundings ask for all the way."""
        states = self.model.states
        return {
            name: bounds
            for name, bounds in clear_bounds(self.surroundings).items()
            if name in states or name not in KINEMATICS
        }

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

    def _down_guess(
        self, group: str, given: Mapping[str, Sequence[float]]
    ) -> dict[str, Sequence[float]]:
        """Return a guess with that of `altitude` as one of z_e."""
        if 'altitude' in given and 'z_e' in given:
            raise InputError(
                f'{self.name}: {group}: give altitude or z_e: the one is minus the other'
            )
        guess = dict(given)
        if 'altitude' in guess:
            guess['z_e'] = tuple(0.0 - v for v in guess.pop('altitude'))
        for name, value in guess.items():
            self._check_name(group, name, (*self.model.states, *self.model.controls))
            if len(value) == 0 or not all(math.isfinite(v) for v in value):
                raise InputError(
                    f'{self.name}: {group}.{name}: must be finite numbers, got {value}'
                )
        return guess

    def _check_phases(self) -> None:
        names = [phase.name for phase in self.phases]
        if len(names) > MAX_PHASES:
            raise InputError(f'{self.name}: phases: at most {MAX_PHASES}, got {len(names)}')
        for name in names:
            if not name.isidentifier() or names.count(name) > 1:
                raise InputError(
                    f"{self.name}: phases: '{name}': each needs a name of its own, of letters, "
                    'digits and underscores'
                )
        changed = []
        for phase in self.phases:
            lower, upper = phase.duration
            if not 0 < lower <= upper < math.inf:
                raise InputError(
                    f'{self.name}: phases.{phase.name}: duration [{lower:g}, {upper:g}] s must be '
                    'positive, finite and in order'
                )
            if not 1 <= phase.nodes <= MAX_NODES:
                raise InputError(
                    f'{self.name}: phases.{phase.name}: nodes must be 1 to {MAX_NODES}, '
                    f'got {phase.nodes}'
                )
            where = f'phases.{phase.name}.'
            bounds: dict[str, Any] = {
                group: self._down(f'{where}{group}', getattr(phase, group))
                for group in ('initial', 'final', 'path')
            }
            guess = self._down_guess(f'{where}guess', phase.guess)
            changed.append(replace(phase, guess=guess, **bounds))
        object.__setattr__(self, 'phases', tuple(changed))

    @property
    def phase_names(self) -> tuple[str, ...]:
        """Names of the phases; an empty one alone for a flight in one."""
        return tuple(phase.name for phase in self.phases) or ('',)

    @property
    def _places(self) -> list[str]:
        return [f'phases.{name}.' if name else '' for name in self.phase_names]

    @cached_property
    def legs(self) -> tuple[Phase, ...]:
        """The phases, each with all that holds in it; one for a flight in one."""
        if not self.phases:
            return (
                Phase(
                    duration=self.duration,
                    duration_guess=self.duration_guess,
                    initial=self._calmed('initial', self.initial),
                    final=self._calmed('final', self.final),
                    path=self._calmed('path', _tightened(self._clear, self.path)),
                    guess=self.guess,
                    nodes=self.nodes,
                ),
            )
        last = len(self.phases) - 1
        return tuple(
            replace(
                phase,
                initial=self._calmed(
                    'initial', _tightened(self.initial if i == 0 else {}, phase.initial)
                ),
                final=self._calmed(
                    'final', _tightened(self.final if i == last else {}, phase.final)
                ),
                path=self._calmed(
                    'path', _tightened(_tightened(self._clear, self.path), phase.path)
                ),
            )
            for i, phase in enumerate(self.phases)
        )

    def _check_bounds(self, group: str, given: Bounds, leg: Phase) -> None:
        model = self.model
        for name, (lower, upper) in given.items():
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
                (leg.path.get(name, UNBOUNDED), 'the path bounds'),
                (self._own.get(name, UNBOUNDED), f'what {self.vehicle.name} can do,'),
            ):
                if lower > bounds[1] or upper < bounds[0]:
                    said = f'{group}.{self._said(group, name)}'
                    raise InputError(
                        f'{self.name}: {said}: [{lower:g}, {upper:g}] lies outside '
                        f'{whose} [{bounds[0]:g}, {bounds[1]:g}]'
                    )

        if group.endswith('final') and all(
            given.get(name, UNBOUNDED)[0] == given.get(name, UNBOUNDED)[1] for name in QUATERNION
        ):
            raise InputError(
                f'{self.name}: {group}: fixes all of {", ".join(QUATERNION)}: their length is 1 '
                'by itself: fix three, and say by a range such as qw: [0, null] which of two it is'
            )

    @property
    def _quantities(self) -> tuple[str, ...]:
        stage = self.stage
        return (*stage.states, *stage.controls, *stage.outputs)

    def _said(self, group: str, name: str) -> str:
        """Return what a bounded quantity is called where it stands: see `_calmed`."""
        kind = group.rpartition('.')[2]
        given = [getattr(each, kind) for each in (self, *self.phases)]
        meant = name == 'speed' and not any('speed' in bounds for bounds in given)
        return 'airspeed' if meant and any('airspeed' in bounds for bounds in given) else name

    def _calmed(self, group: str, given: Bounds) -> Bounds:
        """Return bounds with those of the airspeed as bounds of the speed where air is still.

        A bound of a state costs nothing, one of an output its derivatives.
        """
        still = not any(self.wind_ned) and self.model.wind is None
        if 'airspeed' not in given or not still or 'speed' not in self.model.states:
            return given
        rest = {name: bounds for name, bounds in given.items() if name != 'airspeed'}
        lower, upper = _common(given['airspeed'], rest.get('speed', UNBOUNDED))
        if lower > upper:
            raise InputError(
                f'{self.name}: {group}: airspeed and speed contradict each other: without wind '
                'they are the same'
            )
        return {**rest, 'speed': (lower, upper)}

    @cached_property
    def _own(self) -> dict[str, tuple[float, float]]:
        """What the vehicle can do and stand, and where its aerodynamics are known."""
        found: dict[str, tuple[float, float]] = {}
        if self.wind_strength is not None:
            found[WIND_STRENGTH] = self.wind_strength
        for group in (self.model.controls, self.vehicle.limits, self.vehicle.box):
            for name, given in self._down('limits', group).items():
                found[name] = _common(found.get(name, UNBOUNDED), given)
        return dict(self._calmed('limits', found))

    def bounded(self, leg: int = 0) -> dict[str, tuple[float, float]]:
        """Bounds along a phase of every quantity that has some, the vehicle's own included."""
        path = self.legs[leg].path
        names = {**path, **self._own}
        known = self._quantities if set(names) - set(self.model.states) else self.model.states
        kept = (name for name in names if name in known)
        every = {name: self.limits(name, leg) for name in kept}
        return {name: limits for name, limits in every.items() if limits != UNBOUNDED}

    def without_limits(self) -> 'Problem':
        """Return the problem without those limits of the vehicle's outputs that nobody named.

        Such as of the load factor: flights seldom come near it, and keeping it costs as much as
        a third of a solve. Whoever solves this has to look afterwards, see `beyond_limits`. The
        box of the aerodynamics stays: outside it a solver finds flights that cannot be.
        """
        asked = {
            name
            for leg in self.legs
            for group in (leg.initial, leg.final, leg.path)
            for name in group
        }
        own = {name for name in self._own if name in self.stage.outputs}
        return replace(self, aside=frozenset(own - asked - set(self.vehicle.box)))

    def beyond_limits(self, flight: Trajectory) -> bool:
        """Return whether a flight leaves limits that were set aside."""
        for name in self.aside:
            lower, upper = self._own[name]
            column = flight[name]
            beyond = max(float((lower - column).max()), float((column - upper).max()))
            if beyond > self.tolerance * max(float(np.ptp(column)), 1.0):
                return True
        return False

    def limits(self, name: str, leg: int = 0) -> tuple[float, float]:
        """Return the bounds of a quantity along a phase, the vehicle's own included."""
        if name in self.aside:
            return UNBOUNDED
        return _common(self.legs[leg].path.get(name, UNBOUNDED), self._own.get(name, UNBOUNDED))

    def with_changes(
        self,
        *,
        initial: Bounds | None = None,
        final: Bounds | None = None,
        path: Bounds | None = None,
        **changes: Any,
    ) -> 'Problem':
        """Return the problem with named bounds and other fields replaced, checked again.

        Alternatives are changed alike.
        """
        alternatives = [
            (name, each.with_changes(initial=initial, final=final, path=path, **changes))
            for name, each in self.alternatives
        ]
        return replace(
            self,
            alternatives=tuple(alternatives),
            initial={**self.initial, **self._down('initial', initial or {})},
            final={**self.final, **self._down('final', final or {})},
            path={**self.path, **self._down('path', path or {})},
            **changes,
        )


@lru_cache(maxsize=64)
def _check_objective(objective: Objective, stage: Stage, phases: tuple[str, ...]) -> None:
    """Refuse a formula with names that the stage and the phases do not have."""
    trace(objective, stage, [1.0] * len(stage.controls), phases)


def _tightened(outer: Bounds, inner: Bounds) -> Bounds:
    """Return bounds that keep both."""
    both = {k: _common(outer[k], inner[k]) for k in inner if k in outer}
    return {**outer, **inner, **both}


def _common(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float]:
    return max(a[0], b[0]), min(a[1], b[1])


_stages: dict[str, Stage] = {}


def _stage(key: str, model: Model) -> Stage:
    """Return the traced model; traced again only when it has changed, which its key tells."""
    stage = _stages.get(key)
    if stage is None:
        stage = model.stage()
        while len(_stages) >= MAX_STAGES:
            _stages.pop(next(iter(_stages)), None)
        _stages[key] = stage
    return stage
