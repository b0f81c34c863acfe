"""A rocket climbs to 100 km in 100 s, straight up, on the least fuel.

Thrust has no limit and there is no air, so that burning all at once at the start would be best:
the speed it then needs is known, and so is the fuel. A plan that is flown with a real thrust over
real steps of time takes a little more, never less.
"""

from math import exp

from common import draw, output_folder, plan, save, tell

from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem

FOLDER = output_folder(__doc__)

problem = load_problem('rocket_climb')
flight = plan(Planner(), problem)
fuel = flight['mass'][0] - flight['mass'][-1]

# one impulse: up with v0 from the ground, then without thrust: v0 T - g T^2 / 2 = 100 km
g, duration, height = 9.81, flight.duration, 100e3
v0 = height / duration + g * duration / 2
impulse = flight['mass'][0] * (1 - exp(-v0 / (300 * g)))

save(FOLDER / 'rocket_climb.csv', flight)
tell(
    FOLDER / 'rocket_climb.json',
    {
        'fuel burnt': (fuel / 1e3, 't'),
        'fuel of a single impulse': (impulse / 1e3, 't'),
        'more than that': (100 * (fuel / impulse - 1), '%'),
        'altitude at the end': (-flight['z_e'][-1] / 1e3, 'km'),
        'largest thrust': (flight['thrust'].max() / 1e6, 'MN'),
    },
)
draw(
    FOLDER / 'rocket_climb.png',
    lambda figures: figures.climb_figure(flight),
)
