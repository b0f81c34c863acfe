"""How a problem becomes a nonlinear programme: direct multiple shooting with RK4."""

from dataclasses import dataclass

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from ..dynamics.stage import Stage
from ..simulation.integrator import rk4_step
from ..trajectory import Interpolation
from .blocks import block_derivatives, numbered
from .guess import guess_columns, guess_duration
from .problem import Problem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Mesh:
    """Equal intervals, RK4 substeps in each, and how controls run through them."""

    intervals: int
    substeps: int
    control_interpolation: Interpolation

    @property
    def control_nodes(self) -> int:
        """Number of control values: one an interval if held, one a node if linear."""
        return self.intervals + (self.control_interpolation == 'linear')

    def __str__(self) -> str:
        return (
            f'multiple shooting, RK4 x{self.substeps}, {self.control_interpolation} controls, '
            f'{self.intervals} intervals'
        )


@dataclass(frozen=True)
class Point:
    """Values of a programme's variables, unscaled: states (nx, N + 1), controls (nu, m), time."""

    states: Array
    controls: Array
    duration: float


class MultipleShooting:
    """A minimum-time programme on a mesh; boundary values, bounds and wind stay parameters.

    The variables are states at the nodes, controls and the duration, each over its scale, in the
    order [states by node, controls by node, duration]. The constraints are the gaps between the
    state flown through an interval and the next node's, over the scales too.
    """

    def __init__(self, stage: Stage, mesh: Mesh) -> None:
        self.stage, self.mesh = stage, mesh
        self.nx, self.nu = len(stage.states), len(stage.controls)
        n, m = mesh.intervals, mesh.control_nodes
        self.size = self.nx * (n + 1) + self.nu * m + 1
        interval, gather = self._interval(), self._gather()
        ends = np.arange(self.nx * n) + self.nx  # the states at each interval's end
        w, p = cas.MX.sym('w', self.size), cas.MX.sym('p', interval.size1_in(1) - 1)
        local = cas.reshape(w[gather.ravel(order='F').tolist()], len(gather), n)
        flown = interval.map(n)(local, numbered(p, n))
        self.programme = {'x': w, 'p': p, 'f': w[-1], 'g': cas.vec(flown) - w[ends.tolist()]}
        self.derivatives = block_derivatives(
            interval, gather, (np.arange(self.nx * n), ends), self.nx * n, self.size
        )

    def _interval(self) -> cas.Function:
        """Return (z, p) -> scaled state flown to the end of an interval.

        z is the state and controls at its beginning, the controls at its end where they run, and
        the duration of the whole, all scaled; p is wind, scales and the interval's number.
        """
        linear = self.mesh.control_interpolation == 'linear'
        x, u0, duration = (cas.SX.sym(s, k) for s, k in (('x', self.nx), ('u', self.nu), ('t', 1)))
        u1 = cas.SX.sym('u1', self.nu) if linear else u0
        wind, scale = cas.SX.sym('wind', 3), cas.SX.sym('scale', self.nx + self.nu + 1)
        x_scale, u_scale = scale[: self.nx], scale[self.nx : -1]
        step = duration * scale[-1] / self.mesh.intervals
        number = cas.SX.sym('number')
        p = cas.vertcat(wind, number * step)
        fly = rk4_step(self.stage, self.mesh.substeps)
        flown = fly(x * x_scale, u0 * u_scale, u1 * u_scale, p, step) / x_scale
        z = cas.vertcat(x, u0, u1, duration) if linear else cas.vertcat(x, u0, duration)
        return cas.Function('interval', [z, cas.vertcat(wind, scale, number)], [flown])

    def _gather(self) -> NDArray[np.int64]:
        """Return which variables make z of each interval, (nz, intervals)."""
        k = np.arange(self.mesh.intervals)
        first_u = self.nx * (self.mesh.intervals + 1)
        x = k * self.nx + np.arange(self.nx)[:, None]
        u = first_u + k * self.nu + np.arange(self.nu)[:, None]
        running = [u + self.nu] if self.mesh.control_interpolation == 'linear' else []
        return np.vstack([x, u, *running, np.full((1, k.size), self.size - 1)])

    def scale(self, problem: Problem) -> Array:
        """Return the scale of each state, control and the duration: their expected magnitude."""
        fractions = np.linspace(0, 1, 11)
        sizes = []
        for name in (*self.stage.states, *self.stage.controls):
            known = [
                *np.ravel(problem.initial.get(name, ())),
                *np.ravel(problem.final.get(name, ())),
                *problem.limits(name),
                *guess_columns(problem, (name,), fractions).ravel(),
            ]
            size = max((abs(v) for v in known if np.isfinite(v)), default=0.0)
            sizes.append(size if size > 0 else 1.0)
        return np.array([*sizes, guess_duration(problem)])

    def parameters(self, problem: Problem, scale: Array) -> Array:
        """Return the programme's parameters: wind and scales."""
        return np.concatenate([np.asarray(problem.wind_ned, float), scale])

    def bounds(self, problem: Problem, scale: Array) -> tuple[Array, Array]:
        """Return lower and upper bounds of the scaled variables."""
        limits = np.array([problem.limits(name) for name in self.stage.states])
        states = np.repeat(limits[:, :, None], self.mesh.intervals + 1, axis=2)
        for node, given in ((0, problem.initial), (-1, problem.final)):
            for name, (lower, upper) in given.items():
                row = states[self.stage.states.index(name), :, node]
                row[0], row[1] = max(row[0], lower), min(row[1], upper)
        limits = np.array([problem.limits(name) for name in self.stage.controls])
        controls = np.repeat(limits[:, :, None], self.mesh.control_nodes, axis=2)
        ends = [Point(states[:, i], controls[:, i], problem.duration[i]) for i in range(2)]
        return self.pack(ends[0], scale), self.pack(ends[1], scale)

    def guess(self, problem: Problem) -> Point:
        """Return the problem's guess on this mesh."""
        nodes = np.linspace(0, 1, self.mesh.intervals + 1)
        return Point(
            guess_columns(problem, self.stage.states, nodes),
            guess_columns(problem, self.stage.controls, nodes[: self.mesh.control_nodes]),
            guess_duration(problem),
        )

    def pack(self, point: Point, scale: Array) -> Array:
        """Return the scaled variables of a point."""
        x_scale = scale[: self.nx, None]
        u_scale = scale[self.nx : self.nx + self.nu, None]
        return np.concatenate(
            [
                (point.states / x_scale).ravel(order='F'),
                (point.controls / u_scale).ravel(order='F'),
                [point.duration / scale[-1]],
            ]
        )

    def unpack(self, w: Array, scale: Array) -> Point:
        """Return the point of scaled variables."""
        cut = self.nx * (self.mesh.intervals + 1)
        states = w[:cut].reshape(self.nx, -1, order='F') * scale[: self.nx, None]
        controls = w[cut:-1].reshape(self.nu, -1, order='F') * scale[self.nx : -1, None]
        return Point(states, controls, float(w[-1] * scale[-1]))

    def describe_gap(self, index: int, scale: Array, value: float) -> str:
        """Return words for a violated constraint."""
        interval, row = divmod(index, self.nx)
        return (
            f'{self.stage.states[row]} does not follow the dynamics in interval {interval} '
            f'(off by {abs(value) * scale[row]:.3g})'
        )
