"""How weak may a wind shear be for a glider to circle in it for ever, without an engine?

It climbs against the wind into faster air, turns, and dives with the wind into slower air: seen
from the air it gains speed both ways. What it gains in a loop pays for the drag, or the loop does
not close. The wind's strength is a state of the plan that stays the same, and is made small.
"""

from common import draw, output_folder, plan, save, tell

import flightdyn.numpy as np
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem

FOLDER = output_folder(__doc__)

problem = load_problem('dynamic_soaring')
flight = plan(Planner(), problem)
shear = flight['wind_strength'][0] * problem.wind.gradient  # 1/s
mass, g = problem.vehicle.mass_props.mass, problem.vehicle.gravity
spent = np.trapezoid(flight['drag'] * flight['airspeed'], flight.time)  # J
energy = mass * (g * -flight['z_e'] + flight['airspeed'] ** 2 / 2)

save(FOLDER / 'dynamic_soaring.csv', flight)
tell(
    FOLDER / 'dynamic_soaring.json',
    {
        'least shear': (shear, '1/s'),
        'duration of a loop': (flight.duration, 's'),
        'height of the loop': (-np.min(flight['z_e']), 'm'),
        'wind at its top': (-np.min(flight['z_e']) * shear, 'm/s'),
        'fastest through the air': (np.max(flight['airspeed']), 'm/s'),
        'slowest through the air': (np.min(flight['airspeed']), 'm/s'),
        'largest load factor': (np.max(flight['load_factor']), ''),
        'energy that drag takes in a loop': (spent / 1e3, 'kJ'),
        'energy at the end over the beginning': (energy[-1] / energy[0], ''),
    },
)
draw(FOLDER / 'dynamic_soaring.png', lambda figures: figures.figure_for(flight))
