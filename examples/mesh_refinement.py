"""How fine does a mesh have to be? The turn back to the runway on four of them, by three methods.

Every plan is flown again with the planned controls: how far that leads from where it should be is
what the mesh costs. With steps half as long the trapezoidal rule is 4 times as near, Hermite and
Simpson's 16 times. Left to itself the planner refines the mesh until the error is within the
tolerance: the second picture shows its solves.
"""

from itertools import product

from common import draw, output_folder, tell

import flightdyn.numpy as np
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem
from flightdyn.tables import write_table

FOLDER = output_folder(__doc__)
METHODS = ('trapezoidal', 'hermite_simpson', 'radau')
NODES = (10, 20, 40, 80)

problem = load_problem('cessna152_turnback')
planner = Planner()
table = {'nodes': [], 'method': [], 'error': [], 'height lost': []}
for method, nodes in product(METHODS, NODES):
    report = planner.plan(
        problem.with_changes(transcription=method, nodes=nodes, refine=False)
    ).report
    table['nodes'].append(nodes)
    table['method'].append(method)
    table['error'].append(max(report.verification[name] for name in ('x_e', 'y_e', 'z_e')))
    table['height lost'].append(report.objective)

errors = np.reshape(np.array(table['error']), (len(METHODS), len(NODES)))
orders = -np.log(errors[:, -1] / errors[:, 0]) / np.log(NODES[-1] / NODES[0])
refined = problem.with_changes(nodes=8, tolerance=1e-5)
iterations = []
plan = planner.plan(refined, on_iteration=iterations.append)

write_table(table, FOLDER / 'mesh_refinement.csv')
tell(
    FOLDER / 'mesh_refinement.json',
    {
        **{f'order of {name}': (order, '') for name, order in zip(METHODS, orders, strict=True)},
        'error of radau on 80 intervals': (errors[-1, -1] * 1e3, 'mm'),
        'intervals that the planner needs': (plan.report.nodes, ''),
        'height lost': (plan.report.objective, 'm'),
    },
)
units, log = {'error': 'm'}, ('nodes', 'error')
draw(
    FOLDER / 'mesh_refinement.png',
    lambda figures: figures.sweep_figure(
        table, ['nodes', 'method'], 'error', units=units, log=log, title=problem.name
    ),
)
draw(
    FOLDER / 'solver_history.png',
    lambda figures: figures.convergence_figure(
        iterations, title=f'{problem.name}, {plan.report.message}'
    ),
)
