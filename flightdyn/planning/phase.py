"""A part of a flight with conditions of its own."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

Bounds = Mapping[str, tuple[float, float]]


@dataclass(frozen=True, kw_only=True)
class Phase:
    """A part of a flight with conditions of its own.

    Parameters
    ----------
    name : str
    duration : lower, upper [s]
    duration_guess : float [s]
    initial, final, path, guess : mappings
        As the problem's, of this phase alone and on top of them.
    nodes : int
        Intervals of its first mesh.
    """

    name: str = ''
    duration: tuple[float, float]
    duration_guess: float
    initial: Bounds = field(default_factory=dict)
    final: Bounds = field(default_factory=dict)
    path: Bounds = field(default_factory=dict)
    guess: Mapping[str, Sequence[float]] = field(default_factory=dict)
    nodes: int = 20
