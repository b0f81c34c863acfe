"""A quadcopter is 5 % heavier than its planner believes. Does it still flip?

The plan leaves 5 % of the rotors' range to the controller, which is designed for the vehicle as it
is believed to be. Flown open-loop, the same plan ends elsewhere.
"""

from common import draw, output_folder, plan, save, tell

import flightdyn.numpy as np
from flightdyn.control import track
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem
from flightdyn.simulation.simulator import Simulator, fly
from flightdyn.vehicles.vehicle import load_vehicle

FOLDER = output_folder(__doc__)
RESERVE = [f'path.thrust_{side}=[0.05, 0.95]' for side in ('left', 'right')]
OFF = ['mass=0.105', 'inertia.Iyy=0.000525']  # 5 % more of both

believed, built = load_vehicle('quadcopter'), load_vehicle('quadcopter', settings=OFF)
planned = plan(Planner(), load_problem('quadcopter_flip', RESERVE))
initial = {name: values[0] for name, values in planned.states.items()}
found = {'duration of the flip': (planned.duration, 's')}
for name, controls in (('open-loop', planned), ('by feedback', track(believed, planned))):
    flown = fly(Simulator(built.model(), initial, controls), planned.duration, 200)
    save(FOLDER / f'tracked_flip_{name.replace(" ", "_")}.csv', flown)
    missed = np.hypot(flown['x_e'][-1] - 1, flown['z_e'][-1])
    found[f'place missed {name}'] = 100 * missed, 'cm'
    found[f'turned {name}'] = np.degrees(flown['theta'][-1]), 'deg'
tell(FOLDER / 'tracked_flip.json', found)
draw(FOLDER / 'tracked_flip.png', lambda figures: figures.flip_figure(flown))
