"""A controller that keeps a vehicle on its plan."""

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..dynamics.stage import Model, Stage
from ..errors import InputError
from ..simulation.steering import OpenLoop
from ..trajectory import Trajectory
from ..vehicles.definition import Vehicle
from .lqr import Weights, discretised, gains, linearised, trimmed
from .reference import Reference

Array = NDArray[np.float64]

ANGLES = ('phi', 'theta', 'psi', 'gamma', 'track')
QUATERNION = ('qw', 'qx', 'qy', 'qz')

PERIODS = (0.005, 0.1)  # s, shortest and longest period that is chosen by itself
STEPS = 1000  # in a plan, where the period is in between; as often the model is linearised
MAX_STEPS = 100_000


class Tracker:
    """Feed-forward of a plan's controls plus what a time-varying LQR makes of the deviation.

    Gains come from the model's own derivatives along the plan, backwards from a steady state at
    its end. Afterwards the end is held, by the controls that keep the vehicle there if there are
    such. The deviation is looked at once in a period and the
    correction held through it; controls stay within their ranges and rates.

    Parameters
    ----------
    stage : Stage
        Of the model that the plan was made with: what the controller believes.
    plan : Trajectory
    limits : mapping of control name to (lower, upper)
    rates : mapping of control name to its unit per second
        How fast controls can change; those not named change at once.
    weights : Weights, optional
    period : float [s], optional
        Of the controller; by default a thousandth of the plan's duration, from 5 ms to 0.1 s.
    wind : x, y, z [m/s], optional
        That the controller believes in; by default the plan's.

    Raises
    ------
    InputError
        If the plan is not for the stage, or the period out of range.
    """

    def __init__(
        self,
        stage: Stage,
        plan: Trajectory,
        limits: Mapping[str, tuple[float, float]],
        *,
        rates: Mapping[str, float] | None = None,
        weights: Weights | None = None,
        period: float | None = None,
        wind: ArrayLike | None = None,
    ) -> None:
        self.reference = Reference(stage, plan, wind)
        self._open_loop = OpenLoop(stage, plan)
        duration = plan.duration
        if period is None:
            period = min(max(duration / STEPS, PERIODS[0]), PERIODS[1])
        count = max(1, math.ceil(duration / period - 1e-9)) if period > 0 else 0
        if not 0 < count <= MAX_STEPS:
            raise InputError(
                f'period of the controller is {period:g} s: it must divide the plan of '
                f'{duration:g} s into at most {MAX_STEPS} steps'
            )
        self.period = period
        bounds = np.array([limits[name] for name in stage.controls]).reshape(-1, 2)
        self._lower, self._upper = bounds[:, 0], bounds[:, 1]
        self._rates = np.array([(rates or {}).get(name, math.inf) for name in stage.controls])
        self._start = float(plan.time[0])
        grid = self._start + period * np.arange(count + 1)
        self._end = float(plan.time[-1])
        # the last one is for what comes after the plan
        middles = np.append(np.minimum(grid[:-1] + period / 2, self._end), self._end)
        every = math.ceil(count / STEPS)
        times = np.append(middles[:-1:every], self._end)
        x, u = self.reference.states(times), self.reference.controls(times)
        p = np.vstack([np.repeat(self.reference.wind[:, None], times.size, axis=1), times])
        held = trimmed(stage, x[:, -1], u[:, -1], p[:, -1])
        within = held is not None and np.all((held >= self._lower) & (held <= self._upper))
        self._held = held if within else None
        if self._held is not None:
            u[:, -1] = self._held
        a, b = discretised(*linearised(stage, x, u, p), period)
        used = np.append(np.arange(count) // every, times.size - 1)
        q, r = (weights or Weights()).matrices(stage, plan, limits)
        self.gains, _ = gains(a[used], b[used], q, r, period)
        self._angles = [i for i, name in enumerate(stage.states) if name in ANGLES]
        self._quaternion = [i for i, name in enumerate(stage.states) if name in QUATERNION]
        self.begin(self._start)

    def begin(self, time: float) -> None:
        """Forget what was before: a flight begins at a time [s]."""
        self._step: int | None = None
        self._correction = np.zeros(self._lower.size)
        self._last: Array | None = None

    def deviation(self, x: ArrayLike, time: float) -> Array:
        """Return how far a state (nx,) is from the plan at a time [s], the short way round."""
        x, planned = np.asarray(x, dtype=float), self.reference.states(time)[:, 0]
        off = x - planned
        off[self._angles] = (off[self._angles] + np.pi) % (2 * np.pi) - np.pi
        if self._quaternion and x[self._quaternion] @ planned[self._quaternion] < 0:
            # both signs are one attitude
            off[self._quaternion] = -x[self._quaternion] - planned[self._quaternion]
        return off

    def breaks(self, begin: float, end: float) -> Array:
        """Return times inside an interval [s] where controls jump, bend or are decided anew."""
        samples = self._open_loop.breaks(begin, end)
        first, last = self._step_at(begin) + 1, math.ceil((end - self._start) / self.period)
        decisions = self._start + self.period * np.arange(first, last + 1)
        times = np.union1d(samples, decisions[(decisions > begin) & (decisions < end)])
        # samples that are decisions but for rounding would make steps of no length
        return times[np.append(np.diff(times) > 1e-9, True)] if times.size else times

    def over(self, begin: float, end: float, x: Array) -> tuple[Array, Array]:
        """Return the controls (nu,) at both ends of an interval without a break inside."""
        self._decide(begin, x)
        u0, u1 = (
            np.clip(u + self._correction, self._lower, self._upper)
            for u in self._at_end(begin) or self._open_loop.over(begin, end)
        )
        limited = np.isfinite(self._rates)
        if limited.any():
            start = u0 if self._last is None else np.where(limited, self._last, u0)
            most = self._rates * (end - begin)
            u0, u1 = start, np.where(limited, np.clip(u1, start - most, start + most), u1)
        self._last = u1
        return u0, u1

    def now(self, time: float, x: Array) -> Array:
        """Return the controls (nu,) that act from a time on, where the state is x."""
        self._decide(time, x)
        planned, _ = self._at_end(time) or (self._open_loop.now(time), None)
        u = np.clip(planned + self._correction, self._lower, self._upper)
        return u if self._last is None else np.where(np.isfinite(self._rates), self._last, u)

    def _at_end(self, time: float) -> tuple[Array, Array] | None:
        """Return the controls that hold the vehicle after the plan, if there are such."""
        if time >= self._end - 1e-9 and self._held is not None:
            return self._held, self._held
        return None

    def _step_at(self, time: float) -> int:
        return math.floor((time - self._start) / self.period + 1e-6)

    def _decide(self, time: float, x: Array) -> None:
        step = self._step_at(time)
        if step == self._step:
            return
        self._step = step
        gain = self.gains[min(max(step, 0), len(self.gains) - 1)]
        self._correction = -gain @ self.deviation(x, time)


def track(
    vehicle: Vehicle,
    plan: Trajectory,
    *,
    model: Model | None = None,
    weights: Weights | None = None,
    period: float | None = None,
    wind: ArrayLike | None = None,
) -> Tracker:
    """Return the controller that a vehicle tracks a plan with, within its ranges and rates.

    Give the vehicle as it is believed to be: a simulator may fly another. Its `model` is needed
    where the wind varies by place.
    """
    model = model or vehicle.model()
    return Tracker(
        model.stage(),
        plan,
        model.controls,
        rates=vehicle.rates,
        weights=weights,
        period=period,
        wind=wind,
    )
