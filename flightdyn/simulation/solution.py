"""What an integration returns: states at any time, events, and why it ended."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..dynamics.stage import Stage
from ..errors import InputError
from ..trajectory import Trajectory
from .inputs import Inputs

Array = NDArray[np.float64]


def chebyshev_basis(s: Array, degree: int) -> Array:
    """Return the polynomials T_0 to T_degree at s, (n, degree + 1).

    By their recurrence: importing numpy.polynomial takes longer than verifying a plan.
    """
    columns = [np.ones_like(s), s]
    for _ in range(degree - 1):
        columns.append(2 * s * columns[-1] - columns[-2])
    return np.stack(columns[: degree + 1], axis=1)


@dataclass(frozen=True)
class Panels:
    """Polynomials end to end over time.

    Parameters
    ----------
    edges : array (m + 1,)
        Increasing times [s]; panel i runs from edges[i] to edges[i + 1].
    coefficients : array (m, nx, degree + 1)
        Chebyshev series of each state in s, which runs from -1 to 1 over the panel.
    times, states : arrays (n,), (nx, n)
        What the integrator returned, the panels' edges among them.
    """

    edges: Array
    coefficients: Array
    times: Array
    states: Array

    def first(self, m: int) -> 'Panels':
        """Return the first m panels."""
        keep = self.times <= self.edges[m]
        return Panels(
            self.edges[: m + 1], self.coefficients[:m], self.times[keep], self.states[:, keep]
        )

    def at_edge(self, time: float) -> Array:
        """Return the state (nx,) at one of the edges, as integrated."""
        state: Array = self.states[:, np.searchsorted(self.times, time)]
        return state

    @staticmethod
    def joined(parts: 'list[Panels]') -> 'Panels':
        """Return panels end to end; each part begins where the one before ends."""
        head, tail = parts[0], parts[1:]
        return Panels(
            np.concatenate([head.edges, *(part.edges[1:] for part in tail)]),
            np.concatenate([part.coefficients for part in parts]),
            np.concatenate([head.times, *(part.times[1:] for part in tail)]),
            np.concatenate([head.states, *(part.states[:, 1:] for part in tail)], axis=1),
        )

    def __call__(self, t: Array) -> Array:
        """Return the states (nx, k) at times (k,), beyond the ends by the outer polynomials."""
        last = self.edges.size - 2
        index = np.clip(np.searchsorted(self.edges, t, side='right') - 1, 0, last)
        begin = self.edges[index]
        s = 2 * (t - begin) / (self.edges[index + 1] - begin) - 1
        basis = chebyshev_basis(s, self.coefficients.shape[2] - 1)
        states: Array = np.einsum('kd,kxd->xk', basis, self.coefficients[index])
        return states


class EventRecord(NamedTuple):
    """An event that happened: its name, time [s], and the state (nx,)."""

    name: str
    time: float
    state: Array


@dataclass(frozen=True, kw_only=True)
class Solution:
    """A flight as integrated.

    Parameters
    ----------
    time : array (n,)
        `t_eval` as far as the flight went; without it, the times the integrator returned.
    states : array (nx, n)
        Rows in the order of `stage.states`.
    events : tuple of EventRecord
        In the order of time.
    terminated_by : str or None
        Name of the event that ended the flight; None if it reached the end of the span.
    """

    stage: Stage
    time: Array
    states: Array
    events: tuple[EventRecord, ...]
    terminated_by: str | None
    panels: Panels = field(repr=False)
    inputs: Inputs = field(repr=False)

    @property
    def status(self) -> str:
        """'event' if one ended the flight, else 'finished'."""
        return 'finished' if self.terminated_by is None else 'event'

    @property
    def final_time(self) -> float:
        """When the flight ended [s]."""
        return float(self.panels.edges[-1])

    @property
    def final_state(self) -> Array:
        """State (nx,) at the end."""
        final: Array = self.panels.states[:, -1]
        return final

    def __getitem__(self, name: str) -> Array:
        """Return a state by name at `time`."""
        if name not in self.stage.states:
            raise KeyError(f'{name!r} is not a state; there are {", ".join(self.stage.states)}')
        row: Array = self.states[self.stage.states.index(name)]
        return row

    def sol(self, t: ArrayLike) -> Array:
        """Return the states at any times [s] of the flight: (nx,) of one time, (nx, k) of (k,).

        Between CVODES' outputs the error is below ten times its tolerance, relative to the
        largest value of the state nearby. Between steps of RK4 a quintic Hermite polynomial
        errs with the sixth power of the step, below RK4 itself.

        Raises
        ------
        InputError
            If a time is outside the flight.
        """
        times = np.asarray(t, dtype=float)
        begin, end = self.panels.edges[0], self.panels.edges[-1]
        if not ((times >= begin) & (times <= end)).all():
            raise InputError(f'the flight runs from {begin:.9g} s to {end:.9g} s, asked for {t!r}')
        states = self.panels(times.ravel())
        return states.reshape(-1, *times.shape)

    def to_trajectory(self, *, model: str = '', vehicle: str = '') -> Trajectory:
        """Return states, controls and the stage's outputs at `time`.

        Controls given as a function of time are sampled; between samples they are taken as
        linear.
        """
        if self.time.size == 0:
            raise InputError(f'no time of t_eval lies before the end at {self.final_time:.9g} s')
        u = self.inputs.controls_at(self.time)
        p = self.inputs.parameters_at(self.time)
        outputs = self.stage.function(self.states, u, p)[1].full()
        return Trajectory(
            time=self.time,
            states=dict(zip(self.stage.states, self.states, strict=True)),
            controls=dict(zip(self.stage.controls, u, strict=True)),
            outputs=dict(zip(self.stage.outputs, outputs, strict=True)),
            model=model,
            vehicle=vehicle,
            control_interpolation=self.inputs.interpolation,
        )
