"""A quadcopter flies for a second on slightly unequal rotors, and tips over.

Nothing is planned: controls are given, so the equations of motion are only integrated.
"""

from common import draw, output_folder, save, tell

import flightdyn.numpy as np
from flightdyn.simulation.scenario import load_scenario
from flightdyn.simulation.simulator import fly

FOLDER = output_folder(__doc__)

scenario = load_scenario('quadcopter_open_loop')
flight = fly(scenario.simulator(), scenario.duration, scenario.rate)

save(FOLDER / 'quadcopter_open_loop.csv', flight)
tell(
    FOLDER / 'quadcopter_open_loop.json',
    {
        'x_e at the end': (flight['x_e'][-1], 'm'),
        'altitude at the end': (-flight['z_e'][-1], 'm'),
        'highest altitude': (np.max(-flight['z_e']), 'm'),
        'pitch at the end': (np.degrees(flight['theta'][-1]), 'deg'),
    },
)
draw(FOLDER / 'quadcopter_open_loop.png', lambda figures: figures.flip_figure(flight))
