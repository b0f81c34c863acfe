"""Rigid bodies: attitude and rates are states, driven by moments."""

from .. import numpy as np
from ..frames import IDENTITY, Rotation, Vector, rotation_from_euler, transpose
from ..numpy import Vectorizable
from .base import ZERO, Dynamics, _sum, aerodynamic_rotation
from .mass_properties import MassProperties


class RigidBody(Dynamics):
    """What rigid bodies share: moments, and alpha and beta from the velocity."""

    force_axes = 'body'
    u_b: Vectorizable
    v_b: Vectorizable = 0.0
    w_b: Vectorizable
    phi: Vectorizable = 0.0
    theta: Vectorizable = 0.0
    psi: Vectorizable = 0.0

    def __init__(self, mass_props: MassProperties | None, values: dict[str, Vectorizable]) -> None:
        super().__init__(mass_props, values)
        self._moment: Vector = ZERO

    def _load(self, kind: str) -> Vector:
        return self._moment if kind == 'M' else self._force

    @property
    def alpha(self) -> Vectorizable:
        """Angle of attack [deg], of the inertial velocity."""
        return np.degrees(np.arctan2(self.w_b, self.u_b))

    @property
    def beta(self) -> Vectorizable:
        """Sideslip angle [deg], of the inertial velocity."""
        return np.degrees(np.arctan2(self.v_b, np.hypot(self.u_b, self.w_b)))

    @property
    def velocity_earth(self) -> Vector:
        """Inertial velocity u_e, v_e, w_e [m/s], earth axes."""
        return self.convert_axes(self.u_b, self.v_b, self.w_b, 'body', 'earth')

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
        self._moment = _sum(self._moment, self.convert_axes(Mx, My, Mz, axes, 'body'))

    def _rotation_to_pivot(self, axes: str) -> Rotation:
        if axes == 'body':
            return IDENTITY
        if axes == 'earth':
            return transpose(rotation_from_euler(self.phi, self.theta, self.psi))
        return aerodynamic_rotation(axes, self.alpha, self.beta)


class DynamicsRigidBody2DBody(RigidBody):
    """Rigid body in the vertical plane, velocity in body axes.

    State
    -----
    x_e, z_e : position [m], earth axes (forward, down)
    u_b, w_b : velocity [m/s], body axes
    theta : pitch angle [rad], nose up positive; it counts full turns
    q : pitch rate [rad/s]

    Forces and moments are kept in body axes. The motion stays in the plane by assumption, so
    Iyy alone of the inertia enters.
    """

    states = ('x_e', 'z_e', 'u_b', 'w_b', 'theta', 'q')
    loads = ('Fx_b', 'Fz_b', 'My_b')
    inertia = ('Iyy',)

    q: Vectorizable

    def __init__(
        self,
        mass_props: MassProperties | None = None,
        x_e: Vectorizable = 0.0,
        z_e: Vectorizable = 0.0,
        u_b: Vectorizable = 0.0,
        w_b: Vectorizable = 0.0,
        theta: Vectorizable = 0.0,
        q: Vectorizable = 0.0,
    ) -> None:
        super().__init__(
            mass_props,
            {'x_e': x_e, 'z_e': z_e, 'u_b': u_b, 'w_b': w_b, 'theta': theta, 'q': q},
        )

    def state_derivatives(self) -> dict[str, Vectorizable]:
        """Return d(state)/dt by name, per second, of the accumulated loads.

        References
        ----------
        .. [1] Drela, *Flight Vehicle Aerodynamics*, 2014, section 9.7.
        """
        u_e, _, w_e = self.velocity_earth
        return {
            'x_e': u_e,
            'z_e': w_e,
            'u_b': self._force[0] / self.mass_props.mass - self.q * self.w_b,
            'w_b': self._force[2] / self.mass_props.mass + self.q * self.u_b,
            'theta': self.q,
            'q': self._moment[1] / self.mass_props.Iyy,
        }
