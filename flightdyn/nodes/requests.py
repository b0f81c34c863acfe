"""What clients ask of the planner, checked before any work is done."""

from typing import Any

import numpy as np

from ..config import suggestion
from ..dynamics.stage import Stage
from ..errors import InputError
from ..planning.problem import Problem
from ..planning.problem_file import load_problem
from ..resources import find_config
from ..trajectory import Columns
from ..vehicles.vehicle import Vehicle, load_vehicle
from .convert import (
    bounds_from_msgs,
    flat_table,
    table,
    trajectory_from_message,
)

MAX_GUESS = 100_000  # values of a guess; far above what the finest mesh takes
MAX_POINTS = 100_000  # of one evaluation; a response of a few tens of MB
MAX_STAGES = 16


def problem_of_goal(goal: Any, config_dir: str, max_wall_time: float) -> Problem:
    """Return the problem that a PlanTrajectory goal asks for.

    Parameters
    ----------
    config_dir : str
        Searched before the installed configuration; may be empty.
    max_wall_time : float
        Most that a goal may take [s].

    Raises
    ------
    InputError
        If a name is unknown, or a value is malformed or over a limit.
    """
    find_config('problems', goal.problem, config_dir)  # a name: paths are not opened for clients
    problem = load_problem(goal.problem, (), config_dir)
    changes: dict[str, Any] = {'max_wall_time': min(problem.max_wall_time, max_wall_time)}
    if goal.duration_lower != 0 or goal.duration_upper != 0:
        changes['duration'] = (float(goal.duration_lower), float(goal.duration_upper))
    if len(goal.wind_ned):
        changes['wind_ned'] = tuple(float(w) for w in goal.wind_ned)
    if goal.nodes:
        changes['nodes'] = int(goal.nodes)
    if goal.tolerance != 0:
        changes['tolerance'] = float(goal.tolerance)
    if goal.max_wall_time != 0:
        if goal.max_wall_time > max_wall_time:
            raise InputError(
                f"max_wall_time {goal.max_wall_time:g} s is over the planner's limit, "
                f'{max_wall_time:g} s'
            )
        changes['max_wall_time'] = float(goal.max_wall_time)
    if len(goal.guess.time):
        changes['guess_trajectory'] = _guess(goal.guess, problem)
    return problem.with_changes(
        initial=bounds_from_msgs(goal.initial_bounds, 'initial_bounds'),
        final=bounds_from_msgs(goal.final_bounds, 'final_bounds'),
        path=bounds_from_msgs(goal.path_bounds, 'path_bounds'),
        **changes,
    )


def _guess(message: Any, problem: Problem) -> Any:
    sizes = [len(message.time), len(message.states), len(message.controls), len(message.outputs)]
    if max(sizes) > MAX_GUESS:
        raise InputError(f'guess: over {MAX_GUESS} values')
    guess = trajectory_from_message(message)
    model = problem.vehicle.model()
    for group, known in (('states', model.states), ('controls', tuple(model.controls))):
        for name in getattr(guess, group):
            if name not in known:
                raise InputError(f"guess: {group}: unknown '{name}'{suggestion(name, known)}")
    return guess


def evaluate_model(request: Any, config_dir: str, response: Any) -> None:
    """Fill an EvaluateModel response: derivatives and outputs at the request's points, no wind.

    Raises
    ------
    InputError
        If the vehicle or a name is unknown, one is missing, or sizes do not fit.
    """
    vehicle = load_vehicle(request.vehicle, config_dir)
    stage = _stage(vehicle)
    states = table(request.state_names, request.states, 'states')
    controls = table(request.control_names, request.controls, 'controls')
    _check_names(vehicle.name, 'states', tuple(states), stage.states)
    _check_names(vehicle.name, 'controls', tuple(controls), stage.controls)
    n = _size(states)
    if stage.controls and _size(controls) != n:
        raise InputError(f'{n} rows of states, {_size(controls)} of controls')
    if not 1 <= n <= MAX_POINTS:
        raise InputError(f'{n} points: must be 1 to {MAX_POINTS}')
    x = np.array([states[name] for name in stage.states])
    u = np.array([controls[name] for name in stage.controls]).reshape(-1, n)
    dx, outputs = stage.function(x, u, np.zeros((stage.function.size1_in(2), n)))
    derivatives = dict(zip(stage.states, dx.full(), strict=True))
    found = dict(zip(stage.outputs, outputs.full(), strict=True))
    response.state_derivatives = flat_table({name: derivatives[name] for name in states})
    response.output_names = list(found)
    response.outputs = flat_table(found)


_stages: dict[str, Stage] = {}


def _stage(vehicle: Vehicle) -> Stage:
    """Return the traced model; traced again only when the vehicle's file has changed."""
    key = repr(vehicle)
    if key not in _stages:
        while len(_stages) >= MAX_STAGES:
            _stages.pop(next(iter(_stages)))
        _stages[key] = vehicle.model().stage()
    return _stages[key]


def _size(columns: Columns) -> int:
    return next((int(values.size) for values in columns.values()), 0)


def _check_names(vehicle: str, group: str, given: tuple[str, ...], known: tuple[str, ...]) -> None:
    for name in given:
        if name not in known:
            raise InputError(f"{vehicle}: {group}: unknown '{name}'{suggestion(name, known)}")
    missing = [name for name in known if name not in given]
    if missing:
        raise InputError(f'{vehicle}: {group}: missing {", ".join(missing)}')
