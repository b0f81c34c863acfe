"""Areas that flights bound: their size, and a recording that holds them."""

from pathlib import Path

import numpy as np
import pytest

chunks = pytest.importorskip('rerun.chunk')

from flightdyn.environment.geodesy import GeodeticPoint  # noqa: E402
from flightdyn.errors import InputError  # noqa: E402
from flightdyn.viewing.footprint import Area, save_footprint  # noqa: E402

SQUARE = np.array([[1000.0, 1000.0], [1000.0, -1000.0], [-1000.0, -1000.0], [-1000.0, 1000.0]])


def test_size_is_that_of_the_polygon() -> None:
    assert Area('', SQUARE).size == pytest.approx(4e6, rel=1e-15)
    assert Area('', SQUARE[::-1] + [5000.0, 0.0]).size == pytest.approx(4e6, rel=1e-15)
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    circle = 2.0 * np.column_stack([np.cos(turn), np.sin(turn)])
    # n r^2 sin(2 pi / n) / 2 of a regular polygon
    assert Area('', circle).size == pytest.approx(24 * 4 * np.sin(np.pi / 12) / 2, rel=1e-12)


@pytest.mark.parametrize('place', [None, GeodeticPoint(47.27, 11.35)])
def test_a_recording_of_two_areas(tmp_path: Path, place: GeodeticPoint | None) -> None:
    path = tmp_path / 'reach.rrd'
    flight = np.array([[0.0, 0.0, -500.0], [500.0, 500.0, -200.0], [1000.0, 1000.0, 0.0]])
    areas = [Area('no wind', SQUARE, [flight]), Area('wind', SQUARE + [500.0, 0.0])]
    save_footprint(path, areas, place=place, title='Reach')
    entities = {str(chunk.entity_path) for chunk in chunks.RrdReader(path).stream()}
    assert {'/world/areas/0/edge', '/world/areas/1/fill', '/world/rings'} <= entities
    assert '/world/areas/0/flights' in entities
    assert '/world/areas/1/flights' not in entities
    assert ('/map/areas/0/edge' in entities) == (place is not None)


def test_nothing_to_draw_is_refused_and_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(InputError, match='three flights or more'):
        save_footprint(tmp_path / 'reach.rrd', [Area('', SQUARE[:2])])
    assert list(tmp_path.iterdir()) == []
