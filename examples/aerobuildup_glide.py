"""The Cessna's glide with AeroSandbox's AeroBuildup inside the optimisation, on its symbols.

Needs the extra `aero`, and about half a minute: cessna152_glide has the same aerodynamics sampled
into a table once, and takes a fraction of that.
"""

from common import output_folder, tell

import flightdyn as fd
import flightdyn.numpy as np
from flightdyn.errors import MissingExtraError
from flightdyn.units import knot
from flightdyn.vehicles.aero_buildup import airplane
from flightdyn.vehicles.vehicle import load_vehicle

try:
    from aerosandbox import AeroBuildup
except ImportError:
    raise SystemExit(str(MissingExtraError('this example', 'aero'))) from None

FOLDER = output_folder(__doc__)
N = 50
vehicle = load_vehicle('cessna152')

opti = fd.Opti()
time = np.cosspace(0, opti.variable(init_guess=180, log_transform=True), N)
start = {'x_e': 0, 'z_e': -1000, 'speed': 107 * knot, 'gamma': 0}
dyn = fd.DynamicsPointMass2DSpeedGamma(
    mass_props=vehicle.mass_props,
    x_e=opti.variable(init_guess=start['speed'] * np.linspace(0, 180, N)),
    z_e=opti.variable(init_guess=np.linspace(start['z_e'], 0, N)),
    speed=opti.variable(init_guess=start['speed'], n_vars=N),
    gamma=opti.variable(init_guess=0, n_vars=N, lower_bound=-np.pi / 2, upper_bound=np.pi / 2),
    alpha=opti.variable(init_guess=5, n_vars=N, lower_bound=-5, upper_bound=15),
)
opti.subject_to([dyn.state[name][0] == value for name, value in start.items()])
dyn.add_gravity_force(g=vehicle.gravity)
aero = AeroBuildup(airplane=airplane(vehicle.geometry), op_point=dyn.op_point).run()
dyn.add_force(*aero['F_w'], axes='wind')
opti.subject_to(dyn.altitude > 0)
dyn.constrain_derivatives(opti, time)
opti.maximize(dyn.x_e[-1])
solution = opti.solve(verbose=False)
flight = solution(dyn)

tell(
    FOLDER / 'aerobuildup_glide.json',
    {
        'range': (flight.x_e[-1] / 1e3, 'km'),
        'duration': (solution(time)[-1] / 60, 'min'),
        'zoom climb': (np.max(flight.altitude) + start['z_e'], 'm'),
        'median alpha': (np.median(flight.alpha), 'deg'),
    },
)
