"""Vehicles: mass, rotors, aerodynamics, propulsion and limits become a model."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from ..config import suggestion
from ..dynamics import FAMILY, Dynamics, MassProperties
from ..dynamics.stage import Model
from ..environment.wind import Wind
from ..errors import InputError
from ..numpy import Vectorizable
from .aero_table import FitError, TableAerodynamics
from .aerodynamics import Aerodynamics
from .propulsion import Propulsion, Rotor

Bounds = Mapping[str, tuple[float, float]]

STEERED = tuple(
    dict.fromkeys(
        name for cls in FAMILY.values() for name in (*cls.indirect_controls, *cls.rotor_momenta)
    )
)
"""Controls that the classes of the family have themselves, each only some of them."""


@dataclass(frozen=True, kw_only=True)
class Vehicle:
    """A vehicle as its YAML file describes it; `model()` gives its physics.

    Its `repr` tells apart vehicles that differ, tables included.

    Parameters
    ----------
    mass_props : MassProperties
        At the start, or without fuel that is a state.
    model_name : str
        Class of the Dynamics family that it flies by.
    gravity : float
        m/s^2
    rotors : mapping of control name to Rotor
    aerodynamics : Aerodynamics or None
    propulsion : Propulsion or None
    controls : mapping of name to (lower, upper)
        Beside those of rotors and propulsion. A model takes the indirect controls of its class
        and leaves out those of other classes. Alpha and beta are in degrees.
    limits : mapping of name to (lower, upper)
        What the vehicle stands, for planners to keep: states and outputs of the stage by name.
        Those of extra states are always there.
    rates : mapping of control name to float
        How fast a control can change at most, either way: its unit per second, degrees per
        second of alpha and beta. Controls that are not named change at once.
    geometry : mapping
        `kind` and dimensions for drawing.

    Raises
    ------
    InputError
        If there is no such class, it needs inertia that is missing, a control's name is taken,
        or a rate is of no control or not positive.
    """

    name: str
    description: str
    model_name: str
    mass_props: MassProperties
    gravity: float
    rotors: Mapping[str, Rotor] = field(default_factory=dict)
    aerodynamics: Aerodynamics | None = None
    propulsion: Propulsion | None = None
    controls: Bounds = field(default_factory=dict)
    limits: Bounds = field(default_factory=dict)
    rates: Mapping[str, float] = field(default_factory=dict)
    geometry: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.model_name not in FAMILY:
            raise InputError(
                f"{self.name}: unknown model '{self.model_name}'"
                f'{suggestion(self.model_name, FAMILY)}'
            )
        for key in FAMILY[self.model_name].inertia:
            if not getattr(self.mass_props, key):
                raise InputError(
                    f"{self.name}: inertia: '{key}' is missing: {self.model_name} needs it"
                )
        driven = {} if self.propulsion is None else self.propulsion.controls
        taken = [*self.rotors, *driven, *self.controls]
        for name in taken:
            if taken.count(name) > 1:
                raise InputError(f"{self.name}: two controls have the name '{name}'")
        for name, rate in self.rates.items():
            if name not in taken:
                raise InputError(
                    f"{self.name}: rates: '{name}' is not among the vehicle's controls"
                    + (suggestion(name, taken) if taken else '')
                )
            if not rate > 0:
                raise InputError(f'{self.name}: rates.{name}: must be positive, got {rate:g}')

    @property
    def box(self) -> dict[str, tuple[float, float]]:
        """Ranges by name within which the aerodynamics are known; see `Aerodynamics.box`."""
        return {} if self.aerodynamics is None else self.aerodynamics.box

    @property
    def fit_errors(self) -> Mapping[str, FitError]:
        """How far the fits of a table are off it, by coefficient; empty without a table."""
        return self.aerodynamics.errors if isinstance(self.aerodynamics, TableAerodynamics) else {}

    def with_model(self, model_name: str) -> 'Vehicle':
        """Return the vehicle flown by another class of the Dynamics family.

        Raises
        ------
        InputError
            If there is no such class, or it needs inertia that the vehicle has not.
        """
        return replace(self, model_name=model_name)

    def model(self, wind: Wind | None = None, *, free_wind: bool = False) -> Model:
        """Return the vehicle's physics for planning, simulation and replay.

        Parameters
        ----------
        wind : callable (x_e, y_e, z_e, time) -> (x, y, z) [m/s]
            Where the air moves to, earth axes, beside what is set later on.
        free_wind : bool
            Whether its strength is a state, see `Model`.
        """
        dynamics = FAMILY[self.model_name]
        own = (*dynamics.indirect_controls, *dynamics.rotor_momenta)
        controls = {name: rotor.thrust for name, rotor in self.rotors.items()}
        controls |= {k: v for k, v in self.controls.items() if k in own or k not in STEERED}
        propulsion = self.propulsion
        if propulsion is None:
            return Model(
                vehicle=self.name,
                dynamics=dynamics,
                mass_props=self.mass_props,
                controls=controls,
                attach=self._attach,
                wind=wind,
                free_wind=free_wind,
            )
        return Model(
            vehicle=self.name,
            dynamics=dynamics,
            mass_props=lambda extra: propulsion.mass_props(self.mass_props, extra),
            controls={**controls, **propulsion.controls},
            attach=self._attach,
            extra_states=tuple(propulsion.extra_states),
            wind=wind,
            free_wind=free_wind,
        )

    def _attach(
        self, dyn: Dynamics, controls: Mapping[str, Vectorizable]
    ) -> dict[str, Vectorizable]:
        dyn.add_gravity_force(self.gravity)
        for name, rotor in self.rotors.items():
            rotor.push(dyn, controls[name])
        found: dict[str, Vectorizable] = {}
        if self.aerodynamics is not None:
            found |= self.aerodynamics.attach(dyn, controls)
        if self.propulsion is not None:
            found |= self.propulsion.attach(dyn, controls)
        return found

    def describe(self) -> str:
        """Return what there is to know about the vehicle, in lines for people."""
        model = self.model()
        lines = [
            f'{self.name}: {self.description}',
            f'model {self.model_name}, mass {self.mass_props.mass:g} kg',
            f'states {" ".join(model.states)}',
            *_ranges('controls', model.controls),
            *_ranges('limits', self.limits),
        ]
        if self.rates:
            told = ', '.join(f'{name} {rate:g}/s' for name, rate in self.rates.items())
            lines.append(f'rates {told}')
        if self.aerodynamics is not None:
            lines += self.aerodynamics.describe()
        return '\n'.join(lines)


def _ranges(title: str, ranges: Bounds) -> list[str]:
    if not ranges:
        return []
    told = ', '.join(f'{name} {low:g} to {high:g}' for name, (low, high) in ranges.items())
    return [f'{title} {told}']
