"""What every Dynamics class shares: named states, loads in any axes, state derivatives."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as _np

from .. import numpy as np
from ..errors import InputError
from ..frames import (
    AXES,
    R_BODY_GEOMETRY,
    Rotation,
    Vector,
    matmul,
    rotate,
    rotation_body_stability,
    rotation_stability_wind,
    transpose,
)
from ..numpy import Vectorizable
from .mass_properties import MassProperties

ZERO: Vector = (0.0, 0.0, 0.0)
G = 9.81  # m/s^2, rounded standard gravity, the default of the textbook problems


class Dynamics(ABC):
    """A vehicle's state, the loads on it, and the equations of motion between them.

    Values are floats, arrays of one shape (n,), or CasADi expressions, mixed as they come.
    Earth axes are north-east-down at a flat, non-rotating earth; mass is constant.
    """

    states: ClassVar[tuple[str, ...]]
    indirect_controls: ClassVar[tuple[str, ...]] = ()
    inertia: ClassVar[tuple[str, ...]] = ()
    """Elements of the inertia tensor that the equations divide by."""
    loads: ClassVar[tuple[str, ...]]
    force_axes: ClassVar[str]
    """Axes that forces are kept in, and the default of `add_force`."""

    mass_props: MassProperties

    def __init__(
        self, mass_props: MassProperties | None, values: Mapping[str, Vectorizable]
    ) -> None:
        self.mass_props = MassProperties(mass=1.0) if mass_props is None else mass_props
        for name, value in values.items():
            setattr(self, name, value)
        self._force: Vector = ZERO
        self._gravity: Vectorizable = 0.0

    @property
    def state(self) -> dict[str, Vectorizable]:
        """State variables by name."""
        return {name: getattr(self, name) for name in self.states}

    @property
    def control(self) -> dict[str, Vectorizable]:
        """Indirect controls and the accumulated loads in the axes they are kept in."""
        return {name: getattr(self, name) for name in self.indirect_controls} | {
            name: self._load(name[0])['xyz'.index(name[1])] for name in self.loads
        }

    def _load(self, kind: str) -> Vector:
        """Return the accumulated force ('F'), or moment ('M') where the class has one."""
        return self._force

    alpha: Vectorizable
    """Angle of attack [deg]."""
    beta: Vectorizable
    """Sideslip angle [deg]."""

    @property
    @abstractmethod
    def velocity_earth(self) -> Vector:
        """Inertial velocity u_e, v_e, w_e [m/s], earth axes."""

    @abstractmethod
    def state_derivatives(self) -> dict[str, Vectorizable]:
        """Return d(state)/dt by name, per second, of the accumulated loads."""

    @abstractmethod
    def _rotation_to_pivot(self, axes: str) -> Rotation:
        """Return the rotation from `axes` to the axes that all conversions of the class pass."""

    def add_force(
        self,
        Fx: Vectorizable = 0.0,
        Fy: Vectorizable = 0.0,
        Fz: Vectorizable = 0.0,
        axes: str | None = None,
    ) -> None:
        """Add a force [N] given in any axes; by default in `force_axes`.

        Raises
        ------
        InputError
            If `axes` is not one of earth, body, wind, stability, geometry.
        """
        force = self.convert_axes(Fx, Fy, Fz, axes or self.force_axes, self.force_axes)
        self._force = _sum(self._force, force)

    def add_gravity_force(self, g: Vectorizable = G) -> None:
        """Add the weight, down in earth axes; g in m/s^2."""
        self._gravity = self._gravity + g
        self.add_force(Fz=self.mass_props.mass * g, axes='earth')

    def convert_axes(
        self, x: Vectorizable, y: Vectorizable, z: Vectorizable, from_axes: str, to_axes: str
    ) -> Vector:
        """Return the components of a vector in other axes, at the current attitude.

        Raises
        ------
        InputError
            If a name is not one of earth, body, wind, stability, geometry.
        """
        for axes in (from_axes, to_axes):
            if axes not in AXES:
                raise InputError(f'axes {axes!r} are unknown; known: {", ".join(AXES)}')
        v: Vector = (x, y, z)
        if from_axes == to_axes:
            return v
        v = rotate(self._rotation_to_pivot(from_axes), v)
        return rotate(transpose(self._rotation_to_pivot(to_axes)), v)

    @property
    def altitude(self) -> Vectorizable:
        """Height above the origin [m]; 0 where the class has no vertical state."""
        return -getattr(self, 'z_e', 0.0)

    @property
    def load_factor(self) -> Vectorizable:
        """Force other than the weight, along -z of `force_axes`, over m x 9.81 m/s^2."""
        weight = self.convert_axes(
            0.0, 0.0, self.mass_props.mass * self._gravity, 'earth', self.force_axes
        )
        return -(self._force[2] - weight[2]) / (self.mass_props.mass * G)

    @classmethod
    def pack_state(cls, y: Any) -> dict[str, Vectorizable]:
        """Return rows of a flat state (n_states, ...) by name."""
        if len(cls.states) != (y.shape[0] if hasattr(y, 'shape') else len(y)):
            raise InputError(f'{cls.__name__} has {len(cls.states)} states, got {len(y)}')
        return {name: y[i] for i, name in enumerate(cls.states)}

    def unpack_state(self, state: Mapping[str, Vectorizable] | None = None) -> Any:
        """Return a state by name as a flat array (n_states, ...), in the order of `states`."""
        state = self.state if state is None else state
        return _np.array(_np.broadcast_arrays(*(state[name] for name in self.states)))

    def get_new_instance_with_state(self, state: Mapping[str, Vectorizable]) -> Self:
        """Return a vehicle alike in another state, without loads."""
        controls = {name: getattr(self, name) for name in self.indirect_controls}
        return type(self)(mass_props=self.mass_props, **{**controls, **state})

    def __repr__(self) -> str:
        values = ', '.join(f'{name}={value!r}' for name, value in self.state.items())
        return f'{type(self).__name__}({values})'


def _sum(a: Vector, b: Vector) -> Vector:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def aerodynamic_rotation(axes: str, alpha_deg: Vectorizable, beta_deg: Vectorizable) -> Rotation:
    """Return the rotation from wind, stability or geometry axes to the body."""
    if axes == 'geometry':
        return R_BODY_GEOMETRY
    r_bs = rotation_body_stability(np.radians(alpha_deg))
    if axes == 'stability':
        return r_bs
    return matmul(r_bs, rotation_stability_wind(np.radians(beta_deg)))
