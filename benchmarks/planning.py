"""Trajectories planned by flightdyn and by AeroSandbox in the same run.

Run: python benchmarks/planning.py [--runs N] [--json] [CASE ...]. Each solve is a process of its
own: start-up, building, solving. Printed are medians, and the median of the pairs' ratios.
AeroSandbox states the same problems with trapezoidal collocation on the textbook's meshes;
flightdyn solves its shipped problems as they are and verifies each plan by flying it again, which
AeroSandbox leaves to the user. What flightdyn compiles for a large model is there already, from
the run that is not counted; AeroSandbox evaluates its aerodynamics in the loop.
"""

import argparse
import json
import statistics
import subprocess
import sys
import time

from rich.console import Console
from rich.table import Table

OURS = """
import json, time
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem import load_problem
begin = time.perf_counter()
planner, problem = Planner(), load_problem('{problem}')
plan = planner.plan(problem)
cold = time.perf_counter() - begin
assert plan.report.verified
begin = time.perf_counter()
planner.plan(problem)
again = time.perf_counter() - begin
print(json.dumps({{'value': plan.report.objective, 'plan_s': cold, 'again_s': again}}))
"""

HEAD = """
import json, time
import aerosandbox as asb
import aerosandbox.numpy as np
opti = asb.Opti()
"""

TAIL = """
sol = opti.solve(verbose=False)
print(json.dumps({'value': float(sol(value)), 'plan_s': time.perf_counter() - begin}))
"""

FLIP = """
begin = time.perf_counter()
n = 80
value = opti.variable(init_guess=1, lower_bound=0)
grid = np.linspace(0, value, n)
state = {name: opti.variable(init_guess=0, n_vars=n) for name in ('z_e', 'u_b', 'w_b', 'q')}
state['x_e'] = opti.variable(init_guess=np.linspace(0, 1, n))
state['theta'] = opti.variable(init_guess=np.linspace(0, -2 * np.pi, n))
dyn = asb.DynamicsRigidBody2DBody(
    mass_props=asb.MassProperties(mass=0.1, Ixx=1, Iyy=0.0005, Izz=1), **state
)
left = opti.variable(init_guess=0.5, n_vars=n, lower_bound=0, upper_bound=1)
right = opti.variable(init_guess=0.5, n_vars=n, lower_bound=0, upper_bound=1)
dyn.add_force(Fz=-(left + right), axes='body')
dyn.add_moment(My=(right - left) * 0.05)
dyn.add_gravity_force(g=9.81)
dyn.constrain_derivatives(opti, grid)
ends = {'x_e': 1, 'theta': -2 * np.pi}
opti.subject_to([dyn.state[k][0] == 0 for k in state])
opti.subject_to([dyn.state[k][-1] == ends.get(k, 0) for k in state])
opti.minimize(value)
"""

ROCKET = """
begin = time.perf_counter()
n = 100
grid = np.linspace(0, 100, n)
mass = opti.variable(init_guess=500e3, n_vars=n)
dyn = asb.DynamicsPointMass1DVertical(
    mass_props=asb.MassProperties(mass=mass),
    z_e=opti.variable(init_guess=np.linspace(0, -100e3, n)),
    w_e=opti.variable(init_guess=-1000, n_vars=n),
)
thrust = opti.variable(init_guess=9.81 * 500e3, n_vars=n, lower_bound=0)
dyn.add_force(Fz=-thrust)
dyn.add_gravity_force(g=9.81)
dyn.constrain_derivatives(opti, grid)
opti.constrain_derivative(
    derivative=-thrust / (300 * 9.81), variable=mass, with_respect_to=grid
)
opti.subject_to([
    dyn.z_e[0] == 0, dyn.w_e[0] == 0, mass[0] == 500e3, dyn.z_e[-1] == -100e3, mass >= 0
])
value = mass[0] - mass[-1]
opti.minimize(value)
"""

GLIDE = """
def section(le, chord, airfoil, twist=0):
    return asb.WingXSec(le, chord, twist, asb.Airfoil(airfoil))

tail = [4.0386, 0, -0.6096]
airplane = asb.Airplane(
    wings=[
        asb.Wing(symmetric=True, xsecs=[
            section([0, 0, 0], 1.6256, 'naca2412'),
            section([0, 2.1336, 0.03724], 1.6256, 'naca2412'),
            section([0.10795, 5.08, 0.08866], 1.1303, 'naca0012'),
        ]),
        asb.Wing(symmetric=True, xsecs=[
            section([0, 0, 0], 1.1176, 'naca0012', -2),
            section([0.3048, 1.524, 0], 0.719138, 'naca0012', -2),
        ]).translate(tail),
        asb.Wing(xsecs=[
            section([-1.524, 0, 0], 2.6416, 'naca0012'),
            section([0, 0, 0.3048], 1.1176, 'naca0012'),
            section([0.2032, 0, 1.524], 0.8128, 'naca0012'),
        ]).translate(tail),
    ],
    fuselages=[
        asb.Fuselage(xsecs=[
            asb.FuselageXSec(xyz_c=[x, 0, z], radius=r, shape=s)
            for x, z, r, s in [
                (0, -0.3048, 1e-9, 2), (0, -0.3048, 0.4572, 4), (0.9144, -0.25908, 0.51816, 4),
                (1.524, 0, 0.82296, 3), (3.1496, 0.09144, 0.70104, 3),
                (6.6802, 0.24384, 0.09144, 2),
            ]
        ]).translate([-1.524, 0, -0.9144]).subdivide_sections(2)
    ],
)
begin = time.perf_counter()
n, start = 50, {'x_e': 0, 'z_e': -1000, 'speed': 107 * 1852 / 3600, 'gamma': 0}
grid = np.cosspace(0, opti.variable(init_guess=180, log_transform=True), n)
dyn = asb.DynamicsPointMass2DSpeedGamma(
    mass_props=asb.MassProperties(mass=1151.8 * 0.45359237),
    x_e=opti.variable(init_guess=start['speed'] * np.linspace(0, 180, n)),
    z_e=opti.variable(init_guess=np.linspace(-1000, 0, n)),
    speed=opti.variable(init_guess=start['speed'], n_vars=n),
    gamma=opti.variable(
        init_guess=0, n_vars=n, lower_bound=-np.pi / 2, upper_bound=np.pi / 2
    ),
    alpha=opti.variable(init_guess=5, n_vars=n, lower_bound=-5, upper_bound=15),
)
opti.subject_to([dyn.state[k][0] == v for k, v in start.items()])
dyn.add_gravity_force(g=9.81)
dyn.add_force(*asb.AeroBuildup(airplane=airplane, op_point=dyn.op_point).run()['F_w'], axes='wind')
opti.subject_to(dyn.altitude > 0)
dyn.constrain_derivatives(opti, grid)
value = dyn.x_e[-1]
opti.minimize(-value)
"""

CASES = {
    'quadcopter_flip': (FLIP, 's', 'optimum 0.824074 s'),
    'rocket_climb': (ROCKET, 'kg', 'infimum 198,686 kg'),
    'cessna152_glide': (GLIDE, 'm', 'converged 20,921 m'),
}


def run(code: str) -> dict[str, float]:
    """Return what a process reports, and how long it took as a whole."""
    begin = time.perf_counter()
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    whole = time.perf_counter() - begin
    return {**json.loads(done.stdout.splitlines()[-1]), 'process_s': whole}


def measure(case: str, runs: int) -> dict[str, float]:
    """Return medians of a case."""
    ours, peer = OURS.format(problem=case), HEAD + CASES[case][0] + TAIL
    run(ours)  # the first of each fills caches and is not counted
    run(peer)
    pairs = [(run(ours), run(peer)) for _ in range(runs)]
    found = {'again_s': statistics.median(pair[0]['again_s'] for pair in pairs)}
    for key in ('plan_s', 'process_s'):
        found[f'ours_{key}'] = statistics.median(pair[0][key] for pair in pairs)
        found[f'peer_{key}'] = statistics.median(pair[1][key] for pair in pairs)
        found[f'ratio_{key}'] = statistics.median(pair[1][key] / pair[0][key] for pair in pairs)
    found['ours_value'], found['peer_value'] = (pairs[0][i]['value'] for i in range(2))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description='Plan with flightdyn and with AeroSandbox.')
    # argparse checks the empty list, too
    parser.add_argument('case', nargs='*', choices=[*CASES, []], help='default: all')
    parser.add_argument('--runs', type=int, default=5)
    parser.add_argument('--json', action='store_true')
    arguments = parser.parse_args()
    table = Table(title='flightdyn / AeroSandbox, medians')
    for column in ('case', 'plan [s]', 'ratio', 'again [s]', 'process [s]', 'ratio', 'value', ''):
        table.add_column(column)
    results = {}
    for case in arguments.case or CASES:
        found = results[case] = measure(case, arguments.runs)
        table.add_row(
            case,
            f'{found["ours_plan_s"]:.3f} / {found["peer_plan_s"]:.3f}',
            f'{found["ratio_plan_s"]:.1f}',
            f'{found["again_s"]:.3f}',
            f'{found["ours_process_s"]:.2f} / {found["peer_process_s"]:.2f}',
            f'{found["ratio_process_s"]:.1f}',
            f'{found["ours_value"]:.7g} / {found["peer_value"]:.7g} {CASES[case][1]}',
            CASES[case][2],
        )
    if arguments.json:
        print(json.dumps(results))
    else:
        Console(width=140).print(table)


if __name__ == '__main__':
    main()
