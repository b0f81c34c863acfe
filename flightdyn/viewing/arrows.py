"""Vectors to draw at a vehicle: velocity, wind, and the forces of the air on it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .. import frames
from ..trajectory import Trajectory
from .kinematics import Motion

Array = NDArray[np.float64]

_AIR = ('alpha', 'beta', 'airspeed', 'phi', 'theta', 'psi')


@dataclass(frozen=True)
class Arrow:
    """Vectors of one kind.

    Parameters
    ----------
    name, unit : str
    vectors : array (n, 3)
        In body axes, in that unit.
    scale_with : str
        Those of one kind share a scale: lift and drag can be compared by eye.
    color : (r, g, b)
    """

    name: str
    unit: str
    vectors: Array
    scale_with: str
    color: tuple[int, int, int]


def arrows_of(trajectory: Trajectory, motion: Motion) -> list[Arrow]:
    """Return the vectors that a trajectory's columns tell, each in body axes.

    Always the velocity. The wind from `wind_x_e`, `wind_y_e` (`wind_z_e`), or as the difference
    of the velocities over the ground and through the air where attitude, `alpha`, `beta` and
    `airspeed` are known. Lift and drag from columns of these names [N], along the wind axes; where
    there are none, the load factor of a point mass in speed and gamma [g], square to its
    velocity at its bank.
    """
    found = [Arrow('velocity', 'm/s', motion.velocity_body, 'velocity', (255, 190, 60))]
    wind = wind_earth(trajectory, motion)
    if wind is not None and np.abs(wind).max() > 1e-3:
        found.append(Arrow('wind', 'm/s', motion.in_body(wind), 'velocity', (120, 220, 240)))
    if 'lift' in trajectory and 'drag' in trajectory:
        zero = np.zeros(len(trajectory))
        for name, along, color in (
            ('lift', (zero, zero, -trajectory['lift']), (86, 150, 245)),
            ('drag', (-trajectory['drag'], zero, zero), (230, 80, 70)),
        ):
            found.append(Arrow(name, 'N', _body_from_wind(trajectory, along), 'force', color))
    elif 'gamma' in trajectory.states and all(n in trajectory for n in ('bank', 'load_factor')):
        zero = np.zeros(len(trajectory))
        path = frames.rotation_from_euler(
            trajectory['bank'], trajectory['gamma'], trajectory.columns.get('track', zero)
        )
        up = np.asarray(
            frames.stack(frames.rotate(path, (zero, zero, -trajectory['load_factor'])))
        )
        found.append(Arrow('load factor', 'g', motion.in_body(up), 'force', (86, 150, 245)))
    return found


def wind_earth(trajectory: Trajectory, motion: Motion) -> Array | None:
    """Return where the air moves to, earth axes [m/s] (n, 3); None if that is not known."""
    zero, columns = np.zeros(len(trajectory)), trajectory.columns
    if 'wind_x_e' in columns and 'wind_y_e' in columns:
        return np.column_stack(
            [columns['wind_x_e'], columns['wind_y_e'], columns.get('wind_z_e', zero)]
        )
    if any(name not in columns for name in _AIR):
        return None
    ahead = (columns['airspeed'], zero, zero)
    through = _body_from_wind(trajectory, ahead)
    return motion.velocity - motion.in_earth(through)


def _body_from_wind(trajectory: Trajectory, vector: tuple[Array, Array, Array]) -> Array:
    zero, columns = np.zeros(len(trajectory)), trajectory.columns
    alpha, beta = (np.radians(columns.get(name, zero)) for name in ('alpha', 'beta'))
    r_bw = frames.matmul(
        frames.rotation_body_stability(alpha), frames.rotation_stability_wind(beta)
    )
    return np.asarray(frames.stack(frames.rotate(r_bw, vector)))
