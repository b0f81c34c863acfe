"""Meshes that fit: the first one, and finer ones where a plan, flown again, is off."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .layout import Layout
from .mesh import ORDERS, Mesh, Method
from .problem import MAX_NODES, MAX_SUBSTEPS, Problem
from .programme import Attempt

Array = NDArray[np.float64]
Index = NDArray[np.int64]

MAX_PARTS = 4  # that an interval is cut into at a time


def method_of(problem: Problem) -> Method:
    """Return the transcription that a problem asks for, or that suits it."""
    if problem.transcription != 'auto':
        return problem.transcription
    return 'multiple_shooting' if problem.control_interpolation == 'previous' else 'radau'


def first_mesh(problem: Problem) -> Mesh:
    """Return the mesh that a problem is first solved on."""
    return Mesh.of(
        [leg.nodes for leg in problem.legs],
        method_of(problem),
        problem.control_interpolation,
        spacing=problem.spacing,
        substeps=problem.substeps,
    )


def strategy_of(problem: Problem, mesh: Mesh) -> str:
    """Return the solver's strategy that suits a problem on a mesh.

    With held controls between limits the optimum often lies at these throughout, where lowering
    the barrier step by step is the surer way; else adapting it takes half the iterations.
    """
    limits = [problem.limits(name) for name in problem.stage.controls]
    return 'monotone' if mesh.held and np.isfinite(limits).all() else 'adaptive'


def finer(
    mesh: Mesh, misses: Array, interval: Index, worst: float, tolerance: float
) -> Mesh | None:
    """Return a mesh with shorter steps where a plan is off; None if it cannot be finer.

    Parameters
    ----------
    misses : (nx, stretches)
        How far each stretch between planned states misses the next one, over the states' ranges.
    interval : (stretches,)
        That each lies in.
    worst : float
        How far the plan is off, flown as a whole.
    """
    if mesh.shooting:
        substeps = 2 * mesh.substeps
        return replace(mesh, substeps=substeps) if substeps <= MAX_SUBSTEPS else None
    local = np.zeros(mesh.intervals)
    np.maximum.at(local, interval, np.nan_to_num(np.abs(misses).max(axis=0), nan=1.0))
    # flown in a row the intervals' errors add up, or grow
    growth = max(worst / max(local.sum(), 1e-300), 1.0)
    wanted = max(0.5 * tolerance / (growth * mesh.intervals), 1e-200)  # if it flew off
    parts = np.ceil((local / wanted) ** (1 / (ORDERS[mesh.method] + 1)))
    parts = np.clip(np.nan_to_num(parts, nan=MAX_PARTS), 1, MAX_PARTS).astype(int)
    if parts.max() == 1:
        parts[int(np.argmax(local))] = 2
    return mesh.split(parts.tolist()) if parts.sum() <= MAX_NODES else None


def resampled(attempt: Attempt, layout: Layout) -> Array:
    """Return an attempt's variables (SI) at the places of another layout of the same phases."""
    old, mesh = attempt.layout, layout.mesh
    values = np.zeros(layout.size)
    values[layout.durations] = attempt.values[old.durations]
    values[layout.total] = attempt.values[old.total]
    values[layout.integrals] = attempt.values[old.integrals]
    values[layout.changes] = attempt.values[old.changes]

    def places(of: Mesh, positions: Array) -> Array:
        at = of.phase + of.begin + positions[:, None] * of.length
        return at.ravel(order='F')

    inner = np.concatenate([[0.0], old.mesh.points[:-1]])
    at = np.concatenate([places(old.mesh, inner), [len(mesh.cuts)]])
    states = np.concatenate([old.nodes[:, None, :-1], old.inside], axis=1)
    states = np.column_stack([states.reshape(states.shape[0], -1, order='F'), old.nodes[:, -1]])
    steering = old.steering.reshape(old.steering.shape[0], -1, order='F')
    steered_at = places(old.mesh, old.mesh.control_positions)

    def fill(variables: Any, positions: Array, known: Any, known_at: Array) -> None:
        where = places(mesh, positions)
        for row in range(known.shape[0]):
            column = np.interp(where, known_at, attempt.values[known[row]])
            values[variables[row].ravel(order='F')] = column

    fill(layout.inside, mesh.points[:-1], states, at)
    fill(layout.nodes[:, None, :-1], np.zeros(1), states, at)
    fill(layout.nodes[:, None, 1:], np.ones(1), states, at)
    fill(layout.steering, mesh.control_positions, steering, steered_at)
    names, known = (np.array([each.name for each in of.bounded]) for of in (layout, old))
    at_new, at_old = _when(layout), _when(old)
    for name in np.unique(names):
        mine, theirs = names == name, known == name
        if theirs.any():
            order = np.argsort(at_old[theirs], kind='stable')
            column = attempt.values[old.outputs[theirs]][order]
            values[layout.outputs[mine]] = np.interp(at_new[mine], at_old[theirs][order], column)
    for row in range(layout.rates.shape[0]):
        steps_new, steps_old = (np.linspace(0, 1, each.rates.shape[1]) for each in (layout, old))
        values[layout.rates[row]] = np.interp(steps_new, steps_old, attempt.values[old.rates[row]])
    return values


def _when(layout: Layout) -> Array:
    """Return phase and fraction of it, added up, of each bounded output (ny,)."""
    mesh, bounded = layout.mesh, layout.bounded
    interval = np.array([each.interval for each in bounded], dtype=np.int64)
    position = np.array([each.position for each in bounded])
    when: Array = mesh.phase[interval] + mesh.begin[interval] + position * mesh.length[interval]
    return when
