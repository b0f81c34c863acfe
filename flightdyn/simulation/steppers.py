"""Advancing a flight by some panels: CVODES with control of the dense output, or RK4."""

import math
from collections.abc import Callable
from typing import Any, Protocol

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .inputs import Inputs
from .solution import Panels, chebyshev_basis

Array = NDArray[np.float64]

DEGREE = 12
"""Degree of CVODES' dense output; its panels carry the outputs at as many points and one."""
CHUNK = 8  # panels of CVODES in one call
DENSE_FACTOR = 10.0  # of the tolerance: what the dense output may err
MAX_STEPS = 4_000  # of CVODES in one call; a chunk takes some 800
MAX_FAILURES = 30  # of CVODES in one flight: with MAX_STEPS it bounds what is tried in vain
RK4_CHUNK = 32  # panels in one call
SHORTEST = 1e-9
"""Shortest panel of CVODES [s], or relative to the time."""


class Stepper(Protocol):
    """Advances a flight through a piece of its inputs."""

    def advance(self, x: Array, begin: float, end: float, q: Array) -> Panels:
        """Return some panels from a state (nx,) at `begin` on, at most until `end`."""

    def fly(self, x: Array, begin: float, end: float, q: Array) -> Panels:
        """Return one panel from `begin` to `end`."""


def runge_kutta_step(
    f: Callable[[float, Any], Any], x: Any, times: tuple[float, float, float], h: Any
) -> Any:
    """Return x, SX or MX, after a classical fourth-order step of dx/dt = f(time, x).

    `times` are the begin, middle and end of the step as f takes them.
    """
    begin, middle, end = times
    k1 = f(begin, x)
    k2 = f(middle, x + h / 2 * k1)
    k3 = f(middle, x + h / 2 * k2)
    k4 = f(end, x + h * k3)
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def cvodes(
    inputs: Inputs, grid: Array, rtol: float, atol: float, **options: float
) -> Callable[[Array, Array], Array | None]:
    """Return a function of (x0, p) to the states at a grid of tau, or to None where CVODES fails.

    p is (q, begin, length); the time is begin + tau * length. Each call starts CVODES anew: for
    CasADi's own piecewise constant inputs it does not, and jumps then cost steps or fail.
    """
    right_hand_side = inputs.right_hand_side
    kind = inputs.kind
    nx, nq = right_hand_side.size1_in(1), right_hand_side.size1_in(2)
    x, tau, p = kind.sym('x', nx), kind.sym('tau'), kind.sym('p', nq + 2)
    q, begin, length = cas.vertsplit(p, [0, nq, nq + 1, nq + 2])
    # inlined: see Inputs
    dx = length * right_hand_side.call([begin + tau * length, x, q], True, False)[0]
    # what fails is reported by the caller: no warnings besides
    quiet = {'disable_internal_warnings': True, 'show_eval_warnings': False}
    integrator = cas.integrator(
        'cvodes',
        'cvodes',
        {'x': x, 't': tau, 'p': p, 'ode': dx},
        0.0,
        grid.tolist(),
        {'reltol': rtol, 'abstol': atol, **quiet, **options},
    )
    checked = inputs.checked(integrator)

    def attempt(x0: Array, p: Array) -> Array | str:
        try:
            states: Array = checked(x0=x0, p=p)['xf'].full()
        except RuntimeError as error:  # of CasADi, which has no other type
            return str(error)
        return states if np.isfinite(states).all() else 'not finite'

    def call(x0: Array, p: Array) -> Array | None:
        result = attempt(x0, p)
        if not isinstance(result, str):
            return result
        # Ctrl-C looks like a failure of the equations, which give NaN rather than fail, or of
        # their Jacobian, which may fail: but then again.
        interrupted = 'CV_RHSFUNC_FAIL' in result
        if 'CV_LSETUP_FAIL' in result:
            again = attempt(x0, p)
            interrupted = not (isinstance(again, str) and 'CV_LSETUP_FAIL' in again)
        if interrupted:
            raise KeyboardInterrupt
        return None

    return call


class Cvodes:
    """CVODES, whose outputs at Chebyshev points make the dense output.

    The length of panels is controlled by the last two terms of their Chebyshev series, so that
    the dense output errs less than `DENSE_FACTOR` times the tolerance. Values alone are
    interpolated: derivatives of a stiff flight would amplify what is within the tolerance.
    """

    def __init__(self, inputs: Inputs, rtol: float, atol: float, max_step: float | None) -> None:
        self._inputs, self._rtol, self._atol = inputs, rtol, atol
        self._limited = max_step is not None
        # the widest gap between 13 Chebyshev points is 0.13 of a panel
        self._length = 4 * max_step if max_step is not None else math.inf
        self._longest = self._length
        self._failures = 0
        self._calls: dict[int, Callable[[Array, Array], Array | None]] = {}
        points = -np.cos(np.pi / DEGREE * np.arange(DEGREE + 1))
        self._fractions = (points + 1) / 2
        self._to_series = np.linalg.inv(chebyshev_basis(points, DEGREE)).T

    def fly(self, x: Array, begin: float, end: float, q: Array) -> Panels:
        panels = self._run(x, begin, end, q, 1)
        if panels is None:
            raise _stopped(self._inputs, begin, x)
        return panels

    def advance(self, x: Array, begin: float, end: float, q: Array) -> Panels:
        span = end - begin
        shortest = SHORTEST * max(1.0, abs(begin))
        length = min(self._length, span)
        while True:
            count = 1 if length >= span else CHUNK
            stop = min(begin + count * length, end)
            panels = self._run(x, begin, stop, q, count)
            length = (stop - begin) / count
            if panels is None:
                self._failures += 1
                if length <= shortest or self._failures > MAX_FAILURES:
                    raise _stopped(self._inputs, begin, x)
                length = length / 10
                continue
            errors = self._dense_errors(panels)
            good = int(np.argmax(errors > 1)) if errors.max() > 1 else count
            worst = errors.max() if good == count else errors[good]
            change = 0.8 * max(float(worst), 1e-10) ** (-1 / DEGREE)
            change = min(change, 4.0) if good == count else min(max(change, 0.1), 0.5)
            self._length = min(length * change, self._longest)
            if good > 0 or length <= shortest:
                return panels.first(max(good, 1))
            length = self._length

    def _run(self, x: Array, begin: float, end: float, q: Array, count: int) -> Panels | None:
        """Return equal panels, or None where CVODES fails."""
        if count not in self._calls:
            grid = (np.arange(count)[:, None] + self._fractions[1:]).ravel() / count
            limit = {'max_step_size': 0.25 / count} if self._limited else {}
            self._calls[count] = cvodes(
                self._inputs, grid, self._rtol, self._atol, max_num_steps=MAX_STEPS, **limit
            )
        result = self._calls[count](x, np.concatenate([q, [begin, end - begin]]))
        if result is None:
            return None
        states = np.column_stack([x, result])
        edges = np.linspace(begin, end, count + 1)
        index = np.arange(count)[:, None] * DEGREE + np.arange(DEGREE + 1)
        coefficients = states[:, index].transpose(1, 0, 2) @ self._to_series
        inner = edges[:-1, None] + np.diff(edges)[:, None] * self._fractions[1:]
        inner[:, -1] = edges[1:]
        return Panels(edges, coefficients, np.append(begin, inner), states)

    def _dense_errors(self, panels: Panels) -> Array:
        """Return the estimated error of each panel's polynomial over what it may be."""
        coefficients = np.abs(panels.coefficients)
        errors = coefficients[:, :, -1] + coefficients[:, :, -2]
        allowed = self._atol + self._rtol * coefficients.sum(axis=2)
        worst: Array = (errors / allowed).max(axis=1) / DENSE_FACTOR
        return worst


class RungeKutta4:
    """Classical Runge-Kutta steps of equal length in each piece, two to a panel."""

    def __init__(self, inputs: Inputs, max_step: float) -> None:
        self._inputs, self._max_step = inputs, max_step
        self._calls: dict[int, Callable[..., Any]] = {}
        k = np.arange(6)
        values = chebyshev_basis(np.array([-1.0, 0.0, 1.0]), 5)
        slopes = [(-1.0) ** (k + 1) * k**2, k * np.sin(k * np.pi / 2), k**2]
        self._to_series = np.linalg.inv(np.vstack([values, slopes])).T

    def fly(self, x: Array, begin: float, end: float, q: Array) -> Panels:
        return self._run(x, begin, end, q, 1)

    def advance(self, x: Array, begin: float, end: float, q: Array) -> Panels:
        count = max(1, math.ceil((end - begin) / (2 * self._max_step) - 1e-9))
        if count > RK4_CHUNK:
            end = begin + (end - begin) * (RK4_CHUNK / count)
            count = RK4_CHUNK
        return self._run(x, begin, end, q, count)

    def _run(self, x: Array, begin: float, end: float, q: Array, count: int) -> Panels:
        n = 2 * count
        if count not in self._calls:
            steps = self._step().mapaccum('rk4', n)
            self._calls[count] = self._inputs.checked(steps)
        times = np.linspace(begin, end, n + 1)
        h = (end - begin) / n
        inner = self._calls[count](x, times[None, :-1], h, np.repeat(q[:, None], n, axis=1)).full()
        states = np.column_stack([x, inner])
        finite = np.isfinite(states).all(axis=0)
        if not finite.all():
            last = int(np.argmin(finite)) - 1
            raise _stopped(self._inputs, float(times[last]), states[:, last])
        function = self._inputs.checked(self._inputs.right_hand_side)
        slopes = function(times[None], states, q).full() * h
        index = 2 * np.arange(count)[:, None] + np.arange(3)
        both = np.concatenate([states[:, index], slopes[:, index]], axis=2)
        coefficients = both.transpose(1, 0, 2) @ self._to_series
        return Panels(times[::2], coefficients, times, states)

    def _step(self) -> cas.Function:
        """Return (x, t, h, q) -> x after a step."""
        function = self._inputs.right_hand_side
        kind = self._inputs.kind
        x, q = (kind.sym('xq'[i - 1], function.size1_in(i)) for i in (1, 2))
        t, h = kind.sym('t'), kind.sym('h')

        def f(fraction: float, state: Any) -> Any:
            return function(t + fraction * h, state, q)

        return cas.Function('step', [x, t, h, q], [runge_kutta_step(f, x, (0.0, 0.5, 1.0), h)])


def _stopped(inputs: Inputs, time: float, state: Array) -> InputError:
    pairs = zip(inputs.stage.states, state.tolist(), strict=True)
    values = ', '.join(f'{name} = {value:.6g}' for name, value in pairs)
    return InputError(
        f'the integration cannot go on at {time:.9g} s: the state grows without bounds or the '
        f'equations are undefined there ({values})'
    )
