"""What messages ask of the planner, checked as far as that takes no physics."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import InputError
from ..frames import euler_from_rotation, rotation_from_quaternion
from .convert import (
    bounds_from_msgs,
    from_message_unit,
    nanoseconds,
    table,
    trajectory_from_message,
)
from .replanner import Sample
from .requests import EvaluateRequest, PlanRequest

MAX_GUESS = 100_000  # values of a guess; far above what the finest mesh takes
MAX_POINTS = 100_000  # of one evaluation; a response of a few tens of MB
MAX_NAME = 200  # characters
MAX_BOUNDS = 1000
TOLD = (
    *('x_e', 'y_e', 'z_e', 'u_e', 'v_e', 'w_e', 'p', 'q', 'r', 'speed', 'gamma', 'track'),
    *('bank', 'alpha', 'beta', 'airspeed'),
)
"""What a VehicleState says beside the model's own states and the attitude."""


def request_of_goal(goal: Any, most_wall_time: float) -> PlanRequest:
    """Return what a PlanTrajectory goal asks for; names are not looked up yet.

    Parameters
    ----------
    most_wall_time : float
        Most that a goal may take [s].

    Raises
    ------
    InputError
        If a value is malformed or over a limit.
    """
    check_name(goal.problem, 'problem')
    bounds: dict[str, Any] = {}
    for group in ('initial', 'final', 'path'):
        items = getattr(goal, f'{group}_bounds')
        if len(items) > MAX_BOUNDS:
            raise InputError(f'{group}_bounds: {len(items)} entries, at most {MAX_BOUNDS}')
        for item in items:
            check_name(item.name, f'{group}_bounds')
        bounds[group] = bounds_from_msgs(items, f'{group}_bounds')
    if goal.max_wall_time > most_wall_time:
        raise InputError(
            f"max_wall_time {goal.max_wall_time:g} s is over the planner's limit, "
            f'{most_wall_time:g} s'
        )
    if len(goal.wind_ned) not in (0, 3):
        raise InputError(f'wind_ned: must be three numbers or none, got {len(goal.wind_ned)}')
    guess = None
    message = goal.guess
    sizes = [len(getattr(message, name)) for name in ('time', 'states', 'controls', 'outputs')]
    if max(sizes) > MAX_GUESS:
        raise InputError(f'guess: {max(sizes)} values, at most {MAX_GUESS}')
    if sizes[0]:
        guess = trajectory_from_message(message)
    elif max(sizes):
        raise InputError('guess: has values but no times')
    timed = goal.duration_lower != 0 or goal.duration_upper != 0
    return PlanRequest(
        problem=goal.problem,
        **bounds,
        duration=(float(goal.duration_lower), float(goal.duration_upper)) if timed else None,
        wind_ned=tuple(map(float, goal.wind_ned)) if len(goal.wind_ned) else None,
        guess=guess,
        nodes=int(goal.nodes) if goal.nodes else None,
        tolerance=float(goal.tolerance) if goal.tolerance != 0 else None,
        max_wall_time=float(goal.max_wall_time) if goal.max_wall_time != 0 else None,
        most_wall_time=most_wall_time,
    )


def evaluation_of_message(message: Any) -> EvaluateRequest:
    """Return what an EvaluateModel request asks for; names are not looked up yet.

    Raises
    ------
    InputError
        If a value is malformed or over a limit.
    """
    check_name(message.vehicle, 'vehicle')
    for group in ('state_names', 'control_names'):
        for name in getattr(message, group):
            check_name(name, group)
    most = MAX_POINTS * max(len(message.state_names), len(message.control_names), 1)
    if max(len(message.states), len(message.controls)) > most:
        raise InputError(f'points: at most {MAX_POINTS}')
    if len(message.wind_ned) not in (0, 3) or not np.isfinite(message.wind_ned).all():
        raise InputError('wind_ned: must be three finite numbers or none')
    states = table(message.state_names, message.states, 'states')
    controls = table(message.control_names, message.controls, 'controls')
    wind = tuple(map(float, message.wind_ned)) or (0.0, 0.0, 0.0)
    return EvaluateRequest(message.vehicle, states, controls, wind)


def sample_from_state_msg(message: Any) -> Sample:
    """Return what a VehicleState says; the model's own states count before all else.

    Raises
    ------
    InputError
        If there are not as many values as names.
    """
    told = {name: from_message_unit(name, getattr(message, name)) for name in TOLD}
    w, x, y, z = map(float, message.q_eb)
    attitude = euler_from_rotation(rotation_from_quaternion((w, x, y, z)))
    told.update(zip(('phi', 'theta', 'psi'), map(float, attitude), strict=True))
    states = _named(message.state_names, message.states, 'states')
    controls = _named(message.control_names, message.controls, 'controls')
    return Sample(
        nanoseconds(message.header.stamp), float(message.time), {**told, **states}, controls
    )


def _named(names: Sequence[str], values: Sequence[float], what: str) -> dict[str, float]:
    if len(names) != len(values):
        raise InputError(f'{what}: {len(values)} values for {len(names)} names')
    return {
        name: from_message_unit(name, value) for name, value in zip(names, values, strict=True)
    }


def check_name(name: str, what: str) -> None:
    """Raise InputError if a name is empty or too long to be one."""
    if not name or len(name) > MAX_NAME:
        said = 'is empty' if not name else f'has {len(name)} characters, at most {MAX_NAME}'
        raise InputError(f'{what}: a name {said}')
