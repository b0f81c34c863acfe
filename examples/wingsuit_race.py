"""From the peak of a mountain to its foot as fast as can be: where is the ground in the way?

Straight down and along the ground would be slow: what speed there is comes from the height that is
left. The ground is the limit where the mountain bulges, and nowhere else.
"""

from common import draw, output_folder, plan, save, tell

import flightdyn.numpy as np
from flightdyn.environment.surroundings import NOTHING
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem

FOLDER = output_folder(__doc__)

problem, planner = load_problem('wingsuit_race'), Planner()
flight = plan(planner, problem)
free = plan(planner, problem.with_changes(surroundings=NOTHING))

clear = flight['height_above_terrain']
touches = (clear < 0.01) & (flight['x_e'] > 1)
save(FOLDER / 'wingsuit_race.csv', flight)
tell(
    FOLDER / 'wingsuit_race.json',
    {
        'time': (flight.duration, 's'),
        'time without the mountain': (free.duration, 's'),
        'first touch of the ground at': (np.min(flight['x_e'][touches]), 'm'),
        'last touch of the ground at': (np.max(flight['x_e'][touches]), 'm'),
        'fastest': (np.max(flight['speed']), 'm/s'),
        'height at the end': (-flight['z_e'][-1], 'm'),
        'farthest below the ground': (-np.min(clear), 'm'),
    },
)
draw(FOLDER / 'wingsuit_race.png', lambda figures: figures.profile_figure(flight))
