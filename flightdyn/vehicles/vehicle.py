"""Vehicles from YAML files; `Vehicle.model()` gives their physics."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from ..config import apply_setting, load_yaml, suggestion, text
from ..dynamics import FAMILY, MassProperties
from ..dynamics.base import G
from ..dynamics.stage import KINEMATICS
from ..errors import InputError
from ..resources import find_config, list_configs
from . import (
    aero_direct,
    aero_polar,
    aero_table,
    body_drag,
    buoyancy,
    jet,
    propeller,
    propulsion,
)
from .aerodynamics import COEFFICIENTS, Aerodynamics
from .definition import STEERED
from .definition import Vehicle as Vehicle
from .fields import IN_DEGREES, Context, Fields, check_controls, in_degrees, named_bounds, positive
from .geometry import read_geometry
from .propulsion import Propulsion
from .propulsion import Rotor as Rotor

T = TypeVar('T')

INERTIA = ('Ixx', 'Iyy', 'Izz', 'Ixy', 'Iyz', 'Ixz')
KEYS = (
    *('description', 'model', 'mass', 'inertia', 'radii_of_gyration', 'gravity', 'rotors'),
    *('aerodynamics', 'propulsion', 'controls', 'limits', 'rates', 'geometry'),
)
AERODYNAMICS = {
    'polar': (aero_polar.KEYS, aero_polar.read_polar),
    'table': (aero_table.KEYS, aero_table.read_table_aerodynamics),
    'buildup': (aero_direct.KEYS, aero_direct.read_buildup_or_direct),
    'balloon': (buoyancy.KEYS, buoyancy.read_balloon),
    'body_drag': (body_drag.KEYS, body_drag.read_body_drag),
}
PROPULSION = {
    'rocket': (propulsion.ROCKET_KEYS, propulsion.read_rocket),
    'propeller': (propeller.KEYS, propeller.read_propeller),
    'jet': (jet.KEYS, jet.read_jet),
}

OUTPUTS = ('altitude', *COEFFICIENTS, 'lift', 'drag', 'thrust', 'power', 'rotation', 'mach')
"""What can be limited beside states, controls and the kinematics of every stage."""


def load_vehicle(
    name: str, config_dir: str | Path | None = None, settings: Sequence[str] = ()
) -> Vehicle:
    """Return a configured vehicle by name.

    Parameters
    ----------
    settings : sequence of 'KEY=VALUE'
        Override entries of its file, such as `mass=0.105` or `inertia.Iyy=6e-4`.

    Raises
    ------
    InputError
        If there is no such vehicle, or its file has an unknown key or a value out of range; the
        message names file and key.
    """
    path = find_config('vehicles', name, config_dir)
    values = load_yaml(path)
    for setting in settings:
        apply_setting(values, setting)
    document = Fields(values, KEYS, str(path))
    model_name = document.choice('model', FAMILY)
    gravity = document.number('gravity', G)
    controls = _controls(document)
    geometry = {}
    if 'geometry' in document:
        geometry = read_geometry(document.need('geometry'), path.parent, document.at('geometry'))
    context = Context(path.parent, gravity, tuple(controls), geometry)
    aerodynamics = _aerodynamics(document, context)
    mass = document.positive('mass')
    if aerodynamics is not None:
        mass += aerodynamics.added_mass
    drive = _propulsion(document, mass)
    rotors = _rotors(document)
    extra = {} if drive is None else drive.extra_states
    _check_uses(document, controls, aerodynamics)
    return Vehicle(
        name=name,
        description=text(document.values.get('description', ''), document.at('description')),
        model_name=model_name,
        mass_props=_mass_props(document, mass, model_name),
        gravity=gravity,
        rotors=rotors,
        aerodynamics=aerodynamics,
        propulsion=drive,
        controls=controls,
        limits={**extra, **_limits(document, (*controls, *extra))},
        rates=_rates(document, (*rotors, *({} if drive is None else drive.controls), *controls)),
        geometry=geometry,
    )


def list_vehicles(config_dir: str | Path | None = None) -> list[Vehicle]:
    """Return every configured vehicle, by name."""
    return [load_vehicle(name, config_dir) for name in list_configs('vehicles', config_dir)]


def _controls(document: Fields) -> dict[str, tuple[float, float]]:
    given = document.named('controls')
    where = document.at('controls')
    for name in given:
        if not name.isidentifier():
            raise InputError(f"{where}: '{name}' is no name of letters, digits and underscores")
    return {name: named_bounds(name, v, f'{where}.{name}') for name, v in given.items()}


def _limits(document: Fields, more: Collection[str]) -> dict[str, tuple[float, float]]:
    known = dict.fromkeys(
        (*(name for cls in FAMILY.values() for name in cls.states), *KINEMATICS, *OUTPUTS, *more)
    )
    given = Fields(document.values.get('limits', {}), tuple(known), document.at('limits'))
    return {
        name: named_bounds(name, value, f'{given.where}.{name}')
        for name, value in given.values.items()
    }


def _rates(document: Fields, controls: Collection[str]) -> dict[str, float]:
    given = document.named('rates')
    where = document.at('rates')
    check_controls(tuple(given), controls, where)
    return {
        name: positive(
            in_degrees(value, f'{where}.{name}') if name in IN_DEGREES else value,
            f'{where}.{name}',
        )
        for name, value in given.items()
    }


def _rotors(document: Fields) -> dict[str, Rotor]:
    if 'rotors' not in document:
        return {}
    rotors, where = document.need('rotors'), document.at('rotors')
    if not isinstance(rotors, Mapping) or not rotors:
        raise InputError(f'{where}: expected one or more rotors by name, got {rotors!r}')
    return {str(k): propulsion.read_rotor(v, f'{where}.{k}') for k, v in rotors.items()}


def _mass_props(document: Fields, mass: float, model_name: str) -> MassProperties:
    inertia = _inertia(document, mass, model_name)
    try:
        return MassProperties(mass=mass, **inertia)
    except InputError as error:
        raise InputError(f'{document.where}: {error}') from None


def _inertia(document: Fields, mass: float, model_name: str) -> dict[str, float]:
    """Return the elements of the inertia tensor that are given."""
    if 'radii_of_gyration' in document:
        if 'inertia' in document:
            raise InputError(f'{document.where}: give either inertia or radii_of_gyration')
        radii = document.vector('radii_of_gyration')
        return {key: mass * radius**2 for key, radius in zip(INERTIA[:3], radii, strict=True)}
    given = Fields(document.values.get('inertia', {}), INERTIA, document.at('inertia'))
    for key in FAMILY[model_name].inertia:
        if key not in given:
            raise InputError(f"{given.where}: '{key}' is missing: {model_name} needs it")
    return {
        key: given.positive(key) if key in INERTIA[:3] else given.number(key)
        for key in given.values
    }


def _aerodynamics(document: Fields, context: Context) -> Aerodynamics | None:
    if 'aerodynamics' not in document:
        return None
    (keys, read), where = _kind(document, 'aerodynamics', AERODYNAMICS)
    return read(Fields(document.need('aerodynamics'), keys, where), context)


def _propulsion(document: Fields, mass: float) -> Propulsion | None:
    if 'propulsion' not in document:
        return None
    (keys, read), where = _kind(document, 'propulsion', PROPULSION)
    return read(Fields(document.need('propulsion'), keys, where), mass)


def _kind(document: Fields, key: str, kinds: Mapping[str, T]) -> tuple[T, str]:
    where = document.at(key)
    mapping = document.need(key)
    if not isinstance(mapping, Mapping):
        raise InputError(f'{where}: expected a mapping, got {mapping!r}')
    kind = text(mapping.get('kind', ''), f'{where}: kind')
    if kind not in kinds:
        raise InputError(f"{where}: kind: unknown '{kind}'{suggestion(kind, kinds)}")
    return kinds[kind], where


def _check_uses(
    document: Fields, controls: Collection[str], aerodynamics: Aerodynamics | None
) -> None:
    used = tuple(dict.fromkeys((*STEERED, *(aerodynamics.uses if aerodynamics else ()))))
    for name in controls:
        if name not in used:
            raise InputError(
                f"{document.at('controls')}: '{name}' has no effect{suggestion(name, used)}"
            )
