"""Gates as phases: each is the end of one, so that the time at it is free."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .phase import Bounds, Phase

if TYPE_CHECKING:
    from ..environment.surroundings import Gate

Array = NDArray[np.float64]

FEWEST_NODES = 5  # between two gates
SHORTEST = 1e-3  # of the guessed duration, between two gates
END = 'to_end'
"""Name of the phase after the last gate; those before are to_NAME."""


def gate_conditions(gate: 'Gate') -> Bounds:
    """Return what holds in a gate: in its plane, within its opening, flown the right way."""
    return {
        f'{gate.name}_along': (0.0, 0.0),
        f'{gate.name}_aside': (-gate.width / 2, gate.width / 2),
        f'{gate.name}_above': (-gate.height / 2, gate.height / 2),
        f'{gate.name}_through': (0.0, np.inf),
    }


def gate_phases(
    gates: Sequence['Gate'],
    initial: Bounds,
    final: Bounds,
    duration: tuple[float, float],
    duration_guess: float,
    nodes: int,
    guess: Mapping[str, Sequence[float]],
) -> tuple[Phase, ...]:
    """Return phases through gates in their order, and on to what holds at the end, if anything.

    Nodes and the guessed duration are shared out by the distances between the gates. The guess
    goes straight from gate to gate, for those of x_e, y_e and z_e that `guess` lacks.
    """
    centres = [(x, y, -altitude) for x, y, altitude in (gate.centre for gate in gates)]
    places = [_place(initial, centres[0]), *centres]
    names = [f'to_{gate.name}' for gate in gates]
    ends = [gate_conditions(gate) for gate in gates]
    if final:
        places.append(_place(final, centres[-1]))
        names.append(END)
        ends.append({})
    legs = np.array(places)
    distance = np.linalg.norm(np.diff(legs, axis=0), axis=1)
    # a leg of no length, as in turning about, takes its time, too
    distance = np.maximum(distance, 0.1 * max(float(distance.max()), 1e-3))
    shares = distance / distance.sum()
    return tuple(
        Phase(
            name=name,
            duration=(SHORTEST * duration_guess, duration[1]),
            duration_guess=float(share) * duration_guess,
            final=end,
            guess={
                axis: (float(a), float(b))
                for axis, a, b in zip(('x_e', 'y_e', 'z_e'), start, stop, strict=True)
                if axis not in guess
            },
            nodes=max(FEWEST_NODES, round(float(share) * nodes)),
        )
        for name, share, end, start, stop in zip(
            names, shares, ends, legs[:-1], legs[1:], strict=True
        )
    )


def _place(given: Bounds, otherwise: tuple[float, float, float]) -> tuple[float, ...]:
    """Return the place of an end where it is known, else another."""
    found = []
    for axis, value in zip(('x_e', 'y_e', 'z_e'), otherwise, strict=True):
        lower, upper = given.get(axis, (-np.inf, np.inf))
        known = [each for each in (lower, upper) if np.isfinite(each)]
        found.append(float(np.mean(known)) if known else value)
    return tuple(found)
