"""Figures of plans, simulations and flights, drawn without a screen."""

import os
from pathlib import Path

import numpy as np

from ..environment.surroundings import Surroundings
from ..errors import InputError, MissingExtraError
from ..files import written_whole
from ..logs.track import Track
from ..trajectory import Trajectory
from .climb_figure import climb_figure as climb_figure
from .comparison_figure import comparison_figure as comparison_figure
from .convergence_figure import convergence_figure as convergence_figure
from .flip_figure import flip_figure as flip_figure
from .history_figure import history_figure as history_figure
from .kinematics import motion_of
from .path_figure import path_figure as path_figure
from .plotting import NOTHING
from .plotting import About as About
from .profile_figure import profile_figure as profile_figure
from .replay_figure import replay_figure as replay_figure
from .study_figures import polar_figure as polar_figure
from .study_figures import tracks_figure as tracks_figure
from .sweep_figures import sweep_figure as sweep_figure

try:
    from matplotlib.figure import Figure
except ImportError as error:
    raise MissingExtraError('a figure', 'view') from error

SUFFIXES = ('.png', '.svg', '.pdf')
LEVEL = 1e-3
"""A flight that goes aside, or ahead, by less than this share of its extent does not."""


def figure_for(
    trajectory: Trajectory,
    surroundings: Surroundings | None = None,
    *,
    about: About = NOTHING,
    planned: Trajectory | None = None,
    replayed: Trajectory | None = None,
    track: Track | None = None,
) -> Figure:
    """Return the figure that shows most of a trajectory.

    A comparison if there is a plan to compare with; a replay's ground track and histories with
    their errors; a planar quadcopter's manoeuvre; a path in space over its surroundings; a climb
    straight up; a profile of a flight in a vertical plane; else states and controls over time.

    Parameters
    ----------
    trajectory : Trajectory
    surroundings : Surroundings or None
        What stands around the flight: then it is drawn over that.
    about : About
        What is written above, and limits.
    planned, replayed : Trajectory or None
        See `comparison_figure`.
    track : Track or None
        What a replay was made from, see `replay_figure`.
    """
    if planned is not None:
        return comparison_figure(planned, trajectory, replayed, about)
    if track is not None or trajectory.start_ns or 'lat' in trajectory:
        return replay_figure(trajectory, about, track=track)
    motion = motion_of(trajectory)
    ahead, aside, up = np.ptp(motion.position, axis=0)
    least = LEVEL * max(motion.size, 1e-9)
    if surroundings or aside > least:
        return path_figure(trajectory, surroundings, about)
    if 'theta' in trajectory.states and 'thrust_left' in trajectory:
        return flip_figure(trajectory, about)
    if up > least and ahead <= least:
        return climb_figure(trajectory, about)
    if ahead > least and up > 0:
        return profile_figure(trajectory, about)
    return history_figure(trajectory, about=about)


def save_figure(figure: Figure, path: str | os.PathLike[str], *, dpi: float = 150.0) -> None:
    """Write a figure as PNG, SVG or PDF by the path's suffix; never half a file.

    Raises
    ------
    InputError
        If the suffix is none of them, or there is no such folder.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f'cannot draw {path}: a figure ends in {", ".join(SUFFIXES)}')
    with written_whole(path) as temporary:
        figure.savefig(temporary, format=suffix[1:], dpi=dpi)
