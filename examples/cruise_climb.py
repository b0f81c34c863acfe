"""How far does a jet get on 24 t of fuel? It climbs as it gets lighter, as Breguet would have it.

In the stratosphere, at a Mach number, the best lift coefficient stays the same: the air must thin
out as the weight goes down. Then speed, glide ratio and consumption are constant, and the range is
Breguet's. The plan starts lower and ends there again: what it climbs, the descent gives back.
"""

from math import cos, log, sin, sqrt

from common import draw, output_folder, plan, save, tell

import flightdyn.numpy as np
from flightdyn.environment.atmosphere import Atmosphere
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem

FOLDER = output_folder(__doc__)

problem = load_problem('cruise_climb')
flight = plan(Planner(), problem)
vehicle = problem.vehicle
polar, engine, g = vehicle.aerodynamics, vehicle.propulsion, vehicle.gravity
mass = vehicle.mass_props.mass + flight['fuel']

best = sqrt(polar.CD0 / polar.k)  # CL of the best glide ratio
alpha = (best - polar.CL0) / polar.CL_alpha
ratio = best / (polar.CD0 + polar.k * best**2)
# thrust points up by alpha, and carries some of the weight
ratio = ratio * cos(alpha) + sin(alpha)
speed = problem.path['mach'][1] * Atmosphere(12e3).speed_of_sound()
breguet = speed * ratio / (engine.consumption * g) * log(mass[0] / mass[-1])

cruise = np.linspace(0.2, 0.9, 701) * flight.duration
height, weight = -flight.sample('z_e', cruise), np.interp(cruise, flight.time, mass)
thinner = Atmosphere(height[0]).density() / Atmosphere(height[-1]).density()

save(FOLDER / 'cruise_climb.csv', flight)
tell(
    FOLDER / 'cruise_climb.json',
    {
        'range': (flight['x_e'][-1] / 1e3, 'km'),
        "range, Breguet's": (breguet / 1e3, 'km'),
        'duration': (flight.duration / 3600, 'h'),
        'Mach number in cruise': (np.median(flight.sample('mach', cruise)), ''),
        'CL in cruise': (np.median(flight.sample('CL', cruise)), ''),
        'CL of the best glide ratio': (best, ''),
        'height at the start of the cruise': (height[0], 'm'),
        'climb in cruise': (height[-1] - height[0], 'm'),
        'air gets thinner': (thinner, ''),
        'airplane gets lighter': (weight[0] / weight[-1], ''),
    },
)
draw(
    FOLDER / 'cruise_climb.png',
    lambda figures: figures.history_figure(flight, ['z_e', 'fuel', 'CL', 'throttle']),
)
