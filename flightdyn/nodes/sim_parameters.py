"""The parameters of the sim node, and what they are made into."""

from dataclasses import dataclass
from typing import Any

from ..config import number, parse_yaml
from ..errors import InputError
from ..simulation.gusts import Gusts
from .parameters import NodeParameters, parameter
from .sim_core import Rules, Start
from .sim_run import Setting


@dataclass(frozen=True)
class SimParameters(NodeParameters):
    """See `ros2 param describe /sim NAME`."""

    vehicle: str = parameter(
        'quadcopter', 'what flies when no plan names a vehicle', unconfigured_only=True
    )
    vehicle_settings: str = parameter(
        '',
        "entries of the vehicle's file that are otherwise in flight, semicolons between, such as "
        '`mass=0.105; inertia.Iyy=6e-4`; controllers do not know of it',
        unconfigured_only=True,
    )
    initial: str = parameter(
        '',
        'states of a flight that is there before any plan, such as '
        '`{altitude: 1000, speed: 55, gamma: -3 deg}`; empty for none',
        unconfigured_only=True,
    )
    wait_for_plan: bool = parameter(
        True,
        'that flight stands still until a plan or controls come; false flies neutral controls',
        unconfigured_only=True,
    )
    tracking: str = parameter(
        'lqr',
        'plans are kept to by feedback, or their controls flown open-loop',
        choices=('lqr', 'open_loop'),
        unconfigured_only=True,
    )
    control_period: float = parameter(
        0.0,
        "of the feedback; 0 is a thousandth of the plan's duration, from 5 ms to 0.1 s",
        unit='s',
        lower=0.0,
        upper=10.0,
        unconfigured_only=True,
    )
    new_plan: str = parameter(
        'restart',
        'a plan is flown from its own start, or the flight joins it where it is',
        choices=('restart', 'join'),
    )
    after_plan: str = parameter(
        'pause', "at a plan's end time stops, or goes on at its end", choices=('pause', 'hold')
    )
    controls_timeout: float = parameter(
        0.0,
        'how long after the end of ~/controls the next must come, in run time; 0 is for ever',
        unit='s',
        lower=0.0,
        upper=3600.0,
    )
    on_timeout: str = parameter(
        'hold',
        'what follows when no controls come: the last, neutral ones, or a pause',
        choices=('hold', 'neutral', 'stop'),
    )
    ground_altitude: float = parameter(
        0.0,
        'of the ground above the local origin',
        unit='m',
        lower=-1e5,
        upper=1e5,
        unconfigured_only=True,
    )
    on_ground: str = parameter(
        'report', 'the ground is told of, or also stops time', choices=('report', 'stop')
    )
    rate: float = parameter(
        200.0,
        'samples per simulated second',
        unit='Hz',
        lower=0.1,
        upper=2000.0,
        unconfigured_only=True,
    )
    real_time_factor: float = parameter(
        1.0, 'simulated time over wall time; 0 is as fast as possible', lower=0.0, upper=1000.0
    )
    integrator: str = parameter(
        'rk4',
        'Runge-Kutta steps, or CVODES for what is stiff',
        choices=('rk4', 'cvodes'),
        unconfigured_only=True,
    )
    max_step: float = parameter(
        0.001,
        'longest Runge-Kutta step',
        unit='s',
        lower=1e-6,
        upper=1.0,
        unconfigured_only=True,
    )
    trajectory_topic: str = parameter(
        'planner/trajectory',
        'plans to fly, beside ~/trajectory; empty for none',
        read_only=True,
    )
    wind_ned: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0),
        'where the air moves to (north, east, down), unless a plan says so itself',
        unit='m/s',
        length=3,
        unconfigured_only=True,
    )
    gusts: str = parameter(
        'none',
        'Dryden turbulence on top of the wind',
        choices=('none', 'light', 'moderate', 'severe'),
        unconfigured_only=True,
    )
    seed: int = parameter(
        0,
        'the same seed makes the same gusts and errors of sensors',
        lower=0,
        upper=2**31 - 1,
        unconfigured_only=True,
    )
    fix_rate: float = parameter(
        10.0,
        'NavSatFix per simulated second',
        unit='Hz',
        lower=0.01,
        upper=1000.0,
        unconfigured_only=True,
    )
    fix_noise: tuple[float, ...] = parameter(
        (0.0, 0.0, 0.0),
        'standard deviations of fixes north, east, down',
        unit='m',
        length=3,
        unconfigured_only=True,
    )
    fix_noise_time: float = parameter(
        60.0,
        'how long errors of fixes last',
        unit='s',
        lower=0.01,
        upper=1e5,
        unconfigured_only=True,
    )
    imu_noise: tuple[float, ...] = parameter(
        (0.0, 0.0),
        'standard deviations of an IMU: acceleration [m/s^2], angular rate [rad/s]',
        length=2,
        unconfigured_only=True,
    )
    record: str = parameter(
        '',
        'MCAP file to record to, below record_root; it is replaced; empty for none',
        unconfigured_only=True,
    )
    record_root: str = parameter(
        '', 'folder that recordings stay in; empty allows any', read_only=True
    )
    start_time: float = parameter(
        -1.0,
        'what the clock shows first, since 1970; -1 is the time of day',
        unit='s',
        lower=-1.0,
        upper=4e9,
        unconfigured_only=True,
    )
    config_dir: str = parameter(
        '', 'folder with vehicles/ of your own, searched first; empty for none', read_only=True
    )
    origin_lat: float = parameter(
        0.0,
        'latitude of the local origin',
        unit='deg',
        lower=-90.0,
        upper=90.0,
        unconfigured_only=True,
    )
    origin_lon: float = parameter(
        0.0,
        'longitude of the local origin',
        unit='deg',
        lower=-180.0,
        upper=180.0,
        unconfigured_only=True,
    )
    origin_altitude: float = parameter(
        0.0,
        'altitude of the local origin above the ellipsoid',
        unit='m',
        lower=-1000.0,
        upper=100000.0,
        unconfigured_only=True,
    )


def setting_of(values: Any) -> Setting:
    """Return how runs are made."""
    return Setting(
        vehicle=values.vehicle,
        following=values.tracking,
        wind=values.wind_ned,
        gusts=None if values.gusts == 'none' else Gusts(values.gusts, values.seed),
        method=values.integrator,
        max_step=values.max_step,
        period=values.control_period,
    )


def rules_of(values: Any) -> Rules:
    """Return what happens when."""
    return Rules(**{name: getattr(values, name) for name in Rules.__dataclass_fields__})


def start_of(values: Any) -> Start:
    """Return the flight that is there before any plan.

    Raises
    ------
    InputError
        If `initial` is not YAML of names and numbers.
    """
    where = 'parameter initial'
    document = parse_yaml(values.initial or '{}', where)
    if not isinstance(document, dict):
        raise InputError(f'{where}: expected names and values, got {values.initial!r}')
    initial = {str(name): number(value, f'{where}: {name}') for name, value in document.items()}
    return Start(initial=initial, wait=values.wait_for_plan)
