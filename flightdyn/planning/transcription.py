"""How a problem becomes a nonlinear programme: direct multiple shooting with RK4."""

from collections.abc import Iterable
from dataclasses import dataclass, field

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from ..dynamics.stage import Stage
from ..trajectory import Interpolation
from .blocks import Index, Piece, block_derivatives, differentiated, programme
from .guess import guess_columns, guess_duration
from .interval import interval
from .objective import TIME, Objective, trace, with_integrals
from .problem import Problem

Array = NDArray[np.float64]

NEAR = 1e-4  # of a bound, scaled: at it, as far as an interior point comes


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
class Structure:
    """What of a problem is built into its programme: the values of bounds are not.

    Parameters
    ----------
    effort_scales : (nu,)
        What the objective's `effort` measures each control by.
    along, first, last : output names
        Bounded at every node, but for the last; at the first node besides; at the last node.
    """

    objective: Objective = TIME
    effort_scales: tuple[float, ...] = ()
    along: tuple[str, ...] = ()
    first: tuple[str, ...] = ()
    last: tuple[str, ...] = ()


def structure(problem: Problem, stage: Stage) -> Structure:
    """Return what of a problem its programme is built from."""
    bounded = problem.bounded
    along = tuple(name for name in stage.outputs if name in bounded)
    first = tuple(n for n in stage.outputs if n in problem.initial and n not in along)
    last = tuple(n for n in stage.outputs if n in problem.final or n in along)
    limits = (
        problem.limits(name) if problem.objective.weighs_effort else () for name in stage.controls
    )
    sizes = tuple(_size(each) for each in limits)
    return Structure(problem.objective, sizes, along, first, last)


@dataclass(frozen=True)
class Point:
    """Values of a programme's variables, unscaled.

    Parameters
    ----------
    states : (nx, N + 1)
    controls : (nu, m)
    duration : float
        s
    outputs : (ny,)
        What bounded outputs should be: those along the path by node, at the start, at the end.
    """

    states: Array
    controls: Array
    duration: float
    outputs: Array = field(default_factory=lambda: np.empty(0))


class MultipleShooting:
    """A programme on a mesh; boundary values, bounds, wind and scales stay parameters.

    The variables are states at the nodes, controls, bounded outputs and the duration, each over
    its scale, in this order. Every constraint is an equality: a state flown through an interval
    is the next node's, a bounded output is its variable. Thus all bounds are bounds of variables.
    """

    def __init__(self, stage: Stage, mesh: Mesh, built: Structure | None = None) -> None:
        self.stage, self.mesh = stage, mesh
        self.structure = built or Structure(effort_scales=(1.0,) * len(stage.controls))
        self.costs = trace(self.structure.objective, stage, self.structure.effort_scales)
        self.nx, self.nu = len(stage.states), len(stage.controls)
        n = mesh.intervals
        self.along = len(self.structure.along)
        self.ny = self.along * n + len(self.structure.first) + len(self.structure.last)
        self._controls = self.nx * (n + 1)
        self._outputs = self._controls + self.nu * mesh.control_nodes
        self.size = self._outputs + self.ny + 1
        self.scales = self.nx + self.nu + 1 + len(self.bounded) + 1
        pieces = [self._interval(), self._ends()]
        k = np.arange(n)
        ends = (k + 1) * self.nx + np.arange(self.nx)[:, None]
        along = self._outputs + k * self.along + np.arange(self.along)[:, None]
        rest = self._outputs + np.arange(self.along * n, self.ny)
        # the variable each constraint is about, in the order of the constraints
        self.subject: Index = np.concatenate([np.vstack([ends, along]).ravel(order='F'), rest])
        self.programme = programme(pieces, self.subject, self.size)
        self.derivatives = block_derivatives(pieces, self.subject, self.size)
        self._cost = cas.Function('cost', [self.programme[k] for k in 'xp'], [self.programme['f']])
        self._values = cas.Function(
            'values', [self.programme[k] for k in 'xp'], [self.programme['g']]
        )

    @property
    def bounded(self) -> tuple[str, ...]:
        """Names of the bounded outputs, in the order of their scales."""
        return (*self.structure.along, *self.structure.first, *self.structure.last)

    def _parameters(self) -> dict[str, cas.SX]:
        """Return symbols of a piece's parameters, by what they are."""
        sizes = {'wind': 3, 'x': self.nx, 'u': self.nu, 'T': 1, 'y': len(self.bounded), 'f': 1}
        return {name: cas.SX.sym(name, size) for name, size in {**sizes, 'number': 1}.items()}

    def _interval(self) -> Piece:
        """Return the piece of an interval: its part of the integrals, what is flown and put out.

        z is the state and controls at its beginning, the controls at its end where they run, and
        the duration of the whole, all scaled.
        """
        linear = self.mesh.control_interpolation == 'linear'
        x, u0, duration = (cas.SX.sym(s, k) for s, k in (('x', self.nx), ('u', self.nu), ('t', 1)))
        u1 = cas.SX.sym('u1', self.nu) if linear else u0
        z = cas.vertcat(x, u0, u1, duration) if linear else cas.vertcat(x, u0, duration)
        scale = self._parameters()
        every = cas.vertcat(*scale.values())
        total = duration * scale['T']
        p = cas.vertcat(scale['wind'], scale['number'] * total / self.mesh.intervals)
        outputs = self.stage.function(x * scale['x'], u0 * scale['u'], p)[1]
        along = self._scaled(outputs, self.structure.along, scale['y'])
        begin = cas.vertcat(x * scale['x'], cas.SX.zeros(self.costs.count))
        start = cas.vertcat(begin, u0 * scale['u'], u1 * scale['u'], total)
        end = cas.SX.sym('end', self.nx + self.costs.count)
        cost = self._integral_cost(total, end[self.nx :], scale['f'])
        functions = interval(
            with_integrals(self.stage, self.costs.rates),
            (self.mesh.intervals, self.mesh.substeps),
            cas.Function('start', [z, every], [start]),
            cas.Function('finish', [end, z, every], [cost, end[: self.nx] / scale['x']]),
            cas.Function('along', [z, every], [along]),
        )
        k = np.arange(self.mesh.intervals)
        x_index = k * self.nx + np.arange(self.nx)[:, None]
        u_index = self._controls + k * self.nu + np.arange(self.nu)[:, None]
        running = [u_index + self.nu] if linear else []
        last = np.full((1, k.size), self.size - 1)
        return Piece(*functions, gather=np.vstack([x_index, u_index, *running, last]))

    def _integral_cost(self, total: cas.SX, sums: cas.SX, scale: cas.SX) -> cas.SX:
        """Return what the integrals over an interval add to the objective, scaled."""
        if not self.costs.count:
            return cas.SX(1, 1)
        return self._signed(cas.dot(self.costs.weights(total), sums)) / scale

    def _ends(self) -> Piece:
        """Return the piece of what depends on the ends: part of the objective, bounded outputs.

        z is the state at the first and the last node, the controls there, and the duration.
        """
        x0, xn = cas.SX.sym('x0', self.nx), cas.SX.sym('xn', self.nx)
        u0, un = cas.SX.sym('u0', self.nu), cas.SX.sym('un', self.nu)
        duration, scale = cas.SX.sym('t'), self._parameters()
        total = duration * scale['T']
        first = x0 * scale['x'], u0 * scale['u'], cas.vertcat(scale['wind'], 0)
        last = xn * scale['x'], un * scale['u'], cas.vertcat(scale['wind'], total)
        cost = self.costs.ends(*first[:2], *last[:2], scale['wind'], total)
        y0, yn = (self.stage.function(*point)[1] for point in (first, last))
        bounded = cas.vertcat(
            self._scaled(y0, self.structure.first, scale['y'], self.along),
            self._scaled(
                yn, self.structure.last, scale['y'], self.along + len(self.structure.first)
            ),
        )
        function = cas.Function(
            'ends',
            [cas.vertcat(x0, xn, u0, un, duration), cas.vertcat(*scale.values())],
            [self._signed(cost) / scale['f'], bounded],
        )
        states, controls = np.arange(self.nx), self._controls + np.arange(self.nu)
        gather = np.concatenate(
            [
                states,
                states + self._controls - self.nx,
                controls,
                controls + self._outputs - self._controls - self.nu,
                [self.size - 1],
            ]
        )
        return Piece(*differentiated(function), gather=gather[:, None])

    def _scaled(
        self, outputs: cas.SX, names: tuple[str, ...], scale: cas.SX, offset: int = 0
    ) -> cas.SX:
        """Return outputs by name over their scales, which begin at an offset."""
        rows = (outputs[self.stage.outputs.index(name)] for name in names)
        return cas.vertcat(cas.SX(0, 1), *(row / scale[offset + i] for i, row in enumerate(rows)))

    def _signed(self, cost: cas.SX) -> cas.SX:
        return -cost if self.structure.objective.maximized else cost

    def scale(self, problem: Problem) -> Array:
        """Return the scale of each state, control, the duration, bounded output, and of the cost.

        Those of variables are their expected magnitude. The cost's makes a change of all
        variables by their scales, where they are guessed, change the scaled cost by about 1.
        """
        fractions = np.linspace(0, 1, 11)
        sizes = []
        for name in (*self.stage.states, *self.stage.controls):
            known = [
                *np.ravel(problem.initial.get(name, ())),
                *np.ravel(problem.final.get(name, ())),
                *problem.limits(name),
                *guess_columns(problem, (name,), fractions).ravel(),
            ]
            sizes.append(_size(known))
        sizes.append(guess_duration(problem))
        for i, name in enumerate(self.bounded):
            group = problem.final if i >= self.along + len(self.structure.first) else {}
            group = problem.initial if self.along <= i and not group else group
            sizes.append(_size([*group.get(name, ()), *problem.limits(name)]))
        scale = np.array([*sizes, 1.0])
        scale[-1] = self._cost_scale(problem, scale)
        return scale

    def _cost_scale(self, problem: Problem, scale: Array) -> float:
        lower, upper = self.bounds(problem, scale)
        guess = self.guess(problem)
        most = Point(guess.states, np.ones_like(guess.controls), guess.duration, guess.outputs)
        most.controls[:] = scale[self.nx : self.nx + self.nu, None]
        found = [0.0]
        for point in (guess, most):  # where the guess is no effort, effort has no slope
            w = np.clip(self.pack(point, scale), lower, upper)
            slope = self.derivatives['grad_f'](w, self.parameters(problem, scale))[1]
            total = float(np.abs(slope.full().ravel()[lower < upper]).sum())
            found.append(total if np.isfinite(total) else 0.0)
        return max(found) or 1.0

    def parameters(self, problem: Problem, scale: Array) -> Array:
        """Return the programme's parameters: wind and scales."""
        return np.concatenate([np.asarray(problem.wind_ned, float), scale])

    def objective(self, variables: Array, problem: Problem, scale: Array) -> float:
        """Return the objective in the user's units and sign."""
        cost = float(self._cost(variables, self.parameters(problem, scale)))
        return self.unscaled(cost, scale)

    def unscaled(self, cost: float, scale: Array) -> float:
        """Return the objective in the user's units and sign from the programme's."""
        return self.structure.objective.sign * cost * float(scale[-1])

    def bounds(self, problem: Problem, scale: Array) -> tuple[Array, Array]:
        """Return lower and upper bounds of the scaled variables."""
        n = self.mesh.intervals
        parts: list[Array] = []
        for names, nodes in (
            (self.stage.states, n + 1),
            (self.stage.controls, self.mesh.control_nodes),
        ):
            part = np.array([problem.limits(name) for name in names]).reshape(-1, 2)
            part = np.repeat(part[:, :, None], nodes, axis=2)
            for node, given in ((0, problem.initial), (-1, problem.final)):
                for row, name in enumerate(names):
                    if name in given:
                        part[row, :, node] = _both(part[row, :, node], given[name])
            parts.append(part)
        ends = [(self.structure.first, problem.initial), (self.structure.last, problem.final)]
        along = np.array([problem.limits(name) for name in self.structure.along]).reshape(-1, 2)
        outputs = np.repeat(along[None], n, axis=0)
        for row, name in enumerate(self.structure.along):
            outputs[0, row] = _both(outputs[0, row], problem.initial.get(name))
        rest = [_both(problem.limits(k), given.get(k)) for names, given in ends for k in names]
        outputs = np.vstack([outputs.reshape(-1, 2), np.array(rest).reshape(-1, 2)])
        lower, upper = (
            self.pack(
                Point(parts[0][:, i], parts[1][:, i], problem.duration[i], outputs[:, i]), scale
            )
            for i in range(2)
        )
        return lower, upper

    def guess(self, problem: Problem) -> Point:
        """Return the problem's guess on this mesh."""
        nodes = np.linspace(0, 1, self.mesh.intervals + 1)
        states = guess_columns(problem, self.stage.states, nodes)
        controls = guess_columns(problem, self.stage.controls, nodes[: self.mesh.control_nodes])
        duration = guess_duration(problem)
        point = Point(states, controls, duration, np.zeros(self.ny))
        if not self.ny:
            return point
        ones = np.ones(self.scales)
        gaps = self._values(self.pack(point, ones), self.parameters(problem, ones))
        outputs = np.nan_to_num(gaps.full().ravel()[self.subject >= self._outputs])
        return Point(states, controls, duration, outputs)

    def _output_scale(self, scale: Array) -> Array:
        """Return the scale of each bounded output's variable."""
        y = scale[self.nx + self.nu + 1 : -1]
        return np.concatenate([np.tile(y[: self.along], self.mesh.intervals), y[self.along :]])

    def pack(self, point: Point, scale: Array) -> Array:
        """Return the scaled variables of a point."""
        x_scale = scale[: self.nx, None]
        u_scale = scale[self.nx : self.nx + self.nu, None]
        return np.concatenate(
            [
                (point.states / x_scale).ravel(order='F'),
                (point.controls / u_scale).ravel(order='F'),
                point.outputs / self._output_scale(scale),
                [point.duration / scale[self.nx + self.nu]],
            ]
        )

    def unpack(self, w: Array, scale: Array) -> Point:
        """Return the point of scaled variables."""
        nx, nu = self.nx, self.nu
        states, controls, outputs = np.split(w[:-1], [self._controls, self._outputs])
        return Point(
            states.reshape(nx, -1, order='F') * scale[:nx, None],
            controls.reshape(nu, -1, order='F') * scale[nx : nx + nu, None],
            float(w[-1] * scale[nx + nu]),
            outputs * self._output_scale(scale),
        )

    def describe_gap(self, index: int, variables: Array, gap: float, scale: Array) -> str:
        """Return words for a violated constraint, given the scaled variables and its gap."""
        variable = int(self.subject[index])
        if variable < self._controls:
            node, row = divmod(variable, self.nx)
            return (
                f'{self.stage.states[row]} does not follow the dynamics in interval {node - 1} '
                f'(off by {abs(gap) * scale[row]:.3g})'
            )
        name, node = self._bounded_output(variable - self._outputs)
        size = self._output_scale(scale)[variable - self._outputs]
        time = node / self.mesh.intervals * float(variables[-1] * scale[self.nx + self.nu])
        return (
            f'{name} at {time:.3g} s is {(variables[variable] + gap) * size:.4g}, '
            f'{abs(gap) * size:.3g} {"above" if gap > 0 else "below"} what it must be'
        )

    def quantity(self, variable: int) -> str:
        """Return the name of the state, control or output that a variable is a value of."""
        if variable < self._controls:
            return self.stage.states[variable % self.nx]
        if variable < self._outputs:
            return self.stage.controls[(variable - self._controls) % self.nu]
        if variable < self.size - 1:
            return self._bounded_output(variable - self._outputs)[0]
        return 'duration'

    def at_bounds(self, variables: Array, lower: Array, upper: Array) -> dict[str, float]:
        """Return which share of its values each quantity has at a bound, those fixed left out."""
        free = lower < upper
        near = free & (np.minimum(variables - lower, upper - variables) < NEAR)
        counts: dict[str, list[int]] = {}
        for variable in np.flatnonzero(free):
            count = counts.setdefault(self.quantity(int(variable)), [0, 0])
            count[0] += int(near[variable])
            count[1] += 1
        return {name: met / total for name, (met, total) in counts.items() if met}

    def _bounded_output(self, index: int) -> tuple[str, int]:
        """Return name and node of a bounded output."""
        n = self.mesh.intervals
        if index < self.along * n:
            return self.structure.along[index % self.along], index // self.along
        index -= self.along * n
        if index < len(self.structure.first):
            return self.structure.first[index], 0
        return self.structure.last[index - len(self.structure.first)], n


def _both(limits: Array | tuple[float, float], given: tuple[float, float] | None) -> Array:
    """Return what two ranges have in common, [lower, upper]."""
    lower, upper = given or (-np.inf, np.inf)
    return np.array([max(limits[0], lower), min(limits[1], upper)])


def _size(known: Iterable[float]) -> float:
    """Return the largest magnitude of what is known of a quantity; 1 if nothing is."""
    return max((abs(v) for v in known if np.isfinite(v) and v != 0), default=1.0)
