"""Bang-bang plans: their arcs, and problems in which the switches between them are free.

On a mesh a control can switch only from interval to interval; where the best switch lies inside
one it takes a value between its limits there. Once it is known in which order controls go from
limit to limit, the arcs become phases with controls fixed and durations free, and the plan exact.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .problem import Phase, Problem
from .programme import Attempt

Array = NDArray[np.float64]

AT_LIMIT = 0.05  # of a control's range: taken to be at its limit
LONGEST_SWITCH = 2  # intervals between limits that a switch may take on a mesh
SHORTEST = 1e-4  # of the duration: what arcs are kept above
VANISHED = 1e-3  # of the duration: arcs as short as that are left out
MOST_ARCS = 40


@dataclass(frozen=True)
class Arc:
    """A stretch over which every control is at a limit.

    Parameters
    ----------
    upper : for each control
        Whether it is at its upper limit, or at its lower one.
    duration : float [s]
    """

    upper: tuple[bool, ...]
    duration: float


def find_arcs(problem: Problem, attempt: Attempt) -> list[Arc] | None:
    """Return the arcs that a plan with held controls consists of; None if it is not bang-bang."""
    layout, mesh = attempt.layout, attempt.structure.mesh
    limits = np.array([problem.limits(name) for name in layout.control_names]).reshape(-1, 2)
    if not mesh.held or not limits.size or not np.isfinite(limits).all():
        return None
    spans = limits[:, 1] - limits[:, 0]
    if (spans <= 0).any():
        return None
    level = np.clip((attempt.values[layout.controls] - limits[:, :1]) / spans[:, None], 0, 1)
    durations = attempt.values[layout.durations]
    length = mesh.length * durations[mesh.phase]
    starts = np.concatenate([[0.0], np.cumsum(length)])
    events: list[tuple[float, int, bool]] = []
    first: list[bool] = []
    for row, values in enumerate(level):
        switches = _switches(values, starts)
        if switches is None:
            return None
        first.append(switches[0])
        events += [(time, row, upper) for time, upper in switches[1]]
    state, arcs, before = list(first), list[Arc](), 0.0
    for time, row, upper in sorted(events):
        arcs.append(Arc(tuple(state), time - before))
        state[row], before = upper, time
    arcs.append(Arc(tuple(state), float(starts[-1]) - before))
    return joined(arcs) if len(arcs) <= MOST_ARCS else None


def _switches(level: Array, starts: Array) -> tuple[bool, list[tuple[float, bool]]] | None:
    """Return whether a control begins at its upper limit, and its switches (time, to upper).

    None if it stays between its limits for longer than a switch may take.
    """
    side = np.where(level < AT_LIMIT, -1, np.where(level > 1 - AT_LIMIT, 1, 0))
    known = np.flatnonzero(side)
    if not known.size:
        return None
    inner = np.diff(known) - 1
    if max(inner.max(initial=0), known[0], level.size - 1 - known[-1]) > LONGEST_SWITCH:
        return None
    now = bool(side[known[0]] > 0)
    found: list[tuple[float, bool]] = []
    if known[0] > 0:
        # what is between the limits at the very beginning is a short arc at the other one
        part = _time_at_upper(level[: known[0]], starts[: known[0] + 1])
        other = part if not now else float(starts[known[0]]) - part
        found.append((other, now))
        now = not now
    begin = now
    now = bool(side[known[0]] > 0)
    for a, b in pairwise(known):
        upper = bool(side[b] > 0)
        t0, t1 = float(starts[a + 1]), float(starts[b])
        at_upper = _time_at_upper(level[a + 1 : b], starts[a + 1 : b + 1])
        if upper != now:
            # the switch that gives the same mean
            found.append((t1 - at_upper if upper else t0 + at_upper, upper))
        elif b > a + 1:
            pulse = at_upper if not now else t1 - t0 - at_upper
            middle = (t0 + t1) / 2
            found += [(middle - pulse / 2, not now), (middle + pulse / 2, now)]
        now = upper
    if known[-1] < level.size - 1:
        t0, t1 = float(starts[known[-1] + 1]), float(starts[-1])
        at_upper = _time_at_upper(level[known[-1] + 1 :], starts[known[-1] + 1 :])
        found.append((t0 + at_upper if now else t1 - at_upper, not now))
    return begin, found


def _time_at_upper(level: Array, edges: Array) -> float:
    return float(level @ np.diff(edges))


def joined(arcs: Sequence[Arc]) -> list[Arc]:
    """Return the arcs without those that have vanished, like ones joined."""
    total = sum(arc.duration for arc in arcs)
    kept: list[Arc] = []
    for arc in arcs:
        if arc.duration < VANISHED * total:
            continue
        if kept and kept[-1].upper == arc.upper:
            kept[-1] = Arc(arc.upper, kept[-1].duration + arc.duration)
        else:
            kept.append(arc)
    return kept


def with_arcs(problem: Problem, arcs: Sequence[Arc], nodes: int) -> Problem:
    """Return the problem flown in arcs: controls fixed, durations free.

    Parameters
    ----------
    nodes : int
        Intervals in all, shared by duration; each arc has at least one.
    """
    total = sum(arc.duration for arc in arcs)
    names = problem.stage.controls
    phases = []
    for i, arc in enumerate(arcs):
        fixed = {}
        for name, upper in zip(names, arc.upper, strict=True):
            value = problem.limits(name)[1 if upper else 0]
            fixed[name] = (value, value)
        phases.append(
            Phase(
                name=f'arc_{i + 1}',
                duration=(SHORTEST * problem.duration[0], problem.duration[1]),
                duration_guess=arc.duration,
                path=fixed,
                nodes=max(1, round(nodes * arc.duration / total)),
            )
        )
    # bounds of controls at the ends belong to the mesh: what is fixed there is fixed
    ends: dict[str, Any] = {
        group: {k: v for k, v in getattr(problem, group).items() if k not in names}
        for group in ('initial', 'final')
    }
    return replace(problem, phases=tuple(phases), sharpen=False, **ends)


def arcs_of(problem: Problem, attempt: Attempt) -> list[Arc]:
    """Return the arcs of an attempt at what `with_arcs` made of a problem."""
    durations = attempt.values[attempt.layout.durations]
    return [
        Arc(
            tuple(
                phase.path[name][0] == problem.limits(name)[1] for name in problem.stage.controls
            ),
            float(duration),
        )
        for phase, duration in zip(attempt.problem.phases, durations, strict=True)
    ]


def described(problem: Problem, arcs: Sequence[Arc]) -> list[dict[str, Any]]:
    """Return arcs as a report lists them."""
    edges = np.concatenate([[0.0], np.cumsum([arc.duration for arc in arcs])])
    return [
        {
            'start': float(start),
            'end': float(end),
            'limits': {
                name: 'upper' if upper else 'lower'
                for name, upper in zip(problem.stage.controls, arc.upper, strict=True)
            },
        }
        for arc, start, end in zip(arcs, edges[:-1], edges[1:], strict=True)
    ]
