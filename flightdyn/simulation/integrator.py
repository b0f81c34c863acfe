"""Integrating a stage function: fixed-step RK4 for flying, CVODES as the tight reference."""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Literal, get_args

import casadi as cas
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..config import suggestion
from ..dynamics.stage import Stage
from ..errors import InputError
from .events import Event, EventWatch
from .inputs import Controls, Inputs
from .solution import EventRecord, Panels, Solution
from .steppers import Cvodes, RungeKutta4, Stepper, cvodes, runge_kutta_step

Array = NDArray[np.float64]
Method = Literal['cvodes', 'rk4']

RELATIVE_TOLERANCE = 1e-10
ABSOLUTE_TOLERANCE = 1e-12
MAX_RK4_STEPS = 1_000_000  # in one flight
MAX_PANELS = 600_000  # in one flight; of CVODES they take half a gigabyte


def rk4_step(stage: Stage, substeps: int = 1) -> cas.Function:
    """Return (x, u0, u1, p, dt) -> x after dt, controls running linearly from u0 to u1.

    Classical fourth-order Runge-Kutta in equal `substeps`; u0 = u1 holds the controls. The time
    among the parameters p is that of the beginning, and advances with the step.
    """
    nx, nu, np_ = (stage.function.size1_in(i) for i in range(3))
    x0 = cas.SX.sym('x', nx)
    u0, u1 = cas.SX.sym('u0', nu), cas.SX.sym('u1', nu)
    p, dt = cas.SX.sym('p', np_), cas.SX.sym('dt')

    def f(fraction: float, x: cas.SX) -> cas.SX:
        parameters = cas.vertcat(p[:-1], p[-1] + fraction * dt)
        return stage.function(x, u0 + (u1 - u0) * fraction, parameters)[0]

    x = x0
    for i in range(substeps):
        times = (i / substeps, (i + 0.5) / substeps, (i + 1) / substeps)
        x = runge_kutta_step(f, x, times, dt / substeps)
    return cas.Function('rk4', [x0, u0, u1, p, dt], [x], ['x', 'u0', 'u1', 'p', 'dt'], ['x_next'])


def reintegrate(
    stage: Stage,
    x0: Sequence[float] | Array,
    time: Array,
    u_begin: Array,
    u_end: Array,
    wind: Sequence[float] | Array,
) -> Array:
    """Return the states at `time` when flown from x0 with given controls, to tight tolerance.

    Parameters
    ----------
    x0 : array (nx,)
    time : array (n,)
        Increasing; x0 is the state at time[0] [s].
    u_begin, u_end : arrays (nu, n - 1)
        Controls at the beginning and end of each interval, linear between.
    wind : x, y, z [m/s]
        Where the air moves to, earth axes.

    Returns
    -------
    array (nx, n)
        CVODES (variable-order BDF, relative tolerance 1e-10), restarted at each interval so that
        jumps of the controls cost no accuracy. NaN after time[0] if the flight cannot be
        integrated to the end.
    """
    inputs = Inputs(stage, dict.fromkeys(stage.controls, 0.0), wind)
    interval = cvodes(
        inputs, np.ones(1), RELATIVE_TOLERANCE, ABSOLUTE_TOLERANCE, max_num_steps=100_000
    )
    winds = np.repeat(inputs.wind[:, None], time.size - 1, axis=1)
    ends = (time[:-1], time[1:])
    p = np.vstack([u_begin, u_end, *ends, winds, time[:-1], np.diff(time)])
    states = np.full((len(stage.states), time.size), np.nan)
    states[:, 0] = x0
    for k in range(time.size - 1):
        flown = interval(states[:, k], p[:, k])
        if flown is None:
            break
        states[:, k + 1] = flown[:, 0]
    return states


def integrate(
    stage: Stage,
    x0: Mapping[str, float] | ArrayLike,
    time_span: tuple[float, float],
    *,
    controls: Controls | None = None,
    wind: Sequence[float] | Array = (0.0, 0.0, 0.0),
    breaks: Sequence[float] | Array = (),
    method: Method = 'cvodes',
    max_step: float | None = None,
    rtol: float = RELATIVE_TOLERANCE,
    atol: float = ABSOLUTE_TOLERANCE,
    events: Sequence[Event] = (),
    t_eval: ArrayLike | None = None,
) -> Solution:
    """Return the flight from a state, until the end of a time span or a terminal event.

    Parameters
    ----------
    stage : Stage
    x0 : mapping of state name to value, or array (nx,)
        State at the begin of the span; states not named are `stage.rest`.
    time_span : begin, end [s]
    controls : mapping, Trajectory, CasADi Function of time, or function of time
        Held values by name; a trajectory's controls as they run, held beyond its ends; a
        CasADi Function t -> (nu, 1); or a Python function t -> values by name or in order,
        which is called for every evaluation of the equations and hence slow.
    wind : x, y, z [m/s]
        Where the air moves to, earth axes; the model's own wind comes on top.
    breaks : times [s]
        Where controls given as a function jump or bend; those of a trajectory are known.
    method : 'cvodes' or 'rk4'
        CVODES' variable-order BDF, also for stiff flights, or Runge-Kutta steps of equal length.
        Both start anew at each break, so that jumps of the controls cost no accuracy.
    max_step : float
        Longest step [s]; must be given for 'rk4'.
    rtol, atol : float
        CVODES' tolerances of the error in each step.
    events : sequence of Event
    t_eval : array (n,)
        Increasing times [s] within the span of the solution's `time` and `states`.

    Raises
    ------
    InputError
        If a name is unknown, a value is not finite, or times do not increase; if the flight
        cannot be integrated to its end: the message has the time reached and the state there.
    """
    start = _initial_state(stage, x0)
    begin, end = (float(t) for t in time_span)
    if not (math.isfinite(begin) and math.isfinite(end) and begin < end):
        raise InputError(f'time_span must be two finite, increasing times, got {time_span}')
    wanted = None if t_eval is None else _evaluation_times(t_eval, begin, end)
    inputs = Inputs(stage, controls, wind, breaks)
    stepper = _stepper(method, inputs, max_step, rtol, atol, end - begin)
    panels, records, terminated_by = _fly(stepper, inputs, events, start, begin, end)
    time = panels.times
    if wanted is not None:
        time = wanted[wanted <= panels.edges[-1]]
    return Solution(
        stage=stage,
        time=time,
        states=panels.states if wanted is None else panels(time),
        events=tuple(records),
        terminated_by=terminated_by,
        panels=panels,
        inputs=inputs,
    )


def _fly(
    stepper: Stepper,
    inputs: Inputs,
    events: Sequence[Event],
    start: Array,
    begin: float,
    end: float,
) -> tuple[Panels, list[EventRecord], str | None]:
    """Return the flight, the events in it, and the name of the one that ended it."""
    watch = EventWatch(events, inputs, begin)
    parts: list[Panels] = []
    records: list[EventRecord] = []
    state, count = start, 0
    for piece_begin, piece_end, q in inputs.pieces(begin, end):
        time = piece_begin
        while time < piece_end:
            panels = stepper.advance(state, time, piece_end, q)
            found, panels, terminated_by = watch.look(panels, q, partial(stepper.fly, q=q))
            parts.append(panels)
            records.extend(found)
            if terminated_by is not None:
                return Panels.joined(parts), records, terminated_by
            time, state = float(panels.edges[-1]), panels.states[:, -1]
            count += panels.edges.size - 1
            if count > MAX_PANELS:
                raise InputError(
                    f'the flight took {count} panels until {time:.9g} s: fly a shorter span, '
                    'with longer steps or larger tolerances'
                )
    return Panels.joined(parts), records, None


def _initial_state(stage: Stage, x0: Mapping[str, float] | ArrayLike) -> Array:
    if isinstance(x0, Mapping):
        for name in x0:
            if name not in stage.states:
                raise InputError(f"unknown state '{name}'{suggestion(name, stage.states)}")
        rest = zip(stage.states, stage.rest, strict=True)
        x0 = [float(x0.get(name, value)) for name, value in rest]
    state = np.array(x0, dtype=float)
    if state.shape != (len(stage.states),):
        raise InputError(
            f'the state has {len(stage.states)} values ({", ".join(stage.states)}), '
            f'got an array of shape {state.shape}'
        )
    if not np.isfinite(state).all():
        index = int(np.argmin(np.isfinite(state)))
        raise InputError(f'initial {stage.states[index]} is {state[index]}: must be finite')
    return state


def _evaluation_times(t_eval: ArrayLike, begin: float, end: float) -> Array:
    times = np.asarray(t_eval, dtype=float)
    if times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
        raise InputError('t_eval must be a 1-D array of finite, increasing times')
    if times.size and not begin <= times[0] <= times[-1] <= end:
        raise InputError(
            f't_eval runs from {times[0]:.9g} s to {times[-1]:.9g} s, '
            f'beyond the span from {begin:.9g} s to {end:.9g} s'
        )
    return times


def _stepper(
    method: str, inputs: Inputs, max_step: float | None, rtol: float, atol: float, span: float
) -> Stepper:
    if method not in get_args(Method):
        raise InputError(f"unknown method '{method}'{suggestion(method, get_args(Method))}")
    if max_step is not None and not max_step > 0:
        raise InputError(f'max_step must be positive, got {max_step}')
    if method == 'cvodes':
        if not (0 < rtol < 1 and 0 < atol < math.inf):
            raise InputError(f'rtol {rtol} and atol {atol} must be positive, rtol below 1')
        return Cvodes(inputs, rtol, atol, max_step)
    if max_step is None:
        raise InputError("method 'rk4' has steps of equal length: give max_step in seconds")
    if span / max_step > MAX_RK4_STEPS:
        raise InputError(
            f'{span:g} s in steps of {max_step:g} s are more than {MAX_RK4_STEPS} steps'
        )
    return RungeKutta4(inputs, max_step)
