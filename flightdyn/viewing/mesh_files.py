"""A vehicle's mesh from a file of the user's: .stl read here, .glb shown by the viewer."""

import json
import struct
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..frames import flu_from_frd
from .solids import WHITE, Mesh

MAX_TRIANGLES = 500_000


@dataclass(frozen=True)
class MeshFile:
    """A .glb file that the viewer reads itself.

    Parameters
    ----------
    path : Path
    scale : float
        From the file's units to metres.
    size : float
        Greatest extent [m].
    """

    path: Path
    scale: float
    size: float

    def scaled(self, factor: float) -> 'MeshFile':
        """Return the mesh `factor` times as large."""
        return replace(self, scale=self.scale * factor, size=self.size * factor)


def read_stl(path: Path, scale: float = 1.0) -> Mesh:
    """Return the mesh of an .stl file, binary or text: x forward, y left, z up.

    Raises
    ------
    InputError
        If the file cannot be read, is no STL or has more than half a million triangles.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f'cannot read {path}: {error.strerror}') from error
    count = struct.unpack_from('<I', data, 80)[0] if len(data) >= 84 else 0
    if count and len(data) == 84 + 50 * count:
        _check_count(count, path)
        table = np.frombuffer(data, np.dtype([('f', '<f4', 12), ('a', '<u2')]), count, 84)
        corners = table['f'][:, 3:].reshape(-1, 3).astype(float)
    elif data[:5] == b'solid':
        corners = _corners_of_text(data, path)
    else:
        raise InputError(f'{path} is no STL: neither its size nor its first word fit')
    if not np.isfinite(corners).all():
        raise InputError(f'{path}: a corner is not a finite number')
    x, y, z = corners.T * scale
    faces = np.stack(flu_from_frd((x, y, z)), axis=-1).reshape(-1, 3, 3)  # its own inverse
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    points = faces.reshape(-1, 3)
    return Mesh(
        points.astype(np.float32),
        np.repeat(normal, 3, axis=0).astype(np.float32),
        np.tile(np.array(WHITE, np.uint8), (len(points), 1)),
        float(np.ptp(points, axis=0).max()),
    )


def _corners_of_text(data: bytes, path: Path) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    try:
        lines = [line.split() for line in data.decode('ascii').splitlines()]
        found = [[float(v) for v in w[1:4]] for w in lines if w[:1] == ['vertex']]
        corners = np.array(found, float)
    except (UnicodeDecodeError, ValueError) as error:
        raise InputError(f'{path} is no STL: {error}') from error
    if corners.ndim != 2 or corners.shape[1] != 3 or len(corners) % 3:
        raise InputError(f'{path} is no STL: {len(found)} corners do not make triangles')
    _check_count(len(corners) // 3, path)
    return corners


def _check_count(count: int, path: Path) -> None:
    if count > MAX_TRIANGLES:
        raise InputError(f'{path} has {count} triangles, at most {MAX_TRIANGLES} are drawn')


def read_glb(path: Path, scale: float = 1.0) -> MeshFile:
    """Return a .glb file and its size, from the bounds that glTF keeps of every mesh.

    Raises
    ------
    InputError
        If the file cannot be read or is no binary glTF 2.
    """
    try:
        with path.open('rb') as file:
            head = file.read(20)
            magic, version, _, length, kind = struct.unpack('<4sIII4s', head)
            if magic != b'glTF' or version != 2 or kind != b'JSON':
                raise InputError(f'{path} is no binary glTF 2')
            document = json.loads(file.read(length))
        accessors = document['accessors']
        bounds = [
            (accessors[at]['min'], accessors[at]['max'])
            for mesh in document['meshes']
            for primitive in mesh['primitives']
            for at in (primitive['attributes']['POSITION'],)
        ]
        low = np.min([b[0] for b in bounds], axis=0)
        high = np.max([b[1] for b in bounds], axis=0)
    except OSError as error:
        raise InputError(f'cannot read {path}: {error.strerror}') from error
    except (struct.error, ValueError, KeyError, IndexError, TypeError) as error:
        raise InputError(f'{path} is no binary glTF 2: {error!r}') from error
    return MeshFile(path, scale, float((high - low).max()) * scale)
