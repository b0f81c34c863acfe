"""Winds: the velocity of the air as a function of place and time.

A wind is any callable `wind(x_e, y_e, z_e, time)` that returns where the air moves to, north,
east and down [m/s]. Those here depend on nothing but the height `-z_e` above the origin of the
earth axes, which is the height above the ground if the origin is on it; updraughts are in
`thermals`. They take floats, arrays and CasADi symbols, and have two continuous derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any

import numpy as _np

from .. import numpy as np
from ..errors import InputError
from ..frames import Vector
from ..numpy import Vectorizable, is_symbolic
from .elements import Array, Steps

Wind = Callable[[Vectorizable, Vectorizable, Vectorizable, Vectorizable], Vector]


def as_wind(value: Wind | Sequence[Vectorizable] | None) -> Wind | None:
    """Return a wind of what a user may give: None, three components, or a wind.

    Raises
    ------
    InputError
        If it is none of these.
    """
    if value is None or callable(value):
        return value
    try:
        x, y, z = value
    except (TypeError, ValueError):
        raise InputError(
            f'{value!r} is no wind: give north, east and down [m/s], or a callable '
            '(x_e, y_e, z_e, time) -> (north, east, down)'
        ) from None
    return ConstantWind(x, y, z)


class Summable:
    """A wind that can be added to another, `wind_a + wind_b`, or to three components."""

    def __call__(
        self, x_e: Vectorizable, y_e: Vectorizable, z_e: Vectorizable, time: Vectorizable
    ) -> Vector:
        raise NotImplementedError

    def __add__(self, other: Wind | Sequence[Vectorizable] | None) -> Wind:
        second = as_wind(other)
        return self if second is None else SumOfWinds((self, second))

    __radd__ = __add__


@dataclass(frozen=True)
class SumOfWinds(Summable):
    """Several winds at once."""

    winds: tuple[Wind, ...]

    def __call__(
        self, x_e: Vectorizable, y_e: Vectorizable, z_e: Vectorizable, time: Vectorizable
    ) -> Vector:
        x, y, z = zip(*(wind(x_e, y_e, z_e, time) for wind in self.winds), strict=True)
        return sum(x), sum(y), sum(z)


@dataclass(frozen=True)
class ScaledWind(Summable):
    """A wind times a factor."""

    wind: Wind
    factor: Vectorizable

    def __call__(
        self, x_e: Vectorizable, y_e: Vectorizable, z_e: Vectorizable, time: Vectorizable
    ) -> Vector:
        x, y, z = self.wind(x_e, y_e, z_e, time)
        return self.factor * x, self.factor * y, self.factor * z


@dataclass(frozen=True)
class ConstantWind(Summable):
    """The same wind everywhere.

    Parameters
    ----------
    x, y, z : Vectorizable
        Where the air moves to: north, east, down [m/s].

    Raises
    ------
    InputError
        If a number is not finite.
    """

    x: Vectorizable = 0.0
    y: Vectorizable = 0.0
    z: Vectorizable = 0.0

    def __post_init__(self) -> None:
        check_finite(self)

    @classmethod
    def from_direction(cls, speed: Vectorizable, from_deg: Vectorizable) -> ConstantWind:
        """Return a level wind of a speed [m/s] out of a direction [deg], 0 north, 90 east."""
        north, east = _blowing_to(speed, from_deg)
        return cls(north, east, 0.0)

    def __call__(
        self, x_e: Vectorizable, y_e: Vectorizable, z_e: Vectorizable, time: Vectorizable
    ) -> Vector:
        return self.x, self.y, self.z


@dataclass(frozen=True)
class ShearWind(Summable):
    """Level wind that grows in proportion to the height, without end, and reverses below 0.

    Parameters
    ----------
    gradient : Vectorizable
        Wind speed over height [1/s].
    from_deg : Vectorizable
        Direction the wind comes from [deg], 0 north, 90 east.

    Raises
    ------
    InputError
        If a number is not finite.
    """

    gradient: Vectorizable
    from_deg: Vectorizable

    def __post_init__(self) -> None:
        check_finite(self)

    def __call__(
        self, x_e: Vectorizable, y_e: Vectorizable, z_e: Vectorizable, time: Vectorizable
    ) -> Vector:
        north, east = _blowing_to(self.gradient, self.from_deg)
        return -north * z_e, -east * z_e, 0.0


@dataclass(frozen=True)
class PowerLawWind(Summable):
    """Level wind that grows with a power of the height.

    Parameters
    ----------
    speed : Vectorizable
        At the reference height [m/s].
    from_deg : Vectorizable
        Direction the wind comes from [deg], 0 north, 90 east.
    reference_height : float
        Above the origin [m], positive.
    exponent : float
        1/7 over open land in a neutral atmosphere; positive.

    Raises
    ------
    InputError
        If the height or the exponent is not positive, or a number is not finite.

    Notes
    -----
    The law holds from a tenth of the reference height upwards. Below, where its slope would grow
    without limit, it is faded out to no wind at and below the ground.
    """

    speed: Vectorizable
    from_deg: Vectorizable
    reference_height: float = 10.0
    exponent: float = 1 / 7

    def __post_init__(self) -> None:
        check_finite(self)
        check_positive(self, 'reference_height', 'exponent')

    def __call__(
        self, x_e: Vectorizable, y_e: Vectorizable, z_e: Vectorizable, time: Vectorizable
    ) -> Vector:
        h = -z_e / self.reference_height
        s = np.clip(h / 0.1, 0.0, 1.0)
        fade = s * s * s * (10.0 + s * (6.0 * s - 15.0))
        # Where the height is held at its smallest, the fade is nothing but a rounding error.
        law = np.power(np.fmax(h, 1e-9), self.exponent)
        north, east = _blowing_to(self.speed, self.from_deg)
        return north * (law * fade), east * (law * fade), 0.0


@dataclass(frozen=True)
class LogWind(Summable):
    """Level wind that grows with the logarithm of the height: the neutral surface layer.

    Parameters
    ----------
    speed : Vectorizable
        At the reference height [m/s].
    from_deg : Vectorizable
        Direction the wind comes from [deg], 0 north, 90 east.
    reference_height : float
        Above the origin [m]; larger than the roughness.
    roughness : float
        Height at which the law has no wind [m]: about 0.0002 over water, 0.03 over grass, 1 in
        towns.

    Raises
    ------
    InputError
        If the heights are not positive and in that order, or a number is not finite.

    Notes
    -----
    The height h is replaced by z0 + (h - z0 + sqrt((h - z0)^2 + z0^2)) / 2, where z0 is the
    roughness. That is within 1 % of the law from 5 z0 upwards, keeps the wind of 1.5 z0 at z0,
    and fades away beneath the ground.

    References
    ----------
    .. [1] Stull, *An Introduction to Boundary Layer Meteorology*, 1988, chapter 9.
    """

    speed: Vectorizable
    from_deg: Vectorizable
    reference_height: float = 10.0
    roughness: float = 0.03

    def __post_init__(self) -> None:
        check_finite(self)
        check_positive(self, 'reference_height', 'roughness')
        if self.reference_height <= self.roughness:
            raise InputError(
                f'reference_height {self.reference_height} m must be above the roughness, '
                f'{self.roughness} m'
            )

    def _law(self, height: Vectorizable) -> Vectorizable:
        above = height / self.roughness - 1.0
        return np.log(1.0 + (above + np.sqrt(above * above + 1.0)) / 2.0)

    def __call__(
        self, x_e: Vectorizable, y_e: Vectorizable, z_e: Vectorizable, time: Vectorizable
    ) -> Vector:
        part = self._law(-z_e) / self._law(self.reference_height)
        north, east = _blowing_to(self.speed, self.from_deg)
        return north * part, east * part, 0.0


@dataclass(frozen=True, eq=False)
class TableWind(Summable):
    """Wind by a table over the height.

    Parameters
    ----------
    heights : sequence (n,)
        Above the origin [m], increasing; two or more.
    north, east, down : sequence (n,)
        Where the air moves to [m/s] at each height; down is 0 by default.

    Raises
    ------
    InputError
        If the lengths differ, heights do not increase or a number is not finite.

    Notes
    -----
    Between the heights a cubic spline, held constant outside; the first and last interval are
    quintic, for slope and curvature to vanish at the ends. A spline overshoots steps: give
    steep profiles enough heights.
    """

    heights: Sequence[float] | Array
    north: Sequence[float] | Array
    east: Sequence[float] | Array
    down: Sequence[float] | Array | None = None

    def __post_init__(self) -> None:
        given = {'heights': self.heights, 'north': self.north, 'east': self.east}
        if self.down is not None:
            given['down'] = self.down
        for name, values in given.items():
            column = _np.array(values, dtype=float)
            if column.ndim != 1 or column.size < 2 or column.size != len(self.heights):
                raise InputError(
                    f'wind table: {name} has shape {column.shape}, but every column needs one '
                    f'number a height, and there are {len(self.heights)} heights (at least 2)'
                )
            if not _np.isfinite(column).all():
                raise InputError(f'wind table: {name} has values that are not finite')
            column.flags.writeable = False
            object.__setattr__(self, name, column)
        falls = _np.flatnonzero(_np.diff(self.heights) <= 0)
        if falls.size:
            i = int(falls[0])
            raise InputError(
                f'wind table: heights must increase, but {self.heights[i]} is followed by '
                f'{self.heights[i + 1]}'
            )

    @cached_property
    def _pieces(self) -> Steps:
        columns = [self.north, self.east] + ([] if self.down is None else [self.down])
        return _spline(_np.asarray(self.heights), _np.array(columns))

    def __call__(
        self, x_e: Vectorizable, y_e: Vectorizable, z_e: Vectorizable, time: Vectorizable
    ) -> Vector:
        h = np.clip(-z_e, self.heights[0], self.heights[-1])
        start, scale, *coefficients = self._pieces(h)
        t = (h - start) * scale
        north, east, down = [
            _polynomial(coefficients[i : i + 6], t) for i in range(0, len(coefficients), 6)
        ] + [0.0] * (self.down is None)
        return north, east, down


def _spline(x: Array, values: Array) -> Steps:
    """Return start, 1 / length and each value's quintic of every interval of a spline.

    The cubic spline with level ends gives slopes and curvatures at the table's heights; at both
    ends the curvature is then set to 0.
    """
    length = _np.diff(x)
    rise = _np.diff(values) / length
    n = x.size
    # continuous curvature at the inner heights; level ends
    matrix, right = _np.eye(n), _np.zeros((n, len(values)))
    for i in range(1, n - 1):
        matrix[i, i - 1 : i + 2] = length[i], 2 * (length[i - 1] + length[i]), length[i - 1]
        right[i] = 3 * (length[i] * rise[:, i - 1] + length[i - 1] * rise[:, i])
    slope = _np.linalg.solve(matrix, right).T
    curvature = _np.zeros_like(values)
    curvature[:, 1:-1] = ((6 * rise - 4 * slope[:, :-1] - 2 * slope[:, 1:]) / length)[:, 1:]

    rows = [x[:-1], 1 / length]
    for f, d, c in zip(values, slope, curvature, strict=True):
        f0, d0, c0 = f[:-1], d[:-1] * length, c[:-1] * length**2 / 2
        # what value, slope and half the curvature at the other end still lack
        gap = f[1:] - f0 - d0 - c0
        turn = d[1:] * length - d0 - 2 * c0
        bend = c[1:] * length**2 / 2 - c0
        rows += [
            f0,
            d0,
            c0,
            10 * gap - 4 * turn + bend,
            -15 * gap + 7 * turn - 2 * bend,
            6 * gap - 3 * turn + bend,
        ]
    return Steps(x[1:-1], _np.array(rows))


def _polynomial(coefficients: Sequence[Any], t: Vectorizable) -> Vectorizable:
    total = coefficients[-1]
    for coefficient in reversed(coefficients[:-1]):
        total = coefficient + t * total
    return total


def _blowing_to(speed: Vectorizable, from_deg: Vectorizable) -> tuple[Vectorizable, Vectorizable]:
    """Return the north and east component of a wind out of a direction."""
    direction = np.radians(from_deg)
    return -speed * np.cos(direction), -speed * np.sin(direction)


def check_finite(wind: Any, *, but: str = '') -> None:
    """Refuse a wind with a number that is not finite, but for one that may be infinite.

    Raises
    ------
    InputError
        Naming the number.
    """
    for field in fields(wind):
        value = getattr(wind, field.name)
        if is_symbolic(value) or (field.name == but and not _np.isnan(value)):
            continue
        if not _np.isfinite(value).all():
            raise InputError(f'{type(wind).__name__}: {field.name} is {value}, not finite')


def check_positive(wind: Any, *names: str) -> None:
    """Refuse a wind with a number among those named that is not positive.

    Raises
    ------
    InputError
        Naming the number.
    """
    for name in names:
        value = getattr(wind, name)
        if not value > 0:
            raise InputError(f'{type(wind).__name__}: {name} is {value}, must be positive')
