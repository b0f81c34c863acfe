"""A flight straight up, such as a rocket's or a balloon's: its heights and what drives it."""

from dataclasses import replace

import numpy as np

from ..errors import MissingExtraError
from ..trajectory import Trajectory
from .kinematics import motion_of
from .panels import draw_panels, with_usual
from .plotting import NOTHING, About, put_heading, style

try:
    from matplotlib.figure import Figure
except ImportError as error:
    raise MissingExtraError('a figure', 'view') from error

OUTPUTS = ('radius',)
"""Outputs worth a history, beside altitude, climb rate, controls and the states that change."""


def climb_figure(trajectory: Trajectory, about: About = NOTHING) -> Figure:
    """Return altitude and climb rate over time, the controls, and the states that change.

    Parameters
    ----------
    trajectory : Trajectory
    about : About
        Limits are dashed, arcs shaded.
    """
    motion = motion_of(trajectory)
    climb = {'climb_rate': -motion.velocity[:, 2]}
    flight = with_usual(trajectory, motion)
    flight = replace(flight, outputs={**flight.outputs, **climb})
    moving = {'x_e', 'y_e', 'z_e', 'u_e', 'v_e', 'w_e', 'speed', 'gamma', 'track'}
    others = [n for n, v in flight.states.items() if n not in moving and np.ptp(v) > 0]
    outputs = [n for n in OUTPUTS if n in flight and np.ptp(flight[n]) > 0]
    names = ['altitude', 'climb_rate', *flight.controls, *others, *outputs]
    with style():
        figure = draw_panels(flight, [[name] for name in names], about)
        put_heading(figure, trajectory, about)
    return figure
