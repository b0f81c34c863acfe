"""Derivatives of the stage function, as solvers take them."""

from collections.abc import Sequence
from functools import lru_cache

import casadi as cas

from ..dynamics.opaque import differentiated
from ..dynamics.stage import Outline, Stage
from .compiled import compiled, compiled_wide
from .pointwise import Pointwise, pointwise

Three = tuple[cas.Function, cas.Function, cas.Function]


def increments(stage: Stage, names: Sequence[str] = ()) -> Three:
    """Return what a step of length h adds to the state, and its derivatives.

    With the step's length among the arguments, everything between two stages of a Runge-Kutta
    method is linear.

    Parameters
    ----------
    names : (n,)
        Outputs of the stage that are wanted besides, below the state's increment.

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
    outline, h = stage.outline, cas.SX.sym('h')
    w = cas.vertcat(outline.x, outline.u, outline.p[3], h)
    rows = [stage.outputs.index(name) for name in names]
    return _three('increment', cas.vertcat(h * outline.dx, outline.outputs[rows]), w, outline)


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
    outline = stage.outline
    rows = [stage.outputs.index(name) for name in names]
    w = cas.vertcat(outline.x, outline.u, outline.p[3])
    return _three('output', outline.outputs[rows], w, outline)


@lru_cache(maxsize=64)
def compiled_increments(stage: Stage) -> list[cas.Function]:
    """Return `increments`, compiled where that pays; made once for a stage."""
    return compiled(increments(stage))


@lru_cache(maxsize=64)
def compiled_increment(stage: Stage) -> cas.Function:
    """Return the first of `increments`, compiled where that pays; made once for a stage."""
    return compiled(increments(stage)[:1])[0]


@lru_cache(maxsize=64)
def increments_at_points(stage: Stage, names: tuple[str, ...] = ()) -> list[Pointwise]:
    """Return `increments`, for many points; made once for a stage."""
    return _at_points(increments(stage, names))


@lru_cache(maxsize=64)
def outputs_at_points(stage: Stage, names: tuple[str, ...]) -> list[Pointwise]:
    """Return `outputs`, for many points; made once for a stage."""
    return _at_points(outputs(stage, names))


def _at_points(functions: Three) -> list[Pointwise]:
    wide = compiled_wide(functions)
    return pointwise(functions, wide) if wide else pointwise(compiled(functions))


def _three(name: str, expression: cas.SX, w: cas.SX, outline: Outline) -> Three:
    wind, mu = outline.p[:3], cas.SX.sym('mu', expression.size1())
    value, slope, bend = differentiated(cas.densify(expression), w, mu, outline.calls)
    return (
        cas.Function(name, [w, wind], [value]),
        cas.Function(f'{name}_slope', [w, wind], [value, slope]),
        cas.Function(f'{name}_bend', [w, wind, mu], [bend]),
    )
