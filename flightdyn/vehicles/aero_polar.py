"""Lift and drag by a few parameters: straight lift curve, parabolic drag, smooth stall."""

from dataclasses import dataclass
from math import pi

from .. import numpy as np
from ..config import bounds
from ..dynamics import Dynamics
from ..errors import InputError
from ..numpy import Vectorizable
from .aerodynamics import SHARED_KEYS, Coefficients, Values, read_shared
from .fields import Context, Fields, in_degrees, positive

KEYS = (*SHARED_KEYS, 'CL0', 'CL_alpha', 'CD0', 'k', 'efficiency', 'CL_min_drag', 'stall')
STALL_KEYS = ('alpha', 'width', 'CD90')


@dataclass(frozen=True, kw_only=True)
class Stall:
    """How the flow separates.

    Parameters
    ----------
    alpha : lower, upper [deg]
        Where lift and drag are the mean of those of attached and of separated flow.
    width : float [deg]
        Half-way from there to where the change is all but over: a tanh.
    CD90 : float
        Drag coefficient broadside on.
    """

    alpha: tuple[float, float]
    width: float
    CD90: float

    def attached(self, alpha: Vectorizable) -> Vectorizable:
        """Return how much of the flow is attached at an angle of attack [deg], 0 to 1."""
        lower, upper = self.alpha
        rising = np.tanh((alpha - lower) / self.width)
        return 0.5 * (rising - np.tanh((alpha - upper) / self.width))


@dataclass(frozen=True, kw_only=True)
class Polar(Coefficients):
    """Lift linear in alpha, drag parabolic in lift, both giving way to a stalled plate's.

    Parameters
    ----------
    CL0 : float
        Lift coefficient at alpha = 0.
    CL_alpha : float [1/rad]
    CD0 : float
        Least drag coefficient of attached flow, at the lift coefficient `CL_min_drag`.
    k : float
        Drag coefficient over (CL - CL_min_drag)^2.
    stall : Stall or None
        None for flow that stays attached however far it turns.

    Notes
    -----
    Separated flow presses on the vehicle as on a flat plate, CD90 sin(alpha) across the chord:
    lift CD90 sin(alpha) cos(alpha), drag CD0 + CD90 sin(alpha)^2. All is smooth at any alpha.

    References
    ----------
    .. [1] Beard, McLain, *Small Unmanned Aircraft*, 2012, section 4.2 (a linear lift curve blended
       into that of a flat plate).
    """

    CL0: float
    CL_alpha: float
    CD0: float
    k: float
    CL_min_drag: float = 0.0
    stall: Stall | None = None

    def coefficients(self, dyn: Dynamics, controls: Values) -> dict[str, Vectorizable]:
        """Return CL and CD."""
        alpha = dyn.op_point.alpha
        lift = self.CL0 + self.CL_alpha * np.radians(alpha)
        drag = self.CD0 + self.k * (lift - self.CL_min_drag) ** 2
        if self.stall is None:
            return {'CL': lift, 'CD': drag}
        attached = self.stall.attached(alpha)
        sine, cosine = np.sind(alpha), np.cosd(alpha)
        across = self.stall.CD90 * sine
        return {
            'CL': attached * lift + (1.0 - attached) * across * cosine,
            'CD': attached * drag + (1.0 - attached) * (self.CD0 + across * sine),
        }


def read_polar(fields: Fields, context: Context) -> Polar:
    """Return the polar that a vehicle's file describes.

    Raises
    ------
    InputError
        If a key is missing or wrong.
    """
    shared = read_shared(fields, context)
    if ('k' in fields) == ('efficiency' in fields):
        raise InputError(f'{fields.where}: give either k or efficiency (of the induced drag)')
    if 'k' in fields:
        k = fields.number('k')
    else:
        k = shared['area'] / (pi * fields.positive('efficiency') * shared['span'] ** 2)
    return Polar(
        **shared,
        CL0=fields.number('CL0', 0.0),
        CL_alpha=fields.number('CL_alpha'),
        CD0=fields.number('CD0'),
        k=k,
        CL_min_drag=fields.number('CL_min_drag', 0.0),
        stall=_stall(fields) if 'stall' in fields else None,
    )


def _stall(fields: Fields) -> Stall:
    part = Fields(fields.need('stall'), STALL_KEYS, fields.at('stall'))
    alpha = part.need('alpha')
    if not isinstance(alpha, list) or len(alpha) != 2:
        raise InputError(f'{part.at("alpha")}: expected [lower, upper], got {alpha!r}')
    width = part.values.get('width', 2.0)
    return Stall(
        alpha=bounds([in_degrees(a, part.at('alpha')) for a in alpha], part.at('alpha')),
        width=positive(in_degrees(width, part.at('width')), part.at('width')),
        CD90=part.positive('CD90', 1.8),
    )
