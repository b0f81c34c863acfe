"""What `dyn.draw()` and `trajectory.to_rerun()` give."""

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip('rerun')
pytest.importorskip('pyarrow')

from flights import flip
from recordings import read, rows

import flightdyn as asb
from flightdyn.errors import InputError
from flightdyn.viewing.drawing import trajectory_of, vehicle_of


def glide(**more):
    t = np.linspace(0, 100, 60)
    return t, asb.DynamicsPointMass2DSpeedGamma(
        mass_props=asb.MassProperties(mass=500),
        x_e=40 * np.cos(0.1) * t, z_e=-1000 + 40 * np.sin(0.1) * t,
        speed=np.full(60, 40.0), gamma=np.full(60, -0.1), alpha=np.full(60, 4.0), **more,
    )  # fmt: skip


def test_draw_as_in_the_book_saves_what_it_shows(tmp_path):
    _, dyn = glide()
    drawn = dyn.draw(
        vehicle_model='cessna152',
        show=False,
        n_vehicles_to_draw=7,
        draw_global_grid=False,
        draw_global_axes=False,
        draw_axes=False,
    )
    drawn.save(tmp_path / 'a.rrd')
    drawn.close()
    data = read(tmp_path / 'a.rrd')
    assert len(rows(data['/world/ghosts'], 'translations')[0]) == 7
    assert '/world/ground/grid' not in data
    assert '/world/ground/plane' in data
    assert '/world/curtain' in data
    assert '/world/vehicle/axes' not in data
    at = np.array(rows(data['/world/vehicle'], 'translation')).reshape(-1, 3)
    np.testing.assert_allclose(at[:, 0], dyn.x_e, rtol=1e-6)


def test_parts_can_be_left_out_and_axes_drawn(tmp_path):
    drawn = glide()[1].draw(
        show=False, draw_axes=True, draw_global_axes=True, draw_trajectory_line=False,
        draw_altitude_drape=False, draw_ground_plane=False,
    )  # fmt: skip
    drawn.save(tmp_path / 'a.rrd')
    data = read(tmp_path / 'a.rrd')
    assert {'/world/vehicle/axes', '/world/earth_axes'} <= data.keys()
    assert not {'/world/path/flown', '/world/curtain', '/world/ground/plane'} & data.keys()


def test_times_come_from_speeds_unless_they_are_known():
    t, dyn = glide()
    np.testing.assert_allclose(trajectory_of(dyn).time, t, rtol=1e-9)
    _, timed = glide(time=3 + 2 * t)
    np.testing.assert_allclose(trajectory_of(timed).time, 3 + 2 * t)
    np.testing.assert_allclose(trajectory_of(timed, t).time, t)
    with pytest.raises(InputError, match='time has shape'):
        trajectory_of(dyn, t[:5])


def test_standing_still_takes_time_too():
    dyn = asb.DynamicsPointMass1DHorizontal(
        x_e=np.array([0.0, 0, 1, 2]), u_e=np.array([0.0, 0, 2, 2])
    )
    time = trajectory_of(dyn).time
    assert (np.diff(time) > 0).all()
    np.testing.assert_allclose(np.diff(time), [0.75, 1.0, 0.5])  # the mean of the others, first


def test_symbols_and_single_states_are_refused():
    opti = asb.Opti()
    dyn = asb.DynamicsPointMass1DHorizontal(
        x_e=opti.variable(init_guess=0, n_vars=5), u_e=opti.variable(init_guess=0, n_vars=5)
    )
    with pytest.raises(InputError, match=r'put the solution in first'):
        dyn.draw(show=False)
    with pytest.raises(InputError, match='two states or more'):
        asb.DynamicsPointMass1DHorizontal(x_e=1.0, u_e=0.0).draw(show=False)


@dataclass
class Plane:
    """Of AeroSandbox's kind."""

    wings: list = field(
        default_factory=lambda: [
            SimpleNamespace(
                symmetric=True,
                xsecs=[
                    SimpleNamespace(xyz_le=[0, y, 0], chord=1.0, airfoil=None) for y in (0.0, 4.0)
                ],
            )
        ]
    )
    fuselages: list = field(default_factory=list)
    name: str = 'plane'


def test_a_vehicle_is_a_name_a_file_a_geometry_or_an_airplane(tmp_path):
    assert vehicle_of(None) == ('', None)
    assert vehicle_of('cessna152')[1]['kind'] == 'airplane'
    assert vehicle_of({'kind': 'balloon', 'diameter': 1})[1]['diameter'] == 1
    name, geometry = vehicle_of(Plane())
    assert name == 'plane'
    assert geometry['wings'][0]['sections'][1]['le'] == [0.0, 4.0, 0.0]
    with pytest.raises(InputError, match='no file'):
        vehicle_of(tmp_path / 'none.stl')
    with pytest.raises(InputError, match='vehicle_model int'):
        vehicle_of(3)


def test_a_trajectory_saves_itself(tmp_path):
    flip().to_rerun(tmp_path / 'a.rrd', color='altitude', hidden=['curtain'])
    data = read(tmp_path / 'a.rrd')
    assert '/world/curtain' not in data
    with pytest.raises(InputError, match="no 'curtian' to hide, did you mean 'curtain'"):
        flip().to_rerun(tmp_path / 'b.rrd', hidden=['curtian'])
