"""Vehicles from YAML: mass, rotors and limits become a model."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..config import bounds, check_keys, load_yaml, number, suggestion, text
from ..dynamics import FAMILY, Dynamics, MassProperties
from ..dynamics.base import G
from ..dynamics.stage import Model
from ..errors import InputError
from ..frames import cross
from ..numpy import Vectorizable
from ..resources import find_config, list_configs

INERTIA = ('Ixx', 'Iyy', 'Izz', 'Ixy', 'Iyz', 'Ixz')
KEYS = ('description', 'model', 'mass', 'inertia', 'gravity', 'rotors')


@dataclass(frozen=True)
class Rotor:
    """A rotor: where it pushes, which way, how hard it can.

    Parameters
    ----------
    position : x, y, z [m]
        From the centre of gravity, body axes.
    direction : x, y, z
        Unit vector of its thrust, body axes; up is (0, 0, -1).
    thrust : lower, upper [N]
    """

    position: tuple[float, float, float]
    direction: tuple[float, float, float]
    thrust: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """A vehicle as its YAML file describes it; `model()` gives its physics.

    Parameters
    ----------
    mass_props : MassProperties
    model_name : str
        Class of the Dynamics family that it flies by.
    gravity : float
        m/s^2
    rotors : mapping of control name to Rotor
    """

    name: str
    description: str
    model_name: str
    mass_props: MassProperties
    gravity: float
    rotors: Mapping[str, Rotor]

    def model(self) -> Model:
        """Return the vehicle's physics for planning, simulation and replay."""
        return Model(
            vehicle=self.name,
            dynamics=FAMILY[self.model_name],
            mass_props=self.mass_props,
            controls={name: rotor.thrust for name, rotor in self.rotors.items()},
            attach=self._attach,
        )

    def _attach(self, dyn: Dynamics, controls: Mapping[str, Vectorizable]) -> None:
        dyn.add_gravity_force(self.gravity)
        for name, rotor in self.rotors.items():
            fx, fy, fz = (controls[name] * axis for axis in rotor.direction)
            dyn.add_force(fx, fy, fz, axes='body')
            if hasattr(dyn, 'add_moment'):
                dyn.add_moment(*cross(rotor.position, (fx, fy, fz)), axes='body')


def load_vehicle(name: str, config_dir: str | Path | None = None) -> Vehicle:
    """Return a configured vehicle by name.

    Raises
    ------
    InputError
        If there is no such vehicle, or its file has an unknown key or a value out of range; the
        message names file and key.
    """
    path = find_config('vehicles', name, config_dir)
    document = check_keys(load_yaml(path), KEYS, str(path))
    for key in ('model', 'mass', 'rotors'):
        if key not in document:
            raise InputError(f"{path}: '{key}' is missing")
    model_name = text(document['model'], f'{path}: model')
    if model_name not in FAMILY:
        raise InputError(f"{path}: unknown model '{model_name}'{suggestion(model_name, FAMILY)}")
    inertia = check_keys(document.get('inertia', {}), INERTIA, f'{path}: inertia')
    for key in FAMILY[model_name].inertia:
        if key not in inertia:
            raise InputError(f"{path}: inertia: '{key}' is missing: {model_name} needs it")
    rotors = document['rotors']
    if not isinstance(rotors, Mapping) or not rotors:
        raise InputError(f'{path}: rotors: expected one or more rotors by name, got {rotors!r}')
    return Vehicle(
        name=name,
        description=text(document.get('description', ''), f'{path}: description'),
        model_name=model_name,
        mass_props=MassProperties(
            mass=_positive(document['mass'], f'{path}: mass'),
            **{
                key: (_positive if key in INERTIA[:3] else number)(value, f'{path}: inertia.{key}')
                for key, value in inertia.items()
            },
        ),
        gravity=number(document.get('gravity', G), f'{path}: gravity'),
        rotors={str(key): _rotor(value, f'{path}: rotors.{key}') for key, value in rotors.items()},
    )


def list_vehicles(config_dir: str | Path | None = None) -> list[Vehicle]:
    """Return every configured vehicle, by name."""
    return [load_vehicle(name, config_dir) for name in list_configs('vehicles', config_dir)]


def _positive(value: Any, where: str) -> float:
    result = number(value, where)
    if result <= 0:
        raise InputError(f'{where}: must be positive, got {result:g}')
    return result


def _rotor(value: Any, where: str) -> Rotor:
    keys = ('position', 'direction', 'thrust')
    rotor = check_keys(value, keys, where)
    for key in keys:
        if key not in rotor:
            raise InputError(f"{where}: '{key}' is missing")
    direction = _vector(rotor['direction'], f'{where}.direction')
    if abs(sum(c * c for c in direction) - 1) > 1e-6:
        raise InputError(f'{where}.direction: must be a unit vector, got {direction}')
    return Rotor(
        position=_vector(rotor['position'], f'{where}.position'),
        direction=direction,
        thrust=bounds(rotor['thrust'], f'{where}.thrust'),
    )


def _vector(value: Any, where: str) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        raise InputError(f'{where}: expected [x, y, z], got {value!r}')
    x, y, z = (number(component, where) for component in value)
    return x, y, z
