"""What clients ask of the planner, as plain data, and checks that take the physics; no ROS."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..config import suggestion
from ..dynamics.stage import Stage
from ..errors import InputError
from ..planning.problem import Bounds, Problem
from ..planning.problem_file import load_problem
from ..resources import find_config
from ..trajectory import Columns, Trajectory
from ..vehicles.vehicle import Vehicle, load_vehicle

Array = NDArray[np.float64]

MAX_STAGES = 16


@dataclass(frozen=True, kw_only=True)
class PlanRequest:
    """A goal of `PlanTrajectory` in the library's units; what is None stays as the problem says.

    Parameters
    ----------
    problem : str
        Name of a configured problem.
    settings : sequence of 'KEY=VALUE'
        Override entries of the problem's file.
    most_wall_time : float
        Limit of whatever the problem says [s].
    """

    problem: str
    settings: tuple[str, ...] = ()
    initial: Bounds = field(default_factory=dict)
    final: Bounds = field(default_factory=dict)
    path: Bounds = field(default_factory=dict)
    duration: tuple[float, float] | None = None
    wind_ned: tuple[float, ...] | None = None
    guess: Trajectory | None = None
    nodes: int | None = None
    tolerance: float | None = None
    max_wall_time: float | None = None
    most_wall_time: float


@dataclass(frozen=True)
class EvaluateRequest:
    """Points (n rows) at which a vehicle's model is asked for, in the library's units."""

    vehicle: str
    states: Columns
    controls: Columns
    wind_ned: tuple[float, ...] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Evaluation:
    """Derivatives, per second, and outputs at those points, columns in the request's order."""

    derivatives: Columns
    outputs: Columns


def problem_of_request(request: PlanRequest, config_dir: str) -> Problem:
    """Return the problem that a request asks for.

    Parameters
    ----------
    config_dir : str
        Searched before the installed configuration; may be empty.

    Raises
    ------
    InputError
        If a name is unknown, or values contradict each other or what the vehicle can do.
    """
    find_config('problems', request.problem, config_dir)  # a name: no client has paths opened
    problem = load_problem(request.problem, request.settings, config_dir)
    changes: dict[str, Any] = {
        name: value
        for name in ('duration', 'wind_ned', 'nodes', 'tolerance')
        if (value := getattr(request, name)) is not None
    }
    wall_time = request.max_wall_time or min(problem.max_wall_time, request.most_wall_time)
    if request.guess is not None:
        model = problem.model
        _check_guess('states', request.guess.states, model.states)
        _check_guess('controls', request.guess.controls, tuple(model.controls))
        changes['guess_trajectory'] = request.guess
    return problem.with_changes(
        initial=request.initial,
        final=request.final,
        path=request.path,
        max_wall_time=wall_time,
        **changes,
    )


def _check_guess(group: str, given: Iterable[str], known: tuple[str, ...]) -> None:
    for name in given:
        if name not in known:
            raise InputError(f"guess: {group}: unknown '{name}'{suggestion(name, known)}")


def evaluate(request: EvaluateRequest, config_dir: str) -> Evaluation:
    """Return derivatives and outputs of a vehicle's model at points.

    Raises
    ------
    InputError
        If the vehicle or a name is unknown, one is missing, or rows do not match.
    """
    vehicle = load_vehicle(request.vehicle, config_dir)
    stage = _stage(vehicle)
    _check_names(vehicle.name, 'states', tuple(request.states), stage.states)
    _check_names(vehicle.name, 'controls', tuple(request.controls), stage.controls)
    n = _size(request.states)
    if n == 0 or (request.controls and _size(request.controls) != n):
        raise InputError(f'{n} rows of states, {_size(request.controls)} of controls')
    x = np.array([request.states[name] for name in stage.states])
    u = np.array([request.controls[name] for name in stage.controls]).reshape(-1, n)
    p = np.zeros((stage.function.size1_in(2), n))
    p[: len(request.wind_ned)] = np.reshape(request.wind_ned, (-1, 1))
    dx, outputs = stage.function(x, u, p)
    derivatives = dict(zip(stage.states, dx.full(), strict=True))
    return Evaluation(
        {name: derivatives[name] for name in request.states},
        dict(zip(stage.outputs, outputs.full(), strict=True)),
    )


_stages: dict[str, Stage] = {}


def _stage(vehicle: Vehicle) -> Stage:
    """Return the traced model; traced again only when the vehicle's file has changed."""
    key = repr(vehicle)
    if key not in _stages:
        while len(_stages) >= MAX_STAGES:
            _stages.pop(next(iter(_stages)))
        _stages[key] = vehicle.model().stage()
    return _stages[key]


def _check_names(vehicle: str, group: str, given: tuple[str, ...], known: tuple[str, ...]) -> None:
    for name in given:
        if name not in known:
            raise InputError(f"{vehicle}: {group}: unknown '{name}'{suggestion(name, known)}")
    missing = [name for name in known if name not in given]
    if missing:
        raise InputError(f'{vehicle}: {group}: missing {", ".join(missing)}')


def _size(columns: Mapping[str, Array]) -> int:
    return next((int(values.size) for values in columns.values()), 0)
