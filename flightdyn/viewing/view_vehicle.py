"""What moves in the 3D view: vehicle, arrows, 1-sigma, the plan's ghost, the chase frame."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..errors import MissingExtraError
from .archetypes import MARKED, Clock, log_body, log_ghosts, send, xyzw
from .arrows import Arrow
from .kinematics import Motion, level_attitude
from .mesh_files import MeshFile
from .solids import Mesh, sphere

try:
    import rerun as rr
except ImportError as error:
    raise MissingExtraError('a Rerun recording', 'view') from error

Array = NDArray[np.float64]

ARROW_LENGTH = 0.9  # of the vehicle, for the largest vector of a kind
ARROW_RADIUS = 0.013


def log_vehicle(
    rec: rr.RecordingStream,
    entity: str,
    clock: Clock,
    motion: Motion,
    shape: Mesh | MeshFile,
    enlarged: float,
    color: tuple[int, int, int] = MARKED,
) -> None:
    """Log the vehicle over time, to scale (`body`) and so large that it can be seen."""
    log_body(rec, f'{entity}/body', shape)
    log_body(rec, f'{entity}/enlarged', shape.scaled(enlarged))
    if enlarged > 1:  # a dot that no distance makes too small to find
        dot = rr.Points3D([[0.0, 0.0, 0.0]], radii=rr.Radius.ui_points(4.5), colors=[color])
        rec.log(f'{entity}/marker', dot, static=True)
    log_poses(rec, entity, clock, motion.position, motion.attitude)


def log_poses(
    rec: rr.RecordingStream, entity: str, clock: Clock, position: Array, attitude: Array
) -> None:
    """Log positions (n, 3) and attitudes (n, 4) over time."""
    where, turned = position.astype(np.float32), xyzw(attitude)
    send(
        rec,
        entity,
        clock,
        lambda rows: rr.Transform3D.columns(translation=where[rows], quaternion=turned[rows]),
    )


def log_arrows(
    rec: rr.RecordingStream, entity: str, clock: Clock, arrows: Sequence[Arrow], size: float
) -> list[str]:
    """Log arrows at a vehicle of a size [m]; return notes that tell their scales.

    They are in body axes: they turn with the body, so one column draws each at every attitude.
    """
    notes = []
    largest: dict[str, float] = {}
    for arrow in arrows:
        most = float(np.linalg.norm(arrow.vectors, axis=1).max())
        largest[arrow.scale_with] = max(most, largest.get(arrow.scale_with, 1e-9))
    for arrow in arrows:
        full = largest[arrow.scale_with]
        vectors = (arrow.vectors * (ARROW_LENGTH * size / full)).astype(np.float32)
        name = arrow.name.replace(' ', '_')
        style = rr.Arrows3D.from_fields(
            colors=[arrow.color], radii=[ARROW_RADIUS * size], labels=[arrow.name]
        )
        rec.log(f'{entity}/arrows/{name}', style, static=True)
        _send_arrows(rec, f'{entity}/arrows/{name}', clock, vectors)
        length = f'{ARROW_LENGTH * size:.3g} m for {full:.3g} {arrow.unit}'
        notes.append(f'arrow {arrow.name}: {length}')
    return notes


def _send_arrows(
    rec: rr.RecordingStream, entity: str, clock: Clock, vectors: NDArray[np.float32]
) -> None:
    send(rec, entity, clock, lambda rows: rr.Arrows3D.columns(vectors=vectors[rows]))


def log_uncertainty(rec: rr.RecordingStream, clock: Clock, motion: Motion) -> None:
    """Log an ellipsoid of one sigma that goes with the vehicle, where sigmas are known."""
    if motion.sigma is None:
        return
    place = motion.position.astype(np.float32)
    half = np.maximum(motion.sigma, 1e-6).astype(np.float32)
    # a mesh can be translucent, the viewer's own ellipsoids cannot
    ball = sphere()
    look = rr.Mesh3D(
        vertex_positions=ball.vertices,
        vertex_normals=ball.normals,
        vertex_colors=ball.colors,
        albedo_factor=[255, 255, 255, 35],
    )
    rec.log('world/sigma', look, static=True)
    send(
        rec,
        'world/sigma',
        clock,
        lambda rows: rr.Transform3D.columns(translation=place[rows], scale=half[rows]),
    )


def log_chase(rec: rr.RecordingStream, entity: str, clock: Clock, motion: Motion) -> None:
    """Log a level frame (forward, left, up) that goes and turns with the vehicle."""
    rec.log(entity, rr.ViewCoordinates.FLU, static=True)
    log_poses(rec, entity, clock, motion.position, level_attitude(motion.heading))


def log_planned_vehicle(
    rec: rr.RecordingStream,
    clock: Clock,
    position: Array,
    attitude: Array,
    shape: Mesh | MeshFile,
) -> None:
    """Log where the vehicle was meant to be, as a translucent shape."""
    log_ghosts(rec, 'world/planned_vehicle', shape, fade=1.0, alpha=55)
    log_poses(rec, 'world/planned_vehicle', clock, position, attitude)
