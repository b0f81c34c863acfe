"""How columns are named, scaled and grouped when people read them."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..trajectory import Trajectory
from .kinematics import Motion

Array = NDArray[np.float64]

DEG = float(np.degrees(1.0))

_UNITS: dict[str, tuple[str, float]] = {
    **dict.fromkeys(
        ('x_e', 'y_e', 'z_e', 'altitude', 'distance', 'deviation', 'radius'), ('m', 1.0)
    ),
    **dict.fromkeys(
        (
            'u_e',
            'v_e',
            'w_e',
            'u_b',
            'v_b',
            'w_b',
            'speed',
            'airspeed',
            'groundspeed',
            'climb_rate',
        ),
        ('m/s', 1.0),
    ),
    **dict.fromkeys(('gamma', 'track', 'bank', 'phi', 'theta', 'psi'), ('deg', DEG)),
    **dict.fromkeys(('p', 'q', 'r'), ('deg/s', DEG)),
    **dict.fromkeys(('alpha', 'beta', 'lat', 'lon'), ('deg', 1.0)),
    **dict.fromkeys(('lift', 'drag', 'side_force', 'thrust', 'weight', 'buoyancy'), ('N', 1.0)),
    **dict.fromkeys(('mass', 'fuel'), ('kg', 1.0)),
    'fuel_flow': ('kg/s', 1.0),
    'power': ('W', 1.0),
    **dict.fromkeys(('energy', 'charge'), ('J', 1.0)),
    'energy_height': ('m', 1.0),
    'density': ('kg/m^3', 1.0),
    'pressure': ('Pa', 1.0),
    'temperature': ('K', 1.0),
    'dynamic_pressure': ('Pa', 1.0),
}
NOTHING = 1e-9
"""An output that is never larger says that there is no such motion, such as beta in a plane."""

_MOTION = (
    *('x_e', 'y_e', 'z_e', 'u_e', 'v_e', 'w_e', 'u_b', 'v_b', 'w_b', 'speed', 'gamma', 'track'),
    *('phi', 'theta', 'psi', 'p', 'q', 'r', 'alpha', 'beta', 'bank', 'qw', 'qx', 'qy', 'qz'),
)

_UNIT_PREFIXES = {'thrust_': ('N', 1.0), 'F': ('N', 1.0), 'M': ('N m', 1.0)}
_FORCE_AXES = ('_b', '_e', '_w', '_s', '_g')


def unit_of(name: str) -> tuple[str, float]:
    """Return the unit a column is shown in, '-' for none, and the factor from its own unit."""
    base = name.removesuffix('_std')
    if base in _UNITS:
        return _UNITS[base]
    for prefix, unit in _UNIT_PREFIXES.items():
        if base.startswith(prefix) and (prefix.endswith('_') or base.endswith(_FORCE_AXES)):
            return unit
    return '-', 1.0


@dataclass(frozen=True)
class Series:
    """One line of a plot, in the unit it is shown in; `std` is its 1-sigma or None."""

    name: str
    values: Array
    std: Array | None = None
    steps: bool = False


@dataclass(frozen=True)
class Group:
    """Lines that share an axis; `key` names it in paths, `title` says what it is and its unit."""

    key: str
    title: str
    unit: str
    series: tuple[Series, ...]


def plot_groups(trajectory: Trajectory, motion: Motion) -> list[Group]:
    """Return what is worth plotting over a whole flight, most useful first.

    Parameters
    ----------
    trajectory : Trajectory
    motion : Motion
        Of the same trajectory: altitude and speed come from it, so every model has them.

    Returns
    -------
    list of Group
        Altitude, speed, angles, track, rates, the controls by unit, states beside the motion's,
        load factor, lift and drag. Outputs that are 0 throughout, and angles that tell nothing of
        such a vehicle, are left out.
    """
    altitude_std = 'altitude_std' if 'altitude_std' in trajectory else 'z_e_std'
    groups = [
        _group('altitude', 'Altitude', [_series(trajectory, 'altitude', motion.altitude,
                                                altitude_std)]),
        _group('speed', 'Speed', [_series(trajectory, 'speed', motion.speed, 'speed_std')]),
    ]  # fmt: skip
    if 'airspeed' in trajectory:
        airspeed = _series(trajectory, 'airspeed')
        groups[1] = _group('speed', 'Speed', [*groups[1].series, airspeed])
    shown = {'altitude', 'speed', 'airspeed'}
    angles = _present(trajectory, ('gamma', 'alpha', 'beta', 'bank', 'phi', 'theta'))
    track = _present(trajectory, ('track', 'psi'))
    if {'theta', 'qw'} & {*trajectory.states}:
        if 'lift' not in trajectory:  # what rotors carry feels no angle of attack
            angles = [name for name in angles if name in ('gamma', 'phi', 'theta')]
    elif 'alpha' in trajectory:
        # of a point mass they say nothing that gamma, alpha, track and bank do not
        angles = [name for name in angles if name not in ('phi', 'theta')]
        track = [name for name in track if name != 'psi']
    groups.append(_group('angles', _listing(angles), [_series(trajectory, a) for a in angles]))
    turns = [
        Series(name, np.mod(trajectory[name] * DEG, 360.0))  # a compass reads 0 to 360
        for name in track
    ]
    groups.append(_group('track', _listing(track), turns))
    rates = _present(trajectory, ('p', 'q', 'r'))
    groups.append(_group('rates', 'Rates', [_series(trajectory, a) for a in rates]))
    shown |= {*angles, *track, *rates}
    load = _present(trajectory, ('load_factor',))
    forces = _present(trajectory, ('lift', 'drag'))
    others = [name for name in trajectory.states if name not in _MOTION]
    for kind, columns in (('controls', trajectory.controls), ('states', others)):
        by_unit: dict[str, list[str]] = {}
        for name in columns:
            if name not in shown:
                by_unit.setdefault(unit_of(name)[0], []).append(name)
        for i, names in enumerate(by_unit.values()):
            key = kind if i == 0 else f'{kind}_{i + 1}'
            groups.append(_group(key, _listing(names), [_series(trajectory, a) for a in names]))
    groups.append(_group('load_factor', 'Load factor', [_series(trajectory, a) for a in load]))
    groups.append(_group('forces', 'Lift, drag', [_series(trajectory, a) for a in forces]))
    return [group for group in groups if group.series]


def _present(trajectory: Trajectory, names: Iterable[str]) -> list[str]:
    return [
        name
        for name in names
        if name in trajectory
        and (name not in trajectory.outputs or np.abs(trajectory.outputs[name]).max() > NOTHING)
    ]


def _listing(names: list[str]) -> str:
    text = ', '.join(names)
    return text[:1].upper() + text[1:] if len(names) == 1 else text


def _series(
    trajectory: Trajectory, name: str, values: Array | None = None, std: str = ''
) -> Series:
    factor = unit_of(name)[1]
    std = std or f'{name}_std'
    return Series(
        name,
        (trajectory[name] if values is None else values) * factor,
        trajectory[std] * factor if std in trajectory else None,
        name in trajectory.controls and trajectory.control_interpolation == 'previous',
    )


def _group(key: str, title: str, series: list[Series]) -> Group:
    unit = unit_of(series[0].name)[0] if series else '-'
    return Group(key, f'{title} [{unit}]', unit, tuple(series))
