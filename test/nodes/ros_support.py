"""What the ROS tests share. They run wherever rclpy and the built messages are found.

With FLIGHTDYN_REQUIRE_ROS=1 a missing ROS fails the tests instead of skipping them.
"""

import os
import sys
from pathlib import Path

import pytest

from flightdyn.errors import InputError
from flightdyn.nodes.entry import require_ros

ROOT = Path(__file__).resolve().parents[2]
DISCUS = ROOT / 'test/data/discus2_thermal.mcap'
NODES = ('planner', 'sim', 'replay')


def need_ros() -> None:
    """Skip the module that calls this, or fail it, where there is no ROS."""
    try:
        require_ros()
    except InputError as error:
        if os.environ.get('FLIGHTDYN_REQUIRE_ROS') == '1':
            raise
        pytest.skip(f'needs ROS: {error}', allow_module_level=True)


def command(name: str, *, installed: bool = False) -> list[str]:
    """Return how to start a node: as a module, or by the sourced workspace's executable."""
    if installed:
        for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
            executable = Path(prefix) / 'lib/flightdyn' / name
            if executable.is_file():
                return [str(executable)]
    return [sys.executable, '-m', f'flightdyn.nodes.{name}']
