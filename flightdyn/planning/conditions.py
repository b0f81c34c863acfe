"""The numbers of a problem on a layout: bounds, scales and guess of every variable."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .guess import Guess
from .keep_clear import clear_bounds
from .layout import Layout, Structure
from .mesh import Mesh
from .problem import UNBOUNDED, Bounds, Problem

Array = NDArray[np.float64]

ROUNDING = 1e-9  # SI
LEAST_DURATION = 1e-2  # of what is asked for, and 100 times that, where it may be missed


def structure(problem: Problem, mesh: Mesh) -> Structure:
    """Return what of a problem its programme is built from."""
    stage, legs = problem.stage, problem.legs
    along, ends = [], []
    for i, leg in enumerate(legs):
        bounded = problem.bounded(i)
        names = tuple(name for name in stage.outputs if name in bounded)
        along.append(names)
        ends.append(
            tuple(
                tuple(name for name in stage.outputs if name in given and name not in names)
                for given in (leg.initial, leg.final)
            )
        )
    weighs = problem.objective.weighs_effort
    limits = [problem.limits(name) if weighs else () for name in stage.controls]
    return Structure(
        mesh=mesh,
        objective=problem.objective,
        effort_scales=tuple(_size(each) for each in limits),
        phases=problem.phase_names,
        along=tuple(along),
        ends=tuple(ends),  # type: ignore[arg-type]
        rated=tuple(name for name in stage.controls if name in problem.vehicle.rates),
        changing=tuple(problem.change),
    )


def bounds(problem: Problem, layout: Layout) -> tuple[Array, Array]:
    """Return lower and upper bounds of the variables, in SI units.

    Soft variables keep to what the vehicle can do; their companions to what is asked for.
    """
    limits = _bounds(problem, layout)
    soft = [variable for variable, _ in layout.structure.soft]
    if soft:
        limits[layout.companions] = limits[soft]
        limits[soft] = _bounds(without_conditions(problem), layout)[soft]
        for places in (layout.above, layout.below):
            limits[places, 0] = 0.0
    return limits[:, 0], limits[:, 1]


def without_conditions(problem: Problem) -> Problem:
    """Return a problem that asks for nothing, but to begin in the state that it does."""
    states = problem.stage.states
    initial = {name: bounds for name, bounds in problem.initial.items() if name in states}
    duration = (LEAST_DURATION * problem.duration[0], problem.duration[1] / LEAST_DURATION)
    # kept by name: they are part of the structure
    change = dict.fromkeys(problem.change, UNBOUNDED)
    clear = {name for name in clear_bounds(problem.surroundings) if name not in states}
    problem = replace(problem, change=change, aside=problem.aside | clear)
    if not problem.phases:
        return replace(problem, initial=initial, final={}, path={}, duration=duration)
    phases = [
        replace(
            phase,
            initial={},
            final={},
            path={},
            duration=(LEAST_DURATION * phase.duration[0], phase.duration[1] / LEAST_DURATION),
        )
        for phase in problem.phases
    ]
    return replace(problem, initial=initial, final={}, path={}, duration=duration, phases=phases)


def soft_conditions(
    problem: Problem, layout: Layout, scale: Array
) -> tuple[tuple[int, float], ...]:
    """Return the variables that a problem has conditions for, and a price for missing each.

    What is asked for along the path counts by its mean.
    """
    asked, hard = _bounds(problem, layout), _bounds(without_conditions(problem), layout)
    variables = np.flatnonzero((asked != hard).any(axis=1))
    kinds = [str(layout.kinds[v]) for v in variables]
    counts = {kind: kinds.count(kind) for kind in kinds}
    ends = {*layout.nodes[:, layout.mesh.edges].ravel().tolist(), *layout.durations.tolist()}
    return tuple(
        (int(v), 1 / scale[v] / (1 if int(v) in ends else counts[kind]))
        for v, kind in zip(variables, kinds, strict=True)
    )


def _bounds(problem: Problem, layout: Layout) -> Array:
    """Return lower and upper bounds of the variables (size, 2), none of them soft."""
    mesh, legs = layout.mesh, problem.legs
    limits = np.empty((layout.size, 2))
    limits[:] = UNBOUNDED

    def keep(variables: NDArray[np.int64], given: tuple[float, float]) -> None:
        limits[variables, 0] = np.maximum(limits[variables, 0], given[0])
        limits[variables, 1] = np.minimum(limits[variables, 1], given[1])

    for i, leg in enumerate(legs):
        first, last = int(mesh.edges[i]), int(mesh.edges[i + 1])
        along = problem.bounded(i)
        for row, name in enumerate(layout.state_names):
            keep(layout.nodes[row, first : last + 1], along.get(name, UNBOUNDED))
            keep(layout.inside[row, :, first:last].ravel(), along.get(name, UNBOUNDED))
            keep(layout.nodes[row, first], leg.initial.get(name, UNBOUNDED))
            keep(layout.nodes[row, last], leg.final.get(name, UNBOUNDED))
        for row, name in enumerate(layout.control_names):
            steering = layout.steering[row, :, first:last]
            # where it only follows the first points, `samples.path` keeps it within its limits
            tied = mesh.method == 'radau' and mesh.curved and name not in leg.initial
            keep(steering.ravel(order='F')[int(tied) :], along.get(name, UNBOUNDED))
            keep(steering[0, 0], leg.initial.get(name, UNBOUNDED))
            keep(steering[-1, -1], leg.final.get(name, UNBOUNDED))
        keep(layout.durations[i], leg.duration)
    if len(legs) > 1:
        keep(np.array(layout.total), problem.duration)
    for variable, each in zip(layout.outputs, layout.bounded, strict=True):
        keep(variable, problem.limits(each.name, each.phase))
        first, last = int(mesh.edges[each.phase]), int(mesh.edges[each.phase + 1]) - 1
        leg = legs[each.phase]
        if (each.interval, each.position) == (first, 0.0):
            keep(variable, leg.initial.get(each.name, UNBOUNDED))
        if (each.interval, each.position) == (last, 1.0):
            keep(variable, leg.final.get(each.name, UNBOUNDED))
    for variable, name in zip(layout.changes, layout.structure.changing, strict=True):
        keep(variable, problem.change[name])
    for row, name in enumerate(layout.structure.rated):
        keep(layout.rates[row], (-problem.vehicle.rates[name], problem.vehicle.rates[name]))
    return limits


def guess(story: Guess, layout: Layout) -> Array:
    """Return a guess of the variables, in SI units; outputs and integrals are 0."""
    mesh = layout.mesh
    values = np.zeros(layout.size)
    for i in range(story.durations.size):
        first, last = int(mesh.edges[i]), int(mesh.edges[i + 1])
        cuts = np.array(mesh.cuts[i])
        values[layout.nodes[:, first : last + 1]] = story.columns(layout.state_names, i, cuts)
        inner = cuts[:-1] + mesh.points[:-1, None] * np.diff(cuts)
        columns = story.columns(layout.state_names, i, inner.ravel())
        values[layout.inside[:, :, first:last]] = columns.reshape(
            len(layout.state_names), *inner.shape
        )
        for at, position in enumerate(mesh.control_positions):
            positions = cuts[:-1] + position * np.diff(cuts)
            values[layout.steering[:, at, first:last]] = story.columns(
                layout.control_names, i, positions
            )
    for variable, name in zip(layout.changes, layout.structure.changing, strict=True):
        first, last = layout.first_and_last(name)
        values[variable] = values[last] - values[first]
    values[layout.durations] = story.durations
    values[layout.total] = story.durations.sum()
    soft = [variable for variable, _ in layout.structure.soft]
    values[layout.companions] = values[soft]
    return values


def scales(problem: Problem, story: Guess, layout: Layout) -> Array:
    """Return the expected magnitude of each variable, the same for each value of a quantity."""
    legs = problem.legs
    fractions = np.linspace(0, 1, 11)
    sizes: dict[str, float] = {}
    for name in (*layout.state_names, *layout.control_names):
        known = [
            *_numbers(name, (leg.initial for leg in legs)),
            *_numbers(name, (leg.final for leg in legs)),
        ]
        for i in range(len(legs)):
            known += [*problem.limits(name, i)]
            known += story.columns((name,), i, fractions).ravel().tolist()
        sizes[name] = _size(known)
    for name, phase in dict.fromkeys((each.name, each.phase) for each in layout.bounded):
        if name not in sizes:
            ends = _numbers(name, (legs[phase].initial, legs[phase].final))
            sizes[name] = _size([*ends, *problem.limits(name, phase)])
    scale = np.array([sizes.get(kind, 1.0) for kind in layout.kinds])
    for row, name in enumerate(layout.structure.rated):
        scale[layout.rates[row]] = problem.vehicle.rates[name]
    for variable, name in zip(layout.changes, layout.structure.changing, strict=True):
        scale[variable] = sizes[name]
    scale[layout.durations] = story.durations
    scale[layout.total] = story.durations.sum()
    soft = [variable for variable, _ in layout.structure.soft]
    for places in (layout.companions, layout.above, layout.below):
        scale[places] = scale[soft]
    return scale


def _numbers(name: str, groups: Iterable[Bounds]) -> list[float]:
    return [value for group in groups for value in group.get(name, ())]


def _size(known: Iterable[float]) -> float:
    """Return the largest magnitude of what is known of a quantity; 1 if nothing is.

    Less than `ROUNDING` is a nought that was worked out, such as the cosine of a right angle.
    """
    return max((abs(v) for v in known if np.isfinite(v) and abs(v) > ROUNDING), default=1.0)
