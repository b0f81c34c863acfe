"""Terrain, keep-outs, gates and marks, drawn under a ground track and a profile."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..environment.surroundings import Cylinder, Surroundings, Terrain
from ..errors import MissingExtraError
from .kinematics import Motion
from .plotting import MUTED

try:
    from matplotlib.axes import Axes
    from matplotlib.colors import LinearSegmentedColormap
    from matplotlib.patches import Circle, Polygon
except ImportError as error:
    raise MissingExtraError('a figure', 'view') from error

Array = NDArray[np.float64]

CONTOURS = 9
_GROUND = LinearSegmentedColormap.from_list('ground', ['#f6f4ee', '#cbbfa6'])
_GROUND_COLOR, _KEEP_OUT, _GATE = '#d8cfbb', '#d55e00', '#cc79a7'


def draw_ground(ax: Axes, surroundings: Surroundings, scale: float) -> None:
    """Draw surroundings from above, north up.

    Parameters
    ----------
    scale : float
        From metres to the unit of the axes.
    """
    terrain = surroundings.terrain
    if terrain is not None and np.ptp(terrain.height) > 0:
        grid = terrain.y * scale, terrain.x * scale, terrain.height
        ax.contourf(*grid, CONTOURS, cmap=_GROUND, zorder=0)
        lines = ax.contour(*grid, CONTOURS, colors='#a89878', linewidths=0.5, zorder=0)
        ax.clabel(lines, fontsize=6, fmt='%g m')
    for each in surroundings.keep_out:
        look: dict[str, Any] = {
            'facecolor': _KEEP_OUT,
            'edgecolor': _KEEP_OUT,
            'alpha': 0.25,
            'zorder': 1,
        }
        if isinstance(each, Cylinder):
            north, east = each.centre
            ax.add_patch(Circle((east * scale, north * scale), each.radius * scale, **look))
        else:
            corners = np.array([(east, north) for north, east in each.corners])
            ax.add_patch(Polygon(corners * scale, **look))
            north, east = np.mean(each.corners, axis=0)
        _name(ax, each.name, east * scale, north * scale, _KEEP_OUT, middle=True)
    named: dict[tuple[float, float], list[str]] = {}
    for gate in surroundings.gates:
        north, east, _ = gate.centre
        aside = gate.width / 2 * np.array([np.cos(gate.heading), -np.sin(gate.heading)])
        ends = (np.array([[east], [north]]) + np.outer(aside, [-1, 1])) * scale
        ax.plot(*ends, color=_GATE, lw=3, solid_capstyle='butt', zorder=2)
        named.setdefault((east, north), []).append(gate.name)
    for (east, north), names in named.items():  # gates can stand one above the other
        _name(ax, ', '.join(names), east * scale, north * scale, _GATE)
    for mark in surroundings.marks:
        north, east, _ = mark.place
        ax.plot(east * scale, north * scale, '^', color='black', ms=5, zorder=2)
        _name(ax, mark.name, east * scale, north * scale, 'black')
        if mark.radius > 0:
            circle = Circle(
                (east * scale, north * scale), mark.radius * scale, fill=False, ec=MUTED, ls=':'
            )
            ax.add_patch(circle)


def draw_below(
    ax: Axes, surroundings: Surroundings, motion: Motion, along: Array, factor: float
) -> None:
    """Draw the ground under a flight, the clearance it keeps, and gates where it is nearest.

    Parameters
    ----------
    along : array (n,)
        Where each sample of the motion stands on the axis.
    factor : float
        From metres to the unit of the height axis.
    """
    if surroundings.terrain is not None:
        ground = height_at(surroundings.terrain, motion.position[:, 0], motion.position[:, 1])
        low = min(float(ground.min()), float(motion.altitude.min()))
        foot = low - 0.05 * max(float(motion.altitude.max()) - low, 1e-9)
        for part in motion.segments:
            ax.fill_between(
                along[part], foot * factor, ground[part] * factor, color=_GROUND_COLOR, lw=0
            )
            if surroundings.terrain.clearance > 0:
                least = (ground[part] + surroundings.terrain.clearance) * factor
                ax.plot(along[part], least, color=MUTED, ls=(0, (5, 4)), lw=0.9, zorder=1)
        ax.set_ylim(bottom=foot * factor)
    for gate in surroundings.gates:
        apart = np.linalg.norm(motion.position - np.array(gate.centre) * [1, 1, -1], axis=1)
        at = along[int(np.argmin(apart))]
        half = gate.height / 2
        span = np.array([gate.centre[2] - half, gate.centre[2] + half]) * factor
        ax.plot([at, at], span, color=_GATE, lw=3, solid_capstyle='butt', zorder=2)


def height_at(terrain: Terrain, x: Array, y: Array) -> Array:
    """Return the height of the ground [m], linear between the grid's lines; edges go on outside.

    Parameters
    ----------
    x, y : array (n,)
        North and east [m].
    """
    x, y = (np.clip(at, lines[0], lines[-1]) for at, lines in ((x, terrain.x), (y, terrain.y)))
    i = np.clip(np.searchsorted(terrain.x, x, side='right') - 1, 0, terrain.x.size - 2)
    j = np.clip(np.searchsorted(terrain.y, y, side='right') - 1, 0, terrain.y.size - 2)
    s = (x - terrain.x[i]) / (terrain.x[i + 1] - terrain.x[i])
    t = (y - terrain.y[j]) / (terrain.y[j + 1] - terrain.y[j])
    h = terrain.height
    found: Array = (
        (1 - s) * ((1 - t) * h[i, j] + t * h[i, j + 1])
        + s * ((1 - t) * h[i + 1, j] + t * h[i + 1, j + 1])
    )  # fmt: skip
    return found


def _name(ax: Axes, name: str, x: float, y: float, color: str, *, middle: bool = False) -> None:
    place: dict[str, Any] = (
        {'ha': 'center', 'va': 'center'} if middle else {'ha': 'left', 'va': 'bottom'}
    )
    ax.annotate(
        name, (x, y), (0, 0) if middle else (4, 3), textcoords='offset points', fontsize=7,
        color=color, zorder=4, annotation_clip=True, **place,
    )  # fmt: skip
