"""The benchmark that makes docs/replay-accuracy.md, on the logs of the tests."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parent.parent
SCRIPT = ROOT / 'benchmarks' / 'replay_accuracy.py'
DATA = ROOT / 'test' / 'data'


def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    environment = os.environ | {'PYTHONPATH': str(ROOT)}
    return subprocess.run(
        [sys.executable, str(SCRIPT), *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
        timeout=120,
    )


def test_a_table_of_a_folder_with_a_manifest(tmp_path: Path) -> None:
    log = DATA / 'discus2_thermal.mcap'
    (tmp_path / log.name).write_bytes(log.read_bytes())
    with np.load(DATA / 'discus2_thermal.truth.npz') as archive:
        truth = dict(archive)
    truth['vn'] = truth['vn'] + 5.0  # a record that is off must show
    np.savez(tmp_path / 'other.npz', **truth)
    entry = {
        'file': log.name,
        'truth': 'other.npz',
        'reference_estimate_vs_truth': {'groundspeed_abs_err_mps_median_p95': [0.25, 9.0]},
    }
    (tmp_path / 'MANIFEST.json').write_text(json.dumps([entry, {'file': 'gone', 'truth': None}]))
    page = tmp_path / 'docs' / 'page.md'
    done = run(tmp_path, '-o', page)
    assert done.returncode == 0, done.stderr
    rows = [line.split('|') for line in page.read_text().splitlines() if log.name in line]
    speed = next(row for row in rows if 'speed [m/s]' in row[2])
    assert float(speed[4]) == pytest.approx(2.5, abs=1.5)  # 5 m/s north, on all courses of a turn
    assert [cell.strip() for cell in speed[10:12]] == ['0.25', '9.00']
    assert 'speed, median' in page.read_text().split('## Not as good as elsewhere')[1]


def test_a_folder_without_records_is_refused(tmp_path: Path) -> None:
    done = run(tmp_path)
    assert done.returncode == 2
    assert 'no log with a record' in done.stderr
