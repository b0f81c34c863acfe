"""The air that a vehicle meets: speed, angles and rates in an atmosphere."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, Self

import casadi as cas
import numpy as _np
from numpy.typing import ArrayLike

from .. import frames
from .. import numpy as np
from ..environment import airspeed
from ..environment.atmosphere import Atmosphere
from ..environment.elements import common_length, elements
from ..errors import InputError
from ..frames import Rotation, Vector
from ..numpy import Vectorizable, is_symbolic

G = 9.81  # m/s^2, as in the equations of motion


class OperatingPoint:
    """State of the flow about a vehicle.

    Parameters
    ----------
    atmosphere : Atmosphere, optional
        Sea level by default.
    velocity : Vectorizable
        True airspeed [m/s].
    alpha, beta : Vectorizable
        Angle of attack and sideslip [deg]; beta positive with the wind in the right ear.
    p, q, r : Vectorizable
        Roll, pitch and yaw rate [rad/s], body axes.

    All are floats, arrays (n,) or CasADi expressions of one length, mixed as they come. The
    analyses of AeroSandbox take this class in place of their own.
    """

    names: ClassVar[tuple[str, ...]] = ('atmosphere', 'velocity', 'alpha', 'beta', 'p', 'q', 'r')

    def __init__(
        self,
        atmosphere: Atmosphere | None = None,
        velocity: Vectorizable = 1.0,
        alpha: Vectorizable = 0.0,
        beta: Vectorizable = 0.0,
        p: Vectorizable = 0.0,
        q: Vectorizable = 0.0,
        r: Vectorizable = 0.0,
    ) -> None:
        self.atmosphere = Atmosphere() if atmosphere is None else atmosphere
        self.velocity = velocity
        self.alpha = alpha
        self.beta = beta
        self.p = p
        self.q = q
        self.r = r

    @property
    def state(self) -> dict[str, Any]:
        """The constructor's arguments by name."""
        return {name: getattr(self, name) for name in self.names}

    def pack_state(self, values: Sequence[Any] | None = None) -> dict[str, Any]:
        """Return values in the order of `state` by name; the own ones if none are given.

        Raises
        ------
        InputError
            If there are not seven.
        """
        if values is None:
            return self.state
        if len(values) != len(self.names):
            raise InputError(
                f'{len(values)} values for an operating point; it has {len(self.names)}: '
                + ', '.join(self.names)
            )
        return dict(zip(self.names, values, strict=True))

    def unpack_state(self, state: Mapping[str, Any] | None = None) -> tuple[Any, ...]:
        """Return a state by name, the own one if none is given, as a tuple."""
        return tuple((self.state if state is None else state).values())

    def get_new_instance_with_state(
        self, new_state: Mapping[str, Any] | Sequence[Any] | None = None
    ) -> Self:
        """Return a copy with some values (by name) or all (in order) replaced.

        Raises
        ------
        InputError
            If a name is unknown, or a sequence has not seven values.
        """
        if new_state is None:
            return self.copy()
        if not isinstance(new_state, Mapping):
            new_state = self.pack_state(new_state)
        unknown = sorted(set(new_state) - set(self.names))
        if unknown:
            raise InputError(
                f'an operating point has no {", ".join(unknown)}; it has {", ".join(self.names)}'
            )
        return type(self)(**{**self.state, **new_state})

    def copy(self) -> Self:
        """Return a shallow copy."""
        return copy.copy(self)

    def __len__(self) -> int:
        return common_length(type(self).__name__, self.state)

    def __getitem__(self, index: Any) -> Self:
        return type(self)(**elements(type(self).__name__, self.state, index))

    def __repr__(self) -> str:
        values = ', '.join(f'{name}={value}' for name, value in self.state.items())
        return f'{type(self).__name__}({values})'

    def dynamic_pressure(self) -> Vectorizable:
        """Return the dynamic pressure, half density times velocity squared [Pa]."""
        return 0.5 * self.atmosphere.density() * self.velocity * self.velocity

    def total_pressure(self) -> Vectorizable:
        """Return the pressure after an isentropic stop [Pa]."""
        ratio = self.atmosphere.ratio_of_specific_heats()
        return self.atmosphere.pressure() * self._stagnation() ** (ratio / (ratio - 1))

    def total_temperature(self) -> Vectorizable:
        """Return the temperature after an adiabatic stop [K]."""
        return self.atmosphere.temperature() * self._stagnation()

    def _stagnation(self) -> Vectorizable:
        mach = self.mach()
        return 1 + (self.atmosphere.ratio_of_specific_heats() - 1) / 2 * mach * mach

    def mach(self) -> Vectorizable:
        """Return the Mach number."""
        return self.velocity / self.atmosphere.speed_of_sound()

    def reynolds(self, reference_length: Vectorizable) -> Vectorizable:
        """Return the Reynolds number of a length [m]."""
        density, viscosity = self.atmosphere.density(), self.atmosphere.dynamic_viscosity()
        return density * self.velocity * reference_length / viscosity

    def equivalent_airspeed(self) -> Vectorizable:
        """Return the speed of the same dynamic pressure in standard air at sea level [m/s]."""
        return airspeed.equivalent_from_true(self.velocity, self.atmosphere.density())

    def calibrated_airspeed(self) -> Vectorizable:
        """Return the speed of the same impact pressure in standard air at sea level [m/s].

        Above Mach 1 the pitot tube is behind a normal shock.
        """
        return airspeed.calibrated_from_mach(self.mach(), self.atmosphere.pressure())

    def indicated_airspeed(self) -> Vectorizable:
        """Return what an error-free indicator shows: the calibrated airspeed [m/s]."""
        return self.calibrated_airspeed()

    def energy_altitude(self, g: Vectorizable = G) -> Vectorizable:
        """Return the altitude at which all energy would be potential [m]; g in m/s^2."""
        return self.atmosphere.altitude + self.velocity * self.velocity / (2 * g)

    def convert_axes(
        self,
        x_from: Vectorizable,
        y_from: Vectorizable,
        z_from: Vectorizable,
        from_axes: str,
        to_axes: str,
    ) -> Vector:
        """Return the components of a vector in other axes.

        Raises
        ------
        InputError
            If a name is not one of geometry, body, wind, stability.
        """
        v: Vector = (x_from, y_from, z_from)
        to_body = {axes: self._rotation_to_body(axes) for axes in (from_axes, to_axes)}
        if from_axes == to_axes:
            return v
        v = frames.rotate(to_body[from_axes], v)
        return frames.rotate(frames.transpose(to_body[to_axes]), v)

    def _rotation_to_body(self, axes: str) -> Rotation:
        if axes == 'body':
            return frames.IDENTITY
        if axes == 'geometry':
            return frames.R_BODY_GEOMETRY
        if axes not in ('stability', 'wind'):
            raise InputError(
                f'axes {axes!r} are unknown to an operating point; '
                'known: geometry, body, wind, stability'
            )
        r_bs = frames.rotation_body_stability(np.radians(self.alpha))
        if axes == 'stability':
            return r_bs
        return frames.matmul(r_bs, frames.rotation_stability_wind(np.radians(self.beta)))

    def compute_rotation_matrix_wind_to_geometry(self) -> Any:
        """Return the rotation from wind to geometry axes.

        Returns
        -------
        array (3, 3), or (n, 3, 3) where alpha or beta are arrays, or CasADi (3, 3)

        Raises
        ------
        InputError
            If alpha or beta are CasADi vectors, which make no three-dimensional arrays.
        """
        r_gw = frames.matmul(
            frames.transpose(frames.R_BODY_GEOMETRY), self._rotation_to_body('wind')
        )
        rows = [_columns(row) for row in r_gw]
        if is_symbolic(*rows):
            if any(row.shape[0] != 1 for row in rows):
                raise InputError(
                    'alpha and beta are CasADi vectors; index the operating point first'
                )
            return cas.vertcat(*rows)
        return _np.stack(rows, axis=-2)

    def compute_freestream_direction_geometry_axes(self) -> Any:
        """Return where the air goes to, of length 1, in geometry axes.

        Returns
        -------
        array (3,), or (n, 3) where alpha or beta are arrays, or CasADi (3, 1) or (n, 3)
        """
        return _vector(self.convert_axes(-1.0, 0.0, 0.0, 'wind', 'geometry'))

    def compute_freestream_velocity_geometry_axes(self) -> Any:
        """Return the velocity of the air [m/s] in geometry axes, shaped as its direction."""
        return _vector(self.convert_axes(-self.velocity, 0.0, 0.0, 'wind', 'geometry'))

    def compute_rotation_velocity_geometry_axes(self, points: ArrayLike | Vectorizable) -> Any:
        """Return the velocity of the air that points meet by the vehicle's rotation.

        Parameters
        ----------
        points : (m, 3)
            Positions from the centre of rotation [m], geometry axes.

        Returns
        -------
        array or CasADi (m, 3)
            Velocities [m/s], geometry axes. The rates are one each.
        """
        xyz: Any = points if is_symbolic(points) else _np.asarray(points, float)
        x, y, z = xyz[:, 0], xyz[:, 1], xyz[:, 2]
        p, q, r = self.convert_axes(self.p, self.q, self.r, 'body', 'geometry')
        # points x rates: what a point meets is opposite to its own motion
        return _columns((y * r - z * q, z * p - x * r, x * q - y * p))


def _columns(v: Vector) -> Any:
    """Return a vector's components as the last axis."""
    return cas.horzcat(*v) if is_symbolic(*v) else frames.stack(v)


def _vector(v: Vector) -> Any:
    """Return a vector's components as the last axis, or as a CasADi column if there is one."""
    columns = _columns(v)
    return columns.T if is_symbolic(columns) and columns.shape[0] == 1 else columns
