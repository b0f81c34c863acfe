"""The engine stops: which of four fields is reached, with how much height to spare?

Each is planned on its own, in winds from the west, for the most height over its threshold.
"""

import sys

from common import draw, output_folder, save, tell

from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem
from flightdyn.tables import write_table

FOLDER = output_folder(__doc__)
WINDS = (0.0, 5.0, 10.0)  # m/s, from the west

problem = load_problem('engine_out_any_field')
planner = Planner()
found, margins = {}, {name: [] for name, _ in problem.alternatives}
flights = {}
for wind in WINDS:
    best = planner.plan(problem.with_changes(wind_ned=(0, wind, 0)))
    if not best.report.verified:
        sys.exit(best.report.message)
    for each in best.alternatives:
        margins[each.name].append(each.objective)
        found[f'height left at the {each.name}, wind {wind:g} m/s'] = (each.objective, 'm')
    flights[f'{best.alternatives[0].name}, {wind:g} m/s'] = best.trajectory
    save(FOLDER / f'engine_out_{wind:g}.csv', best.trajectory)
tell(FOLDER / 'engine_out_any_field.json', found)
write_table({'wind': WINDS, **margins}, FOLDER / 'engine_out_any_field.csv')
table = {
    'wind from the west': [wind for wind in WINDS for _ in margins],
    'field': [name for _ in WINDS for name in margins],
    'height left': [margins[name][i] for i in range(len(WINDS)) for name in margins],
}
over, units = ['wind from the west', 'field'], {'wind from the west': 'm/s', 'height left': 'm'}
draw(
    FOLDER / 'engine_out.png',
    lambda figures: figures.sweep_figure(table, over, 'height left', units=units),
)
draw(FOLDER / 'engine_out_tracks.png', lambda figures: figures.tracks_figure(flights))
