"""How quiet can a Cessna 172 leave, past a school, a village and a farm?

The measure is the sound exposure level of all that the three hear. For comparison the same
departure as fast as it goes.
"""

from math import log10

from common import draw, output_folder, plan, save, tell

import flightdyn.numpy as np
from flightdyn.environment.noise import sound_exposure_level
from flightdyn.planning.objective import TIME
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem

FOLDER = output_folder(__doc__)

planner = Planner()
problem = load_problem('noise_departure')
flights = {
    'quiet': plan(planner, problem),
    'fast': plan(planner, problem.with_changes(objective=TIME)),
}
found = {}
for name, flight in flights.items():
    heard = {
        mark.name: sound_exposure_level(flight.time, flight[f'level_{mark.name}'])
        for mark in problem.surroundings.listeners
    }
    total = 10 * log10(sum(10 ** (level / 10) for level in heard.values()))
    found |= {
        f'exposure of all, {name}': (total, 'dB'),
        **{f'exposure at the {place}, {name}': (level, 'dB') for place, level in heard.items()},
        f'duration, {name}': (flight.duration, 's'),
        f'mean throttle, {name}': (100 * np.mean(flight['throttle']), '%'),
    }
    save(FOLDER / f'noise_departure_{name}.csv', flight)
tell(FOLDER / 'noise_departure.json', found)
draw(FOLDER / 'noise_departure.png', lambda figures: figures.tracks_figure(flights))
