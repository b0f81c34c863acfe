"""The minimum-time flip, planned by flightdyn and by AeroSandbox in the same run.

Each solve is a process of its own: start-up, building, solving. Printed are medians and the ratio.
AeroSandbox states the same problem with trapezoidal collocation on 80 nodes; flightdyn solves on
80 intervals and verifies the plan, which AeroSandbox leaves to the user.
"""

import json
import statistics
import subprocess
import sys
import time

RUNS = 5

OURS = """
import json, time
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem import load_problem
planner, problem = Planner(), load_problem('quadcopter_flip')
begin = time.perf_counter()
plan = planner.plan(problem)
cold = time.perf_counter() - begin
begin = time.perf_counter()
planner.plan(problem)
warm = time.perf_counter() - begin
print(json.dumps({'final_time': plan.report.final_time, 'plan_s': cold, 'again_s': warm}))
"""

PEER = """
import json, time
import aerosandbox as asb
import aerosandbox.numpy as np
begin = time.perf_counter()
n = 80
opti = asb.Opti()
final = opti.variable(init_guess=1, lower_bound=0)
grid = np.linspace(0, final, n)
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
opti.minimize(final)
sol = opti.solve(verbose=False)
seconds = time.perf_counter() - begin
print(json.dumps({'final_time': float(sol(final)), 'plan_s': seconds}))
"""


def run(code: str) -> dict[str, float]:
    """Return what a process reports, and how long it took as a whole."""
    begin = time.perf_counter()
    done = subprocess.run([sys.executable, '-c', code], capture_output=True, text=True, check=True)
    whole = time.perf_counter() - begin
    return {**json.loads(done.stdout.splitlines()[-1]), 'process_s': whole}


def main() -> None:
    run(OURS)  # the first of each fills the file cache and is not counted
    run(PEER)
    pairs = [(run(OURS), run(PEER)) for _ in range(RUNS)]
    print(f'{"quadcopter_flip, 80 nodes":28}{"flightdyn":>12}{"AeroSandbox":>12}{"ratio":>8}')
    for key, label in (('process_s', 'whole process [s]'), ('plan_s', 'build and solve [s]')):
        ours = statistics.median(pair[0][key] for pair in pairs)
        peer = statistics.median(pair[1][key] for pair in pairs)
        ratio = statistics.median(pair[1][key] / pair[0][key] for pair in pairs)
        print(f'{label:28}{ours:12.3f}{peer:12.3f}{ratio:8.2f}')
    again = statistics.median(pair[0]['again_s'] for pair in pairs)
    print(f'{"solve again [s]":28}{again:12.3f}')
    ours, peer = (pairs[0][i]['final_time'] for i in range(2))
    print(f'{"final time [s]":28}{ours:12.6f}{peer:12.6f}   optimum 0.824074')


if __name__ == '__main__':
    main()
