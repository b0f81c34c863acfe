"""Derivatives of the stage function, as solvers take them."""

from collections.abc import Sequence

import casadi as cas

from ..dynamics.stage import Stage

Three = tuple[cas.Function, cas.Function, cas.Function]


def increments(stage: Stage) -> Three:
    """Return what a step of length h adds to the state, and its derivatives.

    With the step's length among the arguments, everything between two stages of a Runge-Kutta
    method is linear.

    Returns
    -------
    increment : Function of (w, wind)
        w is (x, u, time, h), wind (3,); gives h dx/dt (nx,).
    increment_slope : Function of (w, wind)
        The same, and its Jacobian (nx, nw).
    increment_bend : Function of (w, wind, mu)
        Hessian (nw, nw) of the product of multipliers mu (nx,) and the increment: both triangles,
        without the entries that are always 0.
    """
    x, u, p = _symbols(stage)
    h = cas.SX.sym('h')
    return _three('increment', h * stage.function(x, u, p)[0], cas.vertcat(x, u, p[3], h), p[:3])


def outputs(stage: Stage, names: Sequence[str]) -> Three:
    """Return outputs of the stage and their derivatives, as `increments` does.

    Parameters
    ----------
    names : (n,)
        Some of `stage.outputs`.

    Returns
    -------
    output, output_slope : Functions of (w, wind)
        w is (x, u, time).
    output_bend : Function of (w, wind, mu (n,))
    """
    x, u, p = _symbols(stage)
    rows = [stage.outputs.index(name) for name in names]
    return _three('output', stage.function(x, u, p)[1][rows], cas.vertcat(x, u, p[3]), p[:3])


def _symbols(stage: Stage) -> tuple[cas.SX, cas.SX, cas.SX]:
    x, u, p = (cas.SX.sym('xup'[i], stage.function.size1_in(i)) for i in range(3))
    return x, u, p


def _three(name: str, value: cas.SX, w: cas.SX, wind: cas.SX) -> Three:
    mu = cas.SX.sym('mu', value.size1())
    slope = cas.jacobian(value, w)
    bend = cas.hessian(cas.dot(mu, value), w)[0]
    options = {'cse': True}
    return (
        cas.Function(name, [w, wind], [value], options),
        cas.Function(f'{name}_slope', [w, wind], [value, slope], options),
        cas.Function(f'{name}_bend', [w, wind, mu], [bend], options),
    )
