"""What the views have in common: meshes, quaternions, colours and times as Rerun takes them."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import frames
from ..errors import MissingExtraError
from .mesh_files import MeshFile
from .solids import Mesh

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


def path_part(name: str) -> str:
    """Return a name as one part of an entity path."""
    return ''.join(c if c.isalnum() or c in '-_.' else '_' for c in name) or '_'


def send(
    rec: rr.RecordingStream, entity: str, clock: Clock, columns: Callable[[slice], Iterable[Any]]
) -> None:
    """Send columns over time in slices of bounded length."""
    for rows in slices(len(clock)):
        rec.send_columns(entity, indexes=clock.at(rows), columns=columns(rows))


def log_body(rec: rr.RecordingStream, entity: str, shape: Mesh | MeshFile) -> None:
    """Log a vehicle's shape in its body axes."""
    if isinstance(shape, Mesh):
        look = rr.Mesh3D(
            vertex_positions=shape.vertices,
            vertex_normals=shape.normals,
            vertex_colors=shape.colors,
        )
        rec.log(entity, look, static=True)
    else:
        turn = xyzw(np.array([frames.Q_BODY_GLTF]))[0]
        pose = rr.Transform3D(quaternion=turn, scale=shape.scale)
        rec.log(entity, rr.Asset3D(path=shape.path), pose, static=True)


def log_ghosts(
    rec: rr.RecordingStream,
    entity: str,
    shape: Mesh | MeshFile,
    *,
    poses: tuple[Array, Array] | None = None,
    fade: float = 0.6,
    alpha: int = 100,
) -> None:
    """Log a translucent shape, its colours faded towards white.

    Parameters
    ----------
    poses : (positions (n, 3), attitudes (n, 4))
        Where it is drawn; at the entity's own place unless given.
    """
    look: rr.AsComponents
    if isinstance(shape, Mesh):
        look = rr.Mesh3D(
            vertex_positions=shape.vertices,
            vertex_normals=shape.normals,
            vertex_colors=((1 - fade) * shape.colors + fade * 225).astype(np.uint8),
            albedo_factor=[255, 255, 255, alpha],
        )
        turn, scale = (1.0, 0.0, 0.0, 0.0), 1.0
    else:
        look = rr.Asset3D(path=shape.path, albedo_factor=[255, 255, 255, alpha])
        turn, scale = frames.Q_BODY_GLTF, shape.scale
    rec.log(entity, look, static=True)
    where, attitudes = poses or (np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]]))
    w, x, y, z = attitudes.T
    turned = np.stack(frames.quaternion_multiply((w, x, y, z), turn), axis=-1)
    instances = rr.InstancePoses3D(
        translations=where, quaternions=xyzw(turned), scales=[[scale] * 3] * len(where)
    )
    rec.log(entity, instances, static=True)


def xyzw(attitude: Array) -> NDArray[np.float32]:
    """Return quaternions (n, 4) in Rerun's order, the scalar last."""
    return np.roll(attitude, -1, axis=1).astype(np.float32)


def line_color(number: int, faint: bool = False) -> list[int]:
    """Return the colour of a plot's line; a faint one is of what was planned."""
    color = np.array(PALETTE[number % len(PALETTE)], float)
    mixed = 0.4 * color + 0.6 * 235 if faint else color
    return [int(c) for c in np.round(mixed)]
