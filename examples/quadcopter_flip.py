"""A quadcopter goes 1 m ahead as fast as it can, turning over once: nose down, or nose up.

Both ways are optima of their own; which one is found, the end that is asked for decides. Turning
against the way takes longer.
"""

from common import draw, output_folder, plan, save, tell

import flightdyn.numpy as np
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem

FOLDER = output_folder(__doc__)

planner = Planner()
found = {}
for name, way in (('quadcopter_flip', 'flip'), ('quadcopter_backflip', 'backflip')):
    problem = load_problem(name)
    flight = plan(planner, problem)
    thrusts = np.array([flight['thrust_left'], flight['thrust_right']])
    full = np.mean((thrusts < 0.01) | (thrusts > 0.99))  # of 0 to 1 N
    found |= {
        f'duration of the {way}': (flight.duration, 's'),
        f'highest altitude of the {way}': (np.max(-flight['z_e']), 'm'),
        f'turned in the {way}': (np.degrees(flight['theta'][-1]), 'deg'),
        f'rotors at a limit in the {way}': (100 * full, '% of the time'),
    }
    save(FOLDER / f'{name}.csv', flight)
    draw(FOLDER / f'{name}.png', lambda figures, flight=flight: figures.flip_figure(flight))
tell(FOLDER / 'quadcopter_flip.json', found)
