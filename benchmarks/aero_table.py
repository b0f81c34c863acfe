"""The Cessna's longest glide by its table against AeroSandbox's AeroBuildup in the loop.

Run: python benchmarks/aero_table.py [--json]. Both stand on the textbook's mesh, 50 cosine-spaced
nodes by the trapezoidal rule, and start from the table's plan. In the loop AeroBuildup is as the
textbook calls it, on the symbols of all nodes at once. Printed are the ranges, what each solve
took, and how far the table is off along AeroBuildup's optimum.
"""

import argparse
import json
import time
from typing import Any

import numpy
from aerosandbox import AeroBuildup

import flightdyn as fd
import flightdyn.numpy as np
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem import Problem
from flightdyn.planning.problem_file import load_problem
from flightdyn.planning.report import Plan
from flightdyn.vehicles.aero_buildup import airplane

MESH = ('transcription=trapezoidal', 'nodes=49', 'spacing=cosine', 'refine=false')
STATES = ('x_e', 'z_e', 'speed', 'gamma')


def in_the_loop(problem: Problem, plane: Any, plan: Plan) -> fd.DynamicsPointMass2DSpeedGamma:
    """Return the states and angles of attack of the glide that AeroBuildup allows."""
    opti, columns = fd.Opti(), plan.trajectory.columns
    end = plan.report.final_time
    nodes = numpy.asarray(np.cosspace(0, end, 50))
    guess = {
        name: numpy.interp(nodes, plan.trajectory.time, columns[name])
        for name in (*STATES, 'alpha')
    }
    bounds = {name: problem.limits(name) for name in guess}
    values = {
        name: opti.variable(init_guess=guess[name], lower_bound=lower, upper_bound=upper)
        for name, (lower, upper) in bounds.items()
    }
    grid = np.cosspace(0, opti.variable(init_guess=end, log_transform=True), 50)
    vehicle = problem.vehicle
    dyn = fd.DynamicsPointMass2DSpeedGamma(mass_props=vehicle.mass_props, **values)
    for name in STATES:
        lower, upper = problem.initial[name]
        opti.subject_to(values[name][0] == (lower + upper) / 2)
    dyn.add_gravity_force(g=vehicle.gravity)
    forces = AeroBuildup(airplane=plane, op_point=dyn.op_point).run()['F_w']
    dyn.add_force(*forces, axes='wind')
    dyn.constrain_derivatives(opti, grid)
    opti.minimize(-dyn.x_e[-1])
    return opti.solve(verbose=False)(dyn)


def compare() -> dict[str, float]:
    """Return ranges [m], times [s], and differences of the table from AeroBuildup."""
    problem, found = load_problem('cessna152_glide', MESH), {}
    plane = airplane(problem.vehicle.geometry)
    begin = time.perf_counter()
    plan = Planner().plan(problem)
    found['table_s'] = time.perf_counter() - begin
    begin = time.perf_counter()
    dyn = in_the_loop(problem, plane, plan)
    found['in_the_loop_s'] = time.perf_counter() - begin
    found['table_m'], found['in_the_loop_m'] = plan.report.objective, float(dyn.x_e[-1])
    found['difference_m'] = found['table_m'] - found['in_the_loop_m']
    exact = AeroBuildup(airplane=plane, op_point=dyn.op_point).run()
    table = problem.vehicle.aerodynamics.coefficients(dyn, {})
    found['CD_relative'] = float(abs(table['CD'] / exact['CD'] - 1).max())
    found['CL_absolute'] = float(abs(table['CL'] - exact['CL']).max())
    ratio = table['CL'] / table['CD'] / (exact['CL'] / exact['CD']) - 1
    found['glide_ratio_relative'] = float(abs(ratio).max())
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--json', action='store_true', help='print JSON instead of text')
    options = parser.parse_args()
    found = compare()
    if options.json:
        print(json.dumps(found))
        return
    print(f'range by the table        {found["table_m"]:12.2f} m in {found["table_s"]:.2f} s')
    print(
        f'range with AeroBuildup    {found["in_the_loop_m"]:12.2f} m '
        f'in {found["in_the_loop_s"]:.1f} s, from the plan by the table'
    )
    print(f'difference                {found["difference_m"]:+12.2f} m')
    print('at most along the latter:')
    print(f'  CD                      {found["CD_relative"]:12.1e} relative')
    print(f'  CL                      {found["CL_absolute"]:12.1e}')
    print(f'  CL / CD                 {found["glide_ratio_relative"]:12.1e} relative')


if __name__ == '__main__':
    main()
