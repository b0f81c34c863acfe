"""A racing quadcopter turns over once on its way to a place ahead and to the right.

The attitude is a quaternion: one turn more ends at the quaternion with the other sign. So the flip
is asked for by the sign of qw at the end; with the other sign there is none.
"""

from common import draw, output_folder, plan, save, tell

import flightdyn.numpy as np
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem

FOLDER = output_folder(__doc__)

planner = Planner()
problem = load_problem('quadcopter_flip_3d')
flight = plan(planner, problem)
straight = plan(
    planner,
    problem.with_changes(
        final={'qw': (0, np.inf)},
        guess=dict.fromkeys(problem.vehicle.rotors, (4,)),
    ),
)
rate = np.hypot(flight['p'], flight['q'], flight['r'])
turned = np.sum(0.5 * (rate[1:] + rate[:-1]) * np.diff(flight.time))
lowest, highest = np.min(-flight['z_e']), np.max(-flight['z_e'])
length = np.sqrt(sum(flight[name] ** 2 for name in ('qw', 'qx', 'qy', 'qz')))
tell(
    FOLDER / 'quadcopter_flip_3d.json',
    {
        'duration with the flip': (flight.duration, 's'),
        'duration without': (straight.duration, 's'),
        'turned in all': (np.degrees(turned), 'deg'),
        'height used': (highest - lowest, 'm'),
        'fastest turn': (np.max(rate), 'rad/s'),
        'length of the quaternion off 1': (np.max(np.abs(length - 1)), ''),
    },
)
save(FOLDER / 'quadcopter_flip_3d.csv', flight)
names = ['qw', 'qx', 'qy', 'qz', 'p', 'q', 'r']
draw(FOLDER / 'quadcopter_flip_3d.png', lambda figures: figures.history_figure(flight, names))
