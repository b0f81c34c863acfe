"""By which quantity a path is coloured, over which range, and its legend."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..config import suggestion
from ..errors import InputError
from ..trajectory import Trajectory
from .kinematics import Motion
from .quantities import unit_of

Array = NDArray[np.float64]
Colors = NDArray[np.uint8]

G0 = 9.80665  # m/s^2, 3rd CGPM 1901
BINS = 24  # of colour: the viewer's time to the first picture grows with strips, not points

# Violet over teal to yellow: luminance rises steadily, so it reads without hue as well.
_MAP = np.array(
    [(92, 82, 190), (70, 118, 200), (44, 146, 182), (36, 168, 142), (84, 196, 104),
     (166, 219, 58), (253, 231, 60)], float,
)  # fmt: skip

DERIVED = ('speed', 'altitude', 'energy', 'uncertainty', 'deviation', 'time')
"""What a path can be coloured by beside the trajectory's own columns."""


def color_map(share: Array) -> Colors:
    """Return colours (n, 3), violet at 0 to yellow at 1."""
    at = np.clip(np.asarray(share, float), 0, 1) * (len(_MAP) - 1)
    rgb = [np.interp(at, np.arange(len(_MAP)), _MAP[:, i]) for i in range(3)]
    return np.round(np.column_stack(rgb)).astype(np.uint8)


@dataclass(frozen=True)
class Coloring:
    """Values along a path and the range that the colours span.

    Parameters
    ----------
    name, unit : str
    values : array (n,)
        In that unit.
    low, high : float
        Violet and yellow; 1 in 200 samples lies beyond each.
    """

    name: str
    unit: str
    values: Array
    low: float
    high: float

    @property
    def share(self) -> Array:
        """Where in the range each value is, from 0 to 1."""
        return np.clip((self.values - self.low) / (self.high - self.low), 0, 1)

    @property
    def title(self) -> str:
        """The quantity and its unit."""
        return f'{self.name} [{self.unit}]'

    @property
    def note(self) -> str:
        """What the colours mean, in words."""
        return f'{self.name} {self.low:.3g} (violet) to {self.high:.3g} {self.unit} (yellow)'


def coloring_of(
    trajectory: Trajectory,
    motion: Motion,
    quantity: str = 'speed',
    *,
    deviation: tuple[Array, Array] | None = None,
) -> Coloring:
    """Return what colours a path.

    Parameters
    ----------
    trajectory : Trajectory
    motion : Motion
        Of it.
    quantity : str
        A column of the trajectory, or one of `DERIVED`: `energy` is the energy height, the sum of
        altitude and speed^2 / 2 g [m]; `uncertainty` the 1-sigma of the position [m];
        `deviation` the distance from the plan [m].
    deviation : (times, distances)
        From the plan, where there is one.

    Raises
    ------
    InputError
        If the flight has no such quantity; the message lists what it has.
    """
    name, unit, values = _values(trajectory, motion, quantity, deviation)
    low, high = (float(v) for v in np.quantile(values, (0.005, 0.995)))
    if high - low <= 1e-9 * max(abs(low), abs(high), 1e-9):
        air = max(0.05 * abs(low), 0.5)
        low, high = low - air, high + air
    return Coloring(name, unit, values, low, high)


def _values(
    trajectory: Trajectory,
    motion: Motion,
    quantity: str,
    deviation: tuple[Array, Array] | None,
) -> tuple[str, str, Array]:
    if quantity == 'speed':
        return 'speed', 'm/s', motion.speed
    if quantity == 'altitude':
        return 'altitude', 'm', motion.altitude
    if quantity == 'energy':
        return 'energy height', 'm', motion.altitude + motion.speed**2 / (2 * G0)
    if quantity == 'time':
        return 'time', 's', motion.time - motion.time[0]
    if quantity == 'deviation' and deviation is not None and deviation[0].size:
        return 'distance from plan', 'm', np.interp(motion.time, *deviation)
    if quantity == 'uncertainty' and motion.sigma is not None:
        return '1-sigma of position', 'm', np.linalg.norm(motion.sigma, axis=1)
    if quantity in trajectory:
        unit, factor = unit_of(quantity)
        return quantity, unit, trajectory[quantity] * factor
    known = [*trajectory.columns, 'speed', 'altitude', 'energy', 'time']
    known += ['deviation'] if deviation is not None else []
    known += ['uncertainty'] if motion.sigma is not None else []
    raise InputError(
        f"cannot colour by '{quantity}': this flight has no such quantity"
        f'{suggestion(quantity, dict.fromkeys(known))}'
    )
