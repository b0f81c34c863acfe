"""What the views have in common: meshes, quaternions, colours and times as Rerun takes them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import MissingExtraError
from .meshes import Mesh

try:
    import rerun as rr
except ImportError as error:
    raise MissingExtraError('a Rerun recording', 'view') from error

Array = NDArray[np.float64]

APPLICATION = 'flightdyn'
ROWS = 65_536  # a chunk this long loads in the viewer with the least memory

PLANNED = (240, 240, 245)
MARKED = (255, 190, 60)
PALETTE = [(255, 176, 64), (86, 180, 233), (204, 121, 167), (0, 158, 115), (240, 228, 66),
           (213, 94, 0)]  # fmt: skip  # after Okabe and Ito: told apart by the colour-blind


@dataclass(frozen=True)
class Clock:
    """Times of some rows on every timeline; `utc` is None where there is no date."""

    elapsed: NDArray[np.timedelta64]
    utc: NDArray[np.datetime64] | None = None

    @classmethod
    def of(cls, seconds: Array, start_ns: int = 0) -> 'Clock':
        """Return the clock of times [s] after a date in Unix time [ns], 0 for none."""
        elapsed = np.round(seconds * 1e9).astype(np.int64)
        utc = (start_ns + elapsed).astype('datetime64[ns]') if start_ns else None
        return cls(elapsed.astype('timedelta64[ns]'), utc)

    def at(self, rows: slice) -> list[rr.TimeColumn]:
        """Return the timelines `flight_time` and `utc` of some rows."""
        columns = [rr.TimeColumn('flight_time', duration=self.elapsed[rows])]
        if self.utc is not None:
            columns.append(rr.TimeColumn('utc', timestamp=self.utc[rows]))
        return columns

    def take(self, index: NDArray[np.intp], later_ns: int = 0) -> 'Clock':
        """Return some of the times, moved by some nanoseconds."""
        move = np.timedelta64(later_ns, 'ns')
        return Clock(
            self.elapsed[index] + move, None if self.utc is None else self.utc[index] + move
        )

    def __len__(self) -> int:
        return int(self.elapsed.size)


def slices(n: int, rows: int = ROWS) -> Iterator[slice]:
    """Yield 0..n in slices of at most `rows`."""
    for start in range(0, n, rows):
        yield slice(start, min(start + rows, n))


def solid(mesh: Mesh) -> rr.Mesh3D:
    """Return a mesh as it is."""
    return rr.Mesh3D(
        vertex_positions=mesh.vertices,
        vertex_normals=mesh.normals,
        vertex_colors=mesh.colors,
    )


def ghost(mesh: Mesh, fade: float, alpha: int) -> rr.Mesh3D:
    """Return a translucent mesh with its colours faded towards white."""
    return rr.Mesh3D(
        vertex_positions=mesh.vertices,
        vertex_normals=mesh.normals,
        vertex_colors=((1 - fade) * mesh.colors + fade * 225).astype(np.uint8),
        albedo_factor=[255, 255, 255, alpha],
    )


def xyzw(attitude: Array) -> NDArray[np.float32]:
    """Return quaternions (n, 4) in Rerun's order, the scalar last."""
    return np.roll(attitude, -1, axis=1).astype(np.float32)


def line_color(number: int, faint: bool = False) -> list[int]:
    """Return the colour of a plot's line; a faint one is of what was planned."""
    color = np.array(PALETTE[number % len(PALETTE)], float)
    mixed = 0.4 * color + 0.6 * 235 if faint else color
    return [int(c) for c in np.round(mixed)]
