"""A plan against what became of it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import MissingExtraError
from ..trajectory import Trajectory
from .kinematics import Motion, motion_of, pose_at
from .plotting import COLORS, NOTHING, About, legend_above, new_figure, put_heading, style

try:
    from matplotlib.figure import Figure
except ImportError as error:
    raise MissingExtraError('a figure', 'view') from error

Array = NDArray[np.float64]


def comparison_figure(
    planned: Trajectory,
    flown: Trajectory,
    replayed: Trajectory | None = None,
    about: About = NOTHING,
) -> Figure:
    """Return a plan and what became of it: paths, altitude, speed and distance apart in time.

    Parameters
    ----------
    planned, flown : Trajectory
        Compared at equal times since each one's start, or by date if both have one.
    replayed : Trajectory or None
        What a replay of the flight's log found.
    about : About
        Of the flight.
    """
    plan = motion_of(planned, origin=flown.origin)
    runs = [('planned', planned, plan), ('flown', flown, motion_of(flown))]
    if replayed is not None:
        runs.append(('replayed', replayed, motion_of(replayed, origin=flown.origin)))
    errors = {name: _apart(plan, planned, run, motion) for name, run, motion in runs[1:]}
    unit, factor = _unit(max(float(np.abs(e).max(initial=0)) for _, e in errors.values()))
    looks = {'planned': ('#000000', '--'), 'flown': (COLORS[0], '-'), 'replayed': (COLORS[1], ':')}
    with style():
        figure = new_figure((9.0, 6.0))
        path, high, apart, fast = figure.subplots(2, 2).ravel()
        sideways = float(np.ptp(plan.position[:, 1])) > 1e-3 * max(plan.size, 1e-9)
        for name, run, motion in runs:
            color, line = looks[name]
            t = run.time + _offset(flown, run)
            for i, part in enumerate(motion.segments):
                label = name if i == 0 else None
                # dashes show on what they meet
                over = 3 if name == 'planned' else 2
                look: dict[str, Any] = {'color': color, 'ls': line, 'zorder': over, 'label': label}
                across = motion.position[part, 1] if sideways else motion.position[part, 0]
                along = motion.position[part, 0] if sideways else motion.altitude[part]
                path.plot(across, along, **look)
                high.plot(t[part], motion.altitude[part], **look)
                fast.plot(t[part], motion.speed[part], **look)
            if name == 'planned':
                continue
            inside, error = errors[name]
            error = error * factor
            label = 'distance' if len(runs) == 2 else name
            apart.plot(t[inside], np.linalg.norm(error, axis=1), color=color, ls=line, label=label)
            if len(runs) == 2:
                for i, axis in enumerate(('x_e', 'y_e', 'z_e')):
                    if np.abs(error[:, i]).max(initial=0) > 0:
                        apart.plot(t[inside], error[:, i], lw=0.9, label=axis, color=COLORS[i + 1])
        path.set(xlabel='y_e, east [m]' if sideways else 'x_e [m]',
                 ylabel='x_e, north [m]' if sideways else 'altitude [m]')  # fmt: skip
        path.set_aspect('equal', adjustable='datalim')
        legend_above(path)
        high.set(xlabel='time [s]', ylabel='altitude [m]')
        fast.set(xlabel='time [s]', ylabel='speed [m/s]')
        what = 'flown less planned' if len(runs) == 2 else 'distance from plan'
        apart.set(xlabel='time [s]', ylabel=f'{what} [{unit}]')
        legend_above(apart)
        put_heading(figure, flown, about)
    return figure


def _apart(
    plan: Motion, planned: Trajectory, run: Trajectory, motion: Motion
) -> tuple[NDArray[np.bool_], Array]:
    """Return at which samples of a run there is a plan, and how far off it they are [m] (m, 3)."""
    meant, _, inside = pose_at(plan, run.time - _offset(run, planned))
    return inside, (motion.position - meant)[inside]


def _unit(greatest: float) -> tuple[str, float]:
    """Return the unit for distances up to so many metres, and the factor to it."""
    for least, unit, factor in ((1e-2, 'm', 1.0), (2e-5, 'mm', 1e3), (2e-8, 'um', 1e6)):
        if greatest >= least:
            return unit, factor
    return ('nm', 1e9) if greatest > 0 else ('m', 1.0)


def _offset(reference: Trajectory, other: Trajectory) -> float:
    if reference.start_ns and other.start_ns:
        return (other.start_ns - reference.start_ns) / 1e9
    return 0.0
