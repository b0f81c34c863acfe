"""The demo keeps its promises, and tells of it when it cannot."""

import json
from pathlib import Path

import pytest
from ros_support import need_ros

need_ros()

from flightdyn.nodes import demo  # noqa: E402


def test_demo_plans_flies_records_and_replays(
    ros: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert demo.main([str(tmp_path)]) == 0
    names = {path.name for path in tmp_path.iterdir()}
    assert {'plan.json', 'flight.mcap', 'flight.rrd', 'glider.rrd', 'flip.png'} <= names
    assert json.loads((tmp_path / 'plan.json').read_text())['verified'] is True
    printed = capsys.readouterr().out
    assert 'flown against planned: position' in printed
    assert 'NOT under' not in printed


def test_demo_into_a_file_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / 'taken'
    path.write_text('')
    assert demo.main([str(path)]) == 2
    assert 'taken' in capsys.readouterr().err


def test_a_broken_promise_fails_the_demo(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    checks = [demo.Check('flown against planned: position', 0.02, 'm', 0.01)]
    monkeypatch.setattr(demo, '_run', lambda folder, console: checks)
    assert demo.main([str(tmp_path)]) == 1
