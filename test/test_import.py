"""`import flightdyn` stays light, and layers import downward only."""

import ast
import subprocess
import sys
from pathlib import Path

PACKAGE = Path(__file__).parents[1] / 'flightdyn'
HEAVY = {
    'rclpy',
    'rerun',
    'scipy',
    'matplotlib',
    'pyarrow',
    'rosbags',
    'mcap',
    'yaml',
    'pymap3d',
    'dask',
}

# from the ground up; a package may import those before it
LAYERS = [
    *('errors', 'units', 'numpy', 'files', 'config', 'frames', 'environment', 'resources'),
    *('trajectory', 'tables', 'dynamics', 'vehicles', 'logs', 'replay', 'simulation'),
    *('control', 'planning', 'viewing', 'export', 'batch', 'batch_replay', 'batch_plan'),
    *('console', 'cli_logs', 'cli_batch', 'cli_view', 'cli', '__main__'),
    'nodes',
]


def test_importing_flightdyn_pulls_in_nothing_heavy() -> None:
    code = 'import sys, flightdyn; print(*sys.modules)'
    loaded = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not HEAVY & {name.partition('.')[0] for name in loaded}


def imported(path: Path) -> set[str]:
    """Return the absolute names of everything a module imports."""
    parts = ('flightdyn', *path.relative_to(PACKAGE).with_suffix('').parts)
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = '.'.join(parts[: -node.level]) if node.level else ''
            module = '.'.join(filter(None, (base, node.module)))
            names |= {module} if node.module else {f'{module}.{a.name}' for a in node.names}
    return names


# methods that show what they belong to import the views when they are called
SHOWING = ('base.py imports flightdyn.viewing.', 'trajectory.py imports flightdyn.viewing.')


def test_layers_import_downward_only() -> None:
    wrong = []
    for path in sorted(PACKAGE.rglob('*.py')):
        layer = path.relative_to(PACKAGE).parts[0].removesuffix('.py')
        if layer == '__init__':
            continue
        for name in imported(path):
            top, _, rest = name.partition('.')
            used = rest.partition('.')[0]
            if top == 'flightdyn' and used and LAYERS.index(used) > LAYERS.index(layer):
                wrong.append(f'{path.name} imports {name}')
    assert {line for line in wrong if not line.startswith(SHOWING)} == set()


def test_ros_and_rerun_stay_where_they_belong() -> None:
    homes = {'rclpy': 'nodes', 'rerun': 'viewing', 'matplotlib': 'viewing'}
    for path in PACKAGE.rglob('*.py'):
        layer = path.relative_to(PACKAGE).parts[0]
        for name in imported(path):
            home = homes.get(name.partition('.')[0], layer)
            assert home == layer, f'{path} imports {name}'
