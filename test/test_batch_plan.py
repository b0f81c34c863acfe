"""Sweeps: the same table from any number of processes, however often it was broken off."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from flightdyn import batch_plan
from flightdyn.batch import JOURNAL, SUMMARY, Batch, Job, Row
from flightdyn.batch_plan import digest, plan_job, sweep_jobs
from flightdyn.cli import main
from flightdyn.errors import InputError, NotConvergedError, ResultCode
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem
from flightdyn.planning.sweep_file import load_sweep
from flightdyn.tables import read_table

pytest.importorskip('distributed')

TIMES = ('wall_s',)
"""What differs from run to run."""
FLIP: dict[str, Any] = {
    'problem': 'quadcopter_flip',
    'over': {'final.x_e': {'from': 0.5, 'to': 2, 'steps': 8}, 'final.z_e': [0, -0.1, -0.2]},
    'settings': {'nodes': 12, 'sharpen': False, 'max_wall_time': 600},
    'value': {'highest': 'largest.altitude'},
    'picture': False,
}


def write(folder: Path, **changes: Any) -> str:
    path = folder / 'sweep.yaml'
    path.write_text(yaml.safe_dump({**FLIP, **changes}, sort_keys=False))
    return str(path)


def serial(jobs: list[Job], folder: Path) -> dict[str, Row]:
    """Do jobs in this process, one by one."""
    rows = {}
    for job in jobs:
        path = folder / job.output
        path.parent.mkdir(parents=True, exist_ok=True)
        row = plan_job(path, **job.arguments)
        rows[job.key] = {**job.columns, **row}
    return rows


def same(rows: dict[str, Row], others: dict[str, Row]) -> None:
    assert rows.keys() == others.keys()
    for key, row in rows.items():
        for name, value in row.items():
            if name not in TIMES:
                assert others[key][name] == value, (key, name)


def test_results_do_not_depend_on_what_a_process_did_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    over = {'final.x_e': [1.0, 1.1, 1.2, 1.3]}
    jobs = sweep_jobs(load_sweep(write(tmp_path, over=over)))
    rows = serial(jobs, tmp_path / 'there')
    batch_plan._planner.cache_clear()
    monkeypatch.setattr(batch_plan, '_kept', type(batch_plan._kept)())
    monkeypatch.setattr(batch_plan, 'MAX_KEPT', 1)
    same(rows, serial(jobs[::-1], tmp_path / 'back'))
    assert len(batch_plan._kept) == 1


@pytest.mark.slow
@pytest.mark.timeout(400)  # three times processes are started, on a machine that may be busy
def test_killed_and_resumed_it_gives_what_the_serial_run_does(tmp_path: Path) -> None:
    path, out = write(tmp_path), tmp_path / 'out'
    command = [sys.executable, '-m', 'flightdyn', 'batch', 'plan', path, '-o', str(out)]
    process = subprocess.Popen(
        [*command, '--workers', '1'], stderr=subprocess.DEVNULL, start_new_session=True
    )
    jobs = sweep_jobs(load_sweep(path))
    rows = serial(jobs, tmp_path / 'serial')
    deadline = time.monotonic() + 200
    journal = out / JOURNAL
    while not (journal.exists() and journal.read_text().count('\n') >= 2):
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert not (out / SUMMARY).exists()
    with Batch(out, jobs, plan_job) as batch:
        before = dict(batch.rows)
        assert 2 <= len(before) < len(jobs)
        at = {key: (out / row['output']).stat().st_mtime_ns for key, row in before.items()}
        done = [row['key'] for row in batch.run(workers=2)]
        assert sorted([*done, *before]) == [job.key for job in jobs]
        batch.write_summary()
        same(rows, batch.rows)
    for job in jobs:
        assert at.get(job.key) in (None, (out / job.output).stat().st_mtime_ns)
        flights = [read_table(tmp_path / each / job.output)[0] for each in ('out', 'serial')]
        assert flights[0].keys() == flights[1].keys()
        for name in flights[0]:
            np.testing.assert_array_equal(flights[0][name], flights[1][name])
    assert read_table(out / SUMMARY)[0]['key'].tolist() == [job.key for job in jobs]
    starts = [row['start'] for row in rows.values()]
    assert starts.count('near') > len(jobs) / 2  # what starting near others is for
    assert all(row['verified'] for row in rows.values())
    # and about what each would give by itself: controls are held, their switches where this case's
    # mesh or that of its neighbour has an edge, some of a hundred intervals of the duration
    for job in jobs[3::10]:
        alone = Planner().plan(load_problem('quadcopter_flip', job.arguments['settings']))
        assert rows[job.key]['objective'] == pytest.approx(alone.report.objective, rel=1e-2)


@pytest.mark.timeout(300)
def test_failures_are_told_and_kept_and_stop_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # the third is no problem at all: its end lies beyond what the path allows
    over = {'final.x_e': [1, 40, 2000], 'path.x_e': [[-100, 100]], 'duration.upper': [2]}
    arguments = ['batch', 'plan', write(tmp_path, over=over), '-o', str(tmp_path / 'out')]
    assert main([*arguments, '--workers', '1', '--json']) == 3
    told = capsys.readouterr()
    figures = json.loads(told.out)
    assert {k: figures[k] for k in ('cases', 'done', 'kept', 'failed')} == {
        'cases': 3,
        'done': 1,
        'kept': 0,
        'failed': 2,
    }
    assert len(told.err.strip().splitlines()) == 2
    table = read_table(figures['summary'])[0]
    assert table['code'].tolist() == ['SUCCESS', 'INFEASIBLE', 'BAD_REQUEST']
    assert table['exit_code'].tolist() == [0, 3, 2]
    assert 'x_e' in table['error'][1]
    assert 'lies outside the path bounds' in table['error'][2]
    assert table['final.x_e'].tolist() == [1, 40, 2000]
    assert table['verified'].tolist()[:2] == [True, False]
    # no figure of what is no plan
    assert np.isnan(table['objective'][1:].astype(float)).all()
    assert np.isnan(table['highest'][1:].astype(float)).all()
    assert table['output'].tolist() == ['plans/0.parquet', 'plans/1.parquet', None]
    last = read_table(tmp_path / 'out' / 'plans/1.parquet')[0]
    assert last['x_e'].size > 5  # where it stood
    assert main([*arguments, '--workers', '1', '--json']) == 3
    figures = json.loads(capsys.readouterr().out)
    assert (figures['done'], figures['kept'], figures['failed']) == (0, 1, 2)


def test_what_time_ran_out_for_is_tried_again(tmp_path: Path) -> None:
    sweep = load_sweep(write(tmp_path, settings={**FLIP['settings'], 'max_wall_time': 1e-6}))
    job = sweep_jobs(sweep)[0]
    with pytest.raises(NotConvergedError, match='max_wall_time') as found:
        plan_job(tmp_path / 'plan.parquet', **job.arguments)
    assert found.value.result_code == ResultCode.TIME_LIMIT
    assert not (tmp_path / 'plan.parquet').exists()


def test_nothing_is_started_that_cannot_be(tmp_path: Path) -> None:
    for changes, said in (
        ({'over': {'final.x_d': [1, 2]}}, "final: unknown 'x_d', did you mean 'x_e'"),
        ({'value': 'final.x_d'}, "value.final.x_d: unknown 'x_d', did you mean 'x_e'"),
        ({'problem': 'flip'}, "no problem 'flip'"),
    ):
        with pytest.raises(InputError) as found:
            sweep_jobs(load_sweep(write(tmp_path, **changes)))
        assert said in str(found.value)


def test_a_problem_that_has_changed_meanwhile_is_refused(tmp_path: Path) -> None:
    mine = tmp_path / 'mine.yaml'
    text = 'vehicle: quadcopter\nduration: {lower: 0.1, upper: 5, guess: 1}\n'
    mine.write_text(text)
    over = {'final.x_e': [1, 2]}
    path = write(tmp_path, problem='mine.yaml', over=over, settings={}, value={})
    jobs = sweep_jobs(load_sweep(path))
    again = sweep_jobs(load_sweep(path))
    assert [job.fingerprint for job in jobs] == [job.fingerprint for job in again]
    mine.write_text(text.replace('guess: 1', 'guess: 2'))
    changed = sweep_jobs(load_sweep(path))
    assert all(a.fingerprint != b.fingerprint for a, b in zip(jobs, changed, strict=True))
    with pytest.raises(InputError, match='have changed'):
        plan_job(tmp_path / 'plan.parquet', **jobs[0].arguments)


def test_a_digest_sees_everything() -> None:
    def made(*settings: str) -> str:
        return digest(load_problem('cessna152_turnback', settings))

    assert made() == made()
    others = ('wind_ned[1]=0.1', 'guess.alpha=7.9', 'vehicle=cessna152_calibrated', 'nodes=31')
    assert len({made(), *map(made, others)}) == 5
    long = np.zeros(10_000)  # of which repr shows six
    other = long.copy()
    other[5000] = 1e-300
    assert digest({'a': long}) != digest({'a': other})
    assert digest([1, [2]]) != digest([[1], 2])
    assert digest(frozenset('ab')) == digest(frozenset('ba'))


@pytest.mark.parametrize('start', ['near', 'cold', 'both'])
def test_starts(tmp_path: Path, start: str) -> None:
    """From the guess in the file the flip goes the way it says; near a plan, that one's way."""
    over = {'final.x_e': [1.0, 1.1, 1.2]}
    jobs = sweep_jobs(load_sweep(write(tmp_path, start=start, over=over)))
    rows = serial(jobs, tmp_path / start)
    found = [row['start'] for row in rows.values()]
    if start == 'near':
        assert found == ['near', 'cold', 'near']
        assert [len(job.arguments['leaders']) for job in jobs] == [3, 3, 3]
    else:  # near is not better than cold by more than the tolerance here
        assert found == ['cold'] * 3
    assert {job.group for job in jobs} == {'' if start == 'cold' else '1'}


def test_the_better_of_two_optima_is_taken(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A guess of the turn nose up leads to an optimum that takes longer by a fifth."""
    good = load_problem('quadcopter_flip')
    longer = load_problem('quadcopter_backflip', ['final.theta=[-360 deg, 360 deg]'])
    assert longer.guess['theta'] == (0.0, 2 * np.pi)
    better = good.with_changes(final={'theta': longer.final['theta']}, nodes=longer.nodes)
    found = batch_plan._planned(longer, [better], 'both')
    alone = Planner().plan(longer)
    assert alone.report.verified
    if found.near:
        assert found.report.objective < alone.report.objective
    else:
        assert found.report.objective == alone.report.objective


def test_problems_of_different_kinds_start_from_their_own(tmp_path: Path) -> None:
    over = {'vehicle': ['cessna152', 'cessna152_calibrated'], 'initial.altitude': [900, 1000]}
    path = write(tmp_path, problem='cessna152_glide', over=over, settings={}, value={})
    jobs = sweep_jobs(load_sweep(path))
    assert len({job.group for job in jobs}) == 2
    assert jobs[0].group == jobs[1].group
    for job in jobs:
        (vehicle,) = (s for s in job.arguments['settings'] if s.startswith('vehicle'))
        assert all(vehicle in leader for leader in job.arguments['leaders'])


def test_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip('matplotlib')
    pytest.importorskip('rerun')
    over = {'heading': {'from': -120, 'to': 120, 'steps': 3}, 'initial.altitude': [150]}
    settings = {
        'model': 'DynamicsPointMass3DSpeedGammaTrack',
        'objective': {'maximize': 'final.x_e*cos({heading}*deg) + final.y_e*sin({heading}*deg)'},
        'initial': {'x_e': 0, 'y_e': 0, 'speed': 40, 'gamma': 0, 'track': '{heading*deg}'},
        'duration.guess': 60,
        'guess.track': '{heading*deg}',
        'guess.x_e': [0, '{2000*cos(heading*deg)}'],
        'guess.y_e': [0, '{2000*sin(heading*deg)}'],
        'nodes': 15,
        'refine': False,
        'tolerance': 0.1,
        'max_wall_time': 600,
    }
    path = write(
        tmp_path,
        problem='cessna152_glide',
        over=over,
        settings=settings,
        value={},
        picture={},
        footprint={'place': {'lat': 47.3, 'lon': 11.4}},
    )
    out = tmp_path / 'out'
    assert main(['batch', 'plan', path, '-o', str(out), '--workers', '1', '--json']) == 0
    drawn = json.loads(capsys.readouterr().out)['pictures']
    assert drawn == [str(out / 'sweep.png'), str(out / 'footprint.rrd')]
    assert (out / 'sweep.png').read_bytes().startswith(b'\x89PNG')
    assert (out / 'footprint.rrd').read_bytes().startswith(b'RRF')
    table = read_table(out / SUMMARY)[0]
    # the same glide, turned round
    reach = np.hypot(table['final.x_e'], table['final.y_e'])
    np.testing.assert_allclose(reach, reach[0], rtol=0.02)
    turned = np.degrees(np.arctan2(table['final.y_e'], table['final.x_e']))
    np.testing.assert_allclose(turned, [-120, 0, 120], atol=1)
