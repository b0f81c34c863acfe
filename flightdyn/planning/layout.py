"""Which variable of a programme is what: states, controls, outputs, durations, integrals."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .mesh import Mesh
from .objective import TIME, Objective

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Structure:
    """What of a problem is built into its programme: the values of bounds are not.

    Parameters
    ----------
    mesh : Mesh
    objective : Objective
    effort_scales : (nu,)
        What the objective's `effort` measures each control by.
    phases : names
    along : for each phase, names of outputs
        Bounded at every point of the phase.
    ends : for each phase, names of outputs
        Bounded at its beginning and at its end alone: (first, last).
    rated : names of controls
        Whose rates are limited.
    changing : names of states and controls
        Whose change from the beginning to the end is bounded.
    soft : pairs (variable, price)
        Conditions that may be missed: a companion keeps the bounds of each of these variables,
        and what the variable is off is paid for, by so much a unit (SI).
    """

    mesh: Mesh
    objective: Objective = TIME
    effort_scales: tuple[float, ...] = ()
    phases: tuple[str, ...] = ('',)
    along: tuple[tuple[str, ...], ...] = ((),)
    ends: tuple[tuple[tuple[str, ...], tuple[str, ...]], ...] = (((), ()),)
    rated: tuple[str, ...] = ()
    changing: tuple[str, ...] = ()
    soft: tuple[tuple[int, float], ...] = ()


@dataclass(frozen=True)
class Bounded:
    """A bounded output's value at a point.

    Parameters
    ----------
    name : str
    phase : int
    interval : int
    position : float
        In the interval, 0 to 1.
    """

    name: str
    phase: int
    interval: int
    position: float


class Layout:
    """Places of a programme's variables.

    In order: states at the nodes, states at points inside intervals, controls, bounded outputs,
    rates of controls, bounded changes, integrals, the duration of each phase, the duration of all
    of them if there are several; of soft conditions the companions, and how far above and below
    them.

    Attributes
    ----------
    nodes : int array (nx, n + 1)
    inside : int array (nx, points inside, n)
    controls : int array (nu, values)
    outputs : int array (ny,)
    rates : int array (nr, steps)
    changes : int array (nc,)
    integrals : int array (k,)
    durations : int array (phases,)
    total : int
        The variable that is the duration of all phases.
    companions, above, below : int array (soft,)
    size : int
    """

    def __init__(
        self,
        states: tuple[str, ...],
        controls: tuple[str, ...],
        integrals: int,
        structure: Structure,
    ) -> None:
        self.state_names, self.control_names = states, controls
        self.structure, self.mesh = structure, structure.mesh
        mesh, n = self.mesh, structure.mesh.intervals
        self._first = 0
        self.nodes = self._take(n + 1, len(states)).T
        self.inside = self._take(n, mesh.points.size - 1, len(states)).T
        self.controls = self._take(mesh.control_values, len(controls)).T
        self.bounded = self._bounded()
        self.outputs = self._take(len(self.bounded))
        self.rates = self._take(max(mesh.control_values - 1, 0), len(structure.rated)).T
        self.changes = self._take(len(structure.changing))
        self.integrals = self._take(integrals)
        self.durations = self._take(len(mesh.cuts))
        several = len(mesh.cuts) > 1
        self.total = int(self._take(1)[0]) if several else int(self.durations[0])
        self.companions, self.above, self.below = (
            self._take(len(structure.soft)) for _ in range(3)
        )
        self.size = self._first

    def _take(self, *shape: int) -> Index:
        count = int(np.prod(shape))
        taken = np.arange(self._first, self._first + count).reshape(shape)
        self._first += count
        return taken

    def _bounded(self) -> list[Bounded]:
        found = []
        mesh, structure = self.mesh, self.structure
        for phase in range(len(mesh.cuts)):
            first, last = int(mesh.edges[phase]), int(mesh.edges[phase + 1]) - 1
            inner = mesh.points[:-1]
            for name in structure.along[phase]:
                found += [
                    Bounded(name, phase, interval, float(position))
                    for interval in range(first, last + 1)
                    for position in (0.0, *inner)
                ]
                found.append(Bounded(name, phase, last, 1.0))
            for names, interval, position in zip(
                structure.ends[phase], (first, last), (0.0, 1.0), strict=True
            ):
                found += [Bounded(name, phase, interval, position) for name in names]
        return found

    def state_at(self, interval: int, position: float) -> Index:
        """Return the variables of the state at a point of an interval (nx,)."""
        if position == 0:
            return self.nodes[:, interval]
        if position == 1:
            return self.nodes[:, interval + 1]
        point = int(np.argmin(np.abs(self.mesh.points - position)))
        return self.inside[:, point, interval]

    @cached_property
    def steering(self) -> Index:
        """Variables of the control values of each interval (nu, values, n)."""
        mesh = self.mesh
        k, steps = np.arange(mesh.intervals), mesh.control_positions.size - 1
        first = k if mesh.held else steps * k + mesh.phase
        return self.controls[:, first + np.arange(steps + 1)[:, None]]

    @cached_property
    def reached(self) -> Index:
        """Variables of the states at the points of each interval, its end last (nx, s, n)."""
        return np.concatenate([self.inside, self.nodes[:, None, 1:]], axis=1)

    @cached_property
    def ends(self) -> Index:
        """What an objective depends on but for integrals, see `objective.Costs`."""
        first, last = self.steering[:, 0, 0], self.steering[:, -1, -1]
        states = self.nodes[:, 0], self.nodes[:, -1]
        return np.concatenate([states[0], first, states[1], last, self.durations])

    def first_and_last(self, name: str) -> tuple[int, int]:
        """Return the variables of a state or control at the beginning and at the end."""
        if name in self.state_names:
            states = self.nodes[self.state_names.index(name)]
            return int(states[0]), int(states[-1])
        controls = self.steering[self.control_names.index(name)]
        return int(controls[0, 0]), int(controls[-1, -1])

    @cached_property
    def kinds(self) -> NDArray[np.object_]:
        """Name of the quantity that each variable is a value of (size,)."""
        kinds = np.empty(self.size, object)
        kinds[self.nodes] = np.array(self.state_names, object)[:, None]
        kinds[self.inside] = np.array(self.state_names, object)[:, None, None]
        kinds[self.controls] = np.array(self.control_names, object)[:, None]
        kinds[self.outputs] = [each.name for each in self.bounded]
        rated = [f'rate of {name}' for name in self.structure.rated]
        kinds[self.rates] = np.array(rated, object)[:, None]
        kinds[self.changes] = [f'change of {name}' for name in self.structure.changing]
        kinds[self.integrals] = 'objective'
        kinds[self.durations] = 'duration'
        kinds[self.total] = 'duration'
        for places in (self.companions, self.above, self.below):
            kinds[places] = kinds[[variable for variable, _ in self.structure.soft]]
        return kinds

    def fraction(self, variable: int) -> tuple[int, float] | None:
        """Return phase and fraction of it of a variable's time; None if it has none."""
        mesh = self.mesh

        def at(interval: int, position: float) -> tuple[int, float]:
            share = mesh.begin[interval] + position * mesh.length[interval]
            return int(mesh.phase[interval]), float(share)

        n = mesh.intervals
        for places in (self.nodes, self.inside, self.controls, self.rates):
            if places.size and places.min() <= variable <= places.max():
                where = np.argwhere(places == variable)[0]
                node = int(where[-1])
                if places is self.inside:
                    return at(node, float(mesh.points[where[1]]))
                if places is not self.nodes and not mesh.held:
                    return self._control_fractions[node]
                return at(node, 0.0) if node < n else at(n - 1, 1.0)
        if self.outputs.size and self.outputs[0] <= variable <= self.outputs[-1]:
            each = self.bounded[variable - int(self.outputs[0])]
            return at(each.interval, each.position)
        return None

    @cached_property
    def _control_fractions(self) -> list[tuple[int, float]]:
        mesh, found = self.mesh, []
        for phase in range(len(mesh.cuts)):
            k = np.flatnonzero(mesh.phase == phase)
            inside = mesh.begin[k] + mesh.control_positions[1:, None] * mesh.length[k]
            found += [(phase, float(f)) for f in (0.0, *inside.ravel(order='F'))]
        return found

    def time(self, variable: int, values: Array) -> float | None:
        """Return the time of a variable [s], given all variables in SI units."""
        found = self.fraction(variable)
        if found is None:
            return None
        phase, share = found
        durations = values[self.durations]
        return float(durations[:phase].sum() + share * durations[phase])
