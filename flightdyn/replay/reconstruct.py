"""From measured positions and velocities to the motion of a point mass."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import frames
from ..environment.geodesy import GeodeticPoint, geodetic_from_ned, ned_from_geodetic
from ..errors import InputError
from ..logs.track import Track
from ..trajectory import Trajectory, stretches
from .flight_path import bank_about, energies, flight_path, turn_from_origin
from .jitter import estimate_jitter, smooth_jittered
from .manoeuvres import local_jerk_density
from .noise import MIN_STD, Noise, estimate_noise
from .outliers import Rejected, Verdict, judge, judge_smoothed
from .samples import Samples, merge_repeats, without, without_obvious
from .smoother import smooth
from .wind import Method, estimate_wind

Array = NDArray[np.float64]

MODEL = 'DynamicsPointMass3DSpeedGammaTrack'
METRES_PER_DEGREE = 111_320.0  # of longitude at the equator, WGS84; only for the size of a digit
VELOCITY_WANDER: Array = np.array([0.045, 0.045, 0.09])
"""1-sigma of the velocity of a satellite fix that stands still, north, east, down [m/s].

What the atmosphere and reflections make of a position wanders: it is common to neighbouring
samples, so no smoothing shows or lessens it. 1 m, down 2 m, of a correlation time of 100 s makes
0.45 m and 0.9 m in the 10 s of a slow smoothing.
"""

_WANDER_S = 10.0  # over which that wander is compared with white noise

_ROUNDS = 4  # of judging the samples: each shows what a worse one hid


def reconstruct(
    track: Track,
    *,
    position_std: ArrayLike | None = None,
    velocity_std: ArrayLike | None = None,
    jerk_density: ArrayLike | None = None,
    wind: Method | None = None,
) -> Trajectory:
    """Return what a point mass did to leave this track.

    Parameters
    ----------
    track : Track
        Samples of one source. Samples of one segment that share a time are averaged into one.
    position_std, velocity_std : float or array (3,), optional
        1-sigma of the measurements, north, east, down [m], [m/s]. Default: estimated from the
        log (`noise.estimate_noise`), at most what it reports, at least what its digits resolve.
    jerk_density : float or array (3,), optional
        How sharply the vehicle manoeuvres [m^2/s^5]. Default: estimated from the log, and from
        moment to moment (`manoeuvres.local_jerk_density`).
    wind : 'circling' or 'airspeed', optional
        Estimate the wind, see `wind.estimate_wind`, and with it the motion through the air.

    Returns
    -------
    Trajectory
        Of model `DynamicsPointMass3DSpeedGammaTrack`.

        States: `x_e`, `y_e`, `z_e` [m] in the tangent plane at the origin, which of a geodetic
        track is its first sample; `speed` over the ground [m/s], `gamma`, `track` [rad].
        Control: `bank` [rad].
        Outputs: `u_e`, `v_e`, `w_e` [m/s], `load_factor` [g]; the 1-sigma of the states, the
        control and the load factor, `x_e_std` to `load_factor_std`; `specific_energy` [J/kg],
        `specific_energy_rate` [W/kg], `specific_excess_power` [m/s]; `lat`, `lon` [deg] and
        `altitude` [m, datum of the track] of the smoothed position, if the track is tied to the
        earth; `phi`, `theta`, `psi` [rad] as measured, if at least half of the samples have an
        attitude; the others have that of those near by.

        With a wind that could be estimated: `wind_x_e`, `wind_y_e`, where the air moves to at the
        vehicle, and the 1-sigma of each, `wind_std` [m/s]; `airspeed` [m/s] with `airspeed_std`;
        `bank_air` [rad], the bank about the velocity through the air.

    Raises
    ------
    InputError
        If a noise level given is not above 0, or the track's arrays do not fit together.

    Notes
    -----
    Motion is smoothed in the tangent plane at the origin, where it is linear. Velocity,
    acceleration and the angles are then turned into north-east-down *at the vehicle*: 100 km from
    the origin the two differ by 0.9 deg, so there `u_e v_e w_e` is not d(x_e y_e z_e)/dt.

    Bank and load factor assume coordinated flight in still air: the lift vector is the
    acceleration less gravity, across the velocity. That the earth rotates counts where it is
    known where on it the vehicle is. Energies are those over the ground, potential from altitude
    0, or from the local origin.

    Nothing is NaN. Where the horizontal speed is within its 1-sigma or below
    `flight_path.REST_SPEED`, `track` keeps its last meaningful value; where the speed is, `gamma`
    and `bank` go to 0, the 1-sigma of `gamma` to that of an angle unknown, and that of `bank` to
    the tilt of the lift.

    Samples that the rest contradicts are not used, see `outliers`; where the positions jump for
    good a new segment begins. `reconstruct_checked` tells what was left out.

    Where there are positions alone and time stamps seem off, positions are taken as less sure
    along the way than across it, see `jitter`.

    What the log reports as 1-sigma beyond the white noise seen in it is taken as an error common
    to neighbouring samples: smoothing does not lessen it, and it is added to the result's. So is
    `VELOCITY_WANDER` where velocity is known from positions on the earth alone.
    """
    return reconstruct_checked(
        track,
        position_std=position_std,
        velocity_std=velocity_std,
        jerk_density=jerk_density,
        wind=wind,
    )[0]


def reconstruct_checked(
    track: Track,
    *,
    position_std: ArrayLike | None = None,
    velocity_std: ArrayLike | None = None,
    jerk_density: ArrayLike | None = None,
    wind: Method | None = None,
) -> tuple[Trajectory, Rejected]:
    """Return what `reconstruct` does, and which samples it did not use and why.

    Parameters, errors and notes: see `reconstruct`.
    """
    given = [
        _positive(name, value)
        for name, value in (
            ('position_std', position_std),
            ('velocity_std', velocity_std),
            ('jerk_density', jerk_density),
        )
    ]
    rejected = Rejected()
    digits = _resolution(track)
    samples = without_obvious(merge_repeats(track), digits * np.sqrt(12), rejected)
    plane = _in_plane(samples, track.origin)
    noise = _noise(samples, plane, digits, given)
    for judging in range(_ROUNDS, -1, -1):
        white, common = _shared(samples, noise, given)
        verdict = Verdict.clean(samples.time.size)
        if judging:
            verdict = judge(
                samples.time,
                plane.measured,
                plane.velocity,
                samples.segment,
                position_std=white[0],
                velocity_std=white[1],
                noise=noise,
                known=rejected,
            )
        if not verdict:
            everywhere = np.broadcast_to(noise.jerk_density, white[0].shape)
            vectors, variances = _smoothed(samples, plane, white, everywhere)
            if judging:
                verdict = judge_smoothed(
                    samples.time,
                    plane.measured,
                    vectors[0],
                    variances[0],
                    samples.segment,
                    position_std=white[0],
                    known=rejected,
                )
        if not verdict:
            break
        samples = without(samples, verdict, rejected)
        plane = _in_plane(samples, track.origin)
        if judging == _ROUNDS:
            noise = _at_most(noise, _noise(samples, plane, digits, given))
    if given[2] is None:
        density = local_jerk_density(
            samples.time,
            plane.measured,
            plane.velocity,
            samples.segment,
            position_std=white[0],
            velocity_std=white[1],
            jerk_density=noise.jerk_density,
        )
        vectors, variances = _smoothed(samples, plane, white, density)
    covariance = np.zeros((3, samples.time.size))  # of north with east
    if given[0] is None and given[2] is None and plane.velocity is None:
        jitter = estimate_jitter(
            samples.time,
            plane.measured[:, :2],
            vectors[1, :, :2],
            samples.segment,
            position_std=float(noise.position_std[0]),
            position_std_limits=(digits, _median(_reported(samples.position_std))),
        )
        if jitter is not None:
            vectors[..., :2], both = smooth_jittered(
                samples.time,
                plane.measured,
                vectors[1, :, :2],
                samples.segment,
                jitter=jitter,
                jerk_density=noise.jerk_density,
            )
            variances[..., :2] = np.diagonal(both, axis1=2, axis2=3)
            covariance = both[..., 0, 1]
    variances[:2] += np.stack(common)
    if samples.geodetic is not None and plane.velocity is None:
        variances[1] += VELOCITY_WANDER**2
    elif samples.geodetic is not None and given[0] is None:
        told = _reported(samples.position_std)
        variances[0] = np.maximum(variances[0], 0.0 if told is None else told**2)
    return _trajectory(samples, plane.origin, vectors, variances, covariance, wind), rejected


@dataclass(frozen=True)
class _Plane:
    """Samples in the tangent plane at the origin; `measured` is NaN where nothing was."""

    origin: GeodeticPoint | None
    measured: Array
    velocity: Array | None


def _in_plane(samples: Samples, origin: GeodeticPoint | None) -> _Plane:
    if samples.geodetic is not None:
        lat, lon, altitude = samples.geodetic
        origin = GeodeticPoint(float(lat[0]), float(lon[0]), float(altitude[0]))
        position = np.stack(ned_from_geodetic(lat, lon, altitude, origin), axis=-1)
    else:
        assert samples.position is not None
        position = samples.position
    velocity = samples.velocity
    if velocity is not None:
        velocity = frames.stack(
            frames.rotate(turn_from_origin(position, origin), _components(velocity))
        )
    return _Plane(origin, np.where(samples.usable, position, np.nan), velocity)


def _noise(samples: Samples, plane: _Plane, digits: Array, given: list[Array | None]) -> Noise:
    reported = _median(_reported(samples.position_std))
    least = digits
    if samples.geodetic is not None and plane.velocity is not None and samples.time.size > 1:
        # A receiver's positions go together smoothly, and wander: white noise of the millimetres
        # that are seen would make more of their differences than of the velocity, which does not
        # wander. This much white noise tells as much of the velocity in `_WANDER_S` as they do.
        usual = max(float(np.median(np.diff(samples.time))), 1e-3)
        white = VELOCITY_WANDER * _WANDER_S * np.sqrt(_WANDER_S / (12 * usual))
        least = np.maximum(digits, np.minimum(white, reported))
    return estimate_noise(
        samples.time,
        plane.measured,
        plane.velocity,
        segment=samples.segment,
        position_std=given[0],
        velocity_std=given[1],
        jerk_density=given[2],
        position_std_limits=(least, reported),
        velocity_std_limits=(MIN_STD, _median(_reported(samples.velocity_std))),
    )


def _at_most(before: Noise, after: Noise) -> Noise:
    """Return the noise after outliers were taken out, no level above what it was before.

    Without outliers a log is less noisy and smoother. If it seems otherwise, what was taken out
    belonged to a motion that white jerk describes badly.
    """
    return Noise(
        position_std=np.minimum(after.position_std, before.position_std),
        velocity_std=np.minimum(after.velocity_std, before.velocity_std),
        jerk_density=np.minimum(after.jerk_density, before.jerk_density),
    )


def _shared(
    samples: Samples, noise: Noise, given: list[Array | None]
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Return the white 1-sigma and the variance of the common error of each sample."""
    size = samples.time.size
    reported_p, reported_v = _reported(samples.position_std), _reported(samples.velocity_std)
    white_p, common_p = _split(reported_p, noise.position_std, given[0] is not None, size)
    white_v, common_v = _split(reported_v, noise.velocity_std, given[1] is not None, size)
    return (white_p, white_v), (common_p, common_v)


def _smoothed(
    samples: Samples, plane: _Plane, white: tuple[Array, Array], jerk_density: Array
) -> tuple[Array, Array]:
    """Return position, velocity, acceleration (3, n, 3) and the variance of each."""
    size = samples.time.size
    vectors, variances = np.empty((3, size, 3)), np.empty((3, size, 3))
    for piece in stretches(samples.segment):
        smoothed = smooth(
            samples.time[piece],
            plane.measured[piece],
            position_std=white[0][piece],
            velocity=None if plane.velocity is None else plane.velocity[piece],
            velocity_std=white[1][piece],
            jerk_density=jerk_density[piece],
        )
        vectors[:, piece] = smoothed.position, smoothed.velocity, smoothed.acceleration
        variances[:, piece] = np.moveaxis(smoothed.std**2, 2, 0)
    return vectors, variances


def _turned(rotation: frames.Rotation, variance: Array, covariance: Array) -> tuple[Array, Array]:
    """Return variances (3, n) and the covariance (n,) of the first two in other axes.

    Parameters
    ----------
    variance : array (n, 3)
    covariance : array (n,)
        Of the first axis with the second.
    """
    first, second, _ = rotation
    found = [
        sum(np.square(r) * variance[:, k] for k, r in enumerate(row))
        + 2 * row[0] * row[1] * covariance
        for row in rotation
    ]
    shared = sum(
        a * b * variance[:, k] for k, (a, b) in enumerate(zip(first, second, strict=True))
    )
    return np.stack(found), shared + (first[0] * second[1] + first[1] * second[0]) * covariance


def _trajectory(
    samples: Samples,
    origin: GeodeticPoint | None,
    vectors: Array,
    variances: Array,
    covariance: Array,
    wind: Method | None,
) -> Trajectory:
    position = vectors[0]
    r_local_origin = frames.transpose(turn_from_origin(position, origin))
    vel, acc = (frames.rotate(r_local_origin, _components(rows)) for rows in vectors[1:])
    (vel_var, vel_cov), (acc_var, acc_cov) = (
        _turned(r_local_origin, variances[k], covariance[k]) for k in (1, 2)
    )
    place: dict[str, Array] = {}
    if origin is not None:
        place = dict(
            zip(
                ('lat', 'lon', 'altitude'),
                geodetic_from_ned(*_components(position), origin),
                strict=True,
            )
        )
    angles = flight_path(
        vel,
        acc,
        _components(vel_var.T),
        _components(acc_var.T),
        vel_covariance=vel_cov,
        acc_covariance=acc_cov,
        lat=place.get('lat'),
    )
    outputs = {
        'u_e': np.asarray(vel[0]),
        'v_e': np.asarray(vel[1]),
        'w_e': np.asarray(vel[2]),
        'load_factor': angles.pop('load_factor'),
        **place,
        **energies(place.get('altitude', -position[:, 2]), vel, acc),
    }
    std = np.sqrt(variances[0])
    outputs |= {f'{name}_std': std[:, i] for i, name in enumerate(('x_e', 'y_e', 'z_e'))}
    outputs |= {name: angles.pop(name) for name in list(angles) if name.endswith('_std')}
    if wind is not None:
        outputs |= _through_air(samples, vel, acc, place.get('lat'), outputs['speed_std'], wind)
    if samples.attitude is not None:
        w, x, y, z = samples.attitude.T
        r_eb = frames.rotation_from_quaternion((w, x, y, z))
        outputs |= dict(
            zip(('phi', 'theta', 'psi'), frames.euler_from_rotation(r_eb), strict=True)
        )
    return Trajectory(
        time=samples.time,
        states={
            'x_e': position[:, 0],
            'y_e': position[:, 1],
            'z_e': position[:, 2],
            **{name: angles[name] for name in ('speed', 'gamma', 'track')},
        },
        controls={'bank': angles['bank']},
        outputs=outputs,
        model=MODEL,
        start_ns=samples.start_ns,
        origin=origin,
        segment=samples.segment,
    )


def _through_air(
    samples: Samples,
    vel: frames.Vector,
    acc: frames.Vector,
    lat: Array | None,
    speed_std: Array,
    method: Method,
) -> dict[str, Array]:
    """Return the wind and what it makes of the motion; nothing if no wind can be told."""
    if method == 'airspeed' and samples.airspeed is None:
        return {}
    found = estimate_wind(
        samples.time,
        frames.stack(vel),
        samples.segment,
        samples.airspeed if method == 'airspeed' else None,
    )
    if found is None:
        return {}
    air = (found.north, found.east, np.zeros_like(found.north))
    airspeed, bank = bank_about(vel, acc, lat, air)
    return {
        'wind_x_e': found.north,
        'wind_y_e': found.east,
        'wind_std': found.std,
        'airspeed': airspeed,
        'airspeed_std': np.hypot(speed_std, found.std),
        'bank_air': bank,
    }


def _components(rows: Array) -> tuple[Array, Array, Array]:
    return rows[:, 0], rows[:, 1], rows[:, 2]


def _positive(name: str, value: ArrayLike | None) -> Array | None:
    if value is None:
        return None
    array = np.asarray(value, dtype=float)
    if array.shape not in ((), (1,), (3,)) or not (np.isfinite(array).all() and (array > 0).all()):
        raise InputError(
            f'{name} must be above 0, one value or three (north, east, down): {value}'
        )
    return np.broadcast_to(array, 3)


def _reported(std: Array | None) -> Array | None:
    """Return the 1-sigma (n, 3) that a log reports, its blanks filled by their median."""
    if std is None:
        return None
    known = np.isfinite(std) & (std > 0)
    if not known.any(axis=0).all():
        return None
    filled = np.where(known, std, np.nan)
    return np.asarray(np.where(known, std, np.nanmedian(filled, axis=0)))


def _median(std: Array | None) -> Array:
    return np.full(3, np.inf) if std is None else np.asarray(np.median(std, axis=0))


def _split(reported: Array | None, white: Array, given: bool, size: int) -> tuple[Array, Array]:
    """Return the white 1-sigma and the variance of the common error, per sample, (n, 3)."""
    if reported is None or given:
        return np.tile(white, (size, 1)), np.zeros((size, 3))
    share = np.minimum(white / np.median(reported, axis=0), 1.0)
    part = np.maximum(reported * share, MIN_STD)
    return part, np.maximum(reported**2 - part**2, 0.0)


def _resolution(track: Track) -> Array:
    """Return the 1-sigma that the digits of the positions alone make, (3,) [m]."""
    if track.lat is None or track.lon is None or track.altitude is None:
        assert track.position_ned is not None
        columns = [track.position_ned[:, i] for i in range(3)]
        scale = np.ones(3)
    else:
        columns = [track.lat, track.lon, track.altitude]
        east = METRES_PER_DEGREE * float(np.cos(np.radians(track.lat[0])))
        scale = np.array([METRES_PER_DEGREE, east, 1.0])
    steps = np.array([_step(column[np.isfinite(column)]) for column in columns])
    return np.asarray(np.maximum(steps * scale / np.sqrt(12), MIN_STD))


def _step(values: Array) -> float:
    """Return the step that all values are multiples of, 0 if there is none to be seen."""
    distinct = np.unique(values)
    apart = np.diff(distinct)
    # Rounding of one and the same number is no step: 1e-11 deg is a micrometre.
    apart = apart[apart > 1e-11]
    if apart.size < 8:
        return 0.0
    step = float(apart.min())
    near = apart[apart < 20 * step] / step
    on_grid = np.abs(near - np.round(near)) < 0.05
    # A steady climb passes evenly spaced heights too, but with one increment only.
    increments = np.unique(np.round(np.abs(np.diff(values)) / step))
    return step if on_grid.mean() > 0.9 and increments.size >= 4 else 0.0
