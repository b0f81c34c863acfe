"""What drives a stage function besides its state: controls over time, wind, the time itself."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import casadi as cas
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..config import suggestion
from ..dynamics.stage import Stage
from ..errors import InputError
from ..trajectory import Interpolation, Trajectory

Array = NDArray[np.float64]
ControlFunction = Callable[[float], 'Mapping[str, float] | Sequence[float] | Array']
Controls = Mapping[str, float] | Trajectory | cas.Function | ControlFunction

SHORT_OF_END = 1e-9
"""Of a piece's length: as late as controls given as a function are asked for."""


class Inputs:
    """Controls and wind of one flight, as pieces of time without a jump or a bend inside.

    A piece is described by numbers q = (controls at its begin, controls at its end, begin, end,
    wind), in which `right_hand_side` is a smooth function: compiled once, it serves every piece.

    Parameters
    ----------
    stage : Stage
    controls : mapping, Trajectory, CasADi Function of time, or function of time; or None
        Held values by name; a trajectory's controls as they run, held beyond its ends; a
        CasADi Function t -> (nu, 1); or a Python function t -> values by name or in order,
        which is called for every evaluation of the equations and hence slow.
    wind : x, y, z [m/s]
        Where the air moves to, earth axes.
    breaks : sequence of times [s]
        Where a function of time jumps or bends.

    Raises
    ------
    InputError
        If a control is missing or unknown, or a value is not finite.
    """

    def __init__(
        self,
        stage: Stage,
        controls: Controls | None = None,
        wind: Sequence[float] | Array = (0.0, 0.0, 0.0),
        breaks: Sequence[float] | Array = (),
    ) -> None:
        self.stage = stage
        self.wind = np.asarray(wind, dtype=float)
        if self.wind.shape != (3,) or not np.isfinite(self.wind).all():
            raise InputError(f'wind must be 3 finite components x, y, z in m/s, got {wind!r}')
        self.interpolation: Interpolation = 'previous'
        self._trajectory: Trajectory | None = None
        self._sampled: _SampledControls | None = None
        self._held = np.zeros(len(stage.controls))
        self._breaks = _ordered(breaks)
        function = None
        if isinstance(controls, Trajectory):
            check_controls(stage, controls.controls, exact=False)
            self._trajectory = controls
            self._breaks = _ordered([*breaks, *controls.time.tolist()])
            self.interpolation = controls.control_interpolation
        elif isinstance(controls, cas.Function):
            if controls.n_in() != 1 or controls.numel_out(0) != len(stage.controls):
                raise InputError(
                    f'controls must be a function of time to {len(stage.controls)} values '
                    f'({", ".join(stage.controls)}), got {controls}'
                )
            function = controls
        elif callable(controls):
            function = self._sampled = _SampledControls(stage, controls)
        else:
            self._held = control_values(stage, controls or {})
        if function is not None:
            self.interpolation = 'linear'
        self._function = function
        self._u = self._controls_of_time()
        self.right_hand_side = self._right_hand_side()

    @property
    def kind(self) -> Any:
        """CasADi's type of symbols: only MX can call a Python function."""
        return cas.SX if self._sampled is None else cas.MX

    def _symbols(self) -> tuple[Any, Any]:
        return self.kind.sym('t'), self.kind.sym('q', 2 * len(self.stage.controls) + 5)

    def _controls_of_time(self) -> cas.Function:
        """Return (t, q) -> u."""
        t, q = self._symbols()
        nu = len(self.stage.controls)
        begin, end = q[2 * nu], q[2 * nu + 1]
        if self._function is not None:
            # at the end of a piece the function may have jumped already
            inside = cas.fmin(t, end - SHORT_OF_END * (end - begin))
            u = cas.densify(cas.vec(self._function(inside)))
        else:
            fraction = (t - begin) / (end - begin)
            u = q[:nu] + (q[nu : 2 * nu] - q[:nu]) * fraction
        return cas.Function('controls', [t, q], [u])

    def _right_hand_side(self) -> cas.Function:
        """Return (t, x, q) -> dx/dt."""
        t, q = self._symbols()
        x = self.kind.sym('x', len(self.stage.states))
        # inlined: so that the Jacobian by x leaves out the controls, which may have no derivatives
        u = self._u.call([t, q], True, False)[0]
        dx = self.stage.function(x, u, cas.vertcat(q[-3:], t))[0]
        return cas.Function('right_hand_side', [t, x, q], [cas.densify(dx)])

    def pieces(self, begin: float, end: float) -> Iterator[tuple[float, float, Array]]:
        """Yield (begin, end, q) of the pieces of a span [s]."""
        inside = self._breaks[(self._breaks > begin) & (self._breaks < end)].tolist()
        for t0, t1 in zip([begin, *inside], [*inside, end], strict=True):
            yield t0, t1, self._piece(t0, t1)

    def _piece(self, begin: float, end: float) -> Array:
        u0 = u1 = self._held
        if self._trajectory is not None:
            times = [begin, end]
            if self.interpolation == 'previous':
                times = [(begin + end) / 2] * 2
            u = self._trajectory.control_at(times)
            u0, u1 = np.array([u[name] for name in self.stage.controls]).reshape(-1, 2).T
        return np.concatenate([u0, u1, [begin, end], self.wind])

    def controls_in(self, t: Array, q: Array) -> Array:
        """Return the controls (nu, n) at times of a piece; at its ends, those inside it."""
        u: Array = self.checked(self._u)(t[None], q).full()
        return u

    def controls_at(self, t: Array) -> Array:
        """Return the controls (nu, n) at times; at a jump, those after it."""
        if self._trajectory is not None:
            u = self._trajectory.control_at(t)
            return np.array([u[name] for name in self.stage.controls]).reshape(-1, t.size)
        if self._function is not None:
            function = self.checked(self._function)
            columns = [function(time).full().ravel() for time in t.tolist()]
            return np.array(columns).reshape(t.size, -1).T
        return np.repeat(self._held[:, None], t.size, axis=1)

    def parameters_at(self, t: Array) -> Array:
        """Return the stage function's parameters (4, n) at times: wind, time."""
        return np.vstack([np.repeat(self.wind[:, None], t.size, axis=1), t])

    def checked(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """Return a function that re-raises what a Python control function raised within it."""
        sampled = self._sampled
        if sampled is None:
            return function

        def call(*args: Any, **kwargs: Any) -> Any:
            try:
                return function(*args, **kwargs)
            finally:
                if sampled.error is not None:
                    raise sampled.error

        return call


class _SampledControls(cas.Callback):
    """A Python function of time that CasADi's functions can call."""

    def __init__(self, stage: Stage, function: ControlFunction) -> None:
        super().__init__()
        self._stage, self._python = stage, function
        self.error: BaseException | None = None
        self.construct('control_function', {})

    def get_n_in(self) -> int:
        return 1

    def get_n_out(self) -> int:
        return 1

    def get_sparsity_out(self, i: int) -> cas.Sparsity:
        return cas.Sparsity.dense(len(self._stage.controls), 1)

    def eval(self, arguments: Sequence[cas.DM]) -> list[cas.DM]:
        if self.error is None:
            try:
                values = self._python(float(arguments[0]))
                return [cas.DM(control_values(self._stage, values))]
            except BaseException as error:  # raised again outside of CasADi, which keeps no type
                self.error = error
        return [cas.DM(np.full(len(self._stage.controls), math.nan))]


def _ordered(times: Sequence[float] | Array) -> Array:
    """Return times in order, each once; np.unique would import numpy.ma, which takes longest."""
    return np.array(sorted({float(time) for time in times}))


def control_values(stage: Stage, values: Mapping[str, float] | ArrayLike) -> Array:
    """Return controls given by name, or in order, as an array (nu,).

    Raises
    ------
    InputError
        If one is missing, unknown or not finite.
    """
    if isinstance(values, Mapping):
        check_controls(stage, values, exact=True)
        values = [float(values[name]) for name in stage.controls]
    row = np.asarray(values, dtype=float).reshape(-1)
    if row.size != len(stage.controls):
        raise InputError(
            f'{row.size} controls given, {len(stage.controls)} needed: {", ".join(stage.controls)}'
        )
    if not np.isfinite(row).all():
        name = stage.controls[int(np.argmin(np.isfinite(row)))]
        raise InputError(f'control {name} must be finite')
    return row


def check_controls(stage: Stage, given: Mapping[str, object], *, exact: bool) -> None:
    """Refuse controls that lack one of the stage's, or, if `exact`, have another one."""
    missing = [name for name in stage.controls if name not in given]
    if missing:
        raise InputError(
            f'the controls {", ".join(missing)} are missing; given: {", ".join(given) or "none"}'
        )
    for name in given if exact else ():
        if name not in stage.controls:
            raise InputError(f"unknown control '{name}'{suggestion(name, stage.controls)}")
