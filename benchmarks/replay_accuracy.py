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
import time
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
FLYING = 15.0  # m/s; slower, a vehicle that rolls may be taxiing, and stands on its wheels
LEVEL_LOAD = 0.7  # g; recorded roll is the lift's only where there is lift
COUNTED = 20  # fewer samples are no statistic

QUANTITIES = {
    'speed': ('m/s', 'groundspeed_abs_err_mps_median_p95'),
    'gamma': ('deg', 'gamma_abs_err_deg_median_p95'),
    'track': ('deg', 'track_abs_err_deg_median_p95'),
    'bank': ('deg', 'bank_vs_roll_abs_err_deg_median_p95'),
}


@dataclass(frozen=True)
class Compared:
    """One quantity of one flight against its truth.

    Parameters
    ----------
    error, std : array (n,)
        Replayed less recorded, and the 1-sigma stated; std is empty if none is.
    correlation : float
        Of replayed and recorded.
    """

    error: Array
    std: Array
    correlation: float

    @property
    def figures(self) -> tuple[float, float]:
        """Median and 95th percentile of the error's size."""
        size = np.abs(self.error)
        return float(np.median(size)), float(np.percentile(size, 95))

    @property
    def inside(self) -> float:
        """Share of the errors within their 1-sigma."""
        if not self.std.size:
            return np.nan
        return float(np.mean(np.abs(self.error) < self.std))


@dataclass(frozen=True)
class Flight:
    """A flight's figures; `reference` are those of the manifest."""

    name: str
    samples: int
    seconds: float
    compared: dict[str, Compared]
    reference: dict[str, tuple[float, float]]
    gamma_finite: bool
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
    """Return how a log's replay compares with its truth."""
    with np.load(truth_path) as archive:
        truth = {name: archive[name] for name in archive.files}
    started = time.perf_counter()
    replay = replay_log(log)
    seconds = time.perf_counter() - started
    at, index = _matched(replay, truth['t_unix_ns'].astype(np.int64))
    flown = replay.trajectory

    def ours(name: str) -> Array:
        return np.asarray(flown[name][at])

    def recorded(name: str) -> Array:
        size = truth['t_unix_ns'].size
        return np.asarray(truth.get(name, np.full(size, np.nan)), float)[index]

    north, east, down = recorded('vn'), recorded('ve'), recorded('vd')
    ground = np.hypot(north, east)
    moving = ground > MOVING
    flying = ground > FLYING
    speed = np.hypot(ours('u_e'), ours('v_e'))
    wanted: dict[str, tuple[Array, Array, NDArray[np.bool_]]] = {
        'speed': (speed, ground, np.isfinite(ground)),
        'gamma': (np.degrees(ours('gamma')), np.degrees(np.arctan2(-down, ground)), moving),
        'track': (np.degrees(ours('track')), np.degrees(np.arctan2(east, north)), moving),
    }
    rolls = _rolls_with_its_lift(reference, truth)
    if rolls:
        # A multicopter's roll is its attitude; that of weightless flight has no lift to it.
        lifted = flying & (ours('load_factor') > LEVEL_LOAD)
        wanted['bank'] = (np.degrees(ours('bank')), np.degrees(recorded('roll')), lifted)
    compared = {}
    for name, (mine, theirs, usable) in wanted.items():
        known = usable & np.isfinite(theirs)
        if known.sum() < COUNTED:
            continue
        error = (mine - theirs)[known]
        if name != 'speed':
            error = (error + 180) % 360 - 180
        sigma = f'{name}_std'
        std = ours(sigma)[known] if sigma in flown else np.empty(0)
        if name != 'speed':
            std = np.degrees(std)
        correlation = float(np.corrcoef(mine[known], theirs[known])[0, 1])
        compared[name] = Compared(error, std, correlation)
    told = {
        name: tuple(reference[key]) for name, (_, key) in QUANTITIES.items() if key in reference
    }
    return Flight(
        name=log.name,
        samples=len(flown),
        seconds=seconds,
        compared=compared,
        reference=told,  # type: ignore[arg-type]
        gamma_finite=bool(np.isfinite(flown['gamma']).all()),
        independent=replay.track.velocity_ned is None,
    )


def _rolls_with_its_lift(reference: dict[str, Any], truth: dict[str, Any]) -> bool:
    """Return whether the recorded roll is that of wings: not of a multicopter."""
    if 'roll' not in truth or not np.isfinite(truth['roll']).any():
        return False
    return not reference or 'bank_vs_roll_abs_err_deg_median_p95' in reference


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
        '| flight | what | samples | error, median | 95 % | elsewhere, median | 95 % '
        '| correlation | within 1-sigma |',
        '|---|---|---|---|---|---|---|---|---|',
    ]
    for flight in flights:
        for name, found in flight.compared.items():
            unit = QUANTITIES[name][0]
            digits = 2
            median, most = found.figures
            there = flight.reference.get(name)
            other = ['', ''] if there is None else [f'{v:.{digits}f}' for v in there]
            inside = found.inside
            lines.append(
                f'| {flight.name} | {name} [{unit}] | {found.error.size} | {median:.{digits}f} '
                f'| {most:.{digits}f} | {other[0]} | {other[1]} | {found.correlation:.4f} '
                f'| {"" if np.isnan(inside) else f"{inside:.0%}"} |'
            )
    return '\n'.join(lines)


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
    print(table(flights))
    return 0


if __name__ == '__main__':
    sys.exit(main())
