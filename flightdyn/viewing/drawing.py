"""Drawings of Dynamics instances: what `dyn.draw()` gives."""

import tempfile
from collections.abc import Collection, Mapping
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError
from ..trajectory import Trajectory
from ..vehicles.geometry import MESHES, load_geometry, read_geometry
from .rerun_view import save_rrd
from .shot import save_shot
from .window import open_window

if TYPE_CHECKING:
    from ..dynamics import Dynamics

Array = NDArray[np.float64]

STANDING = 1e-3
"""Below this share of the greatest speed it counts as standing, for times made of speeds."""


class Drawing:
    """A drawing of a motion, to be shown or saved.

    Parameters
    ----------
    trajectory : Trajectory
    options : mapping
        Of `save_rrd`.
    """

    def __init__(self, trajectory: Trajectory, options: Mapping[str, Any]) -> None:
        self.trajectory, self._options = trajectory, dict(options)

    def save(self, path: 'str | PathLike[str]') -> None:
        """Write it as a recording (.rrd); see `save_rrd` for errors."""
        save_rrd(path, self.trajectory, **self._options)

    def screenshot(self, path: str | Path, *, at: float = 0.0, view: str = 'Overview') -> None:
        """Write it as a picture (.png), at a time [s] from its start; see `save_shot`."""
        with tempfile.TemporaryDirectory(prefix='flightdyn-') as folder:
            recording = Path(folder, 'drawing.rrd')
            self.save(recording)
            save_shot([recording], path, at=at, view=view)

    def show(self) -> None:
        """Open it in a window, and wait until that is closed; see `open_window` for errors."""
        with tempfile.TemporaryDirectory(prefix='flightdyn-') as folder:
            recording = Path(folder, 'drawing.rrd')
            self.save(recording)
            open_window([recording])

    def close(self) -> None:
        """Do nothing: a drawing holds no window. For code that closes what it drew."""


def draw(
    dynamics: 'Dynamics',
    vehicle_model: Any = None,
    *,
    time: ArrayLike | None = None,
    show: bool = True,
    hidden: Collection[str] = (),
    vehicles: int | None = None,
) -> Drawing:
    """Return a drawing of an array-valued instance, see `Dynamics.draw`."""
    name, geometry = vehicle_of(vehicle_model)
    trajectory = trajectory_of(dynamics, time, vehicle=name)
    options = {'geometry': geometry, 'hidden': hidden, 'vehicles': vehicles, 'name': name}
    drawing = Drawing(trajectory, options)
    if show:
        drawing.show()
    return drawing


def trajectory_of(
    dynamics: 'Dynamics', time: ArrayLike | None = None, *, vehicle: str = ''
) -> Trajectory:
    """Return the motion of an array-valued Dynamics instance.

    Parameters
    ----------
    time : array (n,) [s]
        Of its states. Default: the instance's own `time`, if that is an array; else how long the
        way from each state to the next takes at the mean of their speeds.

    Raises
    ------
    InputError
        If the instance holds symbols or a single state, or times do not fit.
    """
    n = len(dynamics)
    if n < 2:
        raise InputError('a drawing needs an instance of two states or more')

    def columns(values: Mapping[str, Any]) -> dict[str, Array]:
        try:
            return {
                k: np.broadcast_to(np.asarray(v, float), (n,)).copy() for k, v in values.items()
            }
        except (TypeError, ValueError, RuntimeError, NotImplementedError):
            raise InputError(
                'a drawing needs numbers, not symbols: put the solution in first, sol(dyn)'
            ) from None

    states, controls = columns(dynamics.state), columns(dynamics.control_variables)
    outputs = columns({'speed': dynamics.speed, 'altitude': dynamics.altitude})
    outputs = {name: v for name, v in outputs.items() if name not in states}
    own = np.asarray(dynamics.time) if time is None else np.asarray(time, float)
    if own.shape != (n,):
        if time is not None:
            raise InputError(f'time has shape {own.shape}, the instance has {n} states')
        own = _times(states, np.broadcast_to(np.asarray(dynamics.speed, float), (n,)))
    return Trajectory(
        time=own,
        states=states,
        controls=controls,
        outputs=outputs,
        model=type(dynamics).__name__,
        vehicle=vehicle,
    )


def _times(states: Mapping[str, Array], speed: Array) -> Array:
    place = np.column_stack([states.get(k, 0 * speed) for k in ('x_e', 'y_e', 'z_e')])
    way = np.linalg.norm(np.diff(place, axis=0), axis=1)
    mean = (np.abs(speed[1:]) + np.abs(speed[:-1])) / 2
    mean = np.maximum(mean, max(STANDING * float(np.abs(speed).max()), 1e-9))
    steps = way / mean
    # where it stands still no time can be told: as much as the others take, in the mean
    usual = float(steps[steps > 0].mean()) if (steps > 0).any() else 1.0
    return np.concatenate([[0.0], np.cumsum(np.where(steps > 0, steps, usual))])


def vehicle_of(model: Any) -> tuple[str, dict[str, Any] | None]:
    """Return name and geometry of what a caller names or hands over as a vehicle.

    Parameters
    ----------
    model : None, str, mapping or airplane
        A configured vehicle or a word such as 'glider'; the path of an .stl or .glb file; a
        geometry as in a vehicle's file; or an airplane of AeroSandbox's kind, with `wings` and
        `fuselages` of `xsecs`.

    Raises
    ------
    InputError
        If it is something else, or there is no such file.
    """
    if model is None:
        return '', None
    if isinstance(model, str | Path):
        path = Path(model)
        if path.suffix.lower() in MESHES:
            mesh = {'kind': 'mesh', 'file': path.name}
            return path.stem, read_geometry(mesh, path.parent, 'vehicle_model')
        return str(model), load_geometry(str(model))
    if isinstance(model, Mapping):
        return '', read_geometry(dict(model), Path(), 'vehicle_model')
    if hasattr(model, 'wings') and hasattr(model, 'fuselages'):
        return str(getattr(model, 'name', '')), _geometry_of(model)
    raise InputError(
        f'vehicle_model {type(model).__name__}: expected a name, a mesh file, a geometry or an '
        'airplane with wings and fuselages'
    )


def _geometry_of(airplane: Any) -> dict[str, Any]:
    wings = [
        {
            'symmetric': bool(wing.symmetric),
            'sections': [
                {
                    'le': [float(v) for v in section.xyz_le],
                    'chord': float(section.chord),
                    'airfoil': str(getattr(section.airfoil, 'name', '')),
                }
                for section in wing.xsecs
            ],
        }
        for wing in airplane.wings
    ]
    if not wings:
        raise InputError('vehicle_model: an airplane needs wings to be drawn')
    bodies = [
        {
            'sections': [
                {
                    'centre': [float(v) for v in section.xyz_c],
                    'radius': float(section.width + section.height) / 4,
                    'shape': float(section.shape),
                }
                for section in body.xsecs
            ]
        }
        for body in airplane.fuselages
    ]
    return {'kind': 'airplane', 'wings': wings, 'fuselages': bodies}
