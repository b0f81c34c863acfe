"""Integrating a stage function: fixed-step RK4 for flying, CVODES as the tight reference."""

from collections.abc import Sequence

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from ..dynamics.stage import Stage

Array = NDArray[np.float64]

RELATIVE_TOLERANCE = 1e-10
ABSOLUTE_TOLERANCE = 1e-12


def rk4_step(stage: Stage, substeps: int = 1) -> cas.Function:
    """Return (x, u0, u1, p, dt) -> x after dt, controls running linearly from u0 to u1.

    Classical fourth-order Runge-Kutta in equal `substeps`; u0 = u1 holds the controls.
    """
    nx, nu, np_ = (stage.function.size1_in(i) for i in range(3))
    x0 = cas.SX.sym('x', nx)
    u0, u1 = cas.SX.sym('u0', nu), cas.SX.sym('u1', nu)
    p, dt = cas.SX.sym('p', np_), cas.SX.sym('dt')
    h = dt / substeps

    def f(x: cas.SX, fraction: float) -> cas.SX:
        return stage.function(x, u0 + (u1 - u0) * fraction, p)[0]

    x = x0
    for i in range(substeps):
        begin, middle, end = i / substeps, (i + 0.5) / substeps, (i + 1) / substeps
        k1 = f(x, begin)
        k2 = f(x + h / 2 * k1, middle)
        k3 = f(x + h / 2 * k2, middle)
        k4 = f(x + h * k3, end)
        x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return cas.Function('rk4', [x0, u0, u1, p, dt], [x], ['x', 'u0', 'u1', 'p', 'dt'], ['x_next'])


def reintegrate(
    stage: Stage,
    x0: Sequence[float] | Array,
    time: Array,
    u_begin: Array,
    u_end: Array,
    p: Sequence[float] | Array,
) -> Array:
    """Return the states at `time` when flown from x0 with given controls, to tight tolerance.

    Parameters
    ----------
    x0 : array (nx,)
    time : array (n,)
        Increasing; x0 is the state at time[0].
    u_begin, u_end : arrays (nu, n - 1)
        Controls at the beginning and end of each interval, linear between.
    p : array (np,)

    Returns
    -------
    array (nx, n)
        CVODES (variable-order BDF, relative tolerance 1e-10), restarted at each interval so that
        jumps of the controls cost no accuracy.
    """
    nx, nu, np_ = (stage.function.size1_in(i) for i in range(3))
    x = cas.SX.sym('x', nx)
    tau, parameters = cas.SX.sym('tau'), cas.SX.sym('p', 2 * nu + np_ + 1)
    u0, u1, wind, dt = cas.vertsplit(parameters, [0, nu, 2 * nu, 2 * nu + np_, 2 * nu + np_ + 1])
    dx, _ = stage.function(x, u0 + (u1 - u0) * tau, wind)
    interval = cas.integrator(
        'interval',
        'cvodes',
        {'x': x, 't': tau, 'p': parameters, 'ode': dt * dx},
        0,
        1,
        {'reltol': RELATIVE_TOLERANCE, 'abstol': ABSOLUTE_TOLERANCE, 'max_num_steps': 100_000},
    )
    states = [np.asarray(x0, float)]
    for k, step in enumerate(np.diff(time)):
        values = np.concatenate([u_begin[:, k], u_end[:, k], np.asarray(p, float), [step]])
        states.append(interval(x0=states[-1], p=values)['xf'].full().ravel())
    return np.array(states).T
