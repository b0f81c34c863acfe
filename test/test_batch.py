"""Batches: one bad job stops none, what is done is kept, nothing is left half."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flightdyn import batch as batch_module
from flightdyn.batch import JOURNAL, SUMMARY, Batch, Job, flattened, run_job, write_rows
from flightdyn.batch_replay import replay_job, replay_jobs
from flightdyn.cli import main
from flightdyn.errors import FlightdynError, InputError, LogError
from flightdyn.tables import read_table

distributed = pytest.importorskip('distributed')

GLIDER = Path(__file__).parent / 'data' / 'discus2_thermal.mcap'


def work(path: Path, *, n: int, deed: str = 'good') -> dict[str, Any]:
    """What the jobs of these tests do; run in other processes."""
    path.write_text('half')
    if deed == 'bad':
        raise LogError(f'log {n} is bad')
    if deed == 'bug':
        raise ZeroDivisionError('not foreseen')
    if deed == 'killed':
        os.kill(os.getpid(), signal.SIGKILL)
    path.write_text(f'whole {n}')
    if deed == 'said':
        return {'exit_code': 3, 'code': 'INFEASIBLE', 'error': 'that is how it is'}
    return {'square': n * n, 'process': os.getpid()}


def jobs_of(deeds: dict[str, str], fingerprint: str = '1') -> list[Job]:
    return [
        Job(key, f'in/{key}.txt', {'n': n, 'deed': deed}, fingerprint, {'n': n})
        for n, (key, deed) in enumerate(deeds.items())
    ]


def run(folder: Path, jobs: list[Job], **where: Any) -> tuple[list[str], dict[str, Any]]:
    """Run a batch; return the keys done in this run, sorted, and the summary's columns."""
    with Batch(folder, jobs, work) as batch:
        done = sorted(row['key'] for row in batch.run(**where))
        batch.write_summary()
        assert batch.pending == []
    return done, read_table(folder / SUMMARY)[0]


def files(folder: Path) -> list[str]:
    """Return what is in a folder but a batch's own files."""
    names = (p.relative_to(folder).as_posix() for p in folder.rglob('*') if p.is_file())
    return sorted(set(names) - {SUMMARY, JOURNAL})


def test_a_bad_job_stops_none_and_a_second_run_does_what_is_missing(tmp_path: Path) -> None:
    deeds = {'a': 'good', 'b': 'bad', 'c': 'killed', 'd': 'bug', 'e': 'good', 'f': 'good'}
    done, table = run(tmp_path, jobs_of(deeds), workers=2)
    assert done == list('abcdef')
    assert files(tmp_path) == ['in/a.txt', 'in/e.txt', 'in/f.txt']
    assert (tmp_path / 'in/e.txt').read_text() == 'whole 4'
    assert table['key'].tolist() == list('abcdef')
    assert table['exit_code'].tolist() == [0, 2, 1, 1, 0, 0]
    assert table['error'][1] == 'log 1 is bad'
    assert 'was killed' in table['error'][2]
    assert table['error'][3] == 'ZeroDivisionError: not foreseen'
    assert table['code'].tolist() == [
        *('SUCCESS', 'BAD_REQUEST', 'INTERNAL', 'INTERNAL', 'SUCCESS', 'SUCCESS')
    ]
    assert table['output'].tolist() == ['in/a.txt', None, None, None, 'in/e.txt', 'in/f.txt']
    assert table['n'].tolist() == list(range(6))
    np.testing.assert_array_equal(table['square'], [0, np.nan, np.nan, np.nan, 16, 25])

    (tmp_path / 'in/e.txt').unlink()
    jobs = jobs_of({**deeds, 'b': 'good', 'c': 'good', 'd': 'bad'})
    jobs[5] = jobs_of({**deeds, 'f': 'bad'}, fingerprint='2')[5]
    done, table = run(tmp_path, jobs, workers=1)
    assert done == list('bcdef')
    assert table['exit_code'].tolist() == [0, 0, 0, 2, 0, 2]
    # f's result was that of what f was before
    assert files(tmp_path) == ['in/a.txt', 'in/b.txt', 'in/c.txt', 'in/e.txt']


def test_a_failure_that_is_a_result_is_kept(tmp_path: Path) -> None:
    done, table = run(tmp_path, jobs_of({'a': 'said', 'b': 'good'}), workers=1)
    assert done == ['a', 'b']
    done, again = run(tmp_path, jobs_of({'a': 'said', 'b': 'good'}), workers=1)
    assert done == []
    for columns in (table, again):
        assert columns['code'].tolist() == ['INFEASIBLE', 'SUCCESS']
        assert columns['exit_code'].tolist() == [3, 0]
        assert columns['error'].tolist() == ['that is how it is', None]
    assert files(tmp_path) == ['in/a.txt', 'in/b.txt']


def test_a_group_is_done_by_one_process(tmp_path: Path) -> None:
    jobs = [
        replace(job, group=f'group {n // 5}')
        for n, job in enumerate(jobs_of(dict.fromkeys(map(str, range(30)), 'good')))
    ]
    done, table = run(tmp_path, jobs, workers=2)
    assert len(done) == 30
    processes = [set(part) for part in np.split(table['process'], 6)]
    assert len(set.union(*processes)) == 2
    # at the very end the one that has nothing left helps the other
    assert sum(len(each) == 1 for each in processes) >= 5


def test_nothing_to_do_starts_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with distributed.LocalCluster(
        n_workers=1, processes=False, dashboard_address=None, host='127.0.0.1', protocol='tcp'
    ) as cluster:
        address = cluster.scheduler_address
        assert address.startswith('tcp://')
        done, _ = run(tmp_path, jobs_of({'a': 'good', 'b': 'good'}), scheduler=address)
    assert done == ['a', 'b']
    monkeypatch.delattr(batch_module, '_client')
    done, table = run(tmp_path, jobs_of({'a': 'good', 'b': 'good'}))
    assert done == []
    assert table['square'].tolist() == [0, 1]


def test_no_scheduler_is_a_clear_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch_module, '_CONNECT_S', 0.5)
    with pytest.raises(InputError, match=r'no Dask scheduler answers at tcp://127\.0\.0\.1:9'):
        run(tmp_path, jobs_of({'a': 'good'}), scheduler='tcp://127.0.0.1:9')


def test_a_journal_cut_short_costs_one_job(tmp_path: Path) -> None:
    jobs = jobs_of({'a': 'good', 'b': 'good'})
    (tmp_path / 'in').mkdir()
    lines = ''
    for job in jobs:
        row = {'exit_code': 0, 'output': job.output}
        row |= run_job(work, str(tmp_path), job.output, dict(job.arguments))
        lines += json.dumps({'key': job.key, 'fingerprint': '1', 'row': row}) + '\n'
    (tmp_path / JOURNAL).write_text(lines[:-20])
    with Batch(tmp_path, jobs, work) as batch:
        assert [job.key for job in batch.pending] == ['b']
        assert batch.rows['a']['square'] == 0


def test_one_batch_at_a_time_in_a_folder(tmp_path: Path) -> None:
    jobs = jobs_of({'a': 'good'})
    with (
        Batch(tmp_path, jobs, work),
        pytest.raises(InputError, match='another batch'),
        Batch(tmp_path, jobs, work),
    ):
        pass
    with Batch(tmp_path, jobs, work) as batch:
        assert len(batch.pending) == 1


@pytest.mark.parametrize('output', ['/etc/passwd', '../x', 'a/../../x', SUMMARY, JOURNAL, 'same'])
def test_outputs_stay_in_the_folder_and_apart(tmp_path: Path, output: str) -> None:
    jobs = [Job('one', 'same', {}, ''), Job('two', output, {}, '')]
    with pytest.raises(InputError, match='two'):
        Batch(tmp_path, jobs, work)


def test_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / 'file').touch()
    with pytest.raises(InputError, match='cannot write to'), Batch(tmp_path / 'file/x', [], work):
        pass


def test_lost_connection_is_said() -> None:
    class Lost:
        status = 'cancelled'

    with pytest.raises(FlightdynError, match='run the same command again'):
        batch_module._outcome(Lost())


def test_rows_become_a_table_with_nulls(tmp_path: Path) -> None:
    nested = {'a': 1, 'b': {'c': 2.5, 'd': {'e': 'x'}}, 'empty': {}, 'list': [1, 2]}
    assert flattened(nested) == {'a': 1, 'b.c': 2.5, 'b.d.e': 'x', 'list': [1, 2]}
    path = tmp_path / 'rows.parquet'
    write_rows([{'a': 1, 'none': None, 'list': []}, {'b': 'x', 'a': 2}], path)
    table = read_table(path)[0]
    assert table['a'].tolist() == [1, 2]
    assert table['b'].tolist() == [None, 'x']
    assert table['none'].tolist() == [None, None]
    write_rows([], path)
    assert read_table(path)[0] == {}


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    """Three good logs and one bad, in two folders."""
    folder = tmp_path / 'logs'
    (folder / 'day2').mkdir(parents=True)
    for name in ('a.mcap', 'day2/a.mcap', 'day2/b.mcap'):
        shutil.copy(GLIDER, folder / name)
    (folder / 'day2/bad.mcap').write_bytes(GLIDER.read_bytes()[:30])
    return folder


def test_patterns_name_logs_by_their_place(
    logs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    everything = ['a.mcap', 'day2/a.mcap', 'day2/b.mcap', 'day2/bad.mcap']
    jobs = replay_jobs([f'{logs}/**/*.mcap'], tmp_path / 'out')
    assert sorted(job.key for job in jobs) == everything
    assert all(job.output == job.key + '.parquet' for job in jobs)
    monkeypatch.chdir(logs)
    (one,) = replay_jobs(['a.mcap'], 'out')
    assert one == next(job for job in jobs if job.key == 'a.mcap')
    several = replay_jobs(['day2/a.mcap', 'a.mcap', 'day2/*'], 'out')
    assert sorted(job.key for job in several) == everything
    assert [j.key for j in replay_jobs(['d*/b.mcap'], 'out')] == ['day2/b.mcap']
    assert sorted(j.key for j in replay_jobs(['**/*.mcap'], 'day2')) == ['a.mcap']
    with pytest.raises(InputError, match=r"no log matches '\*\.bag'"):
        replay_jobs(['*.bag'], 'out')


def test_fingerprint_is_that_of_the_file_and_the_options(logs: Path) -> None:
    def fingerprint(source: str | None = None) -> str:
        (job,) = replay_jobs([str(logs / 'a.mcap')], 'out', source=source)
        return job.fingerprint

    before = fingerprint()
    assert fingerprint() == before
    assert fingerprint('/fix') != before
    os.utime(logs / 'a.mcap', (1, 1))
    assert fingerprint() != before


def test_replay_job_tells_what_replay_does(tmp_path: Path) -> None:
    row = replay_job(tmp_path / 'flown.parquet', file=str(GLIDER), source=None)
    assert row['source'] == '/fix'
    assert row['used'] == row['messages'] - sum(
        n for name, n in row.items() if name.startswith('dropped.')
    )
    assert set(row) >= {'origin.lat', 'duration_s', 'distance_m', 'max_speed', 'warnings'}
    assert read_table(tmp_path / 'flown.parquet')[0]['t'].size == row['used']


def test_batch_replay_command(
    logs: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ['batch', 'replay', f'{logs}/**/*.mcap', '-o', str(tmp_path / 'out'), '--json']
    assert main([*command, '--workers', '1']) == 2
    told = capsys.readouterr()
    figures = json.loads(told.out)
    assert (figures['logs'], figures['done'], figures['kept'], figures['failed']) == (4, 3, 0, 1)
    assert len(told.err.strip().splitlines()) == 1
    assert 'day2/bad.mcap' in told.err
    table = read_table(figures['summary'])[0]
    assert sorted(table['key']) == ['a.mcap', 'day2/a.mcap', 'day2/b.mcap', 'day2/bad.mcap']
    bad = table['key'].tolist().index('day2/bad.mcap')
    assert table['exit_code'][bad] == 2
    assert table['file'][bad] == str(logs / 'day2/bad.mcap')
    assert set(table['segments'][bad - 1][0]) == {'start', 'end', 'samples'}
    assert files(tmp_path / 'out') == [
        f'{name}.parquet' for name in ('a.mcap', 'day2/a.mcap', 'day2/b.mcap')
    ]


def test_batch_needs_something_to_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['batch', 'replay', f'{tmp_path}/*.mcap', '-o', str(tmp_path / 'out')]) == 2
    assert 'no log matches' in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(['batch', 'replay', str(GLIDER), '-o', str(tmp_path), '--workers', '0'])
    assert "'0' is not a number above 0" in capsys.readouterr().err


def test_interrupt_leaves_nothing_half_and_says_how_to_go_on(tmp_path: Path) -> None:
    logs, out = tmp_path / 'logs', tmp_path / 'out'
    logs.mkdir()
    for i in range(60):
        (logs / f'{i:02}.mcap').symlink_to(GLIDER)
    command = [sys.executable, '-m', 'flightdyn', 'batch', 'replay', f'{logs}/*']
    process = subprocess.Popen(
        [*command, '-o', str(out), '--workers', '1'],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 60
    journal = out / JOURNAL
    while not (journal.exists() and journal.read_text()):
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGINT)  # as a terminal does: to every process
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130
    assert 'run the same command again to go on' in told
    assert len(told.strip().splitlines()) == 1
    assert all(name.endswith('.mcap.parquet') for name in files(out))
    assert not (out / SUMMARY).exists()
    assert not (out / '.partial').exists()
    with Batch(out, replay_jobs([f'{logs}/*'], out), replay_job) as batch:
        assert 1 <= len(batch.rows) < 60
        assert int(told.split(' of 60')[0].split()[-1]) == len(batch.rows)
