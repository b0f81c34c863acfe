"""How well a Cessna 152 glides at 107 kt: lift, drag and their ratio over the angle of attack.

Twice: as clean as its geometry, and with the drag of what the geometry leaves out (struts, landing
gear, stopped propeller, cooling), which halves the best glide.
"""

from common import draw, output_folder, tell

import flightdyn as fd
import flightdyn.numpy as np
from flightdyn.tables import write_table
from flightdyn.units import knot
from flightdyn.vehicles.vehicle import load_vehicle

FOLDER = output_folder(__doc__)

alpha = np.linspace(-10, 15, 2501)  # deg
polars, found = {}, {}
for name in ('cessna152', 'cessna152_calibrated'):
    state = fd.DynamicsPointMass2DSpeedGamma(speed=107 * knot, alpha=alpha)  # at sea level
    columns = {'alpha': alpha, **load_vehicle(name).aerodynamics.attach(state, {})}
    polars[name] = {key: columns[key] for key in ('alpha', 'CL', 'CD')}
    glide = columns['CL'] / columns['CD']
    best = np.argmax(glide)
    found |= {
        f'best glide ratio of {name}': (glide[best], ''),
        f'at alpha, {name}': (alpha[best], 'deg'),
        f'at CL, {name}': (columns['CL'][best], ''),
        f'largest CL of {name}': (np.max(columns['CL']), ''),
        f'least CD of {name}': (np.min(columns['CD']), ''),
    }
    write_table(polars[name], FOLDER / f'{name}_polar.csv')
tell(FOLDER / 'cessna152_polar.json', found)
draw(
    FOLDER / 'cessna152_polar.png',
    lambda figures: figures.polar_figure(polars, title='Cessna 152 at 107 kt and sea level'),
)
