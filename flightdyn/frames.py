"""Axis systems: the only place where a sign flips or an axis swaps.

Inside flightdyn the earth is north-east-down (NED) and the body forward-right-down (FRD). ROS
messages are east-north-up (ENU) and forward-left-up (FLU), REP 103. A rotation `R_ab` takes
components in b to components in a: `v_a = R_ab v_b`. Rotations here are 3 x 3 nested tuples of
floats, arrays or CasADi expressions, so that one source serves all of them.
"""

from typing import Any

import numpy as _np

from . import numpy as np
from .numpy import Vectorizable

Vector = tuple[Vectorizable, Vectorizable, Vectorizable]
Rotation = tuple[Vector, Vector, Vector]
Turn = tuple[Vectorizable, Vectorizable]  # sine and cosine of an angle
Quaternion = tuple[Vectorizable, Vectorizable, Vectorizable, Vectorizable]

AXES = ('earth', 'body', 'wind', 'stability', 'geometry')

IDENTITY: Rotation = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

R_BODY_GEOMETRY: Rotation = ((-1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0))
"""Geometry axes point aft, right and up: x and z of the body turned round."""


NO_TURN: Turn = (0.0, 1.0)


def matmul(a: Rotation, b: Rotation) -> Rotation:
    """Return the product a b of two rotations."""
    first, second, third = (rotate(a, column) for column in transpose(b))
    return transpose((first, second, third))


def transpose(a: Rotation) -> Rotation:
    """Return the inverse of a rotation."""
    first, second, third = zip(*a, strict=True)
    return first, second, third


def rotate(a: Rotation, v: Vector) -> Vector:
    """Return the components a v."""
    x, y, z = (sum(r * c for r, c in zip(row, v, strict=True)) for row in a)
    return x, y, z


def cross(a: Vector, b: Vector) -> Vector:
    """Return the vector product a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def turn(angle: Vectorizable) -> Turn:
    """Return sine and cosine of an angle [rad].

    Of numbers both come from the tangent t of half the angle, 2 t/(1 + t^2) and 2/(1 + t^2) - 1,
    within 3e-16 of the truth and several times faster: NumPy's sin and cos are the dearest part
    of a vectorized equation of motion.
    """
    if np.is_symbolic(angle):
        return np.sin(angle), np.cos(angle)
    half = _np.tan(0.5 * angle)
    twice = half * half
    if not isinstance(twice, _np.ndarray):
        twice = 2.0 / (twice + 1.0)
        return half * twice, twice - 1.0
    # the same in place: making new arrays would take as long as the arithmetic
    twice += 1.0
    _np.divide(2.0, twice, out=twice)
    half *= twice
    twice -= 1.0
    return half, twice


def add(a: Vector, b: Vector) -> Vector:
    """Return a + b; a component that is a plain 0 costs nothing."""
    x, y, z = (p if _absent(q) else q if _absent(p) else p + q for p, q in zip(a, b, strict=True))
    return x, y, z


def turn_x(v: Vector, turn: Turn) -> Vector:
    """Return R_x v for the sine and cosine of an angle about x."""
    y, z = _turned(v[1], v[2], turn)
    return v[0], y, z


def turn_y(v: Vector, turn: Turn) -> Vector:
    """Return R_y v for the sine and cosine of an angle about y."""
    z, x = _turned(v[2], v[0], turn)
    return x, v[1], z


def turn_z(v: Vector, turn: Turn) -> Vector:
    """Return R_z v for the sine and cosine of an angle about z."""
    x, y = _turned(v[0], v[1], turn)
    return x, y, v[2]


def _turned(a: Vectorizable, b: Vectorizable, turn: Turn) -> tuple[Vectorizable, Vectorizable]:
    if turn is NO_TURN:
        return a, b
    s, c = turn
    if _absent(s):
        return c * a, c * b
    if _absent(b):
        return (a, b) if _absent(a) else (c * a, s * a)
    return (-s * b, c * b) if _absent(a) else (c * a - s * b, s * a + c * b)


def _absent(component: Vectorizable) -> bool:
    """Return whether a component is a plain 0: most loads have some, and arrays are long."""
    return type(component) in (int, float) and component == 0


def backward(turn: Turn) -> Turn:
    """Return the turn by the opposite angle."""
    return turn if turn is NO_TURN else (-turn[0], turn[1])


def body_from_geometry(v: Vector) -> Vector:
    """Return forward, right, down of aft, right, up; it is its own inverse."""
    return -v[0], v[1], -v[2]


Q_BODY_GLTF = (0.5, -0.5, 0.5, -0.5)
"""Attitude (w, x, y, z) of a glTF model (z forward, x left, y up) in body axes."""


def direction(x: Vectorizable, y: Vectorizable, z: Vectorizable) -> tuple[Turn, Turn]:
    """Return the turns of a vector: first up out of the x-y plane, then from x towards y.

    For a velocity in earth axes these are (sin, cos) of the flight-path angle and of the track.
    A vector without length points along x, one along z lies over x: values and derivatives stay
    finite there.
    """
    if _absent(x) and _absent(y):
        return (-np.sign(z), z == 0), NO_TURN
    flat2 = x * x + y * y
    over = flat2 == 0
    flat = np.sqrt(flat2 + over)
    length2 = flat2 + z * z
    nowhere = length2 == 0
    length = np.sqrt(length2 + nowhere)
    track = (0.0 if _absent(y) else y / flat), (x + over) / flat
    return (-z / length, (flat - over + nowhere) / length), track


def rotation_from_euler(phi: Vectorizable, theta: Vectorizable, psi: Vectorizable) -> Rotation:
    """Return `R_eb` for roll, pitch, yaw [rad], applied in the order yaw, pitch, roll (z-y'-x'').

    References
    ----------
    .. [1] Drela, *Flight Vehicle Aerodynamics*, 2014, section 9.2.
    """
    sphi, cphi = np.sin(phi), np.cos(phi)
    sth, cth = np.sin(theta), np.cos(theta)
    spsi, cpsi = np.sin(psi), np.cos(psi)
    return (
        (cth * cpsi, sphi * sth * cpsi - cphi * spsi, cphi * sth * cpsi + sphi * spsi),
        (cth * spsi, sphi * sth * spsi + cphi * cpsi, cphi * sth * spsi - sphi * cpsi),
        (-sth, sphi * cth, cphi * cth),
    )


def rotation_body_stability(alpha: Vectorizable) -> Rotation:
    """Return `R_bs` for the angle of attack [rad]; stability axes are the body's pitched down."""
    s, c = np.sin(alpha), np.cos(alpha)
    return ((c, 0.0, -s), (0.0, 1.0, 0.0), (s, 0.0, c))


def rotation_stability_wind(beta: Vectorizable) -> Rotation:
    """Return `R_sw` for the sideslip angle [rad], positive with the wind in the right ear."""
    s, c = np.sin(beta), np.cos(beta)
    return ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))


def rotation_from_quaternion(q_ab: Quaternion) -> Rotation:
    """Return `R_ab` of a unit quaternion (w, x, y, z)."""
    w, x, y, z = q_ab
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def quaternion_from_euler(phi: Vectorizable, theta: Vectorizable, psi: Vectorizable) -> Quaternion:
    """Return `q_eb` (w, x, y, z) for roll, pitch, yaw [rad]."""
    sphi, cphi = np.sin(phi / 2), np.cos(phi / 2)
    sth, cth = np.sin(theta / 2), np.cos(theta / 2)
    spsi, cpsi = np.sin(psi / 2), np.cos(psi / 2)
    return (
        cphi * cth * cpsi + sphi * sth * spsi,
        sphi * cth * cpsi - cphi * sth * spsi,
        cphi * sth * cpsi + sphi * cth * spsi,
        cphi * cth * spsi - sphi * sth * cpsi,
    )


def euler_from_rotation(r_eb: Rotation) -> Vector:
    """Return roll, pitch, yaw [rad] of `R_eb`; at |theta| = pi/2 only phi -+ psi has meaning."""
    phi = np.arctan2(r_eb[2][1], r_eb[2][2])
    theta = np.arctan2(-r_eb[2][0], np.hypot(r_eb[2][1], r_eb[2][2]))
    psi = np.arctan2(r_eb[1][0], r_eb[0][0])
    return phi, theta, psi


def quaternion_multiply(a: Quaternion, b: Quaternion) -> Quaternion:
    """Return the Hamilton product a b of quaternions (w, x, y, z)."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def enu_from_ned(v: Vector) -> Vector:
    """Return east, north, up of north, east, down; it is its own inverse."""
    return v[1], v[0], -v[2]


ned_from_enu = enu_from_ned


def flu_from_frd(v: Vector) -> Vector:
    """Return forward, left, up of forward, right, down; it is its own inverse."""
    return v[0], -v[1], -v[2]


frd_from_flu = flu_from_frd


_SQRT_HALF = float(_np.sqrt(0.5))
_Q_ENU_NED: Quaternion = (0.0, _SQRT_HALF, _SQRT_HALF, 0.0)  # half a turn about north + east
_Q_FRD_FLU: Quaternion = (0.0, 1.0, 0.0, 0.0)  # half a turn about forward


def ros_attitude_from_ned(q_eb: Quaternion) -> Quaternion:
    """Return the attitude FLU to ENU (w, x, y, z) of an attitude FRD to NED."""
    return quaternion_multiply(quaternion_multiply(_Q_ENU_NED, q_eb), _Q_FRD_FLU)


def ned_attitude_from_ros(q: Quaternion) -> Quaternion:
    """Return the attitude FRD to NED (w, x, y, z) of an attitude FLU to ENU."""
    # both outer turns are half turns, their own inverses up to sign
    return ros_attitude_from_ned(q)


def stack(v: Vector) -> Any:
    """Return a vector's components as one (..., 3) NumPy array."""
    return _np.stack(_np.broadcast_arrays(*v), axis=-1)
