"""The planner plans anew while the sim flies: a glide with the engine out, in wind.

Both are real nodes. The flight is recorded, replayed and drawn, and its range compared with that
of the plan that knows everything from the start.
"""

import argparse
import os
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from ..errors import FlightdynError
from ..logs.recorded import read_flights, read_plans
from ..planning.planner import Planner
from ..planning.problem_file import load_problem
from ..replay import replay_log
from ..trajectory import Trajectory
from .client import NodeTimeout, Session
from .demo import MAX_REPLAYED_POSITION, Check, print_checks
from .process import NodeProcess

PROBLEM = 'cessna152_glide'
SPEED = 55.0456  # m/s, 107 kt, as in the problem
RATE = 1.0  # Hz, of planning
SAMPLES = 20.0  # Hz
MAX_STEP = 0.01  # s
CLEARANCE = 0.5  # m, kept above the ground by plans: feedback is not exact
MIN_SHARE = 0.98  # of the range that was possible
MAX_PERIODS = 2.0  # of planning, that a plan is flown
START_S = 120.0  # for both nodes and the first plan


@dataclass(frozen=True)
class Glide:
    """What the two nodes flew.

    Parameters
    ----------
    range : float
        Where the ground was met, north of the start [m].
    optimum : Trajectory
        The plan that knows everything from the start.
    flown : Trajectory
    plan_starts : array (n,)
        When each plan came into force, since the start of the flight [s].
    """

    range: float
    optimum: Trajectory
    flown: Trajectory
    plan_starts: np.ndarray[Any, np.dtype[np.float64]]

    def checks(self) -> list[Check]:
        """Return the figures, and what is promised of them."""
        possible = float(self.optimum['x_e'][-1])
        lost = 100 * (1 - self.range / possible)
        return [
            Check('range flown', self.range, 'm'),
            Check('range of the plan that knows everything', possible, 'm'),
            Check('lost of it', lost, '%', 100 * (1 - MIN_SHARE)),
            Check('plans', float(self.plan_starts.size), ''),
            Check('longest flown', self.longest_flown(), 's', MAX_PERIODS / RATE),
        ]

    def longest_flown(self) -> float:
        """Return how long the plan was flown that was flown longest, but for the last [s]."""
        return float(np.diff(self.plan_starts).max(initial=0.0))


def fly_glide(
    recording: Path, altitude: float, wind: tuple[float, float, float], real_time_factor: float
) -> Glide:
    """Return the glide that planner and sim nodes fly together.

    Parameters
    ----------
    recording : Path
        MCAP file; it is replaced.
    altitude : float
        At the start [m].
    wind : north, east, down [m/s]
        Where the air moves to; the planner knows it.
    real_time_factor : float

    Raises
    ------
    FlightdynError
        If nothing is planned, or the flight does not come down.
    """
    settings = [f'initial.altitude={altitude}', f'wind_ned={list(wind)}']
    guess = [f'guess.altitude=[{altitude}, 0]', f'guess.x_e=[0, {15 * altitude}]']
    best = Planner().plan(load_problem(PROBLEM, [*settings, *guess]))
    if not best.report.verified:
        raise FlightdynError(f'planning failed: {best.report.message}')
    again = [settings[1], *guess, f'path.altitude=[{CLEARANCE}, null]']
    again.append(f'duration={{lower: 1, upper: 2000, guess: {best.report.final_time:.0f}}}')
    timeout = START_S + 3 * best.report.final_time / real_time_factor
    with (
        tempfile.TemporaryDirectory() as logs,
        NodeProcess(
            'sim',
            env={'ROS_LOG_DIR': logs},
            vehicle='cessna152',
            initial=f'{{altitude: {altitude}, speed: {SPEED}}}',
            tracking='open_loop',  # what the planner reckons with until its next plan begins
            new_plan='join',
            after_plan='hold',
            on_ground='stop',
            wind_ned=list(wind),
            rate=SAMPLES,
            max_step=MAX_STEP,
            real_time_factor=real_time_factor,
            record=str(recording.absolute()),
        ) as sim,
        Session() as session,
    ):
        from flightdyn_msgs.msg import SimEvent

        events = session.subscribe(SimEvent, 'sim/event', timeout=START_S)
        with NodeProcess(
            'planner',
            env={'ROS_LOG_DIR': logs},
            use_sim_time=True,
            replan_problem=PROBLEM,
            replan_settings='; '.join(again),
            replan_rate=RATE,
            replan_stop_before=3.0,
        ) as planner:
            try:
                contact = events.wait(_grounded, timeout=timeout)
            except NodeTimeout:
                planner.check()
                sim.check()
                raise FlightdynError(f'the glide is not over: {sim.output[-500:]}') from None
        code = sim.stop()
        if code != 0:
            raise FlightdynError(f'sim ended with {code}: {sim.output[-500:]}')
    flown = read_flights(recording)[-1]
    starts = np.array([plan.start_ns for plan in read_plans(recording)], dtype=np.int64)
    ground = next(event for event in contact if event.kind == SimEvent.GROUND_CONTACT)
    return Glide(
        range=float(flown.sample('x_e', [ground.time])[0]),
        optimum=best.trajectory,
        flown=flown,
        plan_starts=(starts - flown.start_ns) / 1e9,
    )


def _grounded(events: list[Any]) -> bool:
    return any(event.kind == event.GROUND_CONTACT for event in events)


def main(arguments: list[str] | None = None) -> int:
    """Fly the glide; return 0 if every promise is kept."""
    parser = argparse.ArgumentParser(prog='closed_loop', description=__doc__)
    parser.add_argument('folder', nargs='?', default='demo', help='where files go (demo)')
    parser.add_argument('--altitude', type=float, default=60.0, help='at the start [m]')
    parser.add_argument('--wind', type=float, default=-6.0, help='north component [m/s]')
    parser.add_argument('--real-time-factor', type=float, default=1.0)
    given = parser.parse_args(arguments)
    folder = Path(given.folder)
    console = Console(stderr=True)
    # nodes elsewhere on the network are not part of the demo
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    try:
        folder.mkdir(parents=True, exist_ok=True)
        recording = folder / 'glide.mcap'
        with console.status('gliding'):
            wind = (given.wind, 0.0, 0.0)
            glide = fly_glide(recording, given.altitude, wind, given.real_time_factor)
        checks = [*glide.checks(), _replayed(folder, recording, glide)]
    except (FlightdynError, OSError) as error:
        console.print(f'closed_loop: {error}', style='red', markup=False, highlight=False)
        return error.exit_code if isinstance(error, FlightdynError) else 2
    except KeyboardInterrupt:
        return 130
    print_checks(checks, folder)
    return 0 if all(check.kept for check in checks) else 1


def _replayed(folder: Path, recording: Path, glide: Glide) -> Check:
    """Replay and draw the recording; return how far the replay is off the flight."""
    from ..viewing.rerun_view import save_rrd

    replayed, flown = replay_log(recording).trajectory, glide.flown
    save_rrd(folder / 'glide.rrd', flown, planned=glide.optimum, name='glide')
    at = replayed.time + (replayed.start_ns - flown.start_ns) / 1e9
    gaps = [replayed[name] - flown.sample(name, at) for name in ('x_e', 'y_e', 'z_e')]
    off = float(np.linalg.norm(gaps, axis=0).max())
    return Check('replayed against flown: position', off, 'm', MAX_REPLAYED_POSITION)


if __name__ == '__main__':
    sys.exit(main())
