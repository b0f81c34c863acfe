"""Verification: fly the planned controls again and measure how far the plan is off."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..dynamics.stage import Stage
from ..simulation.integrator import reintegrate
from .transcription import Mesh, Point

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Verification:
    """Largest error of each state against the flight, and the largest one over its range."""

    errors: dict[str, float]
    worst: float
    worst_state: str


def verify(stage: Stage, mesh: Mesh, point: Point, wind: tuple[float, ...]) -> Verification:
    """Return how far the nodes are from the flight that starts at the first node.

    The whole plan is flown open-loop by CVODES, so errors build up as they would in the air.
    """
    n = mesh.intervals
    u_begin = point.controls[:, :n]
    u_end = point.controls[:, 1:] if mesh.control_interpolation == 'linear' else u_begin
    time = np.linspace(0, point.duration, n + 1)
    flown = reintegrate(stage, point.states[:, 0], time, u_begin, u_end, wind)
    errors = np.abs(flown - point.states).max(axis=1)
    ranges = np.maximum(np.ptp(point.states, axis=1), 1.0)
    relative = np.nan_to_num(errors / ranges, nan=np.inf)
    worst = int(np.argmax(relative))
    return Verification(
        errors=dict(zip(stage.states, errors.tolist(), strict=True)),
        worst=float(relative[worst]),
        worst_state=stage.states[worst],
    )
