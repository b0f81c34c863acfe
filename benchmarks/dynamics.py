"""Equations of motion by flightdyn and by AeroSandbox in the same run.

Run: python benchmarks/dynamics.py [--runs N] [--json]. Each measurement is a process of its
own, the two in turn; printed are medians, and the median of the pairs' ratios. The processes run
the same code with other imports:

- for each class, one vectorised evaluation for 100,000 states: making the instance, a force in
  wind (point masses) or body axes (rigid bodies), the weight, the derivatives;
- a helium balloon rising for six hours, whose right-hand side SciPy calls with single states; of
  flightdyn also by the compiled stage function, and the flight by its own integrator.
"""

import argparse
import json
import statistics
import subprocess
import sys
import time
from typing import Any

from rich import box
from rich.console import Console
from rich.table import Table

IMPORT_OURS = """
import flightdyn as fd
import flightdyn.numpy as np
from flightdyn import gas_constant_universal
"""

IMPORT_PEER = """
import aerosandbox as fd
import aerosandbox.numpy as np
from aerosandbox.atmosphere.atmosphere import gas_constant_universal
"""

COMMON = """
import json, statistics, time
import numpy

def median_time(function, repeat):
    function()
    times = []
    for _ in range(repeat):
        begin = time.perf_counter()
        function()
        times.append(time.perf_counter() - begin)
    return statistics.median(times)

result = {}
"""

CLASSES = """
n = 100_000
rng = numpy.random.default_rng(1)
mass_props = fd.MassProperties(mass=2.0, Ixx=0.3, Iyy=0.5, Izz=0.7, Ixz=0.05)
names = '''DynamicsPointMass1DHorizontal DynamicsPointMass1DVertical DynamicsPointMass2DCartesian
DynamicsPointMass2DSpeedGamma DynamicsPointMass3DCartesian DynamicsPointMass3DSpeedGammaTrack
DynamicsRigidBody2DBody DynamicsRigidBody3DBodyEuler DynamicsRigidBody3DBodyQuaternion'''.split()
for name in names:
    if not hasattr(fd, name):
        continue
    cls = getattr(fd, name)
    state = {key: rng.uniform(0.2, 1.2, n) for key in cls().state}
    force, axes = rng.uniform(-1, 1, (3, n)), 'body' if 'Rigid' in name else 'wind'
    def derivatives():
        dyn = cls(mass_props=mass_props, **state)
        dyn.add_force(*force, axes=axes)
        dyn.add_gravity_force()
        return dyn.state_derivatives()
    result[name] = median_time(derivatives, 15)
"""

BALLOON = """
mass_rubber, helium_molar_mass = 0.005, 4.002602e-3
ground = fd.Atmosphere(altitude=0)
mass_helium = (
    ground.pressure() * (4 / 3 * np.pi * 0.127**3) * helium_molar_mass
    / (gas_constant_universal * ground.temperature())
)
mass_props = fd.MassProperties(mass=mass_rubber + mass_helium)
template = fd.DynamicsPointMass2DCartesian(mass_props=mass_props)

def attach(dyn):
    air = dyn.op_point.atmosphere
    volume = (
        mass_helium / helium_molar_mass * gas_constant_universal
        * air.temperature() / air.pressure()
    )
    radius = (volume * 3 / (4 * np.pi)) ** (1 / 3)
    dyn.add_gravity_force(g=9.81)
    dyn.add_force(Fz=-volume * air.density() * 9.81, axes='earth')
    dyn.add_force(Fx=-dyn.op_point.dynamic_pressure() * 0.4 * np.pi * radius**2, axes='wind')

def equations_of_motion(t, y):
    dyn = template.get_new_instance_with_state(template.pack_state(y))
    attach(dyn)
    return dyn.unpack_state(dyn.state_derivatives())

def fly(function):
    from scipy.integrate import solve_ivp
    span, begin = (0.0, 6 * 3600.0), time.perf_counter()
    end = solve_ivp(function, span, numpy.zeros(4), 'LSODA', numpy.linspace(*span, 300))
    return time.perf_counter() - begin, -end.y[1, -1], end.nfev

y = numpy.array([10.0, -3000.0, 0.1, -4.0])
result['balloon_call'] = median_time(lambda: equations_of_motion(0.0, y), 300)
result['balloon_flight'], result['altitude'], result['calls'] = fly(equations_of_motion)
"""

BALLOON_OF_STAGE = """
from flightdyn.dynamics.stage import Model
from flightdyn.simulation.integrator import integrate
begin = time.perf_counter()
stage = Model(
    vehicle='balloon', dynamics=type(template), mass_props=mass_props, controls={},
    attach=lambda dyn, u: attach(dyn),
).stage()
function = stage.right_hand_side()
result['stage_build'] = time.perf_counter() - begin
result['stage_call'] = median_time(lambda: function(0.0, y), 3000)
result['stage_flight'], result['stage_altitude'], result['stage_calls'] = fly(function)
begin = time.perf_counter()
flown = integrate(stage, {}, (0, 6 * 3600), rtol=1e-8, atol=1e-10)
result['cvodes_flight'] = time.perf_counter() - begin
result['cvodes_altitude'] = -flown.final_state[1]
"""

REPORT = '\nprint(json.dumps({key: float(value) for key, value in result.items()}))\n'
OURS = IMPORT_OURS + COMMON + CLASSES + BALLOON + BALLOON_OF_STAGE + REPORT
PEER = IMPORT_PEER + COMMON + CLASSES + BALLOON + REPORT

ROWS = {  # label: key of flightdyn, key of AeroSandbox
    'balloon, one call by methods': ('balloon_call', 'balloon_call'),
    'balloon, one call of the stage': ('stage_call', 'balloon_call'),
    'balloon, LSODA by methods': ('balloon_flight', 'balloon_flight'),
    'balloon, LSODA of the stage': ('stage_flight', 'balloon_flight'),
    'balloon, CVODES of the stage': ('cvodes_flight', 'balloon_flight'),
    'whole process': ('process', 'process'),
}


def run(code: str) -> dict[str, float]:
    """Return what a process reports, and how long it took as a whole."""
    begin = time.perf_counter()
    done = subprocess.run([sys.executable, '-c', code], stdout=subprocess.PIPE, check=True)
    whole = time.perf_counter() - begin
    return {**json.loads(done.stdout.splitlines()[-1]), 'process': whole}


def compare(pairs: list[tuple[dict[str, float], dict[str, float]]]) -> list[dict[str, Any]]:
    """Return a row for each measurement: medians [s] of both and of their ratios."""
    classes = {key: (key, key) for key in pairs[0][0] if key.startswith('Dynamics')}
    rows = []
    for label, (ours, peer) in {**classes, **ROWS}.items():
        row: dict[str, Any] = {
            'what': label,
            'flightdyn_s': statistics.median(pair[0][ours] for pair in pairs),
        }
        if peer in pairs[0][1]:
            row['aerosandbox_s'] = statistics.median(pair[1][peer] for pair in pairs)
            row['ratio'] = statistics.median(pair[1][peer] / pair[0][ours] for pair in pairs)
        rows.append(row)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition('\n')[0])
    parser.add_argument('--runs', type=int, default=5, help='pairs of processes (5)')
    parser.add_argument('--json', action='store_true', help='print JSON instead of a table')
    options = parser.parse_args()
    run(OURS)  # the first of each fills the file cache and is not counted
    run(PEER)
    pairs = [(run(OURS), run(PEER)) for _ in range(options.runs)]
    rows, (ours, peer) = compare(pairs), pairs[0]
    flights = {
        'flightdyn, LSODA by methods': (ours['altitude'], ours['calls']),
        'flightdyn, LSODA of the stage': (ours['stage_altitude'], ours['stage_calls']),
        'flightdyn, CVODES at rtol 1e-8': (ours['cvodes_altitude'], None),
        'AeroSandbox, LSODA': (peer['altitude'], peer['calls']),
    }
    if options.json:
        ends = {k: {'altitude_m': v, 'calls': calls} for k, (v, calls) in flights.items()}
        print(json.dumps({'measurements': rows, 'balloon_flights': ends}, indent=1))
        return
    table = Table(box=box.SIMPLE)
    table.add_column('equations of motion')
    for name in ('flightdyn, ms', 'AeroSandbox, ms', 'ratio'):
        table.add_column(name, justify='right')
    for row in rows:
        peer_ms = f'{row["aerosandbox_s"] * 1e3:.3f}' if 'ratio' in row else '-'
        ratio = f'{row["ratio"]:.1f}' if 'ratio' in row else '-'
        table.add_row(row['what'], f'{row["flightdyn_s"] * 1e3:.3f}', peer_ms, ratio)
    Console().print(table)
    for label, (altitude, calls) in flights.items():
        counted = f' in {calls:.0f} calls' if calls is not None else ''
        print(f'  {label:32}{altitude / 1e3:8.3f} km after six hours{counted}')


if __name__ == '__main__':
    main()
