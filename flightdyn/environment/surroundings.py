"""What stands around a flight: terrain, volumes to keep out of, gates, marks on the ground.

Positions are x_e (north) and y_e (east) [m] from the origin of the earth axes; heights are
altitudes above it [m].
"""

import hashlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from .polygons import Point, crossing_sides

Array = NDArray[np.float64]

MARK_KINDS = ('place', 'field', 'listener')


@dataclass(frozen=True, eq=False)
class Terrain:
    """Heights of the ground on a rectangular grid.

    Its `repr` tells apart terrains that differ.

    Parameters
    ----------
    x, y : array (n,), (m,)
        North and east of the grid's lines [m], increasing.
    height : array (n, m)
        Of the ground [m].
    clearance : float
        How far above the ground flights keep [m].

    Raises
    ------
    InputError
        If the shapes do not fit, the lines do not increase or a value is not finite.
    """

    x: Array
    y: Array
    height: Array
    clearance: float = 0.0

    def __post_init__(self) -> None:
        for name in ('x', 'y', 'height'):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if not np.isfinite(value).all():
                bad = np.argwhere(~np.isfinite(value))
                raise InputError(
                    f'terrain: {name} at {bad[0].tolist()} is not a finite number '
                    f'({len(bad)} of {value.size} are not): fill or cut out what is missing'
                )
            object.__setattr__(self, name, value)
        for name in ('x', 'y'):
            line = getattr(self, name)
            if line.ndim != 1 or line.size < 2 or not (np.diff(line) > 0).all():
                raise InputError(f'terrain: {name} must be two or more increasing numbers')
        if self.height.shape != (self.x.size, self.y.size):
            raise InputError(
                f'terrain: height has shape {self.height.shape}, expected one value for each x '
                f'and y: {(self.x.size, self.y.size)}'
            )
        object.__setattr__(self, 'clearance', float(self.clearance))
        if not math.isfinite(self.clearance):
            raise InputError(f'terrain: clearance must be finite, got {self.clearance}')

    def __repr__(self) -> str:
        content = b''.join(each.tobytes() for each in (self.x, self.y, self.height))
        digest = hashlib.sha256(content).hexdigest()[:16]
        shape = f'{self.x.size} x {self.y.size}'
        return f'Terrain({shape}, {digest}, clearance={self.clearance!r})'


@dataclass(frozen=True, kw_only=True)
class Cylinder:
    """An upright cylinder to keep out of.

    Parameters
    ----------
    name : str
    centre : x_e, y_e [m]
    radius : float [m]
    bottom, top : float
        Altitudes it reaches from and to [m].

    Raises
    ------
    InputError
        If the radius is not positive or the top is not above the bottom.
    """

    name: str
    centre: Point
    radius: float
    bottom: float = -math.inf
    top: float = math.inf

    def __post_init__(self) -> None:
        if not self.radius > 0:
            raise InputError(f"keep-out '{self.name}': radius must be positive")
        _check_heights(self)


@dataclass(frozen=True, kw_only=True)
class Polygon:
    """An upright prism to keep out of.

    Parameters
    ----------
    name : str
    corners : sequence of x_e, y_e [m]
        In order, either way round, not closed.
    bottom, top : float
        Altitudes it reaches from and to [m].

    Raises
    ------
    InputError
        If there are fewer than three corners, sides cross or touch, or the top is not above the
        bottom.
    """

    name: str
    corners: Sequence[Point]
    bottom: float = -math.inf
    top: float = math.inf

    def __post_init__(self) -> None:
        corners = tuple((float(x), float(y)) for x, y in self.corners)
        object.__setattr__(self, 'corners', corners)
        if len(corners) < 3:
            raise InputError(f"keep-out '{self.name}': needs three corners or more")
        crossing = crossing_sides(corners)
        if crossing is not None:
            raise InputError(
                f"keep-out '{self.name}': the sides from corner {crossing[0]} and from corner "
                f'{crossing[1]} (counted from 0) cross or touch: give corners in order, each once'
            )
        _check_heights(self)


@dataclass(frozen=True, kw_only=True)
class Gate:
    """An upright rectangle to fly through.

    Parameters
    ----------
    name : str
    centre : x_e, y_e, altitude [m]
    heading : float
        Of the way through it, clockwise from north [rad].
    width, height : float
        Of the opening [m].

    Raises
    ------
    InputError
        If the opening has no size.
    """

    name: str
    centre: tuple[float, float, float]
    heading: float
    width: float
    height: float

    def __post_init__(self) -> None:
        if not (self.width > 0 and self.height > 0):
            raise InputError(f"gate '{self.name}': width and height must be positive")


@dataclass(frozen=True, kw_only=True)
class Mark:
    """A named place, such as an airfield or who listens on the ground.

    Parameters
    ----------
    name : str
    place : x_e, y_e, altitude [m]
    radius : float
        Of a circle to draw round it [m], or 0.
    kind : 'place', 'field' or 'listener'
        Listeners hear the flight, see `clearance.outputs_around`.

    Raises
    ------
    InputError
        If the kind is another word.
    """

    name: str
    place: tuple[float, float, float]
    radius: float = 0.0
    kind: str = 'place'

    def __post_init__(self) -> None:
        if self.kind not in MARK_KINDS:
            raise InputError(
                f"mark '{self.name}': kind must be {', '.join(MARK_KINDS)}, got {self.kind!r}"
            )


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """All that stands around a flight.

    Raises
    ------
    InputError
        If two things have one name, or a name has other characters than letters, digits and _.
    """

    terrain: Terrain | None = None
    keep_out: Sequence[Cylinder | Polygon] = ()
    gates: Sequence[Gate] = ()
    marks: Sequence[Mark] = ()

    def __post_init__(self) -> None:
        for group in ('keep_out', 'gates', 'marks'):
            object.__setattr__(self, group, tuple(getattr(self, group)))
        names = [each.name for each in (*self.keep_out, *self.gates, *self.marks)]
        for name in names:
            if not name.isidentifier() or names.count(name) > 1:
                raise InputError(
                    f"surroundings: '{name}': each needs a name of its own, of letters, digits "
                    'and underscores'
                )

    def __bool__(self) -> bool:
        """Whether there is anything."""
        return self.terrain is not None or bool(self.keep_out or self.gates or self.marks)

    @property
    def listeners(self) -> tuple[Mark, ...]:
        """The marks that hear the flight."""
        return tuple(mark for mark in self.marks if mark.kind == 'listener')

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON can hold, with nothing in it that is not there; see `from_dict`."""
        found: dict[str, Any] = {}
        if self.terrain is not None:
            found['terrain'] = {
                'x': self.terrain.x.tolist(),
                'y': self.terrain.y.tolist(),
                'height': self.terrain.height.tolist(),
                'clearance': self.terrain.clearance,
            }
        for group in ('keep_out', 'gates', 'marks'):
            if getattr(self, group):
                found[group] = {each.name: dict(_plain(each)) for each in getattr(self, group)}
        return found

    @classmethod
    def from_dict(cls, document: Any, where: str = 'surroundings') -> 'Surroundings':
        """Return surroundings of what `to_dict` gives, or of the same keys in a YAML file.

        Raises
        ------
        InputError
            If a key is missing, unknown or wrong; the message names the place.
        """
        from .surroundings_file import read_surroundings

        return read_surroundings(document, where)


NOTHING = Surroundings()


def _plain(thing: Cylinder | Polygon | Gate | Mark) -> Iterator[tuple[str, Any]]:
    """Return fields but for the name, without those that are infinite."""
    for key, value in vars(thing).items():
        if key == 'corners':
            yield key, [list(corner) for corner in value]
        elif isinstance(value, tuple):
            yield key, list(value)
        elif key != 'name' and not (isinstance(value, float) and math.isinf(value)):
            yield key, value


def _check_heights(volume: Cylinder | Polygon) -> None:
    if not volume.bottom < volume.top:
        raise InputError(
            f"keep-out '{volume.name}': top {volume.top:g} m must be above bottom "
            f'{volume.bottom:g} m'
        )
