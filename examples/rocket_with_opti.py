"""The rocket's climb written as an optimisation problem, by hand and by the dynamics.

By hand, each step goes by the rates at its start (forward Euler). The dynamics take the mean of
both ends (trapezoidal rule), which at the same number of points is nearer to what the answer tends
to as points are added.
"""

from typing import Any

from common import output_folder, tell

import flightdyn as fd
import flightdyn.numpy as np

FOLDER = output_folder(__doc__)
MASS, HEIGHT, DURATION, G = 500e3, 100e3, 100.0, 9.81
BURN = 1 / (300 * G)  # kg/s of fuel per N


def variables(opti: fd.Opti, n: int) -> tuple[Any, Any, Any, Any]:
    """Return altitude, climb rate, mass and thrust at n times, with the conditions on them."""
    altitude = opti.variable(init_guess=np.linspace(0, HEIGHT, n))
    climb = opti.variable(init_guess=HEIGHT / DURATION, n_vars=n)
    mass = opti.variable(init_guess=MASS, n_vars=n, lower_bound=0)
    thrust = opti.variable(init_guess=G * MASS, n_vars=n, lower_bound=0)
    opti.subject_to([altitude[0] == 0, climb[0] == 0, mass[0] == MASS, altitude[-1] == HEIGHT])
    opti.maximize(mass[-1])
    return altitude, climb, mass, thrust


def fuel_by_hand(n: int) -> float:
    opti = fd.Opti()
    altitude, climb, mass, thrust = variables(opti, n)
    step = DURATION / (n - 1)
    opti.subject_to(
        [
            np.diff(altitude) == climb[:-1] * step,
            np.diff(climb) == (thrust / mass - G)[:-1] * step,
            np.diff(mass) == -BURN * thrust[:-1] * step,
        ]
    )
    return float(MASS - opti.solve(verbose=False)(mass[-1]))


def fuel_by_dynamics(n: int) -> float:
    opti = fd.Opti()
    time = np.linspace(0, DURATION, n)
    altitude, climb, mass, thrust = variables(opti, n)
    rocket = fd.DynamicsPointMass1DVertical(
        mass_props=fd.MassProperties(mass=mass), z_e=-altitude, w_e=-climb
    )
    rocket.add_force(Fz=-thrust)  # z points down
    rocket.add_gravity_force(g=G)
    rates = rocket.state_derivatives()
    opti.constrain_derivative(-rates['z_e'], variable=altitude, with_respect_to=time)
    opti.constrain_derivative(-rates['w_e'], variable=climb, with_respect_to=time)
    opti.constrain_derivative(-BURN * thrust, variable=mass, with_respect_to=time)
    return float(MASS - opti.solve(verbose=False)(mass[-1]))


tell(
    FOLDER / 'rocket_with_opti.json',
    {
        'fuel by hand, Euler, 100 points': (fuel_by_hand(100) / 1e3, 't'),
        'fuel by dynamics, 100 points': (fuel_by_dynamics(100) / 1e3, 't'),
        'fuel by dynamics, 2000 points': (fuel_by_dynamics(2000) / 1e3, 't'),
    },
)
