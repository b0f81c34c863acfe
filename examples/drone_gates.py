"""How fast can a racing quadcopter fly through six gates, and is there a faster way?

The plan from the problem's own guess, straight from gate to gate, is compared with another's,
bent and stretched at random. Raise `STARTS` for more.
"""

import sys

from common import draw, output_folder, save, tell

import flightdyn.numpy as np
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem
from flightdyn.planning.remedies import perturbed

FOLDER = output_folder(__doc__)
STARTS = 2

problem = load_problem('drone_gates')
planner = Planner()
plans = [planner.plan(perturbed(problem, i) if i else problem) for i in range(STARTS)]
if not plans[0].report.verified:
    sys.exit(plans[0].report.message)
flight = plans[0].trajectory
times = [each.report.final_time for each in plans if each.report.verified]
tilt = np.degrees(np.arccos(np.cos(flight['phi']) * np.cos(flight['theta'])))
found = {
    'duration': (times[0], 's'),
    'duration of the best start': (min(times), 's'),
    'fastest': (np.max(flight['speed']), 'm/s'),
    'most load factor': (np.max(flight['load_factor']), 'g'),
    'most tilt': (np.max(tilt), 'deg'),
}
before = 0.0
for gate in plans[0].surroundings.gates:
    ahead = (np.abs(flight[f'{gate.name}_along']) < 1e-3) & (flight.time > before)
    before = float(flight.time[np.argmax(ahead)])
    found[f'time at {gate.name}'] = (before, 's')
tell(FOLDER / 'drone_gates.json', found)
save(FOLDER / 'drone_gates.csv', flight)
draw(FOLDER / 'drone_gates.png', lambda figures: figures.figure_for(flight, plans[0].surroundings))
