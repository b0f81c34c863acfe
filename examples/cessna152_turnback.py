"""The engine stops after take-off: on how little height can a Cessna 152 turn back to its runway?

It starts level at 65 kt through the air, and comes back over the same place the other way, no
slower. In calm air, and in wind along the runway, both ways round are alike. In a wind from the
side they are as unlike as can be; an optimiser stays with the one it was told, so plan both.
"""

from functools import cache
from itertools import product

from common import draw, output_folder, plan, save, tell

import flightdyn.numpy as np
from flightdyn import Trajectory
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem
from flightdyn.tables import write_table

FOLDER = output_folder(__doc__)
RUNWAY = np.radians(240)  # heading of the take-off
SPEEDS = (0.0, 5.0, 10.0)  # m/s, of the wind
LEFT, RIGHT = -1, 1
CASES = {  # where the wind comes from, off the runway's heading [deg], and the way round
    'headwind': (0, RIGHT),
    'tailwind': (180, RIGHT),
    'side wind, turning into it': (90, RIGHT),
    'side wind, turning with it': (90, LEFT),
}

shipped = load_problem('cessna152_turnback')  # takes off to the north and turns right in the end
planner = Planner()


@cache
def turn_back(off: float, speed: float, side: int) -> Trajectory:
    """Return the flight on least height in a wind from an angle off the runway [rad]."""
    goes = RUNWAY + off + np.pi
    ahead, aside = np.array(shipped.guess['x_e']), side * np.array(shipped.guess['y_e'])
    problem = shipped.with_changes(
        initial={'track': (RUNWAY, RUNWAY)},
        final={'track': (RUNWAY + side * np.pi, RUNWAY + side * np.pi)},
        wind_ned=(speed * np.cos(goes), speed * np.sin(goes), 0.0),
        guess={
            **shipped.guess,
            'x_e': tuple(ahead * np.cos(RUNWAY) - aside * np.sin(RUNWAY)),
            'y_e': tuple(ahead * np.sin(RUNWAY) + aside * np.cos(RUNWAY)),
            'track': tuple(RUNWAY + side * np.array(shipped.guess['track'])),
            'bank': tuple(side * np.array(shipped.guess['bank'])),
        },
    )
    return plan(planner, problem)


lost, strongest = {name: [] for name in CASES}, {}
for (name, (off, side)), speed in product(CASES.items(), SPEEDS):
    strongest[name] = flight = turn_back(np.radians(off if speed else 0), speed, side)
    lost[name].append(flight['z_e'][-1] - flight['z_e'][0])
    save(FOLDER / f'turnback_{name.replace(", ", "_").replace(" ", "_")}_{speed:g}.csv', flight)
tell(
    FOLDER / 'cessna152_turnback.json',
    {
        f'height lost, {speed:g} m/s {name}': (lost[name][i], 'm')
        for name, (i, speed) in product(CASES, enumerate(SPEEDS))
    },
)
write_table({'wind': SPEEDS, **lost}, FOLDER / 'cessna152_turnback.csv')
cases = list(product(CASES, SPEEDS))
table = {
    'wind': [speed for _, speed in cases],
    'case': [name for name, _ in cases],
    'height lost': [value for name in CASES for value in lost[name]],
}
units = {'wind': 'm/s', 'height lost': 'm'}
draw(
    FOLDER / 'turnback_wind.png',
    lambda figures: figures.sweep_figure(table, ['wind', 'case'], 'height lost', units=units),
)
draw(FOLDER / 'turnback_10.png', lambda figures: figures.tracks_figure(strongest))
