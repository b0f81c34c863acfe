"""The shipped problems as a user of AeroSandbox states them: trapezoidal collocation.

Meshes, bounds and guesses are the textbook's, and those of the problem's file for the turnback.
AeroBuildup is evaluated in the loop. Limits of the vehicle that no optimum touches (load factor,
never-exceed speed) are left out, which is in AeroSandbox's favour.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import aerosandbox as asb
import aerosandbox.numpy as np

from flightdyn.vehicles.aero_buildup import airplane
from flightdyn.vehicles.vehicle import load_vehicle

NODES = {'glide': 50, 'turnback': 50, 'flip': 80, 'rocket': 100}


@dataclass(frozen=True)
class Statement:
    """A problem ready to be solved, its dynamics, and what it is about in the user's units."""

    opti: Any
    dynamics: Any
    value: Any


def cessna() -> Any:
    """Return the Cessna 152 of config/vehicles."""
    return airplane(load_vehicle('cessna152').geometry)


def _aerodynamic_force(dyn: Any) -> None:
    dyn.add_gravity_force(g=9.81)
    force = asb.AeroBuildup(airplane=cessna(), op_point=dyn.op_point).run()['F_w']
    dyn.add_force(*force, axes='wind')


def glide() -> Statement:
    """Longest glide from 1000 m and 107 kt, on cosine-spaced nodes."""
    opti, n = asb.Opti(), NODES['glide']
    start = {'x_e': 0, 'z_e': -1000, 'speed': 107 * 1852 / 3600, 'gamma': 0}
    grid = np.cosspace(0, opti.variable(init_guess=180, log_transform=True), n)
    dyn = asb.DynamicsPointMass2DSpeedGamma(
        mass_props=asb.MassProperties(mass=1151.8 * 0.45359237),
        x_e=opti.variable(init_guess=start['speed'] * np.linspace(0, 180, n)),
        z_e=opti.variable(init_guess=np.linspace(-1000, 0, n)),
        speed=opti.variable(init_guess=start['speed'], n_vars=n),
        gamma=opti.variable(init_guess=0, n_vars=n, lower_bound=-np.pi / 2, upper_bound=np.pi / 2),
        alpha=opti.variable(init_guess=5, n_vars=n, lower_bound=-5, upper_bound=15),
    )
    opti.subject_to([dyn.state[name][0] == value for name, value in start.items()])
    _aerodynamic_force(dyn)
    opti.subject_to(dyn.altitude > 0)
    dyn.constrain_derivatives(opti, grid)
    opti.minimize(-dyn.x_e[-1])
    return Statement(opti, dyn, dyn.x_e[-1])


def turnback() -> Statement:
    """Back over the start the other way, on least height, from 150 m and 65 kt."""
    opti, n = asb.Opti(), NODES['turnback']
    start = {'x_e': 0, 'y_e': 0, 'z_e': -150, 'speed': 65 * 1852 / 3600, 'gamma': 0, 'track': 0}

    def board(values: list[float], **bounds: Any) -> Any:
        """Return a variable, guessed by points in equal steps."""
        points = np.linspace(0, 1, len(values))
        return opti.variable(init_guess=np.interp(np.linspace(0, 1, n), points, values), **bounds)

    grid = np.linspace(0, opti.variable(init_guess=17, lower_bound=5, upper_bound=60), n)
    limit = np.radians(60)
    dyn = asb.DynamicsPointMass3DSpeedGammaTrack(
        mass_props=asb.MassProperties(mass=1151.8 * 0.45359237),
        x_e=board([0, 60, 80, 40, 0]),
        y_e=board([0, -20, 30, 30, 0]),
        z_e=board([-150, -105], upper_bound=0),
        speed=board([30, 30], lower_bound=23),
        gamma=board([0, 0], lower_bound=-limit, upper_bound=limit),
        track=board(list(np.radians(np.array([0, -60, 60, 200, 180])))),
        alpha=board([8, 8], lower_bound=-5, upper_bound=12),
        bank=board(
            list(np.radians(np.array([-45, 45, 45, 45, 0]))),
            lower_bound=-limit,
            upper_bound=limit,
        ),
    )
    opti.subject_to([dyn.state[name][0] == value for name, value in start.items()])
    opti.subject_to([dyn.x_e[-1] == 0, dyn.y_e[-1] == 0, dyn.track[-1] == np.pi])
    opti.subject_to(dyn.speed[-1] >= start['speed'])
    _aerodynamic_force(dyn)
    dyn.constrain_derivatives(opti, grid)
    lost = dyn.altitude[0] - dyn.altitude[-1]
    opti.minimize(lost)
    return Statement(opti, dyn, lost)


def flip() -> Statement:
    """A full turn nose down on the way to 1 m ahead, from rest to rest, in least time."""
    opti, n = asb.Opti(), NODES['flip']
    duration = opti.variable(init_guess=1, lower_bound=0)
    state = {name: opti.variable(init_guess=0, n_vars=n) for name in ('z_e', 'u_b', 'w_b', 'q')}
    state['x_e'] = opti.variable(init_guess=np.linspace(0, 1, n))
    state['theta'] = opti.variable(init_guess=np.linspace(0, -2 * np.pi, n))
    dyn = asb.DynamicsRigidBody2DBody(
        mass_props=asb.MassProperties(mass=0.1, Ixx=1, Iyy=0.0005, Izz=1), **state
    )
    left, right = (
        # hovering: with 0.5 N it takes more iterations
        opti.variable(init_guess=0.1 * 9.81 / 2, n_vars=n, lower_bound=0, upper_bound=1)
        for _ in range(2)
    )
    dyn.add_force(Fz=-(left + right), axes='body')
    dyn.add_moment(My=(right - left) * 0.05)
    dyn.add_gravity_force(g=9.81)
    dyn.constrain_derivatives(opti, np.linspace(0, duration, n))
    ends = {'x_e': 1, 'theta': -2 * np.pi}
    opti.subject_to([dyn.state[name][0] == 0 for name in state])
    opti.subject_to([dyn.state[name][-1] == ends.get(name, 0) for name in state])
    opti.minimize(duration)
    return Statement(opti, dyn, duration)


def rocket() -> Statement:
    """To 100 km in 100 s, straight up, on least fuel."""
    opti, n = asb.Opti(), NODES['rocket']
    grid = np.linspace(0, 100, n)
    mass = opti.variable(init_guess=500e3, n_vars=n)
    dyn = asb.DynamicsPointMass1DVertical(
        mass_props=asb.MassProperties(mass=mass),
        z_e=opti.variable(init_guess=np.linspace(0, -100e3, n)),
        w_e=opti.variable(init_guess=-1000, n_vars=n),
    )
    thrust = opti.variable(init_guess=9.81 * 500e3, n_vars=n, lower_bound=0)
    dyn.add_force(Fz=-thrust)
    dyn.add_gravity_force(g=9.81)
    dyn.constrain_derivatives(opti, grid)
    opti.constrain_derivative(
        derivative=-thrust / (300 * 9.81), variable=mass, with_respect_to=grid
    )
    opti.subject_to([dyn.z_e[0] == 0, dyn.w_e[0] == 0, mass[0] == 500e3])
    opti.subject_to([dyn.z_e[-1] == -100e3, mass >= 0])
    fuel = mass[0] - mass[-1]
    opti.minimize(fuel)
    return Statement(opti, dyn, fuel)


PROBLEMS: dict[str, Callable[[], Statement]] = {
    'glide': glide,
    'turnback': turnback,
    'flip': flip,
    'rocket': rocket,
}


def timed(case: str) -> dict[str, Any]:
    """State and solve a problem.

    Returns
    -------
    build_s, solve_s, solve_cpu_s, total_cpu_s : floats
    value : float
    solution : dynamics of the optimum
    """
    start, start_cpu = time.perf_counter(), time.process_time()
    statement = PROBLEMS[case]()
    built, built_cpu = time.perf_counter(), time.process_time()
    solution = statement.opti.solve(verbose=False)
    end, end_cpu = time.perf_counter(), time.process_time()
    return {
        'build_s': built - start,
        'solve_s': end - built,
        'solve_cpu_s': end_cpu - built_cpu,
        'total_cpu_s': end_cpu - start_cpu,
        'value': float(solution(statement.value)),
        'solution': solution(statement.dynamics),
    }
