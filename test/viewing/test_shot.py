"""Pictures and animations, drawn by a viewer without a window where there is a driver for it."""

import numpy as np
import pytest

pytest.importorskip('rerun')
Image = pytest.importorskip('PIL.Image')

from flights import flip  # noqa: E402

from flightdyn.errors import InputError  # noqa: E402
from flightdyn.viewing import shot  # noqa: E402
from flightdyn.viewing.footprint import Area, save_footprint  # noqa: E402
from flightdyn.viewing.rerun_view import save_rrd  # noqa: E402


@pytest.fixture(scope='module')
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp('shot') / 'flip.rrd'
    save_rrd(path, flip())
    return path


def drawn(function, *arguments, **options):
    try:
        function(*arguments, **options)
    except InputError as error:
        if 'Vulkan' in str(error):
            pytest.skip('nothing to draw with')
        raise


@pytest.mark.slow
def test_the_3d_view_shows_path_vehicle_and_ground(recording, tmp_path):
    out = tmp_path / 'a.png'
    drawn(shot.save_shot, [recording], out, at=0.4, view='Overview', size=(800, 600))
    pixels = np.asarray(Image.open(out).convert('RGB')).astype(int)
    assert pixels.shape[0] > 450 and pixels.shape[1] > 750  # the view, without the window's bars
    scene = pixels.reshape(-1, 3)
    red, green, blue = scene.T
    ground = (abs(red - 38) < 14) & (abs(green - 56) < 14) & (abs(blue - 50) < 14)
    path = (green > 150) & (green > blue + 60)  # yellow to green: fast in the middle of the flip
    rotors = (red > 180) & (red > blue + 60) & (green < 190)  # orange
    sky = (abs(red - 22) < 6) & (abs(green - 30) < 6) & (abs(blue - 42) < 6)
    shares = [float(each.mean()) for each in (ground, path, rotors, sky)]
    assert shares[0] > 0.1  # half of the picture is ground, less what the curtain covers
    assert shares[1] > 0.002  # a line of 4 px across half the picture
    assert shares[2] > 0.0005  # forward rotors and their ghosts
    assert shares[3] > 0.1


@pytest.mark.slow
def test_an_animation_moves(recording, tmp_path):
    out = tmp_path / 'a.webp'
    drawn(shot.save_animation, [recording], out, seconds=1.0, rate=4.0, size=(480, 300))
    with Image.open(out) as movie:
        assert movie.n_frames == 4
        movie.seek(0)
        first = np.asarray(movie.convert('RGB')).astype(int)
        movie.seek(2)
        assert (np.abs(np.asarray(movie.convert('RGB')).astype(int) - first) > 60).any()


@pytest.mark.slow
def test_a_view_or_time_that_is_not_there_is_named(recording, tmp_path):
    with pytest.raises(InputError, match=r"no view 'Owerview' in the recording; it has .*Chase"):
        drawn(shot.save_shot, [recording], tmp_path / 'a.png', view='Owerview')
    with pytest.raises(InputError, match=r'time 9 s is not within the recording, 0 to 0\.8 s'):
        drawn(shot.save_shot, [recording], tmp_path / 'a.png', at=9.0)
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_what_does_not_change_over_time_is_drawn_too(tmp_path):
    """Such as a footprint: it was once waited for in vain."""
    path, out = tmp_path / 'reach.rrd', tmp_path / 'a.png'
    square = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]])
    save_footprint(path, [Area('reach', 1000 * square)])
    drawn(shot.save_shot, [path], out, view='Reach', size=(800, 600))
    red, _, blue = np.asarray(Image.open(out).convert('RGB')).reshape(-1, 3).astype(int).T
    assert ((red > 100) & (red > blue + 60)).mean() > 0.1  # the area, orange
    with pytest.raises(InputError, match='time 1 s: nothing in the recording changes over time'):
        drawn(shot.save_shot, [path], out, at=1.0)
    with pytest.raises(InputError, match='draw a picture of it'):
        drawn(shot.save_animation, [path], tmp_path / 'a.webp', seconds=1.0, rate=4.0)


def test_without_a_driver_it_says_what_to_install(recording, tmp_path, monkeypatch):
    monkeypatch.setenv('VK_ICD_FILENAMES', '/nowhere.json')
    monkeypatch.setenv('VK_DRIVER_FILES', '/nowhere.json')
    with pytest.raises(InputError, match='mesa-vulkan-drivers'):
        shot.save_shot([recording], tmp_path / 'a.png')
    assert not list(tmp_path.iterdir())


def test_what_cannot_be_animated_or_found_is_refused(recording, tmp_path):
    with pytest.raises(InputError, match='has 2 to 600 frames, not 0'):
        shot.save_animation([recording], tmp_path / 'a.webp', seconds=0.0)
    with pytest.raises(InputError, match='no file'):
        shot.save_shot([tmp_path / 'none.rrd'], tmp_path / 'a.png')
