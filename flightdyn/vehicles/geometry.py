"""What a vehicle looks like: the `geometry` of its file, for drawing and for its aerodynamics."""

from pathlib import Path
from typing import Any

from ..config import load_yaml, suggestion, text
from ..errors import InputError
from ..resources import list_configs
from . import aero_buildup
from .fields import Fields

MESHES = ('.stl', '.glb')

SHAPES: dict[str, tuple[str, ...]] = {
    'rocket': ('length', 'diameter'),
    'balloon': ('diameter',),
    'quadcopter': ('width',),
}
"""Dimensions [m] of shapes beside airplanes, which `aero_buildup` describes, and mesh files."""


def read_geometry(geometry: Any, folder: Path, where: str) -> dict[str, Any]:
    """Return a geometry that can be drawn; a mesh's file is named from the vehicle's folder.

    Parameters
    ----------
    geometry : mapping
        `kind: airplane` with `wings` and `fuselages`; `kind: rocket`, `balloon` or `quadcopter`
        with their dimensions [m]; or `kind: mesh` with a `file`, .stl (x forward, y left, z up)
        or .glb (as glTF has it: z forward, x left, y up), and the `scale` that makes it metres.
    folder : path
    where : str
        For messages.

    Raises
    ------
    InputError
        If a key is unknown or missing, a dimension is not positive, or there is no such file.
    """
    kinds = (*SHAPES, 'airplane', 'mesh')
    if not isinstance(geometry, dict):
        raise InputError(f'{where}: expected a mapping, got {geometry!r}')
    kind = text(geometry.get('kind', ''), f'{where}: kind')
    if kind not in kinds:
        raise InputError(f"{where}: kind: unknown '{kind}'{suggestion(kind, kinds)}")
    if kind == 'airplane':
        aero_buildup.check_geometry(geometry, where)
    elif kind == 'mesh':
        given = Fields(geometry, ('kind', 'file', 'scale'), where)
        path = folder / text(given.need('file'), given.at('file'))
        if path.suffix.lower() not in MESHES:
            raise InputError(f'{given.at("file")}: {path.name}: must be {" or ".join(MESHES)}')
        if not path.is_file():
            raise InputError(f'{given.at("file")}: no file {path}')
        return {'kind': kind, 'file': str(path), 'scale': given.positive('scale', 1.0)}
    else:
        given = Fields(geometry, ('kind', *SHAPES[kind]), where)
        for key in SHAPES[kind]:
            given.positive(key)
    return geometry


def load_geometry(name: str, config_dir: str | Path | None = None) -> dict[str, Any]:
    """Return the geometry of a configured vehicle; empty if there is no such, or it has none.

    Raises
    ------
    InputError
        If the vehicle's file cannot be read or its geometry is wrong.
    """
    path = list_configs('vehicles', config_dir).get(name)
    document = {} if path is None else load_yaml(path)
    if path is None or 'geometry' not in document:
        return {}
    return read_geometry(document['geometry'], path.parent, f'{path}: geometry')
