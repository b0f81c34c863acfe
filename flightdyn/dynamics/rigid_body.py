"""Rigid bodies: attitude and rates are states, driven by moments."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, Self

from .. import numpy as np
from ..environment.wind import Wind
from ..errors import InputError
from ..frames import (
    Rotation,
    Turn,
    Vector,
    add,
    backward,
    body_from_geometry,
    cross,
    direction,
    euler_from_rotation,
    quaternion_from_euler,
    rotate,
    rotation_from_quaternion,
    transpose,
    turn_x,
    turn_y,
    turn_z,
)
from ..numpy import Vectorizable
from .base import ZERO, Dynamics
from .mass_properties import MassProperties
from .named_values import Names

_AFTER = {'geometry': 'body', 'wind': 'stability', 'stability': 'body', 'body': 'earth'}

NORM_FEEDBACK = 1.0  # 1/s, how fast an attitude quaternion returns to unit length


class RigidBody(Dynamics):
    """What rigid bodies share: velocity in body axes, moments, alpha and beta from the velocity.

    Forces and moments are kept in body axes, the default of `add_force` and `add_moment`.
    """

    force_axes = 'body'
    kept_axes = 'body'

    u_b: Vectorizable = 0.0
    v_b: Vectorizable = 0.0
    w_b: Vectorizable = 0.0
    phi: Vectorizable = 0.0
    theta: Vectorizable = 0.0
    psi: Vectorizable = 0.0
    hx_b: Vectorizable = 0.0
    hy_b: Vectorizable = 0.0
    hz_b: Vectorizable = 0.0
    _moment: Vector = ZERO

    def _map_columns(self, function: Callable[[Any], Any]) -> Self:
        part = super()._map_columns(function)
        part.__dict__['_moment'] = tuple(function(component) for component in self._moment)
        return part

    def add_moment(
        self,
        Mx: Vectorizable = 0.0,
        My: Vectorizable = 0.0,
        Mz: Vectorizable = 0.0,
        axes: str = 'body',
    ) -> None:
        """Add a moment about the centre of gravity [N m], given in any axes.

        Raises
        ------
        InputError
            If `axes` is not one of earth, body, wind, stability, geometry.
        """
        moment = self.convert_axes(Mx, My, Mz, axes, self.kept_axes)
        self.__dict__['_moment'] = add(self._moment, moment)

    def _load(self, kind: str) -> Vector:
        return self._moment if kind == 'M' else self._force

    @property
    def velocity_earth(self) -> Vector:
        found: Vector = self._once(
            'velocity', lambda: self.convert_axes(self.u_b, self.v_b, self.w_b, 'body', 'earth')
        )
        return found

    @property
    def speed(self) -> Vectorizable:
        return self._once('speed', lambda: np.hypot(self.u_b, self.v_b, self.w_b))

    @property
    def gamma(self) -> Vectorizable:
        """Flight-path angle over the ground [rad], up positive; 0 at rest."""
        u_e, v_e, w_e = self.velocity_earth
        return np.arctan2(-w_e, np.hypot(u_e, v_e))

    @property
    def track(self) -> Vectorizable:
        """Direction over the ground [rad], 0 north, pi/2 east; 0 without horizontal velocity."""
        u_e, v_e, _ = self.velocity_earth
        return np.arctan2(v_e, u_e)

    @property
    def air_velocity_body(self) -> Vector:
        """Velocity through the air [m/s], body axes."""
        if self.wind is None:
            return self.u_b, self.v_b, self.w_b
        found: Vector = self._once('air velocity', self._air_velocity_body)
        return found

    def _air_velocity_body(self) -> Vector:
        x, y, z = self.convert_axes(*self.wind_earth, 'earth', 'body')
        return self.u_b - x, self.v_b - y, self.w_b - z

    @property
    def airspeed(self) -> Vectorizable:
        """True airspeed [m/s]: the length of the velocity through the air."""
        return self.speed if self.wind is None else np.hypot(*self.air_velocity_body)

    @property
    def alpha(self) -> Vectorizable:
        """Angle of attack [deg] of the velocity through the air; 0 at rest."""
        u, _, w = self.air_velocity_body
        return np.degrees(np.arctan2(w, u))

    @property
    def beta(self) -> Vectorizable:
        """Sideslip angle [deg] of the velocity through the air; 0 at rest."""
        u, v, w = self.air_velocity_body
        return np.degrees(np.arctan2(v, np.hypot(u, w)))

    def _air_direction(self) -> tuple[Turn, Turn]:
        """Return (sin, cos) of beta and of alpha."""

        def evaluate() -> tuple[Turn, Turn]:
            u, v, w = self.air_velocity_body
            return direction(u, w, -v)

        found: tuple[Turn, Turn] = self._once('direction', evaluate)
        return found

    def _next_axes(self, axes: str) -> str:
        return _AFTER[axes]

    def _to_next(self, axes: str, v: Vector) -> Vector:
        if axes == 'geometry':
            return body_from_geometry(v)
        if axes == 'body':
            return self._body_to_earth(v)
        beta, alpha = self._air_direction()
        return turn_z(v, beta) if axes == 'wind' else turn_y(v, backward(alpha))

    def _from_next(self, axes: str, v: Vector) -> Vector:
        if axes == 'geometry':
            return body_from_geometry(v)
        if axes == 'body':
            return self._earth_to_body(v)
        beta, alpha = self._air_direction()
        return turn_z(v, backward(beta)) if axes == 'wind' else turn_y(v, alpha)

    @abstractmethod
    def _body_to_earth(self, v: Vector) -> Vector: ...

    @abstractmethod
    def _earth_to_body(self, v: Vector) -> Vector: ...


class DynamicsRigidBody3DBodyEuler(RigidBody):
    """Rigid body in three dimensions, velocity in body axes, attitude by Euler angles.

    State
    -----
    x_e, y_e, z_e : position [m], earth axes (north, east, down)
    u_b, v_b, w_b : inertial velocity [m/s], body axes (forward, right, down)
    phi, theta, psi : roll, pitch and yaw angle [rad], turned in the order yaw, pitch, roll
    p, q, r : roll, pitch and yaw rate [rad/s], body axes

    Rotor momenta hx_b, hy_b, hz_b [kg m^2/s] are the angular momentum of spinning rotors
    relative to the body, in body axes, at constant speed; their gyroscopic moments turn the body.
    The rates of phi and psi grow without bound towards theta = +-pi/2: bound it away, or take
    the quaternion class.
    """

    states: Names = (
        *('x_e', 'y_e', 'z_e', 'u_b', 'v_b', 'w_b'),
        *('phi', 'theta', 'psi', 'p', 'q', 'r'),
    )
    rotor_momenta: Names = ('hx_b', 'hy_b', 'hz_b')
    loads: Names = ('Fx_b', 'Fy_b', 'Fz_b', 'Mx_b', 'My_b', 'Mz_b')
    inertia: Names = ('Ixx', 'Iyy', 'Izz')

    @property
    def angular_momentum_body(self) -> Vector:
        """Angular momentum about the centre of gravity, rotors included [kg m^2/s], body axes."""
        hx, hy, hz = rotate(self.mass_props.inertia_rows(), (self.p, self.q, self.r))
        return hx + self.hx_b, hy + self.hy_b, hz + self.hz_b

    @property
    def angular_momentum_earth(self) -> Vector:
        """Angular momentum about the centre of gravity, rotors included, earth axes."""
        return self.convert_axes(*self.angular_momentum_body, 'body', 'earth')

    @property
    def rotational_kinetic_energy(self) -> Vectorizable:
        hx, hy, hz = rotate(self.mass_props.inertia_rows(), (self.p, self.q, self.r))
        return 0.5 * (self.p * hx + self.q * hy + self.r * hz)

    def state_derivatives(self) -> dict[str, Vectorizable]:
        """Return d(state)/dt by name, per second, of the accumulated loads.

        Raises
        ------
        InputError
            If the inertia tensor has no inverse: a moment of inertia is 0.

        References
        ----------
        .. [1] Drela, *Flight Vehicle Aerodynamics*, 2014, chapter 9 (dynamics of a rigid body
           with spinning rotors).
        """
        (fx, fy, fz), mass = self._force, self.mass_props.mass
        rates = (self.p, self.q, self.r)
        gx, gy, gz = cross(rates, self.angular_momentum_body)
        mx, my, mz = self._moment
        accelerations = rotate(self.mass_props.inverse_inertia_rows(), (mx - gx, my - gy, mz - gz))
        cx, cy, cz = cross(rates, (self.u_b, self.v_b, self.w_b))
        return {
            **dict(zip(('x_e', 'y_e', 'z_e'), self.velocity_earth, strict=True)),
            'u_b': fx / mass - cx,
            'v_b': fy / mass - cy,
            'w_b': fz / mass - cz,
            **self._attitude_derivatives(),
            **dict(zip(('p', 'q', 'r'), accelerations, strict=True)),
        }

    def _attitude_derivatives(self) -> dict[str, Vectorizable]:
        (sin_phi, cos_phi), (sin_theta, cos_theta) = self._sines('phi'), self._sines('theta')
        across = sin_phi * self.q + cos_phi * self.r
        psi_rate = across / cos_theta
        return {
            'phi': self.p + psi_rate * sin_theta,
            'theta': cos_phi * self.q - sin_phi * self.r,
            'psi': psi_rate,
        }

    def _body_to_earth(self, v: Vector) -> Vector:
        v = turn_y(turn_x(v, self._sines('phi')), self._sines('theta'))
        return turn_z(v, self._sines('psi'))

    def _earth_to_body(self, v: Vector) -> Vector:
        v = turn_y(turn_z(v, backward(self._sines('psi'))), backward(self._sines('theta')))
        return turn_x(v, backward(self._sines('phi')))


class DynamicsRigidBody3DBodyQuaternion(DynamicsRigidBody3DBodyEuler):
    """Rigid body in three dimensions, velocity in body axes, attitude by a quaternion.

    State
    -----
    x_e, y_e, z_e : position [m], earth axes (north, east, down)
    u_b, v_b, w_b : inertial velocity [m/s], body axes (forward, right, down)
    qw, qx, qy, qz : attitude quaternion, body to earth, scalar first; by default (1, 0, 0, 0)
    p, q, r : roll, pitch and yaw rate [rad/s], body axes

    Regular at every attitude. Rotations use the quaternion over its length, and its rate has a
    part that brings the length back to 1 at 1/s, so that errors of integration do not pile up.
    Rotor momenta are as in the Euler class. `phi`, `theta` and `psi` are there to be read.
    """

    states: Names = (
        *('x_e', 'y_e', 'z_e', 'u_b', 'v_b', 'w_b'),
        *('qw', 'qx', 'qy', 'qz', 'p', 'q', 'r'),
    )

    qw: Vectorizable = 1.0
    qx: Vectorizable = 0.0
    qy: Vectorizable = 0.0
    qz: Vectorizable = 0.0

    @classmethod
    def from_euler(
        cls,
        mass_props: MassProperties | None = None,
        *,
        phi: Vectorizable = 0.0,
        theta: Vectorizable = 0.0,
        psi: Vectorizable = 0.0,
        wind: Wind | None = None,
        **values: Vectorizable,
    ) -> Self:
        """Return a body at roll, pitch and yaw angle [rad]; the rest as in the constructor."""
        attitude = zip(
            ('qw', 'qx', 'qy', 'qz'), quaternion_from_euler(phi, theta, psi), strict=True
        )
        return cls(mass_props, wind=wind, **dict(attitude), **values)

    @property
    def phi(self) -> Vectorizable:
        """Roll angle [rad]."""
        return euler_from_rotation(self._rotation())[0]

    @property
    def theta(self) -> Vectorizable:
        """Pitch angle [rad]."""
        return euler_from_rotation(self._rotation())[1]

    @property
    def psi(self) -> Vectorizable:
        """Yaw angle [rad]."""
        return euler_from_rotation(self._rotation())[2]

    def _rotation(self) -> Rotation:
        def evaluate() -> Rotation:
            q = (self.qw, self.qx, self.qy, self.qz)
            length = np.hypot(*q)
            w, x, y, z = (component / length for component in q)
            return rotation_from_quaternion((w, x, y, z))

        found: Rotation = self._once('rotation', evaluate)
        return found

    def _attitude_derivatives(self) -> dict[str, Vectorizable]:
        w, x, y, z = self.qw, self.qx, self.qy, self.qz
        p, q, r = self.p, self.q, self.r
        back = NORM_FEEDBACK * (1 - (w * w + x * x + y * y + z * z))
        return {
            'qw': 0.5 * (-x * p - y * q - z * r) + back * w,
            'qx': 0.5 * (w * p + y * r - z * q) + back * x,
            'qy': 0.5 * (w * q + z * p - x * r) + back * y,
            'qz': 0.5 * (w * r + x * q - y * p) + back * z,
        }

    def _body_to_earth(self, v: Vector) -> Vector:
        return rotate(self._rotation(), v)

    def _earth_to_body(self, v: Vector) -> Vector:
        return rotate(transpose(self._rotation()), v)


class DynamicsRigidBody2DBody(RigidBody):
    """Rigid body in the vertical plane, velocity in body axes.

    State
    -----
    x_e, z_e : position [m], earth axes (forward, down)
    u_b, w_b : inertial velocity [m/s], body axes
    theta : pitch angle [rad], nose up positive; it counts full turns
    q : pitch rate [rad/s]

    The motion stays in the plane by assumption: what pushes or turns out of it is held by nothing
    and left out. So of the inertia Iyy alone enters, and rotor momenta hx_b, hy_b, hz_b, which
    are accepted, turn nothing.
    """

    states: Names = ('x_e', 'z_e', 'u_b', 'w_b', 'theta', 'q')
    loads: Names = ('Fx_b', 'Fz_b', 'My_b')
    also_accepted: Names = ('hx_b', 'hy_b', 'hz_b')
    inertia: Names = ('Iyy',)

    @property
    def rotational_kinetic_energy(self) -> Vectorizable:
        return 0.5 * self.mass_props.Iyy * self.q**2

    def state_derivatives(self) -> dict[str, Vectorizable]:
        """Return d(state)/dt by name, per second, of the accumulated loads.

        Raises
        ------
        InputError
            If Iyy is 0.

        References
        ----------
        .. [1] Drela, *Flight Vehicle Aerodynamics*, 2014, chapter 9.
        """
        if isinstance(self.mass_props.Iyy, float | int) and self.mass_props.Iyy == 0:
            raise InputError(f'{type(self).__name__} needs mass_props.Iyy, which is 0')
        u_e, _, w_e = self.velocity_earth
        return {
            'x_e': u_e,
            'z_e': w_e,
            'u_b': self._force[0] / self.mass_props.mass - self.q * self.w_b,
            'w_b': self._force[2] / self.mass_props.mass + self.q * self.u_b,
            'theta': self.q,
            'q': self._moment[1] / self.mass_props.Iyy,
        }

    def _body_to_earth(self, v: Vector) -> Vector:
        return turn_y(v, self._sines('theta'))

    def _earth_to_body(self, v: Vector) -> Vector:
        return turn_y(v, backward(self._sines('theta')))
