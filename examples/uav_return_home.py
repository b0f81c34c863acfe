"""An electric UAV is called back against the wind: how much of its battery does that take?

Down where the wind is weaker, and at the airspeed at which a metre over the ground costs least:
faster than in calm air, for the wind to have less time. What remains is what could have been flown
outwards: with the cost of a metre it gives how much further away the point of no return is.
"""

from common import draw, output_folder, plan, save, tell

import flightdyn.numpy as np
from flightdyn import Atmosphere
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem

FOLDER = output_folder(__doc__)

problem = load_problem('uav_return_home')
flight = plan(Planner(), problem)
vehicle, charge = problem.vehicle, flight['charge']
polar, drive = vehicle.aerodynamics, vehicle.propulsion
away = np.hypot(flight['x_e'], flight['y_e'])
level = (away > 1000) & (away < 5000)
per_metre = np.diff(charge[level][[0, -1]])[0] / np.diff(away[level][[0, -1]])[0]

# level flight at the lowest height, by momentum theory of the propeller
height = -problem.path['z_e'][1]
density = Atmosphere(height).density()
fast = np.linspace(11, 30, 1901)  # m/s through the air
pressure = 0.5 * density * fast**2 * polar.area
lift = vehicle.mass_props.mass * vehicle.gravity / pressure
drag = pressure * (polar.CD0 + polar.k * (lift - polar.CL_min_drag) ** 2)
disc = np.pi / 4 * drive.propeller.diameter**2
flow = fast / 2 + np.sqrt(fast**2 / 4 + drag / (2 * density * disc))
drawn = drag * flow / drive.propeller.efficiency * drive.engine.use  # W

north, east, _ = problem.wind(0, 0, -height, 0)
home = -np.array([problem.initial[name][0] for name in ('x_e', 'y_e')])
home = home / np.linalg.norm(home)
against, across = -(north * home[0] + east * home[1]), north * home[1] - east * home[0]
over_ground = np.sqrt(fast**2 - across**2) - against
windy, calm = np.argmin(drawn / over_ground), np.argmin(drawn / fast)

save(FOLDER / 'uav_return_home.csv', flight)
tell(
    FOLDER / 'uav_return_home.json',
    {
        'charge used': ((charge[0] - charge[-1]) / 1e3, 'kJ'),
        'duration': (flight.duration / 60, 'min'),
        'headwind at the lowest height': (against, 'm/s'),
        'airspeed on the way': (np.median(flight['airspeed'][level]), 'm/s'),
        'airspeed of least charge a metre': (fast[windy], 'm/s'),
        'the same in calm air': (fast[calm], 'm/s'),
        'charge a metre on the way': (per_metre, 'J/m'),
        'least charge a metre': ((drawn / over_ground)[windy], 'J/m'),
        'further away with what is left': (charge[-1] / per_metre / 1e3, 'km'),
    },
)
draw(FOLDER / 'uav_return_home.png', lambda figures: figures.figure_for(flight))
