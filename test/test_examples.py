"""Every example runs as a user would run it, and tells what others have measured.

Where numbers come from: "peer" is AeroSandbox 4.2.10 (MIT licence) on the same problems, measured;
"reference" is an optimum found by other means than the planner's; "closed form" is arithmetic.
None depends on how a plan is made: tolerances leave room for other meshes and transcriptions.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from flightdyn.tables import read_table

approx = pytest.approx
EXAMPLES = Path(__file__).parents[1] / 'examples'

GOLDEN: dict[str, dict[str, Any]] = {
    'rocket_climb': {
        # closed form: v0 = 1000 + 9.81 x 50 m/s, 500 t (1 - exp(-v0 / (300 x 9.81)))
        'fuel of a single impulse': approx(198.68624, abs=1e-4),
        # never below it (1e-3: what verification lets pass); the peer is at 1.5 % with 100 points
        'more than that': approx(0.75, abs=0.75 + 1e-3),
        'altitude at the end': approx(100, abs=1e-3),
    },
    'rocket_with_opti': {  # peer; digits as its solver's tolerance of 1e-8 leaves them
        'fuel by hand, Euler, 100 points': approx(209.95019, abs=1e-3),
        'fuel by dynamics, 100 points': approx(201.71292, abs=1e-3),
        'fuel by dynamics, 2000 points': approx(199.02706, abs=1e-3),
    },
    'quadcopter_open_loop': {  # SciPy's DOP853 at tight tolerance
        'x_e at the end': approx(3.13663, abs=1e-5),
        'altitude at the end': approx(0.848075, abs=1e-5),
        'highest altitude': approx(1.31643, abs=1e-4),  # of samples at 200 Hz
        'pitch at the end': approx(-200.5352, abs=1e-3),  # closed form: -7 rad/s^2 / 2
    },
    'quadcopter_flip': {
        # reference: switching times, 0.8240737 s; held controls on a mesh cannot be faster, and
        # the peer's 0.82577 s with 80 points is a bound from above
        'duration of the flip': approx(0.8249, abs=0.0009),
        'duration of the backflip': approx(1.0015, abs=0.0015),  # peer, 80 points: 1.00154 s
        'turned in the flip': approx(-360, abs=1e-3),
        'turned in the backflip': approx(360, abs=1e-3),
        'highest altitude of the flip': approx(0.34, abs=0.01),  # peer: 0.3402 m
    },
    'drone_gates': {
        # the planner's own: best of 20 starts 3.24244 s, and another optimum at 3.24963 s
        'duration': approx(3.24244, rel=0.02),
        'duration of the best start': approx(3.24244, rel=5e-3),
        # closed form: all rotors full, 4 x 8.5 N on 0.752 kg
        'most load factor': approx(34 / (0.752 * 9.81), abs=0.1),
    },
    'quadcopter_flip_3d': {
        # the planner's own, the same from 10 other guesses
        'duration with the flip': approx(0.4805, abs=0.002),
        'duration without': approx(0.495, abs=0.005),
        'turned in all': approx(360, abs=2),  # closed form, if about one axis
        'length of the quaternion off 1': approx(0, abs=1e-3),
    },
    'terrain_racing': {
        # the planner's own; 62.033 s with controls that run straight, by Hermite-Simpson or Radau
        'duration': approx(62.04, abs=0.05),
        'duration over the tops': approx(57.38, abs=0.1),
        'least height above the terrain': approx(30, abs=0.2),  # what is asked for
    },
    'engine_out_any_field': {
        # the planner's own; two finer meshes, one of another method, are within 0.03 m
        'height left at the strip, wind 0 m/s': approx(250.10, abs=0.1),
        'height left at the meadow, wind 0 m/s': approx(227.99, abs=0.1),
        'height left at the airfield, wind 0 m/s': approx(210.97, abs=0.1),
        'height left at the airfield, wind 10 m/s': approx(110.11, abs=0.1),
    },
    'noise_departure': {
        # the planner's own, the best of 47 guesses; past the other side it is 1 dB louder
        'exposure of all, quiet': approx(91.91, abs=0.05),
        'exposure of all, fast': approx(104.36, abs=0.1),
        'duration, quiet': approx(300, abs=0.1),  # all that is allowed
    },
    'tracked_flip': {
        # closed form: turning is free of all else, and its acceleration a twentieth too small
        'turned open-loop': approx(-360 / 1.05, abs=0.01),
        'place missed by feedback': approx(2.5, abs=2.5),  # promised: 5 cm and 5 degrees
        'turned by feedback': approx(-360, abs=5),
        # never faster than with all of the rotors' range, 0.8240737 s
        'duration of the flip': approx(0.89, abs=0.06),
    },
    'cessna152_polar': {  # AeroBuildup of the peer; the table's fit is within 7e-4
        'best glide ratio of cessna152': approx(18.6715, rel=1e-3),
        'at alpha, cessna152': approx(3.06, abs=0.05),  # flat there: 0.05 deg is 2e-4 of the ratio
        'at CL, cessna152': approx(0.45863, abs=0.005),
        'largest CL of cessna152': approx(1.57078, rel=1e-3),
        'least CD of cessna152': approx(0.0133189, rel=1e-3),
        # what the FAA quotes, 9:1, is at 60 kt; at 107 kt the Reynolds number is higher
        'best glide ratio of cessna152_calibrated': approx(9.1, abs=0.15),
    },
    'cessna152_glide': {
        # reference: 20.9208 km in 587.87 s by Radau collocation, 60 to 150 intervals, with all of
        # AeroBuildup. Altitude is bounded at nodes alone, so that coarse meshes gain some metres.
        'range': approx(20.9208, abs=0.006),
        'duration': approx(587.87 / 60, abs=0.05),
        'energy height at the start': approx(1154.43, abs=0.01),  # closed form
        'best glide ratio': approx(18.6715, rel=1e-3),  # peer
        'at alpha': approx(3.06, abs=0.05),
        'most that energy allows': approx(1.15443 * 18.6715, rel=1e-3),
        'reached of it': approx(97.0, abs=0.2),
        # what it comes to with 200, 400 and 800 intervals; 79 m with the textbook's 50 points
        'zoom climb': approx(62.3, abs=2.0),
        'median alpha': approx(3.044, abs=0.03),  # peer, in its own atmosphere
        'median speed': approx(35.75, abs=0.2),
        'alpha at the end': approx(15, abs=0.1),  # the limit
        'speed at the end': approx(17.6, abs=0.7),
    },
    'cessna152_turnback': {
        # reference: 45.641 m by Radau collocation, with all of AeroBuildup
        **{
            f'height lost, 0 m/s {name}': approx(45.641, abs=0.05)
            for name in (
                *('headwind', 'tailwind'),
                *('side wind, turning into it', 'side wind, turning with it'),
            )
        },
        # the planner's own, 40 and 120 intervals within 0.01 m: what others have is without wind
        'height lost, 5 m/s headwind': approx(43.757, abs=0.05),
        'height lost, 10 m/s headwind': approx(39.496, abs=0.05),
        'height lost, 5 m/s tailwind': approx(43.298, abs=0.05),
        'height lost, 10 m/s tailwind': approx(40.692, abs=0.05),
        'height lost, 5 m/s side wind, turning into it': approx(38.657, abs=0.05),
        'height lost, 10 m/s side wind, turning into it': approx(31.292, abs=0.05),
        'height lost, 5 m/s side wind, turning with it': approx(52.778, abs=0.05),
        # optima at 58.28, 58.58 and 60.44 m lie close to each other: whichever a machine ends in
        'height lost, 10 m/s side wind, turning with it': approx(59.4, abs=1.2),
    },
    'dynamic_soaring': {
        # reference: another collocation of Zhao's equations, by airspeed, in feet, in this
        # atmosphere: 0.0633246 1/s, 25.489 s (0.063586 in air of one density, as the study has it)
        'least shear': approx(0.0633246, rel=5e-4),
        'duration of a loop': approx(25.489, abs=0.03),
        'largest load factor': approx(5.0, abs=0.02),  # the limit, kept at points of the mesh
        'energy at the end over the beginning': approx(1, abs=1e-5),
    },
    'glider_thermal_transfer': {
        # MacCready's: 47.9 m/s, and 28.49 m/s on average; getting in and out of circles costs some
        'speed of gliding': approx(47.93, rel=0.015),
        'average speed': approx(28.49, rel=0.005),
        'speed of gliding, MacCready': approx(47.93, abs=0.1),
        'average speed, MacCready': approx(28.49, abs=0.05),
    },
    'cruise_climb': {  # closed form
        'range': approx(3761.49, rel=2e-4),
        "range, Breguet's": approx(3761.49, abs=0.5),
        'Mach number in cruise': approx(0.85, abs=1e-4),
        'CL in cruise': approx(0.644, rel=0.01),  # flat there, and thrust carries some weight
        'air gets thinner': approx(1.0813, abs=2e-4),
        'airplane gets lighter': approx(1.0813, abs=2e-4),
    },
    'uav_return_home': {
        # closed form: momentum theory, level flight; that theory without the model's 0.1 m/s of
        # flow at rest is half a per cent off
        'airspeed on the way': approx(17.29, rel=0.005),
        'airspeed of least charge a metre': approx(17.29, abs=0.02),
        'charge a metre on the way': approx(12.604, rel=0.008),
        # the planner's own, several transcriptions and meshes
        'charge used': approx(80.36, abs=0.05),
    },
    'wingsuit_race': {
        # peer on the same ground: 42.043 s with 150 points, 41.9994 s with 600; 42.019 s and
        # 41.994 s on its own, which is rougher
        'time': approx(41.996, abs=0.005),
        'time without the mountain': approx(38.42, abs=0.02),
        'first touch of the ground at': approx(157, abs=5),  # where the mountain bulges: 155 m
        'last touch of the ground at': approx(484, abs=6),  # and 480 m, to its 20 m
        'farthest below the ground': approx(0, abs=1e-4),
    },
    'helium_balloon': {
        # peer at tight tolerance: 95.993 km, 14.03 m, in its own atmosphere
        'altitude after six hours': approx(95.993, abs=0.05),
        'radius up there': approx(14.03, abs=0.05),
        'radius at the start': approx(0.127, abs=1e-4),
    },
    'mesh_refinement': {
        # orders of the methods, which a mesh has only nearly: controls have kinks between nodes
        'order of trapezoidal': approx(2, abs=0.1),
        'order of hermite_simpson': approx(4, abs=0.4),
        'order of radau': approx(4, abs=0.6),  # of its 5, in spite of the kinks
        'height lost': approx(45.641, abs=0.01),  # as of cessna152_turnback
    },
    'aerobuildup_glide': {  # peer, the same 50 points, in its own atmosphere
        'range': approx(20.92793, abs=0.003),
        'duration': approx(588.99 / 60, abs=0.01),
        'zoom climb': approx(79.02, abs=0.5),
        'median alpha': approx(3.0438, abs=0.005),
    },
}
SLOW = {'aerobuildup_glide'}
NEEDS = {'aerobuildup_glide': 'aerosandbox'}


def run(name: str, folder: Path, **environment: str) -> 'subprocess.CompletedProcess[str]':
    path = os.pathsep.join([*environment.values(), str(EXAMPLES.parent)])
    return subprocess.run(
        [sys.executable, str(EXAMPLES / f'{name}.py'), '-o', str(folder / 'made')],
        cwd=folder,
        env={**os.environ, 'PYTHONPATH': path},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.parametrize(
    'name',
    [
        pytest.param(path.stem, marks=[pytest.mark.slow] if path.stem in SLOW else [])
        for path in sorted(EXAMPLES.glob('*.py'))
        if path.stem != 'common'
    ],
)
def test_example(name: str, tmp_path: Path) -> None:
    pytest.importorskip(NEEDS.get(name, 'flightdyn'))
    done = run(name, tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / 'made' / f'{name}.json').read_text())
    for line, (key, told) in zip(done.stdout.splitlines(), found.items(), strict=True):
        assert line.startswith(f'{key} ')
        assert line.removeprefix(key).split()[0] == f'{told["value"]:.8g}'
        assert line.endswith(told['unit'])
    for key, expected in GOLDEN[name].items():
        assert found[key]['value'] == expected, key
    for table in (tmp_path / 'made').glob('*.csv'):
        assert all(column.size > 1 for column in read_table(table)[0].values())


def test_every_example_is_short_and_has_its_figures_checked() -> None:
    files = {path.stem: path for path in EXAMPLES.glob('*.py') if path.stem != 'common'}
    assert files.keys() == GOLDEN.keys()
    for path in files.values():
        assert len(path.read_text(encoding='utf-8').splitlines()) < 80, path


def test_examples_draw_where_matplotlib_is(tmp_path: Path) -> None:
    name = 'quadcopter_open_loop'
    missing = tmp_path / 'without' / 'matplotlib'
    missing.mkdir(parents=True)
    (missing / '__init__.py').write_text('raise ImportError')
    done = run(name, tmp_path, without=str(missing.parent))
    assert done.returncode == 0, done.stderr
    assert "no quadcopter_open_loop.png: a figure needs the extra 'view'" in done.stderr
    made = {path.suffix for path in (tmp_path / 'made').iterdir()}
    assert made == {'.csv', '.json'}
    pytest.importorskip('matplotlib')
    assert run(name, tmp_path).returncode == 0
    assert (tmp_path / 'made' / f'{name}.png').read_bytes().startswith(b'\x89PNG')


def test_an_example_ends_where_there_is_no_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    import common

    report = SimpleNamespace(verified=False, message='Infeasible: x_e')
    planner = SimpleNamespace(plan=lambda problem: SimpleNamespace(report=report))
    with pytest.raises(SystemExit, match='climb: Infeasible: x_e'):
        common.plan(planner, SimpleNamespace(name='climb'))
