"""A planar quadcopter drawn along its path, each rotor coloured by its thrust."""

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, MissingExtraError
from ..trajectory import Trajectory
from .plotting import NOTHING, About, draw_columns, label_time, new_figure, put_heading, style

try:
    from matplotlib.axes import Axes
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize
    from matplotlib.figure import Figure
    from matplotlib.patches import Ellipse, Rectangle
    from matplotlib.transforms import Affine2D
except ImportError as error:
    raise MissingExtraError('a figure', 'view') from error

WIDTH = 0.1  # m, between the rotors
ROTORS = {'thrust_left': -0.5, 'thrust_right': 0.5}  # x_b in widths
SNAPSHOTS = 13
MOST_WIDTHS = 15  # along a path: of a longer one the vehicle is drawn larger, to be seen
_THRUST_MAP = LinearSegmentedColormap.from_list('thrust', ['#dbe6f2', '#5b92c8', '#08306b'])


def flip_figure(plan: Trajectory, about: About = NOTHING) -> Figure:
    """Return a quadcopter's planar manoeuvre: the vehicle along its path, and its thrusts.

    Parameters
    ----------
    plan : Trajectory
        With x_e, z_e [m], theta [rad] and, if known, thrust_left, thrust_right [N]. On a path
        longer than `MOST_WIDTHS` the vehicle is drawn larger, and the figure says so.
    about : About
        Limits of the thrusts are dashed, every other arc is shaded.

    Raises
    ------
    InputError
        If x_e, z_e or theta is missing.
    """
    missing = [name for name in ('x_e', 'z_e', 'theta') if name not in plan]
    if missing:
        raise InputError(f'no flip to draw: the trajectory lacks {", ".join(missing)}')
    x, altitude = plan['x_e'], -plan['z_e']
    extent = max(float(np.ptp(x)), float(np.ptp(altitude)), WIDTH)
    larger = max(1.0, extent / (MOST_WIDTHS * WIDTH))
    thrusts = [name for name in ROTORS if name in plan]
    high = max((float(plan[name].max()) for name in thrusts), default=1.0)
    norm = Normalize(0.0, max(high, 1e-9))
    with style():
        figure = new_figure((8.0, 4.6 + 1.0 * len(thrusts)))
        scene, *histories = figure.subplots(
            1 + len(thrusts), 1, height_ratios=(3.4, *(1 for _ in thrusts)), squeeze=False
        ).ravel()
        for ax, name in zip(histories, thrusts, strict=True):
            draw_columns(ax, plan, [name], about=about)
            ax.margins(y=0.12)
        if thrusts:
            label_time(histories, plan)
            bar = ScalarMappable(norm=norm, cmap=_THRUST_MAP)
            figure.colorbar(bar, ax=scene, label='rotor thrust [N]', pad=0.01)
        scene.plot(x, altitude, color='#b0b0b0', lw=1.2, zorder=1)
        for t in _snapshot_times(plan):
            _draw_vehicle(scene, plan, float(t), WIDTH * larger, norm)
        room = 0.9 * WIDTH * larger
        scene.set_xlim(x.min() - room, x.max() + room)
        scene.set_ylim(altitude.min() - room, altitude.max() + room)
        scene.set_aspect('equal', adjustable='box')
        scene.set(xlabel='x_e [m]', ylabel='altitude [m]')
        note = f'vehicle drawn {larger:.2g} times its size' if larger > 1.05 else ''
        put_heading(figure, plan, about, note)
    return figure


def _snapshot_times(plan: Trajectory) -> NDArray[np.float64]:
    """Return times spread evenly over path, rotation and time, so that pictures rarely overlap."""
    x, z, theta = plan['x_e'], plan['z_e'], plan['theta']
    moved = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(z)))])
    turned = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(theta)))])
    share = 0.05 * (plan.time - plan.time[0]) / max(plan.duration, 1e-12)
    share = share + 0.75 * moved / max(moved[-1], 1e-12) + 0.2 * turned / max(turned[-1], 1e-12)
    times: NDArray[np.float64] = np.interp(np.linspace(0, share[-1], SNAPSHOTS), share, plan.time)
    return times


def _draw_vehicle(ax: Axes, plan: Trajectory, t: float, width: float, norm: Normalize) -> None:
    x, z, theta = (float(plan.sample(name, [t])[0]) for name in ('x_e', 'z_e', 'theta'))
    # Forward is to the right and up is up: pitching up turns anticlockwise.
    place = Affine2D().scale(width).rotate(theta).translate(x, -z) + ax.transData
    patches = [
        Rectangle((-0.5, -0.05), 1.0, 0.1, color='#333333'),
        Rectangle((0.3, -0.05), 0.2, 0.1, color='#d55e00'),  # the nose
    ]
    for at in ROTORS.values():
        patches.append(Rectangle((at - 0.025, 0.0), 0.05, 0.16, color='#333333'))
    rotors = []
    for name, at in ROTORS.items():
        thrust = float(plan.sample(name, [t])[0]) if name in plan else 0.0
        rotors.append(
            Ellipse((at, 0.19), 0.62, 0.15, fc=_THRUST_MAP(norm(thrust)), ec='#333333', lw=0.5)
        )
    for patch in [*patches, *rotors]:
        patch.set_transform(place)
        patch.set_zorder(5)
        ax.add_patch(patch)
