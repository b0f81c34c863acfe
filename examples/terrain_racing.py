"""How fast does an aerobatic racer get through a valley, 30 m over the ground and more?

A ceiling keeps it below the tops; how low and how hard it turns, the fastest flight decides.
Without the ceiling it goes straight.
"""

from common import draw, output_folder, plan, save, tell

import flightdyn.numpy as np
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem

FOLDER = output_folder(__doc__)

planner = Planner()
problem = load_problem('terrain_racing')
flight = plan(planner, problem)
free = plan(planner, problem.with_changes(path={'altitude': (-np.inf, 600)}))
distance = np.sum(np.hypot(*(np.diff(flight[axis]) for axis in ('x_e', 'y_e', 'z_e'))))
tell(
    FOLDER / 'terrain_racing.json',
    {
        'duration': (flight.duration, 's'),
        'duration over the tops': (free.duration, 's'),
        'distance flown': (distance / 1e3, 'km'),
        'fastest': (np.max(flight['airspeed']), 'm/s'),
        'least height above the terrain': (np.min(flight['height_above_terrain']), 'm'),
        'half of the time lower than': (np.median(flight['height_above_terrain']), 'm'),
        'most load factor': (np.max(flight['load_factor']), 'g'),
    },
)
save(FOLDER / 'terrain_racing.csv', flight)
draw(
    FOLDER / 'terrain_racing.png',
    lambda figures: figures.tracks_figure({'below 230 m': flight, 'over the tops': free}),
)
