"""What every kind of aerodynamics shares: from coefficients to forces and moments."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi
from typing import Any

from .. import numpy as np
from ..dynamics import Dynamics
from ..numpy import Vectorizable
from .fields import Context, Fields, check_controls

Values = Mapping[str, Vectorizable]

COEFFICIENTS = ('CL', 'CD', 'CY', 'Cl', 'Cm', 'Cn')
"""Lift, drag and side force in wind axes; roll, pitch and yaw moment in body axes."""

RATES = {'p': 'span', 'q': 'chord', 'r': 'span'}
"""Rates and the length that makes each dimensionless: p span / (2 airspeed)."""

SHARED_KEYS = ('kind', 'area', 'span', 'chord', 'increments', 'ground_effect', 'derivatives')
"""Keys that every kind with coefficients takes."""


class Aerodynamics(ABC):
    """Forces of the air on a vehicle."""

    @property
    def box(self) -> dict[str, tuple[float, float]]:
        """Ranges by name within which the forces are known, for planners to stay in.

        Angles of attack and sideslip are in degrees.
        """
        return {}

    @property
    def uses(self) -> tuple[str, ...]:
        """Names of the controls that the forces depend on, beside the class's own."""
        return ()

    @property
    def added_mass(self) -> float:
        """Mass that comes with the aerodynamics [kg], such as a balloon's gas."""
        return 0.0

    @abstractmethod
    def attach(self, dyn: Dynamics, controls: Values) -> dict[str, Vectorizable]:
        """Add the forces, and moments to rigid bodies; return what else is known by name."""

    def describe(self) -> list[str]:
        """Return lines about the aerodynamics for people."""
        return []


@dataclass(frozen=True)
class Increment:
    """What a part adds: a coefficient or a drag area, all the time or as a control moves it.

    Parameters
    ----------
    CL, CD : float
        On the vehicle's reference area; CD is of profile drag.
    drag_area : float [m^2]
        Drag over dynamic pressure.
    control : str or None
        Name of a control to multiply with: 0 for retracted, 1 for full.
    """

    CL: float = 0.0
    CD: float = 0.0
    drag_area: float = 0.0
    control: str | None = None


@dataclass(frozen=True)
class GroundEffect:
    """Less induced drag near the ground.

    Parameters
    ----------
    span : float [m]
    efficiency : float
        Oswald's, of the induced drag far from the ground, CL^2 / (pi aspect_ratio efficiency).
    height : float [m]
        Of the wing over the ground when the vehicle's altitude is the ground's.
    elevation : float [m]
        Altitude of the ground.
    """

    span: float
    efficiency: float
    height: float
    elevation: float

    def factor(self, altitude: Vectorizable) -> Vectorizable:
        """Return the induced drag as a part of that far from the ground: from 0 at it up to 1.

        References
        ----------
        .. [1] McCormick, *Aerodynamics, Aeronautics, and Flight Mechanics*, 2nd edition, 1995,
           chapter 7 (ground effect).
        """
        ratio = 16.0 * (altitude - self.elevation + self.height) / self.span
        return ratio * ratio / (1.0 + ratio * ratio)


@dataclass(frozen=True, kw_only=True)
class Coefficients(Aerodynamics):
    """Aerodynamics by dimensionless coefficients.

    Parameters
    ----------
    area : float [m^2]
    span, chord : float [m]
        Reference lengths of roll and yaw, and of pitch.
    increments : mapping of part to Increment
    ground_effect : GroundEffect or None
    derivatives : mapping of coefficient to (variable to slope)
        Added to the coefficients: slopes by alpha and beta [1/rad], by the dimensionless rates
        p, q, r (see `RATES`), and by controls; `constant` is the value at 0.
    """

    area: float
    span: float
    chord: float
    increments: Mapping[str, Increment] = field(default_factory=dict)
    ground_effect: GroundEffect | None = None
    derivatives: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def uses(self) -> tuple[str, ...]:
        """Names of the controls that increments and derivatives go by."""
        moved = [part.control for part in self.increments.values() if part.control is not None]
        return (*moved, *(name for slopes in self.derivatives.values() for name in slopes))

    @property
    def aspect_ratio(self) -> float:
        return self.span**2 / self.area

    @abstractmethod
    def coefficients(self, dyn: Dynamics, controls: Values) -> dict[str, Vectorizable]:
        """Return the coefficients of `COEFFICIENTS` that there are, by name; CL and CD at least.

        Without increments, ground effect and derivatives.
        """

    def attach(self, dyn: Dynamics, controls: Values) -> dict[str, Vectorizable]:
        """Add the forces, and moments to rigid bodies.

        Returns
        -------
        CL, CD, and lift and drag [N] by name
            Without the part of the rates.
        """
        air = dyn.op_point
        c = dict(self.coefficients(dyn, controls))
        for part in self.increments.values():
            much = 1.0 if part.control is None else controls[part.control]
            c['CL'] = c['CL'] + part.CL * much
            c['CD'] = c['CD'] + (part.CD + part.drag_area / self.area) * much
        variables = self._variables(dyn, controls)
        for name, slopes in self.derivatives.items():
            for variable, slope in slopes.items():
                if variable not in RATES:
                    c[name] = c.get(name, 0.0) + slope * variables[variable]
        if self.ground_effect is not None:
            saved = 1.0 - self.ground_effect.factor(dyn.altitude)
            full = pi * self.aspect_ratio * self.ground_effect.efficiency
            c['CD'] = c['CD'] - saved * c['CL'] * c['CL'] / full
        force = air.dynamic_pressure() * self.area
        # of the rates: dynamic pressure / (2 airspeed), which is finite at rest
        turning = 0.25 * air.atmosphere.density() * air.velocity * self.area

        def load(name: str) -> Vectorizable:
            total = force * c[name] if name in c else 0.0
            for variable, slope in self.derivatives.get(name, {}).items():
                if variable in RATES:
                    total = total + turning * slope * variables[variable]
            return total

        dyn.add_force(-load('CD'), load('CY'), -load('CL'), axes='wind')
        if hasattr(dyn, 'add_moment'):
            span, chord = self.span, self.chord
            dyn.add_moment(span * load('Cl'), chord * load('Cm'), span * load('Cn'), axes='body')
        return {'CL': c['CL'], 'CD': c['CD'], 'lift': force * c['CL'], 'drag': force * c['CD']}

    def _variables(self, dyn: Dynamics, controls: Values) -> dict[str, Vectorizable]:
        angles = {name: np.radians(getattr(dyn.op_point, name)) for name in ('alpha', 'beta')}
        rates = {name: getattr(dyn, name) * getattr(self, of) for name, of in RATES.items()}
        return {'constant': 1.0, **angles, **rates, **controls}


def read_shared(fields: Fields, context: Context) -> dict[str, Any]:
    """Return the constructor's arguments that every kind with coefficients has.

    Raises
    ------
    InputError
        If one is missing or wrong.
    """
    area = fields.positive('area')
    span = fields.positive('span')
    chord = fields.positive('chord', area / span)
    return {
        'area': area,
        'span': span,
        'chord': chord,
        'increments': _increments(fields, context),
        'ground_effect': _ground_effect(fields, span) if 'ground_effect' in fields else None,
        'derivatives': _derivatives(fields, context),
    }


def _increments(fields: Fields, context: Context) -> dict[str, Increment]:
    found = {}
    where = fields.at('increments')
    for name, value in fields.named('increments').items():
        part = Fields(value, ('CL', 'CD', 'drag_area', 'control'), f'{where}.{name}')
        control = part.values.get('control')
        if control is not None:
            check_controls([str(control)], context.controls, part.at('control'))
        found[name] = Increment(
            CL=part.number('CL', 0.0),
            CD=part.number('CD', 0.0),
            drag_area=part.number('drag_area', 0.0),
            control=control,
        )
    return found


def _ground_effect(fields: Fields, span: float) -> GroundEffect:
    keys = ('efficiency', 'height', 'elevation')
    part = Fields(fields.need('ground_effect'), keys, fields.at('ground_effect'))
    return GroundEffect(
        span=span,
        efficiency=part.positive('efficiency', 0.8),
        height=part.number('height', 0.0),
        elevation=part.number('elevation', 0.0),
    )


def _derivatives(fields: Fields, context: Context) -> dict[str, dict[str, float]]:
    found: dict[str, dict[str, float]] = {}
    where = fields.at('derivatives')
    given = Fields(fields.values.get('derivatives', {}), COEFFICIENTS, where)
    known = ('constant', 'alpha', 'beta', *RATES, *context.controls)
    for name in given.values:
        slopes = Fields(given.need(name), known, f'{where}.{name}')
        found[name] = {variable: slopes.number(variable) for variable in slopes.values}
    return found
