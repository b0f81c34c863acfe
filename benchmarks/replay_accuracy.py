"""How far replayed flights are from what the vehicles recorded of themselves.

Run: python benchmarks/replay_accuracy.py [FOLDER ...] [-o docs/replay-accuracy.md]. A folder holds
logs and, for each, a .truth.npz: the one a MANIFEST.json names (`file`, `truth`), else the one
whose name begins the log's. Default: the logs of the tests.

A .truth.npz has, per fix, `t_unix_ns`, `vn ve vd` [m/s] or `groundspeed` and `track_deg`, and
`roll` [rad], NaN where unknown. A manifest may tell how another estimate did
(`reference_estimate_vs_truth`); it is put beside ours.
"""

import argparse
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightdyn.errors import FlightdynError
from flightdyn.replay import Replay, replay_log

Array = NDArray[np.float64]

LOGS_OF_THE_TESTS = Path(__file__).parent.parent / 'test' / 'data'
MOVING = 3.0  # m/s over the ground; slower, the recorded direction is as doubtful as ours
TAXIING = 0.1  # of the highest speed; slower, an aeroplane taxies, and turns on the spot
FLYING = 15.0  # m/s; slower, a vehicle that rolls may be taxiing, and stands on its wheels
LEVEL_LOAD = 0.7  # g; recorded roll is the lift's only where there is lift
KNOT = 1852 / 3600  # m/s; ADS-B and FLARM tell speeds in whole ones
VERTICAL_STEP = 64 * 0.3048 / 60  # m/s; ADS-B tells climb in steps of 64 feet a minute
STEPPED = 0.95  # of a record in whole units: the rest may be filled in between
COUNTED = 20  # fewer samples are no statistic

UNITS = {'speed': 'm/s', 'gamma': 'deg', 'track': 'deg', 'bank': 'deg', 'airspeed': 'm/s'}
REFERENCES = {
    'speed': 'groundspeed_abs_err_mps_median_p95',
    'gamma': 'gamma_abs_err_deg_median_p95',
    'track': 'track_abs_err_deg_median_p95',
    'bank': 'bank_vs_roll_abs_err_deg_median_p95',
}
"""How a manifest names the median and 95th percentile of another estimate's errors."""


@dataclass(frozen=True)
class Compared:
    """One quantity of one flight against its record.

    Parameters
    ----------
    error, std : array (n,)
        Replayed less recorded, and the 1-sigma stated.
    step : float or array (n,)
        Resolution of the record, 0 if none is to be seen.
    correlation : float
        Of replayed and recorded.
    """

    error: Array
    std: Array
    step: float | Array
    correlation: float

    @property
    def figures(self) -> tuple[float, float]:
        """Median and 95th percentile of the error's size."""
        size = np.abs(self.error)
        return float(np.median(size)), float(np.percentile(size, 95))

    @property
    def bias(self) -> float:
        """Median error."""
        return float(np.median(self.error))

    @property
    def inside(self) -> float:
        """Share of the errors within their 1-sigma."""
        return self._share(self.error)

    @property
    def inside_less_bias(self) -> float:
        """Share of them less the bias."""
        return self._share(self.error - self.bias)

    def _share(self, error: Array) -> float:
        return float(np.mean(np.abs(error) < np.hypot(self.std, self.step / np.sqrt(12))))


@dataclass(frozen=True)
class Flight:
    """A flight's figures; `reference` are those of the manifest.

    `independent`: replay did not see the recorded velocity.
    """

    name: str
    compared: dict[str, Compared]
    reference: dict[str, tuple[float, float]]
    finite: bool
    independent: bool


def flights_in(folder: Path) -> list[tuple[Path, Path, dict[str, Any]]]:
    """Return each log of a folder with its truth and the manifest's reference."""
    manifest = folder / 'MANIFEST.json'
    if manifest.exists():
        entries = json.loads(manifest.read_text())
        named = [(e['file'], e['truth'], e.get('reference_estimate_vs_truth')) for e in entries]
        pairs = [(folder / log, folder / truth, ref or {}) for log, truth, ref in named if truth]
        return [pair for pair in pairs if pair[0].exists() and pair[1].exists()]
    truths = sorted(folder.glob('*.truth.npz'))
    logs = [p for p in sorted(folder.iterdir()) if not p.name.endswith(('.npz', '.md'))]
    stems = [(truth, truth.name.removesuffix('.truth.npz')) for truth in truths]
    return [(log, truth, {}) for log in logs for truth, stem in stems if log.name.startswith(stem)]


def compare(log: Path, truth_path: Path, reference: dict[str, Any]) -> Flight:
    """Return how a log's replay compares with its record."""
    with np.load(truth_path) as archive:
        truth = {name: archive[name] for name in archive.files}
    replay = replay_log(log)
    at, index = _matched(replay, truth['t_unix_ns'].astype(np.int64))
    flown = replay.trajectory

    def recorded(name: str) -> Array:
        size = truth['t_unix_ns'].size
        return np.asarray(truth.get(name, np.full(size, np.nan)), float)[index]

    north, east, down = recorded('vn'), recorded('ve'), recorded('vd')
    ground = np.hypot(north, east)
    moving = ground > max(MOVING, TAXIING * float(np.nanmax(ground, initial=0.0)))
    speed = np.hypot(flown['u_e'], flown['v_e'])[at]
    deg = float(np.degrees(1.0))
    # A velocity in whole knots leaves its course open as well.
    knot = _step(ground, KNOT)
    course = np.degrees(np.arctan2(east, north))
    with np.errstate(divide='ignore', invalid='ignore'):
        course_step = np.fmax(_step(course), np.degrees(knot / ground))
        climb_step = np.degrees(_step(down, VERTICAL_STEP) / ground)
    compared = {
        'speed': _compared(speed, ground, flown['speed_std'][at], np.isfinite(ground), step=knot),
        'gamma': _compared(
            deg * flown['gamma'][at],
            deg * np.arctan2(-down, ground),
            deg * flown['gamma_std'][at],
            moving,
            turns=True,
            step=climb_step,
        ),
        'track': _compared(
            deg * flown['track'][at],
            course,
            deg * flown['track_std'][at],
            moving,
            turns=True,
            step=course_step,
        ),
    }
    airborne = np.zeros(len(flown), bool)
    for flight in replay.flights():
        airborne |= (flown.time >= flight.start) & (flown.time <= flight.end)
    airborne = airborne[at] & (ground > FLYING)
    if _rolls_with_its_lift(reference, truth):
        compared['bank'] = _compared(
            deg * flown['bank'][at],
            deg * recorded('roll'),
            deg * flown['bank_std'][at],
            airborne & (flown['load_factor'][at] > LEVEL_LOAD),
            turns=True,
        )
    if np.isfinite(recorded('tas')).any():
        through = replay_log(log, wind='circling').trajectory
        if 'airspeed' in through:
            compared['airspeed'] = _compared(
                through['airspeed'][at], recorded('tas'), through['airspeed_std'][at], airborne
            )
    return Flight(
        name=log.name,
        compared={name: found for name, found in compared.items() if found is not None},
        reference={
            name: (reference[key][0], reference[key][1])
            for name, key in REFERENCES.items()
            if key in reference
        },
        finite=all(np.isfinite(values).all() for values in flown.columns.values()),
        independent=replay.track.velocity_ned is None,
    )


def _compared(
    mine: Array,
    theirs: Array,
    std: Array,
    usable: NDArray[np.bool_],
    *,
    turns: bool = False,
    step: float | Array = 0.0,
) -> Compared | None:
    """Return the comparison where it is usable and known, None of too few samples."""
    known = usable & np.isfinite(theirs)
    if known.sum() < COUNTED:
        return None
    error = (mine - theirs)[known]
    if turns:
        error = (error + 180) % 360 - 180
    correlation = float(np.corrcoef(mine[known], theirs[known])[0, 1])
    steps = np.fmax(np.broadcast_to(step, theirs.shape)[known], _step(theirs[known]))
    return Compared(error, std[known], steps, correlation)


def _step(recorded: Array, unit: float = 1.0) -> float:
    """Return the unit where a record is in whole numbers of it, else 0."""
    number = recorded[np.isfinite(recorded)] / unit
    whole = np.abs(number - np.round(number)) < 1e-4
    return unit if number.size and np.mean(whole) >= STEPPED and np.ptp(number) > 1 else 0.0


def _rolls_with_its_lift(reference: dict[str, Any], truth: dict[str, Any]) -> bool:
    """Return whether the recorded roll is that of wings: not of a multicopter."""
    if 'roll' not in truth or not np.isfinite(truth['roll']).any():
        return False
    return not reference or REFERENCES['bank'] in reference


def _matched(replay: Replay, recorded: NDArray[np.int64]) -> tuple[Any, Any]:
    """Return which samples of the flight and of the record are of the same time.

    A log whose clock starts with the vehicle is shifted so that its first fix is the record's.
    """
    time_ns = replay.trajectory.unix_ns
    first, last = recorded.min(), recorded.max()
    if time_ns.max() < first or time_ns.min() > last:
        time_ns = time_ns + (recorded[0] - replay.track.time_ns[0])
    order = np.argsort(recorded, kind='stable')
    place = np.clip(np.searchsorted(recorded[order], time_ns), 1, recorded.size - 1)
    before, after = order[place - 1], order[place]
    late = np.abs(time_ns - recorded[before]) > np.abs(time_ns - recorded[after])
    nearest = np.where(late, after, before)
    near = np.abs(recorded[nearest] - time_ns) < 30_000_000
    return np.flatnonzero(near), nearest[near]


def table(flights: list[Flight]) -> str:
    """Return the figures as Markdown."""
    lines = [
        '| flight | what | samples | median | 95 % | bias | correlation | within 1-sigma '
        '| less bias | elsewhere: median | 95 % |',
        '|---|---|---|---|---|---|---|---|---|---|---|',
    ]
    for flight in flights:
        for name, found in flight.compared.items():
            median, most = found.figures
            there = flight.reference.get(name)
            other = ['', ''] if there is None else [f'{value:.2f}' for value in there]
            inside = [f'{share:.0%}' for share in (found.inside, found.inside_less_bias)]
            figures = [f'{median:.2f}', f'{most:.2f}', f'{found.bias:+.2f}']
            cells = [
                flight.name + ('' if flight.independent else ' *'),
                f'{name} [{UNITS[name]}]',
                str(found.error.size),
                *figures,
                f'{found.correlation:.4f}',
                *inside,
                *other,
            ]
            lines.append(f'| {" | ".join(cells)} |')
    return '\n'.join(lines)


def shortfalls(flights: list[Flight]) -> list[str]:
    """Return what is not as good as it should be, a sentence each."""
    found = []
    for flight in flights:
        if not flight.finite:
            found.append(f'{flight.name}: not all of the replay is finite')
        for name, (median, most) in flight.reference.items():
            if name in flight.compared:
                ours = flight.compared[name].figures
                for what, mine, theirs in zip(
                    ('median', '95 %'), ours, (median, most), strict=True
                ):
                    if mine > theirs + 0.005:  # what the table rounds away
                        found.append(
                            f'{flight.name}: {name}, {what} {mine:.2f} against {theirs:.2f} '
                            'elsewhere'
                        )
    return found


def document(flights: list[Flight], logs: int) -> str:
    """Return the page of docs/ that holds the table."""
    lacking = shortfalls(flights)
    lines = [f'- {text}' for text in lacking] or ['Nothing.']
    return f"""# How accurate replays are

Made by `python benchmarks/replay_accuracy.py FOLDER -o docs/replay-accuracy.md` from {logs} logs \
of aircraft, gliders and multicopters whose vehicles recorded their own speed, course, climb or \
attitude beside the positions. Replay sees the log only.

{table(flights)}

*median*, *95 %*: size of the error, replayed less recorded. *bias*: its median with the sign. \
*within 1-sigma*: share of the errors smaller than the 1-sigma that replay states; 68 % were \
ideal, if the record had no error of its own. Resolution of the record, such as whole knots, is \
allowed for; *less bias*, also a constant error, such as that of an attitude sensor mounted askew \
or of a course cut to whole degrees. *elsewhere*: a local polynomial fitted to the positions, as \
the collection of these logs states it.

`*`: the log has a velocity, which replay uses: that record is not independent.

Speed is that over the ground. Gamma and track are compared above {MOVING:g} m/s and \
{TAXIING:.0%} of the highest speed, bank above {FLYING:g} m/s in flight, where the load factor is \
above {LEVEL_LOAD:g}: without lift, recorded roll is no bank. A multicopter's roll is not \
compared. *airspeed* is with the wind out of full turns alone (`--wind circling`), against the \
recorded true airspeed.

## What the record cannot tell

- The Garmin of the light aircraft gives its own speed and course half a second late, and its \
climb two seconds late, by barometer: compared with the replay of so much earlier, its climb \
differs by half as much. Its roll is a momentary one, once a second: gusts that rock the wings \
for less than that do not show in the positions. Averaged over three seconds it agrees better, \
with a correlation of 0.995 instead of 0.991.
- Courses in IGC files are whole degrees, cut or rounded; speeds of ADS-B and FLARM whole knots, \
climb steps of 64 feet a minute.
- ADS-B positions come with stamps that are seconds off and are held between receptions; the \
recorded speed is held as well. Of these logs the median says more than the 95 %.

## Not as good as elsewhere

{chr(10).join(lines)}
""".replace('\\\n', '')


def main() -> int:
    parser = argparse.ArgumentParser(description=str(__doc__).split('\n')[0])
    parser.add_argument('folder', nargs='*', type=Path, default=[LOGS_OF_THE_TESTS])
    parser.add_argument('-o', '--output', type=Path, help='Markdown file to write')
    arguments = parser.parse_args()
    flights = []
    for folder in arguments.folder:
        for log, truth, reference in flights_in(folder):
            try:
                flights.append(compare(log, truth, reference))
            except FlightdynError as error:
                print(f'{log.name}: {error}', file=sys.stderr)
    told = [flight for flight in flights if flight.compared]
    if not told:
        print('no log with a record to compare with', file=sys.stderr)
        return 2
    print(table(told))
    for text in shortfalls(flights):
        print(text, file=sys.stderr)
    if arguments.output is not None:
        arguments.output.parent.mkdir(parents=True, exist_ok=True)
        arguments.output.write_text(document(told, len(told)), encoding='utf-8')
    return 0


if __name__ == '__main__':
    sys.exit(main())
