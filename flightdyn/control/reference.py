"""A plan between its samples, as what a controller steers to."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..dynamics.stage import WIND, Stage
from ..errors import InputError
from ..trajectory import Trajectory

Array = NDArray[np.float64]

STEADY = 1e-9  # m/s, of a wind that does not vary


class Reference:
    """States and controls of a plan at any time; beyond its ends, those of the ends.

    Between samples the states run as cubic polynomials that have the slopes of the model's own
    equations of motion at both ends, so that a coarse plan bends as the vehicle does.

    Parameters
    ----------
    stage : Stage
        Of the model that the plan was made for.
    plan : Trajectory
    wind : x, y, z [m/s], optional
        Where the air moves to, earth axes; as the plan's outputs say, else 0.

    Raises
    ------
    InputError
        If the plan lacks a state or a control of the stage, or has gaps.
    """

    def __init__(self, stage: Stage, plan: Trajectory, wind: ArrayLike | None = None) -> None:
        for kind, names, given in (
            ('states', stage.states, plan.states),
            ('controls', stage.controls, plan.controls),
        ):
            missing = [name for name in names if name not in given]
            if missing:
                raise InputError(
                    f'a plan without the {kind} {", ".join(missing)} cannot be tracked; '
                    f'it has {", ".join(given) or "none"}'
                )
        if len(list(plan.segments())) != 1:
            raise InputError('a plan with gaps cannot be tracked')
        self.stage, self.plan = stage, plan
        self.wind = planned_wind(plan) if wind is None else np.asarray(wind, dtype=float)
        self.time = plan.time
        self._x = np.array([plan.states[name] for name in stage.states])
        if len(plan) > 1:
            u = np.array([plan.controls[name] for name in stage.controls])
            u = u.reshape(-1, len(plan))
            ends = u[:, 1:] if plan.control_interpolation == 'linear' else u[:, :-1]
            self._begin = self._slopes(self._x[:, :-1], u[:, :-1], self.time[:-1])
            self._end = self._slopes(self._x[:, 1:], ends, self.time[1:])

    def _slopes(self, x: Array, u: Array, time: Array) -> Array:
        p = np.vstack([np.repeat(self.wind[:, None], time.size, axis=1), time])
        slopes: Array = self.stage.function(x, u, p)[0].full()
        return slopes

    def states(self, t: ArrayLike) -> Array:
        """Return the states (nx, m) at times (m,) [s]."""
        at = np.atleast_1d(np.asarray(t, dtype=float))
        at = np.clip(at, self.time[0], self.time[-1])
        if self.time.size == 1:
            return np.repeat(self._x, at.size, axis=1)
        k = np.clip(np.searchsorted(self.time, at, side='right') - 1, 0, self.time.size - 2)
        h = self.time[k + 1] - self.time[k]
        s = (at - self.time[k]) / h
        x0, x1 = self._x[:, k], self._x[:, k + 1]
        states: Array = (
            x0
            + (x1 - x0) * (s * s * (3 - 2 * s))
            + h * s * (1 - s) * (self._begin[:, k] * (1 - s) - self._end[:, k] * s)
        )
        return states

    def controls(self, t: ArrayLike) -> Array:
        """Return the controls (nu, m) at times (m,) [s]; at a jump, those after it."""
        at = np.atleast_1d(np.asarray(t, dtype=float))
        u = self.plan.control_at(at)
        return np.array([u[name] for name in self.stage.controls]).reshape(-1, at.size)


def planned_wind(plan: Trajectory, otherwise: ArrayLike = (0.0, 0.0, 0.0)) -> Array:
    """Return the wind (3,) [m/s] that a plan says it was made for, or another.

    Raises
    ------
    InputError
        If it varies on the plan's way: samples of it do not tell what it is beside that.
    """
    found = []
    for name, default in zip(WIND, np.asarray(otherwise, dtype=float), strict=True):
        column = plan.outputs.get(name, np.array([default]))
        if np.ptp(column) > STEADY:
            raise InputError(
                f'plan of {plan.problem!r}: {name} varies on its way, and what it is elsewhere '
                'the trajectory does not tell: fly the plan from its file, '
                '`flightdyn sim plan.json`'
            )
        found.append(float(column[0]))
    return np.array(found)
