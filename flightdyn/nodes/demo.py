"""The whole path with real nodes: plan a flip, fly, record, replay, view; then a real glider."""

import argparse
import os
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from ..errors import FlightdynError
from ..export import deviation, write_flight
from ..logs.recorded import read_flights
from ..planning.plan_file import plan_document
from ..planning.report import Plan
from ..replay import Replay, replay_log
from ..resources import share_dir
from ..trajectory import Trajectory
from .client import NodeTimeout, PlannerClient, Session
from .convert import report_from_msg
from .process import NodeProcess

PROBLEM = 'quadcopter_flip'
GLIDER = Path('test') / 'data' / 'discus2_thermal.mcap'
RATE = 500.0  # Hz, so that reading the flown states between samples errs by micrometres
TIMEOUT_S = 60.0

# what the demo promises; it fails if the suite does not keep it
MAX_FLOWN_POSITION = 0.01  # m
MAX_REPLAYED_POSITION = 1.0  # m
MAX_REPLAYED_SPEED = 0.2  # m/s


@dataclass(frozen=True)
class Check:
    """A measured figure, and the most that it may be."""

    label: str
    value: float
    unit: str
    limit: float | None = None

    @property
    def kept(self) -> bool:
        return self.limit is None or self.value <= self.limit


def main(arguments: list[str] | None = None) -> int:
    """Run the demo; return 0 if every promise is kept."""
    parser = argparse.ArgumentParser(prog='demo', description=__doc__)
    parser.add_argument('folder', nargs='?', default='demo', help='where files go (demo)')
    folder = Path(parser.parse_args(arguments).folder)
    console = Console(stderr=True)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        checks = _run(folder, console)
    except FlightdynError as error:
        console.print(f'demo: {error}', style='red', markup=False, highlight=False)
        return error.exit_code
    except OSError as error:
        console.print(f'demo: {error}', style='red', markup=False, highlight=False)
        return 2
    except KeyboardInterrupt:
        return 130
    print_checks(checks, folder)
    return 0 if all(check.kept for check in checks) else 1


def _run(folder: Path, console: Console) -> list[Check]:
    recording = folder / 'flight.mcap'
    with console.status('starting planner and sim'):
        plan = _plan_and_fly(recording, console.print)
    with console.status('replaying and drawing'):
        flown = read_flights(recording)[-1]
        replay = replay_log(recording)
        checks = [
            Check('planned: time of the flip', plan.report.final_time, 's'),
            Check('solved in', plan.report.wall_s, 's'),
            Check('iterations', plan.report.iterations, ''),
            *_compare_flown(plan.trajectory, flown),
            *_compare_replayed(flown, replay.trajectory),
        ]
        _write_flip(folder, plan, flown, replay)
        glider = _glider_log()
        if glider is not None:
            checks += _replay_glider(folder, glider)
    return checks


def _plan_and_fly(recording: Path, say: Callable[[str], None]) -> Plan:
    """Return the plan that the planner node made and the sim node flew and recorded."""
    # nodes elsewhere on the network are not part of the demo
    environment = {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
    os.environ.update(environment)
    with (
        tempfile.TemporaryDirectory() as logs,
        NodeProcess('planner', env={'ROS_LOG_DIR': logs}) as planner,
        NodeProcess(
            'sim', env={'ROS_LOG_DIR': logs}, record=str(recording.absolute()), rate=RATE
        ) as sim,
        Session() as session,
    ):
        from flightdyn_msgs.msg import VehicleState

        try:
            states = session.subscribe(VehicleState, 'sim/state', timeout=TIMEOUT_S)
            iterations: list[Any] = []
            outcome = PlannerClient(session).plan(
                PROBLEM, on_feedback=iterations.append, result_timeout=TIMEOUT_S
            )
            if not outcome.succeeded or outcome.trajectory is None:
                raise FlightdynError(f'planning failed: {outcome.result.message}')
            say(f'planner: {outcome.result.message} ({len(iterations)} feedback messages)')
            # its time counts from whenever the sim takes it up, not from when it was made
            trajectory = replace(outcome.trajectory, start_ns=0)
            plan = Plan(trajectory, report_from_msg(outcome.result.report, outcome.code))
            end = trajectory.duration
            states.wait(
                lambda messages: messages and messages[-1].time >= end - 1e-9, timeout=TIMEOUT_S
            )
        except NodeTimeout:
            planner.check()
            sim.check()
            raise
        code = sim.stop()
        if code != 0:
            raise FlightdynError(f'sim ended with {code}: {sim.output[-500:]}')
    return plan


def _compare_flown(plan: Trajectory, flown: Trajectory) -> list[Check]:
    errors = deviation(flown, plan)
    position = float(np.hypot(errors['x_e'], errors['z_e']))
    return [
        Check('flown against planned: position', position, 'm', MAX_FLOWN_POSITION),
        Check('flown against planned: pitch', errors['theta'], 'rad'),
    ]


def _compare_replayed(flown: Trajectory, replayed: Trajectory) -> list[Check]:
    """Compare at the replayed samples, by date: both come from the same recording."""
    at = replayed.time + (replayed.start_ns - flown.start_ns) / 1e9
    gaps = [replayed[name] - flown.sample(name, at) for name in ('x_e', 'y_e', 'z_e')]
    velocities = [replayed[name] - flown.sample(name, at) for name in ('u_e', 'v_e', 'w_e')]
    position = float(np.linalg.norm(gaps, axis=0).max())
    velocity = float(np.linalg.norm(velocities, axis=0).max())
    return [
        Check('replayed against flown: position', position, 'm', MAX_REPLAYED_POSITION),
        Check('replayed against flown: velocity', velocity, 'm/s', MAX_REPLAYED_SPEED),
    ]


def _write_flip(folder: Path, plan: Plan, flown: Trajectory, replay: Replay) -> None:
    from ..viewing import figures
    from ..viewing.rerun_view import save_rrd

    write_flight(folder / 'plan.json', plan.trajectory, plan_document(plan))
    save_rrd(folder / 'flight.rrd', flown, planned=plan.trajectory, name='quadcopter flip')
    figures.save_figure(figures.flip_figure(plan.trajectory), folder / 'flip.png')
    figures.save_figure(figures.history_figure(plan.trajectory), folder / 'plan.png')
    compared = figures.comparison_figure(plan.trajectory, flown, replay.trajectory)
    figures.save_figure(compared, folder / 'flown.png')


def _glider_log() -> Path | None:
    """Return the shipped glider log; an installation without the tests has none."""
    for path in (share_dir() / GLIDER, Path.cwd() / GLIDER):
        if path.is_file():
            return path
    return None


def _replay_glider(folder: Path, log: Path) -> list[Check]:
    from ..replay.table import write_table
    from ..viewing import figures
    from ..viewing.rerun_view import save_rrd

    replay = replay_log(log)
    flight = replace(replay.trajectory, vehicle='Discus 2')
    write_table(flight, folder / 'glider.parquet')
    save_rrd(folder / 'glider.rrd', flight, name='Discus 2')
    figures.save_figure(figures.replay_figure(flight, track=replay.track), folder / 'glider.png')
    summary = replay.summary()
    checks = [
        Check('glider: fixes replayed', summary['used'], ''),
        Check('glider: distance', summary['distance_m'] / 1e3, 'km'),
        Check('glider: greatest speed', summary['max_speed'], 'm/s'),
        Check('glider: steepest bank', float(np.degrees(np.abs(flight['bank']).max())), 'deg'),
    ]
    truth_path = log.with_suffix('.truth.npz')
    if truth_path.is_file():
        truth = np.load(truth_path)
        bank = np.interp(truth['t_unix_ns'], flight.unix_ns, np.degrees(flight['bank']))
        error = float(np.median(np.abs(bank - truth['roll'])))
        checks.append(Check("glider: bank against the glider's own gyro, median", error, 'deg'))
    return checks


def print_checks(checks: list[Check], folder: Path) -> None:
    """Print figures beside what is promised of them, and which files there are."""
    table = Table(title='flightdyn: planned, flown, replayed')
    table.add_column('measured')
    table.add_column('value', justify='right')
    table.add_column('promised')
    for check in checks:
        verdict = ''
        if check.limit is not None:
            verdict = f'{"under" if check.kept else "NOT under"} {check.limit:g} {check.unit}'
        table.add_row(check.label, f'{check.value:.4g} {check.unit}', verdict)
    # a pipe has no width; a table that is cut helps nobody
    console = Console(width=None if sys.stdout.isatty() else 110)
    console.print(table)
    names = ' '.join(sorted(path.name for path in folder.iterdir()))
    console.print(f'written to {folder}: {names}', markup=False, highlight=False, soft_wrap=True)


if __name__ == '__main__':
    sys.exit(main())
