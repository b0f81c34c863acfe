"""What is known of a flight comes onto the figure that is written of it."""

from pathlib import Path

import numpy as np
import pytest

pytest.importorskip('matplotlib')

from flightdyn import export
from flightdyn.environment.surroundings import Cylinder, Surroundings
from flightdyn.trajectory import Trajectory


def straight() -> Trajectory:
    t = np.linspace(0, 10, 11)
    return Trajectory(
        time=t,
        states={
            'x_e': 30 * t,
            'y_e': 3 * t,
            'z_e': -100 - t,
            'speed': 30 + 0.1 * t,
            'gamma': 0 * t,
        },
        problem='past_a_tower',
        vehicle='glider',
    )


def written(path: Path, around: Surroundings | None = None, **more: object) -> str:
    document: dict[str, object] = {
        'verified': False, 'converged': False, 'message': 'Infeasible: speed', 'objective': 0.0,
    }  # fmt: skip
    if around is not None:
        document['surroundings'] = around.to_dict()
    export.write_flight(path, straight(), document, **more)
    return path.read_text(encoding='utf-8')


def test_a_figure_of_a_plan_has_surroundings_limits_and_verdict(tmp_path: Path) -> None:
    tower = Surroundings(keep_out=[Cylinder(name='tower', centre=(100.0, 60.0), radius=20.0)])
    # of letters, which are drawn as shapes, the text stands beside in a comment
    text = written(tmp_path / 'a.svg', tower, limits={'speed': (30.0, 40.0)})
    assert '<!-- tower -->' in text and 'Infeasible: speed' in text
    assert '<!-- past_a_tower (glider)' in text
    without = written(tmp_path / 'b.svg')
    assert 'tower -->' not in without
    assert text.count('stroke-dasharray') > without.count('stroke-dasharray')


def test_a_figure_of_a_flight_shows_it_beside_its_plan(tmp_path: Path) -> None:
    assert '<!-- planned -->' in written(tmp_path / 'a.svg', planned=straight())
