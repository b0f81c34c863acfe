"""What tests of vehicles share: a stage's values by name, and vehicles from text."""

from pathlib import Path
from typing import Any

import casadi as cas
import numpy as np

from flightdyn.dynamics.stage import Stage
from flightdyn.vehicles.vehicle import Vehicle, load_vehicle


def vehicle_of(folder: Path, text: str, name: str = 'made') -> Vehicle:
    """Return the vehicle of a YAML text."""
    (folder / 'vehicles').mkdir(exist_ok=True)
    (folder / 'vehicles' / f'{name}.yaml').write_text(text)
    return load_vehicle(name, folder)


def evaluated(
    stage: Stage, wind: tuple[float, float, float] = (0.0, 0.0, 0.0), **values: float
) -> tuple[dict[str, float], dict[str, float]]:
    """Return rates and outputs at states and controls by name, 0 where not given."""
    assert set(values) <= {*stage.states, *stage.controls}
    x = [values.get(name, 0.0) for name in stage.states]
    u = [values.get(name, 0.0) for name in stage.controls]
    dx, outputs = stage.function(x, u, [*wind, 0.0])
    return (
        dict(zip(stage.states, dx.full().ravel().tolist(), strict=True)),
        dict(zip(stage.outputs, outputs.full().ravel().tolist(), strict=True)),
    )


def derivatives(stage: Stage) -> cas.Function:
    """Return value, Jacobian and all second derivatives of a stage's rates and outputs."""
    x = cas.SX.sym('x', len(stage.states) + len(stage.controls))
    p = cas.SX.sym('p', stage.function.size1_in(2))
    n = len(stage.states)
    value = cas.vertcat(*stage.function(x[:n], x[n:], p))
    first = cas.jacobian(value, x)
    return cas.Function('d', [x, p], [value, first, cas.jacobian(first, x)])


def check_first_derivatives(stage: Stage, x: Any, wind: Any, scale: Any) -> None:
    """Compare the Jacobian at x with central differences in steps of 1e-4 scale."""
    function = derivatives(stage)
    p = [*wind, 0.0]
    exact = function(x, p)[1].full()
    for i, size in enumerate(scale):
        step = np.zeros(len(x))
        step[i] = 1e-4 * size
        above, below = function(x + step, p)[0].full(), function(x - step, p)[0].full()
        found = (above - below)[:, 0] / (2 * step[i])
        bound = 1e-5 * np.abs(exact[:, i]) + 1e-5 * (1.0 + np.abs(above[:, 0])) / size
        # the differences' own error: (1e-4)^2 of third derivatives, in units of size
        assert np.all(np.abs(found - exact[:, i]) <= bound), (i, found, exact[:, i])
