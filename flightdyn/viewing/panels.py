"""Which columns of a flight are worth a history, and which of them share an axis."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import MissingExtraError
from ..trajectory import Trajectory
from .kinematics import Motion
from .plotting import NOTHING, About, draw_columns, label_time, new_figure, time_unit
from .quantities import unit_of

try:
    from matplotlib.figure import Figure
except ImportError as error:
    raise MissingExtraError('a figure', 'view') from error

_ORDER = (
    ('airspeed', 'speed'), ('gamma',), ('bank',), ('phi', 'theta'), ('alpha',), ('load_factor',),
)  # fmt: skip
STILL = (
    1e-9  # an output that moves by no more, such as the bank in a vertical plane, tells nothing
)
_RELATED = (
    ('x_e', 'y_e'), ('u_e', 'v_e', 'w_e'), ('u_b', 'v_b', 'w_b'), ('speed', 'airspeed'),
    ('gamma', 'theta', 'alpha', 'beta'), ('bank', 'phi'), ('track', 'psi'),
    ('qw', 'qx', 'qy', 'qz'), ('p', 'q', 'r'),
)  # fmt: skip


def with_usual(trajectory: Trajectory, motion: Motion) -> Trajectory:
    """Return the trajectory with the altitude and speed that its motion has, as outputs."""
    more = {'altitude': motion.altitude, 'speed': motion.speed}
    lacking = {name: column for name, column in more.items() if name not in trajectory}
    return replace(trajectory, outputs={**trajectory.outputs, **lacking})


def panels_of(trajectory: Trajectory, about: About = NOTHING) -> list[list[str]]:
    """Return which columns of a flight are worth a history, those that share an axis together.

    Speeds, angles, controls by unit, and the load factor. In still air there is but one speed,
    the one that has limits.
    """
    speeds = [name for name in _ORDER[0] if name in trajectory]
    if len(speeds) == 2 and np.allclose(trajectory['speed'], trajectory['airspeed'], rtol=1e-6):
        speeds = [name for name in speeds if name in about.limits][:1] or speeds[:1]
    chosen = [speeds]
    chosen += [[name for name in group if name in trajectory] for group in _ORDER[1:]]
    # a rigid body's attitude tells more than its bank about the velocity, a point mass' does not
    chosen[2 if 'theta' in trajectory.states or 'qw' in trajectory.states else 3] = []
    if 'lift' not in trajectory and 'alpha' not in trajectory.controls:
        chosen[4] = []  # nothing comes of it
    still = {name for name, column in trajectory.outputs.items() if not np.ptp(column) > STILL}
    chosen = [[name for name in names if name not in still] for names in chosen]
    shown = {name for names in chosen for name in names}
    by_unit: dict[str, list[str]] = {}
    for name in trajectory.controls:
        if name not in shown:
            unit = unit_of(name)[0]
            by_unit.setdefault(name if unit == '-' else unit, []).append(name)
    bare = [name for name in by_unit if unit_of(name)[0] == '-']
    if len(bare) > 2:  # such as the rotors, too many for an axis each
        by_unit = {key: names for key, names in by_unit.items() if key not in bare}
        by_unit['-'] = bare
    # controls are what was decided: they come before what follows of them
    alike = list(by_unit.values())
    return [names for names in (*chosen[:3], *alike, *chosen[3:]) if names]


def related(trajectory: Trajectory, names: list[str]) -> list[list[str]]:
    """Return names that share an axis, in the order given."""
    panels: dict[object, list[str]] = {}
    for name in names:
        key: object = next((group for group in _RELATED if name in group), None)
        if key is None:
            key = (unit_of(name)[0], name in trajectory.controls)
            if key[0] == '-':  # without a unit nothing says that two belong together
                key = name
        panels.setdefault(key, []).append(name)
    return list(panels.values())


def draw_panels(
    trajectory: Trajectory, panels: Sequence[Sequence[str]], about: About = NOTHING
) -> Figure:
    """Return a figure with a panel for each group of columns, in one column or two."""
    _, per_second = time_unit(trajectory)
    columns = 1 if len(panels) < 4 else 2
    rows = -(-len(panels) // columns)
    figure = new_figure((7.0 if columns == 1 else 9.0, 1.0 + 1.6 * rows))
    grid = figure.subplots(rows, columns, sharex=True, squeeze=False)
    axes = grid.T.ravel()
    for ax, panel in zip(axes, panels, strict=False):
        draw_columns(ax, trajectory, panel, per_second, about)
    for ax in axes[len(panels) :]:
        ax.set_visible(False)
    for i in range(columns):
        label_time(list(axes[i * rows : min((i + 1) * rows, len(panels))]), trajectory)
    return figure
