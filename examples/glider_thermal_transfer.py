"""From a thermal to the next: how fast to glide between them, and how far does that get a glider?

MacCready's answer: as fast as makes the average of climbing and gliding largest, which depends on
nothing but how well the glider climbs. His climb is a steady circle, his glide straight; the plan
also gets into the circle, out of it and back into the next thermal, where it arrives as it began.
"""

from common import draw, output_folder, plan, save, tell

import flightdyn.numpy as np
from flightdyn import Atmosphere
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem

FOLDER = output_folder(__doc__)

problem = load_problem('glider_thermal_transfer')
flight = plan(Planner(), problem)
distance = flight['x_e'][-1]
gliding = (flight['x_e'] > 0.35 * distance) & (flight['x_e'] < 0.65 * distance)

# steady flight by the polar: circles of every lift coefficient and bank about the thermal's axis
vehicle, thermal = problem.vehicle, problem.wind.winds[0]
polar, weight = vehicle.aerodynamics, vehicle.mass_props.mass * vehicle.gravity
density = Atmosphere(-np.mean(flight['z_e'])).density()
largest = polar.CL0 + polar.CL_alpha * np.radians(vehicle.controls['alpha'][1])


def airspeed(lift, bank):
    """Return the airspeed [m/s] at a lift coefficient in a steady turn."""
    return np.sqrt(2 * weight / (density * polar.area * lift * np.cos(bank)))


def sink(lift, bank):
    """Return the speed of sinking through the air [m/s]."""
    return airspeed(lift, bank) * (polar.CD0 + polar.k * lift**2) / (lift * np.cos(bank))


lift, bank = np.meshgrid(np.linspace(0.3, largest, 400), np.radians(np.linspace(5, 45, 400)))
radius = airspeed(lift, bank) ** 2 / (vehicle.gravity * np.tan(bank))
climbs = thermal.updraft * np.exp(-((radius / thermal.radius) ** 2)) - sink(lift, bank)
best = np.max(climbs)
lift = np.linspace(0.1, largest, 10001)
average = airspeed(lift, 0) * best / (best + sink(lift, 0))
chosen = np.argmax(average)

save(FOLDER / 'glider_thermal_transfer.csv', flight)
tell(
    FOLDER / 'glider_thermal_transfer.json',
    {
        'time': (flight.duration, 's'),
        'height climbed': (-np.min(flight['z_e']) - 600, 'm'),
        'speed of gliding': (np.mean(flight['airspeed'][gliding]), 'm/s'),
        'average speed': (distance / flight.duration, 'm/s'),
        'rate of climb, steady circle': (best, 'm/s'),
        'radius of that circle': (radius.ravel()[np.argmax(climbs)], 'm'),
        'speed of gliding, MacCready': (airspeed(lift, 0)[chosen], 'm/s'),
        'average speed, MacCready': (average[chosen], 'm/s'),
    },
)
draw(FOLDER / 'glider_thermal_transfer.png', lambda figures: figures.figure_for(flight))
