"""Point masses: attitude is a control, not a state."""

from .. import numpy as np
from ..frames import IDENTITY, Rotation, Vector, matmul, rotation_from_euler, transpose
from ..numpy import Vectorizable
from .base import Dynamics, aerodynamic_rotation
from .mass_properties import MassProperties


class DynamicsPointMass3DSpeedGammaTrack(Dynamics):
    """Point mass in three dimensions, velocity by speed, flight-path angle and track.

    State
    -----
    x_e, y_e, z_e : position [m], earth axes (north, east, down)
    speed : inertial speed [m/s]
    gamma : flight-path angle [rad], up positive
    track : direction over the ground [rad], 0 north, pi/2 east

    Indirect controls: alpha, beta [deg]; bank [rad], the roll of the lift vector about the
    velocity, right positive. Forces are kept in wind axes. Singular at speed = 0 and at
    |gamma| = pi/2: bound them away.
    """

    states = ('x_e', 'y_e', 'z_e', 'speed', 'gamma', 'track')
    indirect_controls = ('alpha', 'beta', 'bank')
    loads = ('Fx_w', 'Fy_w', 'Fz_w')
    force_axes = 'wind'

    speed: Vectorizable
    gamma: Vectorizable
    track: Vectorizable
    bank: Vectorizable

    def __init__(
        self,
        mass_props: MassProperties | None = None,
        x_e: Vectorizable = 0.0,
        y_e: Vectorizable = 0.0,
        z_e: Vectorizable = 0.0,
        speed: Vectorizable = 0.0,
        gamma: Vectorizable = 0.0,
        track: Vectorizable = 0.0,
        alpha: Vectorizable = 0.0,
        beta: Vectorizable = 0.0,
        bank: Vectorizable = 0.0,
    ) -> None:
        super().__init__(
            mass_props,
            {
                'x_e': x_e,
                'y_e': y_e,
                'z_e': z_e,
                'speed': speed,
                'gamma': gamma,
                'track': track,
                'alpha': alpha,
                'beta': beta,
                'bank': bank,
            },
        )

    @property
    def velocity_earth(self) -> Vector:
        """Inertial velocity u_e, v_e, w_e [m/s], earth axes."""
        horizontal = self.speed * np.cos(self.gamma)
        return (
            horizontal * np.cos(self.track),
            horizontal * np.sin(self.track),
            -self.speed * np.sin(self.gamma),
        )

    def state_derivatives(self) -> dict[str, Vectorizable]:
        """Return d(state)/dt by name, per second, of the accumulated loads.

        References
        ----------
        .. [1] Stevens, Lewis, Johnson, *Aircraft Control and Simulation*, 3rd edition, 2016,
           section 2.5 (wind-axes force equations).
        """
        fx, fy, fz = self._force
        # the lift vector's components beside and below the velocity, with the wings levelled
        side = np.cos(self.bank) * fy - np.sin(self.bank) * fz
        down = np.sin(self.bank) * fy + np.cos(self.bank) * fz
        momentum = self.mass_props.mass * self.speed
        u_e, v_e, w_e = self.velocity_earth
        return {
            'x_e': u_e,
            'y_e': v_e,
            'z_e': w_e,
            'speed': fx / self.mass_props.mass,
            'gamma': -down / momentum,
            'track': side / (momentum * np.cos(self.gamma)),
        }

    def _rotation_to_pivot(self, axes: str) -> Rotation:
        if axes == 'wind':
            return IDENTITY
        if axes == 'earth':
            return transpose(rotation_from_euler(self.bank, self.gamma, self.track))
        r_wb = transpose(aerodynamic_rotation('wind', self.alpha, self.beta))
        if axes == 'body':
            return r_wb
        return matmul(r_wb, aerodynamic_rotation(axes, self.alpha, self.beta))
