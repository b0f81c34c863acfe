"""What stands still in the 3D view: coloured path, uncertainty, curtain, ground and ghosts."""

import numpy as np
from numpy.typing import NDArray

from ..errors import MissingExtraError
from . import scenery
from .archetypes import PLANNED, log_ghosts
from .coloring import Coloring
from .kinematics import Motion
from .mesh_files import MeshFile
from .solids import Mesh

try:
    import rerun as rr
except ImportError as error:
    raise MissingExtraError('a Rerun recording', 'view') from error

Array = NDArray[np.float64]

GRID = [82, 104, 96]
SOIL = [38, 56, 50]


def log_world(rec: rr.RecordingStream) -> None:
    """Say how the world's axes are to be shown: north, east, down."""
    rec.log('world', rr.ViewCoordinates.FRD, static=True)


def log_path(rec: rr.RecordingStream, entity: str, motion: Motion, coloring: Coloring) -> None:
    """Log the path in the colours of a quantity."""
    strips = scenery.colored_strips(motion, coloring)
    if strips:
        path = rr.LineStrips3D(
            [motion.position[strip.index] for strip in strips],
            colors=[strip.color for strip in strips],
            radii=rr.Radius.ui_points(2.0),
        )
        rec.log(entity, path, static=True)


def log_line(
    rec: rr.RecordingStream,
    entity: str,
    motion: Motion,
    *,
    color: tuple[int, int, int] = PLANNED,
    width: float = 1.2,
) -> None:
    """Log the path as a line of one colour."""
    parts = scenery.drawn_samples(motion, scenery.MAX_PATH_POINTS)
    path = rr.LineStrips3D(
        [motion.position[part] for part in parts if part.size > 1],
        colors=[color],
        radii=rr.Radius.ui_points(width),
    )
    rec.log(entity, path, static=True)


def log_curtain(
    rec: rr.RecordingStream, motion: Motion, coloring: Coloring, ground: float
) -> None:
    """Log a translucent curtain from the path down to the ground's altitude [m]."""
    vertices, triangles, colors = scenery.curtain(motion, coloring, ground)
    if not len(triangles):
        return
    drape = rr.Mesh3D(
        vertex_positions=vertices,
        triangle_indices=triangles,
        vertex_colors=colors,
        albedo_factor=[255, 255, 255, 70],
    )
    rec.log('world/curtain', drape, static=True)


def log_tube(rec: rr.RecordingStream, motion: Motion) -> bool:
    """Log a translucent tube of one sigma about the path; return whether there is one."""
    found = scenery.tube(motion)
    if found is None:
        return False
    vertices, triangles = found
    look = rr.Mesh3D(
        vertex_positions=vertices,
        triangle_indices=triangles,
        vertex_colors=np.tile(np.array([150, 190, 255], np.uint8), (len(vertices), 1)),
        albedo_factor=[255, 255, 255, 60],
    )
    rec.log('world/uncertainty', look, static=True)
    return True


def log_axes(rec: rr.RecordingStream, entity: str, length: float) -> None:
    """Log the axes of an entity, x red, y green, z blue, with a length [m]."""
    rec.log(entity, rr.TransformAxes3D(axis_length=length), static=True)


def log_ground(rec: rr.RecordingStream, grid: scenery.Ground, *, lines: bool = True) -> None:
    """Log a level ground, with the lines of a grid or without."""
    if lines:
        drawn = rr.LineStrips3D(grid.lines, colors=[GRID], radii=rr.Radius.ui_points(0.6))
        rec.log('world/ground/grid', drawn, static=True)
    plane = rr.Mesh3D(
        vertex_positions=grid.vertices,
        triangle_indices=grid.triangles,
        vertex_colors=np.tile(np.array(SOIL, np.uint8), (len(grid.vertices), 1)),
    )
    rec.log('world/ground/plane', plane, static=True)


def log_vehicles_along(
    rec: rr.RecordingStream, motion: Motion, shape: Mesh | MeshFile, count: int | None = None
) -> None:
    """Log translucent vehicles at intervals of the path, as many as fit unless given."""
    index = scenery.ghost_samples(motion, shape.size, count)
    poses = motion.position[index], motion.attitude[index]
    log_ghosts(rec, 'world/ghosts', shape, poses=poses)
