"""How fast every configured vehicle is simulated.

Run: python benchmarks/simulation.py [--seconds S] [--rate HZ] [--json]. Each vehicle flies for
some simulated seconds with neutral controls, in Runge-Kutta steps of 1 ms, sampled as the sim
node does but without its messages; in gusts too, and the quadcopter hovering by feedback. Printed
is simulated over process time.
"""

import argparse
import json
import sys
import time

import numpy as np
from rich.console import Console
from rich.table import Table

from flightdyn import Trajectory
from flightdyn.control.tracker import track
from flightdyn.simulation.gusts import Gusts
from flightdyn.simulation.simulator import Simulator, fly
from flightdyn.simulation.steering import Steering
from flightdyn.vehicles.vehicle import Vehicle, list_vehicles, load_vehicle

GUSTS = Gusts('moderate', 0)
START = {'speed': 40.0, 'z_e': -1000.0}  # as far as the model has such states


def neutral(vehicle: Vehicle) -> Trajectory:
    """Return controls at 0, or as near to it as their ranges allow."""
    controls = vehicle.model().controls.items()
    columns = {name: np.full(1, min(max(0.0, low), high)) for name, (low, high) in controls}
    return Trajectory(time=np.zeros(1), states={}, controls=columns)


def hover(quadcopter: Vehicle) -> Steering:
    """Return a controller that holds the quadcopter."""
    weight = quadcopter.mass_props.mass * quadcopter.gravity
    plan = Trajectory(
        time=np.array([0.0, 10.0]),
        states={name: np.zeros(2) for name in quadcopter.model().states},
        controls={name: np.full(2, weight / 2) for name in quadcopter.model().controls},
    )
    return track(quadcopter, plan)


def factor(
    vehicle: Vehicle,
    controls: Trajectory | Steering,
    gusts: Gusts | None,
    given: argparse.Namespace,
) -> float:
    """Return simulated over process time."""
    model = vehicle.model()
    initial = {name: value for name, value in START.items() if name in model.states}
    if vehicle.name == 'quadcopter':
        initial = {}
    for name in model.extra_states:  # full
        initial[name] = vehicle.limits[name][1]
    simulator = Simulator(model, initial, controls, gusts=gusts)
    simulator.advance_to(0.1)  # what is built the first time
    began = time.process_time()
    fly(simulator, given.seconds, given.rate)
    return float(given.seconds / (time.process_time() - began))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=10.0, help='simulated (10)')
    parser.add_argument('--rate', type=float, default=50.0, help='samples a second (50)')
    parser.add_argument('--json', action='store_true')
    given = parser.parse_args()
    found: dict[str, float] = {}
    for vehicle in list_vehicles():
        found[vehicle.name] = factor(vehicle, neutral(vehicle), None, given)
        if 'u_e' in vehicle.model().stage().outputs:
            found[f'{vehicle.name}, gusts'] = factor(vehicle, neutral(vehicle), GUSTS, given)
    quadcopter = load_vehicle('quadcopter')
    found['quadcopter, feedback'] = factor(quadcopter, hover(quadcopter), None, given)
    found['quadcopter, feedback, gusts'] = factor(quadcopter, hover(quadcopter), GUSTS, given)
    if given.json:
        print(json.dumps(found))
        return 0
    table = Table(
        'vehicle', 'times real time', title=f'1 kHz RK4, {given.rate:g} samples a second'
    )
    for name, value in found.items():
        table.add_row(name, f'{value:.1f}')
    Console(width=None if sys.stdout.isatty() else 100).print(table)
    return 0


if __name__ == '__main__':
    sys.exit(main())
