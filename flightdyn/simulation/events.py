"""Events of a flight: where a quantity crosses a value."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from ..config import suggestion
from ..errors import InputError
from .inputs import Inputs
from .solution import EventRecord, Panels

Array = NDArray[np.float64]
Quantity = str | cas.Function | Callable[[float, Mapping[str, float]], float]
Refly = Callable[[Array, float, float], Panels]
"""(state, begin, end) -> the flight between, integrated anew."""

SUBPOINTS = 12
"""In how many parts of a panel a change of sign is looked for."""
START_WINDOW = 1e-9  # s; a crossing sooner after the start is the one that the flight starts from
TIME_TOLERANCE = 1e-12  # s, or relative to the time
REFINEMENTS = 8  # one or two are enough where the crossing is not tangential


@dataclass(frozen=True)
class Event:
    """A quantity crossing a value.

    Parameters
    ----------
    name : str
        How the solution calls it.
    quantity : str, CasADi Function, or function
        Name of a state, control or output of the stage, or 'altitude'; a CasADi Function of the
        stage function's arguments (x, u, p); or a Python function of (time, states by name).
        Continuous: a jump counts as a crossing at the moment of the jump.
    value : float
        What is crossed.
    terminal : bool
        Whether the flight ends there.
    direction : -1, 0 or 1
        Falling through the value, both ways, or rising.

    Raises
    ------
    InputError
        If the direction is another, or the value is not finite.
    """

    name: str
    quantity: Quantity
    value: float = 0.0
    terminal: bool = True
    direction: int = 0

    def __post_init__(self) -> None:
        if self.direction not in (-1, 0, 1):
            raise InputError(f'event {self.name}: direction is -1, 0 or 1, got {self.direction}')
        if not math.isfinite(self.value):
            raise InputError(f'event {self.name}: value must be finite, got {self.value}')


def ground_contact(height: float = 0.0, *, terminal: bool = True) -> Event:
    """Return the event of the altitude falling through a height [m] above the origin."""
    return Event('ground contact', 'altitude', height, terminal, -1)


class EventWatch:
    """Looks for events panel by panel while a flight is integrated.

    The sign of each quantity is compared at `SUBPOINTS` + 1 points of a panel. A pair of
    crossings between two of them is missed: limit the integrator's `max_step` to less than what
    must be seen. A crossing within 1e-9 s of the start is not reported, so that a flight may
    go on from where an event ended another.
    """

    def __init__(self, events: Sequence[Event], inputs: Inputs, start: float) -> None:
        self.events = events
        self._inputs, self._start = inputs, start
        self._functions = [_function_of(event, inputs) for event in events]
        self._before = [0.0] * len(events)  # the last value; 0 if there is no side to leave
        self._s = -np.cos(np.pi / SUBPOINTS * np.arange(SUBPOINTS + 1))

    def look(
        self, panels: Panels, q: Array, refly: Refly
    ) -> tuple[list[EventRecord], Panels, str | None]:
        """Return the events in panels of one piece q, the panels up to a terminal one, its name.

        Where there is none, the panels are all of them.
        """
        records: list[EventRecord] = []
        if not self.events:
            return records, panels, None
        for begin, end in pairwise(panels.edges.tolist()):
            times = begin + (self._s + 1) / 2 * (end - begin)
            times[-1] = end
            found = [
                (t, i)
                for i in range(len(self.events))
                for t in self._crossings(i, times, panels, q)
            ]
            for t, i in sorted(found):
                event = self.events[i]
                time, flown = self._refined(i, t, begin, panels, q, refly)
                if time - self._start <= START_WINDOW:
                    continue
                state = panels.at_edge(begin) if flown is None else flown.states[:, -1]
                records.append(EventRecord(event.name, time, state))
                if event.terminal:
                    done = panels.first(int(np.searchsorted(panels.edges, begin)))
                    if flown is not None:
                        done = Panels.joined([done, flown])
                    return records, done, event.name
        return records, panels, None

    def _value(self, i: int, t: Array, x: Array, q: Array) -> Array:
        return self._functions[i](t, x, self._inputs.controls_in(t, q)) - self.events[i].value

    def _crossings(self, i: int, times: Array, panels: Panels, q: Array) -> list[float]:
        """Return where a quantity crosses within a panel, as the panel's polynomial says."""
        values = self._value(i, times, panels(times), q)
        if not np.isfinite(values).all():
            at = times[int(np.argmin(np.isfinite(values)))]
            raise InputError(f'event {self.events[i].name} is not finite at {at:.9g} s')
        found = []
        before, last = self._before[i], times[0]
        for t, value in zip(times.tolist(), values.tolist(), strict=True):
            crossed = before * value < 0 or (value == 0 and before != 0)
            if crossed and self.events[i].direction * before <= 0:
                found.append(self._root(i, last, t, panels, q) if last < t else t)
            before, last = value, t
        self._before[i] = before
        return found

    def _root(self, i: int, low: float, high: float, panels: Panels, q: Array) -> float:
        """Return the zero between two times of different sign, by bisection."""

        def value(t: float) -> float:
            at = np.array([t])
            return float(self._value(i, at, panels(at), q)[0])

        falling = value(low) > 0
        while high - low > TIME_TOLERANCE * max(1.0, abs(low)):
            middle = (low + high) / 2
            if not low < middle < high:
                break
            if (value(middle) > 0) == falling:
                low = middle
            else:
                high = middle
        return (low + high) / 2

    def _refined(
        self, i: int, t: float, begin: float, panels: Panels, q: Array, refly: Refly
    ) -> tuple[float, Panels | None]:
        """Return an event's time, corrected by flying to it from the panel's begin, and that."""
        resolution = TIME_TOLERANCE * max(1.0, abs(t))
        state = panels.at_edge(begin)
        if t - begin <= resolution:
            return begin, None
        end = float(panels.edges[np.searchsorted(panels.edges, begin, side='right')])
        near = 1e-4 * (end - begin)
        around = np.array([max(t - near, begin), min(t + near, end)])
        values = self._value(i, around, panels(around), q)
        slope = float(values[1] - values[0]) / float(around[1] - around[0])
        flown = refly(state, begin, t)
        for _ in range(REFINEMENTS):
            value = float(self._value(i, np.array([t]), flown.states[:, -1:], q)[0])
            correction = -value / slope if slope != 0 else 0.0
            # where the quantity jumps or only touches, the slope says nothing
            if abs(correction) <= resolution or not abs(correction) <= near:
                break
            if not begin + resolution < t + correction:
                break
            t += correction
            flown = refly(state, begin, t)
        return t, flown


Values = Callable[[Array, Array, Array], Array]
"""(t (n,), x (nx, n), u (nu, n)) -> values of a quantity (n,)."""


def _function_of(event: Event, inputs: Inputs) -> Values:
    quantity, stage = event.quantity, inputs.stage
    if isinstance(quantity, str):
        return _named(event.name, quantity, inputs)
    if isinstance(quantity, cas.Function):
        if quantity.n_in() != 3 or quantity.numel_out(0) != 1:
            raise InputError(
                f'event {event.name}: a CasADi Function takes (x, u, p) and returns one value, '
                f'got {quantity}'
            )
        return lambda t, x, u: quantity(x, u, inputs.parameters_at(t)).full()[0]
    python = quantity

    def values(t: Array, x: Array, u: Array) -> Array:
        rows = (dict(zip(stage.states, column, strict=True)) for column in x.T.tolist())
        pairs = zip(t.tolist(), rows, strict=True)
        return np.array([float(python(time, state)) for time, state in pairs])

    return values


def _named(event: str, name: str, inputs: Inputs) -> Values:
    stage = inputs.stage
    if name in stage.states:
        row = stage.states.index(name)
        return lambda t, x, u: x[row]
    if name in stage.controls:
        row = stage.controls.index(name)
        return lambda t, x, u: u[row]
    if name in stage.outputs:
        row = stage.outputs.index(name)
        return lambda t, x, u: stage.function(x, u, inputs.parameters_at(t))[1].full()[row]
    if name == 'altitude' and 'z_e' in stage.states:
        down = stage.states.index('z_e')
        return lambda t, x, u: -x[down]
    known = (*stage.states, *stage.controls, *stage.outputs)
    raise InputError(f"event {event}: unknown quantity '{name}'{suggestion(name, known)}")
