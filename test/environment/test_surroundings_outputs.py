"""Outputs about surroundings, by hand: signs of a gate's axes, levels, heights."""

import numpy as np
import pytest

from flightdyn.environment.surroundings import Cylinder, Gate, Mark, Surroundings, Terrain
from flightdyn.environment.surroundings_outputs import surroundings_outputs

AROUND = Surroundings(
    terrain=Terrain(np.array([0.0, 100.0]), np.array([0.0, 100.0]), np.array([[0, 10], [20, 30]])),
    keep_out=[Cylinder(name='mast', centre=(50.0, 10.0), radius=5.0)],
    gates=[Gate(name='east', centre=(40.0, 30.0, 20.0), heading=np.pi / 2, width=2, height=2)],
    marks=[
        Mark(name='ear', place=(40.0, 33.0, 26.0), kind='listener'),
        Mark(name='tower', place=(0.0, 0.0, 0.0)),
    ],
)


def test_a_gate_looks_along_its_heading() -> None:
    # 3 m past the gate (east), 1 m to the left (north), 2 m above; flying 5 m/s east, 7 north
    found = surroundings_outputs(AROUND, (41.0, 33.0, -22.0), (7.0, 5.0, -1.0))
    assert found['east_along'] == pytest.approx(3.0)
    assert found['east_aside'] == pytest.approx(-1.0)
    assert found['east_above'] == pytest.approx(2.0)
    assert found['east_through'] == pytest.approx(5.0)


def test_heights_and_clearances() -> None:
    found = surroundings_outputs(AROUND, (50.0, 30.0, -22.0), (0.0, 0.0, 0.0))
    # a plane: 20 m a 100 m north, 10 m a 100 m east
    assert found['height_above_terrain'] == pytest.approx(22 - 10 - 3)
    assert found['clearance_mast'] == pytest.approx(20 - 5)


def test_only_listeners_hear_and_only_what_sounds() -> None:
    here = (40.0, 30.0, -22.0), (0.0, 0.0, 0.0)
    assert not [name for name in surroundings_outputs(AROUND, *here) if 'level' in name]
    found = surroundings_outputs(AROUND, *here, source_level=100.0)
    assert [name for name in found if 'level' in name] == ['level_ear']
    # 5 m away; near by the level is bent to be finite at 0: 5^2 + 1^2
    assert found['level_ear'] == pytest.approx(100 - 10 * np.log10(26) - 1.9e-3 * 5)


def test_nothing_around_is_nothing_put_out() -> None:
    assert surroundings_outputs(Surroundings(), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 90.0) == {}
