"""h f(x, u, t) of a stage, and outputs, with their first and second derivatives."""

import casadi as cas

from ..dynamics.stage import Stage


def increments(stage: Stage) -> tuple[cas.Function, cas.Function, cas.Function]:
    """Return (w, wind) -> h f, the same with its Jacobian, and (w, wind, mu) -> its Hessian.

    w is (x, u, time, h). With the step's length among the arguments, everything between two
    stages of RK4 is linear.
    """
    nx, nu = len(stage.states), len(stage.controls)
    w, wind, mu = cas.SX.sym('w', nx + nu + 2), cas.SX.sym('wind', 3), cas.SX.sym('mu', nx)
    x, u, time, h = cas.vertsplit(w, [0, nx, nx + nu, nx + nu + 1, nx + nu + 2])
    k = h * stage.function(x, u, cas.vertcat(wind, time))[0]
    options = {'cse': True}
    return (
        cas.Function('increment', [w, wind], [k], options),
        cas.Function('increment_slope', [w, wind], [k, cas.jacobian(k, w)], options),
        cas.Function(
            'increment_bend', [w, wind, mu], [cas.hessian(cas.dot(mu, k), w)[0]], options
        ),
    )


def outputs(
    stage: Stage, names: tuple[str, ...]
) -> tuple[cas.Function, cas.Function, cas.Function]:
    """Return (w, wind) -> outputs, the same with its Jacobian, and (w, wind, mu) -> its Hessian.

    w is (x, u, time).
    """
    nx, nu = len(stage.states), len(stage.controls)
    w, wind = cas.SX.sym('w', nx + nu + 1), cas.SX.sym('wind', 3)
    mu = cas.SX.sym('mu', len(names))
    x, u, time = cas.vertsplit(w, [0, nx, nx + nu, nx + nu + 1])
    y = stage.function(x, u, cas.vertcat(wind, time))[1]
    y = cas.densify(y[[stage.outputs.index(name) for name in names]])
    options = {'cse': True}
    return (
        cas.Function('output', [w, wind], [y], options),
        cas.Function('output_slope', [w, wind], [y, cas.jacobian(y, w)], options),
        cas.Function('output_bend', [w, wind, mu], [cas.hessian(cas.dot(mu, y), w)[0]], options),
    )
