"""Position, attitude and velocity of whatever a trajectory holds, for drawing."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .. import frames
from ..environment.geodesy import GeodeticPoint, geodetic_from_ned, ned_from_geodetic
from ..trajectory import Trajectory

Array = NDArray[np.float64]

STANDSTILL = 1e-3
"""Below this share of the greatest speed a velocity points nowhere."""


@dataclass(frozen=True)
class Motion:
    """Where a vehicle was, how it was turned and how it moved.

    Parameters
    ----------
    time : array (n,)
        Seconds, as in the trajectory.
    position : array (n, 3)
        x_e, y_e, z_e [m].
    attitude : array (n, 4)
        q_eb (w, x, y, z), body FRD to local NED.
    heading : array (n,)
        Where the vehicle faces over the ground [rad], 0 = north.
    velocity : array (n, 3)
        u_e, v_e, w_e [m/s].
    speed : array (n,)
        Inertial speed [m/s].
    altitude : array (n,)
        Height in the trajectory's own datum [m]: its output `altitude`, or -z_e.
    segments : list of slice
        The unbroken stretches.
    sigma : array (n, 3) or None
        1-sigma of the position, north, east, down [m], where it is known.
    """

    time: Array
    position: Array
    attitude: Array
    heading: Array
    velocity: Array
    speed: Array
    altitude: Array
    segments: list[slice]
    sigma: Array | None = None

    @cached_property
    def arc_length(self) -> Array:
        """Distance flown up to each sample [m]; gaps count as nothing."""
        total = np.zeros(len(self.time))
        for part in self.segments:
            step = np.linalg.norm(np.diff(self.position[part], axis=0), axis=1)
            total[part.start + 1 : part.stop] = step
        return np.cumsum(total)

    @cached_property
    def bounds(self) -> tuple[Array, Array]:
        """Least and greatest x_e, y_e, z_e [m]."""
        return self.position.min(axis=0), self.position.max(axis=0)

    @cached_property
    def size(self) -> float:
        """Diagonal of the box around the path [m]."""
        low, high = self.bounds
        return float(np.linalg.norm(high - low))

    @cached_property
    def velocity_body(self) -> Array:
        """Velocity in body axes [m/s] (n, 3)."""
        return self.in_body(self.velocity)

    @cached_property
    def hovers(self) -> bool:
        """Whether it stays in the air, 3 m above its lowest point, all but standing."""
        aloft = self.altitude > self.altitude.min() + 3.0
        still = aloft & (self.speed < 1.5)
        return bool(still.sum() > 0.1 * max(int(aloft.sum()), 1))

    def in_body(self, vectors: Array) -> Array:
        """Return vectors (n, 3) of earth axes in body axes."""
        x, y, z = vectors.T
        r_be = frames.transpose(_rotation(self.attitude))
        return np.asarray(frames.stack(frames.rotate(r_be, (x, y, z))))

    def in_earth(self, vectors: Array) -> Array:
        """Return vectors (n, 3) of body axes in earth axes."""
        x, y, z = vectors.T
        return np.asarray(frames.stack(frames.rotate(_rotation(self.attitude), (x, y, z))))


def motion_of(trajectory: Trajectory, *, origin: GeodeticPoint | None = None) -> Motion:
    """Return the motion in a trajectory, from whichever columns its model has.

    Parameters
    ----------
    trajectory : Trajectory
        Missing position components are 0. The attitude is phi, theta, psi (missing ones 0) where
        there is `theta`; a point mass points along track and gamma, rolled by `bank` about its
        velocity, then pitched by `alpha` and yawed by `beta` [deg] if it has them.
    origin : GeodeticPoint or None
        Express positions in the local frame at this point, if the trajectory is tied to another.

    Returns
    -------
    Motion

    Notes
    -----
    A point mass without angles takes them from its velocity; while it stands still they keep the
    last value.
    """
    n = len(trajectory)
    zero, columns = np.zeros(n), trajectory.columns

    def get(name: str) -> Array:
        return columns.get(name, zero)

    segments = list(trajectory.segments())
    position = _position(trajectory, origin)
    if 'theta' in trajectory:
        euler = get('phi'), get('theta'), get('psi')
        attitude = _stack(frames.quaternion_from_euler(*euler))
        velocity = _rigid_velocity(trajectory, attitude, position, segments)
        heading = get('psi')
    else:
        velocity, gamma, heading = _point_velocity(trajectory, position, segments)
        along = frames.quaternion_from_euler(get('bank'), gamma, heading)
        alpha, beta = np.radians(get('alpha')), np.radians(get('beta'))
        body = frames.quaternion_from_euler(zero, alpha, -beta)
        attitude = _stack(frames.quaternion_multiply(along, body))
    speed = trajectory['speed'] if 'speed' in trajectory else np.linalg.norm(velocity, axis=1)
    altitude = trajectory['altitude'] if 'altitude' in trajectory else -position[:, 2]
    stds = [columns.get(f'{name}_std') for name in ('x_e', 'y_e', 'z_e')]
    known = [std for std in stds if std is not None]
    sigma = np.column_stack([zero if std is None else std for std in stds]) if known else None
    return Motion(
        trajectory.time, position, attitude, heading, velocity, speed, altitude, segments, sigma
    )


def level_attitude(heading: Array) -> Array:
    """Return the attitude (n, 4) of a level frame forward, left, up at headings [rad]."""
    turn = frames.quaternion_from_euler(0.0, 0.0, heading)
    # The viewer wants up to be up: half a turn about forward.
    return _stack(frames.quaternion_multiply(turn, (0.0, 1.0, 0.0, 0.0)))


def thinned(trajectory: Trajectory, most: int) -> Trajectory:
    """Return about `most` of a trajectory's samples, or all of them if there are no more.

    Every k-th sample stays, and so do the ends of each segment and the extremes of each column:
    no peak is lost, and no gap moves.
    """
    n = len(trajectory)
    if n <= most:
        return trajectory
    ends = [i for part in trajectory.segments() for i in (part.start, part.stop - 1)]
    peaks = [i for c in trajectory.columns.values() for i in (int(c.argmin()), int(c.argmax()))]
    index = np.unique(np.concatenate([np.arange(0, n, -(-n // most)), ends, peaks])).astype(int)
    return trajectory.take(index)


def lat_lon_of(trajectory: Trajectory) -> Array | None:
    """Return latitude and longitude [deg] (n, 2); None without a place on earth."""
    if 'lat' in trajectory and 'lon' in trajectory:
        return np.column_stack([trajectory['lat'], trajectory['lon']])
    if trajectory.origin is None:
        return None
    x_e, y_e, z_e = _position(trajectory, None).T
    lat, lon, _ = geodetic_from_ned(x_e, y_e, z_e, trajectory.origin)
    return np.column_stack([lat, lon])


def pose_at(motion: Motion, t: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return positions (m, 3) and attitudes (m, 4) at times [s], and where they are known.

    Positions are cubic Hermite between samples, with the velocity at both: a straight line would
    show a distance to a curved plan that is not there. Attitudes go the short way, at a rate that
    is nearly even. Nothing is known before, after and between the segments.
    """
    position, known = np.zeros((len(t), 3)), np.zeros(len(t), bool)
    attitude = np.tile([1.0, 0.0, 0.0, 0.0], (len(t), 1))
    for part in motion.segments:
        time = motion.time[part]
        inside = (t >= time[0]) & (t <= time[-1])
        known |= inside
        before = np.clip(np.searchsorted(time, t[inside], side='right') - 1, 0, len(time) - 1)
        after = np.minimum(before + 1, len(time) - 1)
        step = (time[after] - time[before])[:, None]
        elapsed = (t[inside] - time[before])[:, None]
        s = np.divide(elapsed, step, out=np.zeros_like(step), where=step > 0)
        x, v, q = motion.position[part], motion.velocity[part], motion.attitude[part]
        position[inside] = (
            (1 + 2 * s) * (1 - s) ** 2 * x[before]
            + s**2 * (3 - 2 * s) * x[after]
            + s * (1 - s) * step * ((1 - s) * v[before] - s * v[after])
        )
        turned = np.where((q[before] * q[after]).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
        mixed = (1 - s) * q[before] + s * turned * q[after]
        attitude[inside] = mixed / np.linalg.norm(mixed, axis=1, keepdims=True)
    return position, attitude, known


def _position(trajectory: Trajectory, origin: GeodeticPoint | None) -> Array:
    zero, columns = np.zeros(len(trajectory)), trajectory.columns
    x_e, y_e, z_e = (columns.get(name, zero) for name in ('x_e', 'y_e', 'z_e'))
    if 'z_e' not in trajectory and 'altitude' in trajectory:
        z_e = -trajectory['altitude']
    if origin is not None and trajectory.origin not in (None, origin):
        assert trajectory.origin is not None
        x_e, y_e, z_e = ned_from_geodetic(
            *geodetic_from_ned(x_e, y_e, z_e, trajectory.origin), origin
        )
    return np.column_stack([x_e, y_e, z_e])


def _rigid_velocity(
    trajectory: Trajectory, attitude: Array, position: Array, segments: list[slice]
) -> Array:
    body = [name for name in ('u_b', 'v_b', 'w_b') if name in trajectory]
    if not body:
        return _earth_velocity(trajectory, position, segments)
    zero, columns = np.zeros(len(trajectory)), trajectory.columns
    u_b, v_b, w_b = (columns.get(name, zero) for name in ('u_b', 'v_b', 'w_b'))
    return np.asarray(frames.stack(frames.rotate(_rotation(attitude), (u_b, v_b, w_b))))


def _point_velocity(
    trajectory: Trajectory, position: Array, segments: list[slice]
) -> tuple[Array, Array, Array]:
    """Return the velocity (n, 3) and its gamma and track [rad]."""
    zero, columns = np.zeros(len(trajectory)), trajectory.columns
    if 'speed' in trajectory and 'gamma' in trajectory:
        gamma, track = trajectory['gamma'], columns.get('track', zero)
        if not any(name in trajectory for name in ('u_e', 'v_e', 'w_e')):
            along = (trajectory['speed'], zero, zero)
            r_ew = frames.rotation_from_euler(zero, gamma, track)
            return np.asarray(frames.stack(frames.rotate(r_ew, along))), gamma, track
        return _earth_velocity(trajectory, position, segments), gamma, track
    velocity = _earth_velocity(trajectory, position, segments)
    u_e, v_e, w_e = velocity.T
    level = np.hypot(u_e, v_e)
    least = STANDSTILL * max(float(np.linalg.norm(velocity, axis=1).max()), 1e-9)
    gamma = _hold(np.arctan2(-w_e, level), np.hypot(level, w_e) > least)
    track = _hold(np.unwrap(np.arctan2(v_e, u_e)), level > least)
    return velocity, columns.get('gamma', gamma), columns.get('track', track)


def _earth_velocity(trajectory: Trajectory, position: Array, segments: list[slice]) -> Array:
    """Return u_e, v_e, w_e: each as given, or the slope of its position."""
    velocity = np.zeros((len(trajectory), 3))
    for i, name in enumerate(('u_e', 'v_e', 'w_e')):
        if name in trajectory:
            velocity[:, i] = trajectory[name]
            continue
        for part in segments:
            if part.stop - part.start > 1:
                velocity[part, i] = np.gradient(position[part, i], trajectory.time[part])
    return velocity


def _hold(angle: Array, known: NDArray[np.bool_]) -> Array:
    """Return the angle, its last known value where it is not known (the first one before that)."""
    if not known.any():
        return np.zeros_like(angle)
    index = np.where(known, np.arange(angle.size), -1)
    index = np.maximum.accumulate(index)
    index[index < 0] = np.argmax(known)
    return angle[index]


def _rotation(attitude: Array) -> frames.Rotation:
    w, x, y, z = attitude.T
    return frames.rotation_from_quaternion((w, x, y, z))


def _stack(components: frames.Quaternion) -> Array:
    return np.stack(np.broadcast_arrays(*components), axis=-1).astype(float)
