"""How a problem becomes a nonlinear programme: multiple shooting and collocation in one form.

The variables are listed in `layout.py`. Every constraint is an equality: the equations of motion
over each interval; a bounded output is its variable, and so are integrals and rates. Thus all
bounds are bounds of variables, and boundary values, bounds, wind and scales are parameters of a
programme that is built once.
"""

from functools import cached_property
from typing import Any

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from ..dynamics.stage import Stage
from .assembly import Block, Cost, Triplets, assemble, differentiated
from .increments import increments_at_points, outputs_at_points
from .layout import Layout, Structure
from .mesh import lagrange, scheme
from .objective import trace, with_integrals
from .pointwise import pointwise
from .shooting import flight

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Transcription:
    """A programme of one structure.

    Attributes
    ----------
    layout : Layout
    subject : int array (rows,)
        The variable that each constraint is about.
    programme, derivatives : mappings
        See `assembly.assemble`.
    """

    def __init__(self, stage: Stage, structure: Structure) -> None:
        self.stage, self.structure, self.mesh = stage, structure, structure.mesh
        self.costs = trace(structure.objective, stage, structure.effort_scales, structure.phases)
        self.flying = with_integrals(stage, self.costs.rates) if self.costs.count else stage
        self.layout = Layout(stage.states, stage.controls, self.costs.count, structure)
        self._linear = Triplets()
        self._subject: list[Index] = []
        self._rows = 0
        self._output_rows = self._new_rows(self.layout.outputs)
        self._linear.add(self._output_rows, self.layout.outputs, 1.0)
        self._put_out: set[int] = set()  # bounded outputs that the motion's points give
        makers = [self._motion(), *self._bounded_outputs(), *self._rates()]
        self._changes()
        self._total_duration()
        self._soft_conditions()
        self.rows = self._rows
        blocks = [
            Block(functions, select.elements(height), weights.elements(self._rows))
            for functions, select, height, weights in makers
        ]
        self.subject = np.concatenate(self._subject)
        self.programme, self.derivatives = assemble(
            self._linear.elements(self._rows), blocks, self._cost()
        )

    def _new_rows(self, subject: Index) -> Index:
        """Return the numbers of new constraints, each about a variable; same shape."""
        rows = np.arange(self._rows, self._rows + subject.size).reshape(subject.shape)
        self._rows += subject.size
        self._subject.append(subject.ravel())
        return rows

    def _motion(self) -> Any:
        """Return the block of the equations of motion, and of integrals."""
        layout, mesh = self.layout, self.mesh
        nx, n = layout.nodes.shape[0], mesh.intervals
        sums = self._new_rows(layout.integrals)
        self._linear.add(sums, layout.integrals, 1.0)
        return self._shot(nx, n, sums) if mesh.shooting else self._collocated(nx, n, sums)

    def _shot(self, nx: int, n: int, sums: Index) -> Any:
        layout, mesh = self.layout, self.mesh
        rows = self._new_rows(layout.nodes[:, 1:])
        self._linear.add(rows, layout.nodes[:, 1:], 1.0)
        nu, count = layout.controls.shape[0], self.costs.count
        nv = nx + count
        values = layout.steering.shape[1]
        nz = nv + values * nu + 2
        select, weights = Triplets(), Triplets()
        k = np.arange(n)
        place = nz * k
        select.add(place + np.arange(nx)[:, None], layout.nodes[:, :-1], 1.0)
        for i in range(values):
            select.add(place + nv + i * nu + np.arange(nu)[:, None], layout.steering[:, i], 1.0)
        self._select_time(select, place + nz - 2, k, np.zeros(n))
        select.add(place + nz - 1, layout.durations[mesh.phase], mesh.length)
        weights.add(rows, nv * k + np.arange(nx)[:, None], 1.0)
        weights.add(sums[:, None], nv * k + nx + np.arange(count)[:, None], 1.0)
        functions = flight(self.flying, mesh.substeps, linear=not mesh.held)
        return functions, select, n * nz, weights

    def _collocated(self, nx: int, n: int, sums: Index) -> Any:
        layout, mesh = self.layout, self.mesh
        s = scheme(mesh.method)
        nu, count = layout.controls.shape[0], self.costs.count
        names = tuple(dict.fromkeys(name for each in self.structure.along for name in each))
        nv, nz = nx + count + len(names), nx + count + nu + 2
        select, weights = Triplets(), Triplets()
        states = layout.reached
        rows = self._new_rows(states)
        for i in range(s.points.size):
            for j in range(s.points.size):
                self._linear.add(rows[:, i], states[:, j], s.differences[i, j])
            self._linear.add(rows[:, i], layout.nodes[:, :-1], -s.differences[i].sum())
        places = np.concatenate([[0.0], s.points])
        number = np.full((n, s.points.size + 1), -1)
        first = 0

        def points(k: Index, at: int, state: Index) -> Index:
            """Select a point (0: the beginning) of intervals k; return their numbers."""
            nonlocal first
            numbers = np.arange(first, first + k.size)
            first += k.size
            number[k, at] = numbers
            place = nz * numbers
            select.add(place + np.arange(nx)[:, None], state, 1.0)
            self._select_controls(select, place + nx + count, k, at)
            self._select_time(select, place + nz - 2, k, places[at])
            select.add(place + nz - 1, layout.durations[mesh.phase[k]], 1.0)
            return numbers

        def count_in(k: Index, numbers: Index, at: int) -> None:
            """Add what the derivatives at a point (0: the beginning) count for intervals k."""
            length = mesh.length[k]
            column = nv * numbers
            for i in range(s.points.size):
                share = s.start[i] if at == 0 else float(i == at - 1)
                if share:
                    weights.add(rows[:, i, k], column + np.arange(nx)[:, None], share * length)
            if count:
                weights.add(
                    sums[:, None],
                    column + nx + np.arange(count)[:, None],
                    s.weights[at] * length,
                )

        every = np.arange(n)
        for at in range(1, s.points.size + 1):
            count_in(every, points(every, at, states[:, at - 1]), at)
        # where controls and the phase go on, the end before is the same point
        on = every[1:][(mesh.phase[1:] == mesh.phase[:-1]) & (not mesh.held)]
        number[on, 0] = number[on - 1, -1]
        if s.at_start:
            own = np.setdiff1d(every, on)
            points(own, 0, layout.nodes[:, own])
            count_in(every, number[:, 0], 0)
        for i, each in enumerate(layout.bounded):
            there = number[each.interval, int(np.argmin(np.abs(places - each.position)))]
            if each.name in names and there >= 0:
                column = nv * there + nx + count + names.index(each.name)
                weights.add(self._output_rows[i], column, 1.0)
                self._put_out.add(i)
        self._tie_first_control()
        functions = increments_at_points(self.flying, names)
        return functions, select, first * nz, weights

    def _tie_first_control(self) -> None:
        """Let controls where a phase begins follow those of its first interval's points.

        The equations of motion do not hold there where it is no point, and tell nothing of them.
        """
        layout, mesh = self.layout, self.mesh
        if not mesh.curved or scheme(mesh.method).at_start:
            return
        first = mesh.edges[:-1]
        rows = self._new_rows(layout.steering[:, 0, first])
        self._linear.add(rows, layout.steering[:, 0, first], 1.0)
        for i, share in enumerate(lagrange(mesh.points, np.zeros(1))[0]):
            self._linear.add(rows, layout.steering[:, i + 1, first], -share)

    def _select_controls(self, select: Triplets, rows: Index, k: Index, at: Any) -> None:
        """Select the controls at a point (0: the beginning) of intervals k."""
        layout = self.layout
        below = np.arange(layout.controls.shape[0])[:, None]
        shares = np.atleast_2d(self.mesh.steered[at])
        for i in range(shares.shape[1]):
            select.add(rows + below, layout.steering[:, i, k], shares[:, i])

    def _select_time(self, select: Triplets, rows: Index, k: Index, position: Any) -> None:
        """Select the time at a position of intervals k, where the model depends on it."""
        if not self._timed:
            return
        mesh, durations = self.mesh, self.layout.durations
        for phase, duration in enumerate(durations):
            share = mesh.begin[k] + position * mesh.length[k]
            share = np.where(mesh.phase[k] == phase, share, (mesh.phase[k] > phase) * 1.0)
            select.add(rows, duration, share)

    @cached_property
    def _timed(self) -> bool:
        x, u, p = (cas.SX.sym('xup'[i], self.flying.function.size1_in(i)) for i in range(3))
        dx, y = self.flying.function(x, u, p)
        return bool(cas.depends_on(cas.vertcat(dx, y), p[-1]))

    def _bounded_outputs(self) -> list[Any]:
        """Return the block of bounded outputs that no point of the motion gives."""
        layout = self.layout
        left = [i for i in range(len(layout.bounded)) if i not in self._put_out]
        if not left:
            return []
        bounded = [layout.bounded[i] for i in left]
        names = tuple(dict.fromkeys(each.name for each in bounded))
        nx, nu = layout.nodes.shape[0], layout.controls.shape[0]
        nz = nx + nu + 1
        where = list(dict.fromkeys((b.interval, b.position) for b in bounded))
        number = {place: i for i, place in enumerate(where)}
        # one evaluation a place, of all that is bounded anywhere
        select, weights = Triplets(), Triplets()
        k = np.array([place[0] for place in where])
        position = np.array([place[1] for place in where])
        states = np.stack([layout.state_at(*place) for place in where], axis=1)
        first = nz * np.arange(k.size)
        select.add(first + np.arange(nx)[:, None], states, 1.0)
        at = np.abs(position[:, None] - np.concatenate([[0.0], self.mesh.points])).argmin(axis=1)
        self._select_controls(select, first + nx, k, at)
        self._select_time(select, first + nz - 1, k, position)
        column = [
            number[b.interval, b.position] * len(names) + names.index(b.name) for b in bounded
        ]
        weights.add(self._output_rows[left], np.array(column), 1.0)
        return [(outputs_at_points(self.stage, names), select, k.size * nz, weights)]

    def _rates(self) -> list[Any]:
        """Return the block of the controls' rates: rate times time is the change."""
        layout, rated = self.layout, self.structure.rated
        if not rated:
            return []
        r, h, wind = cas.SX.sym('r', len(rated)), cas.SX.sym('h'), cas.SX.sym('wind', 3)
        function = cas.Function('change', [cas.vertcat(r, h), wind], [r * h])
        which = [layout.control_names.index(name) for name in rated]
        steps = layout.rates.shape[1]
        where = [layout.fraction(int(v)) for v in layout.controls[0]]
        phase = np.array([each[0] for each in where if each is not None])[:-1]
        share = np.array([each[1] for each in where if each is not None])
        # from the end of a phase to the beginning of the next no time passes: no jump
        length = np.where(np.diff(share) > 0, np.diff(share), 1 - share[:-1])
        rows = self._new_rows(layout.rates)
        self._linear.add(rows, layout.controls[which, 1:], 1.0)
        self._linear.add(rows, layout.controls[which, :-1], -1.0)
        nz, k = len(rated) + 1, np.arange(steps)
        select, weights = Triplets(), Triplets()
        select.add(nz * k + np.arange(len(rated))[:, None], layout.rates, 1.0)
        select.add(nz * k + nz - 1, layout.durations[phase], length)
        weights.add(rows, len(rated) * k + np.arange(len(rated))[:, None], 1.0)
        return [(pointwise(differentiated(function)), select, steps * nz, weights)]

    def _changes(self) -> None:
        """Tie each bounded change to the ends that it is between."""
        layout = self.layout
        rows = self._new_rows(layout.changes)
        for row, name in zip(rows, self.structure.changing, strict=True):
            first, last = layout.first_and_last(name)
            self._linear.add(row, last, -1.0)
            self._linear.add(row, first, 1.0)
        self._linear.add(rows, layout.changes, 1.0)

    def _total_duration(self) -> None:
        layout = self.layout
        if layout.durations.size > 1:
            row = self._new_rows(np.array([layout.total]))
            self._linear.add(row, layout.total, 1.0)
            self._linear.add(row, layout.durations, -1.0)

    def _soft_conditions(self) -> None:
        """Tie soft variables to companions: they differ by what is paid for."""
        layout, soft = self.layout, self.structure.soft
        variables = np.array([variable for variable, _ in soft], dtype=np.int64)
        rows = self._new_rows(variables)
        for places, sign in ((variables, 1), (layout.companions, -1), (layout.above, -1)):
            self._linear.add(rows, places, sign)
        self._linear.add(rows, layout.below, 1.0)

    def _cost(self) -> Cost:
        layout = self.layout
        picked = np.concatenate([layout.ends, layout.integrals])
        select = Triplets()
        select.add(np.arange(picked.size), picked, 1.0)
        z, wind = (cas.SX.sym('zw'[i], self.costs.cost.size1_in(i)) for i in range(2))
        sign = self.structure.objective.sign
        prices = np.zeros(layout.size)
        for places in (layout.above, layout.below):
            prices[places] = [price for _, price in self.structure.soft]
        function = cas.Function('cost', [z, wind], [sign * self.costs.cost(z, wind)])
        return Cost(
            differentiated(function),
            select.elements(picked.size),
            prices,
        )
