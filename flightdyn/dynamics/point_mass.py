"""Point masses: attitude is a control, not a state."""

from collections.abc import Mapping
from typing import ClassVar

from .. import numpy as np
from ..frames import (
    NO_TURN,
    Turn,
    Vector,
    backward,
    body_from_geometry,
    direction,
    turn,
    turn_x,
    turn_y,
    turn_z,
)
from ..numpy import Vectorizable
from .base import Dynamics
from .named_values import Names

_AFTER = {'geometry': 'body', 'body': 'stability', 'stability': 'wind', 'wind': 'earth'}


class PointMass(Dynamics):
    """What point masses share: axes from the direction of flight, alpha, beta and bank.

    Wind axes point along the velocity through the air, rolled about it by the bank; of a vehicle
    without airspeed they are level and point north. Stability and body axes follow by beta and
    alpha.
    """

    bank: Vectorizable = 0.0

    def _next_axes(self, axes: str) -> str:
        return _AFTER[axes]

    def _to_next(self, axes: str, v: Vector) -> Vector:
        if axes == 'geometry':
            return body_from_geometry(v)
        if axes == 'body':
            return turn_y(v, self._degrees('alpha')) if self._has('alpha') else v
        if axes == 'stability':
            return turn_z(v, backward(self._degrees('beta'))) if self._has('beta') else v
        gamma, track = self._air_direction()
        return turn_z(turn_y(self._rolled(v), gamma), track)

    def _from_next(self, axes: str, v: Vector) -> Vector:
        if axes == 'geometry':
            return body_from_geometry(v)
        if axes == 'body':
            return turn_y(v, backward(self._degrees('alpha'))) if self._has('alpha') else v
        if axes == 'stability':
            return turn_z(v, self._degrees('beta')) if self._has('beta') else v
        gamma, track = self._air_direction()
        return self._unrolled(turn_y(turn_z(v, backward(track)), backward(gamma)))

    def _has(self, control: str) -> bool:
        return control in self.indirect_controls

    def _rolled(self, v: Vector) -> Vector:
        return turn_x(v, self._sines('bank')) if self._has('bank') else v

    def _unrolled(self, v: Vector) -> Vector:
        return turn_x(v, backward(self._sines('bank'))) if self._has('bank') else v

    def _degrees(self, angle: str) -> Turn:
        found: Turn = self._once(angle, lambda: turn(np.radians(getattr(self, angle))))
        return found

    def _air_direction(self) -> tuple[Turn, Turn]:
        """Return (sin, cos) of the flight-path angle and track of the velocity through the air."""
        found: tuple[Turn, Turn] = self._once(
            'direction', lambda: direction(*self.air_velocity_earth)
        )
        return found


class DynamicsPointMass3DCartesian(PointMass):
    """Point mass in three dimensions, velocity by earth-axes components.

    State
    -----
    x_e, y_e, z_e : position [m], earth axes (north, east, down)
    u_e, v_e, w_e : inertial velocity [m/s], earth axes

    Indirect controls: alpha, beta [deg]; bank [rad], the roll of the lift vector about the
    velocity, right positive. Forces are kept in earth axes, the default of `add_force`.
    """

    states: Names = ('x_e', 'y_e', 'z_e', 'u_e', 'v_e', 'w_e')
    indirect_controls: Names = ('alpha', 'beta', 'bank')
    loads: Names = ('Fx_e', 'Fy_e', 'Fz_e')
    force_axes = 'earth'
    kept_axes = 'earth'

    u_e: Vectorizable = 0.0
    v_e: Vectorizable = 0.0
    w_e: Vectorizable = 0.0

    @property
    def velocity_earth(self) -> Vector:
        return self.u_e, self.v_e, self.w_e

    @property
    def speed(self) -> Vectorizable:
        return self._once('speed', lambda: np.hypot(self.u_e, self.v_e, self.w_e))

    @property
    def gamma(self) -> Vectorizable:
        """Flight-path angle over the ground [rad], up positive; 0 at rest."""
        return np.arctan2(-self.w_e, np.hypot(self.u_e, self.v_e))

    @property
    def track(self) -> Vectorizable:
        """Direction over the ground [rad], 0 north, pi/2 east; 0 without horizontal velocity."""
        return np.arctan2(self.v_e, self.u_e)

    def state_derivatives(self) -> dict[str, Vectorizable]:
        """Return d(state)/dt by name, per second: Newton's second law in inertial axes."""
        every = dict(zip(('x_e', 'y_e', 'z_e'), self.velocity_earth, strict=True))
        for name, force in zip(('u_e', 'v_e', 'w_e'), self._force, strict=True):
            every[name] = force / self.mass_props.mass
        return {name: every[name] for name in self.states}


class DynamicsPointMass2DCartesian(DynamicsPointMass3DCartesian):
    """Point mass in the vertical plane, velocity by earth-axes components.

    State
    -----
    x_e, z_e : position [m], earth axes (forward, down)
    u_e, w_e : inertial velocity [m/s], earth axes

    Indirect control: alpha [deg]. What pushes out of the plane is held by nothing and left out.
    """

    states: Names = ('x_e', 'z_e', 'u_e', 'w_e')
    indirect_controls: Names = ('alpha',)
    loads: Names = ('Fx_e', 'Fz_e')


class DynamicsPointMass1DHorizontal(DynamicsPointMass3DCartesian):
    """Point mass on a level line: a vehicle on rails.

    State
    -----
    x_e : position [m]
    u_e : inertial velocity [m/s]
    """

    states: Names = ('x_e', 'u_e')
    indirect_controls: Names = ()
    loads: Names = ('Fx_e',)


class DynamicsPointMass1DVertical(DynamicsPointMass3DCartesian):
    """Point mass on a vertical line.

    State
    -----
    z_e : position [m], down positive
    w_e : inertial velocity [m/s], down positive
    """

    states: Names = ('z_e', 'w_e')
    indirect_controls: Names = ()
    loads: Names = ('Fz_e',)


class DynamicsPointMass3DSpeedGammaTrack(PointMass):
    """Point mass in three dimensions, velocity by speed, flight-path angle and track.

    State
    -----
    x_e, y_e, z_e : position [m], earth axes (north, east, down)
    speed : inertial speed [m/s]
    gamma : flight-path angle over the ground [rad], up positive
    track : direction over the ground [rad], 0 north, pi/2 east

    Indirect controls: alpha, beta [deg]; bank [rad], the roll of the lift vector about the
    velocity, right positive. Forces are given in wind axes by default, and kept in path axes,
    which point along the inertial velocity with level wings; without wind the two differ by the
    bank alone.

    Gamma and track lose their meaning at speed = 0, where their rates are 0 here, and track at
    |gamma| = pi/2: bound both away, or take the Cartesian class.
    """

    states: Names = ('x_e', 'y_e', 'z_e', 'speed', 'gamma', 'track')
    indirect_controls: Names = ('alpha', 'beta', 'bank')
    loads: Names = ('Fx_w', 'Fy_w', 'Fz_w')
    force_axes = 'wind'
    kept_axes = 'path'
    singular_at: ClassVar[Mapping[str, float]] = {'speed': 0.0}

    speed: Vectorizable = 0.0
    gamma: Vectorizable = 0.0
    track: Vectorizable = 0.0

    @property
    def velocity_earth(self) -> Vector:
        (sin_gamma, cos_gamma), (sin_track, cos_track) = self._path()
        horizontal = self.speed * cos_gamma
        return horizontal * cos_track, horizontal * sin_track, -self.speed * sin_gamma

    def _path(self) -> tuple[Turn, Turn]:
        track = self._sines('track') if 'track' in self.states else NO_TURN
        return self._sines('gamma'), track

    def _air_direction(self) -> tuple[Turn, Turn]:
        return self._path() if self.wind is None else super()._air_direction()

    def _next_axes(self, axes: str) -> str:
        if axes == 'path':
            return 'earth'
        # without wind the turns between wind and earth axes need not be gone through
        return 'path' if axes == 'wind' and self.wind is None else super()._next_axes(axes)

    def _to_next(self, axes: str, v: Vector) -> Vector:
        if axes == 'wind' and self.wind is None:
            return self._rolled(v)
        if axes == 'path':
            gamma, track = self._path()
            v = turn_y(v, gamma)
            return turn_z(v, track) if 'track' in self.states else v
        return super()._to_next(axes, v)

    def _from_next(self, axes: str, v: Vector) -> Vector:
        if axes == 'wind' and self.wind is None:
            return self._unrolled(v)
        if axes == 'path':
            gamma, track = self._path()
            v = turn_z(v, backward(track)) if 'track' in self.states else v
            return turn_y(v, backward(gamma))
        return super()._from_next(axes, v)

    def state_derivatives(self) -> dict[str, Vectorizable]:
        """Return d(state)/dt by name, per second, of the accumulated loads.

        References
        ----------
        .. [1] Stevens, Lewis, Johnson, *Aircraft Control and Simulation*, 3rd edition, 2016,
           section 2.5 (wind-axes force equations).
        """
        forward, right, down = self._force
        mass, speed = self.mass_props.mass, self.speed
        squared = speed * speed
        # 1/(m V), but 0 at rest, where gamma and track mean nothing and must not become infinite
        turning = speed / (mass * (squared + (squared == 0)))
        u_e, v_e, w_e = self.velocity_earth
        every = {
            'x_e': u_e,
            'y_e': v_e,
            'z_e': w_e,
            'speed': forward / mass,
            'gamma': -down * turning,
        }
        if 'track' in self.states:
            every['track'] = right * turning / self._sines('gamma')[1]
        return {name: every[name] for name in self.states}


class DynamicsPointMass2DSpeedGamma(DynamicsPointMass3DSpeedGammaTrack):
    """Point mass in the vertical plane, velocity by speed and flight-path angle.

    State
    -----
    x_e, z_e : position [m], earth axes (forward, down)
    speed : inertial speed [m/s]
    gamma : flight-path angle over the ground [rad], up positive

    Indirect control: alpha [deg]. Gamma loses its meaning at speed = 0, where its rate is 0 here.
    What pushes out of the plane is held by nothing and left out.
    """

    states: Names = ('x_e', 'z_e', 'speed', 'gamma')
    indirect_controls: Names = ('alpha',)
    loads: Names = ('Fx_w', 'Fz_w')
