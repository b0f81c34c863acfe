"""One DDS domain for the whole session, apart from whatever else runs on the machine."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from flightdyn.nodes.client import Session


@pytest.fixture(scope='session')
def ros(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Set the environment that ROS reads, before rclpy is used the first time."""
    import domain_coordinator

    with domain_coordinator.domain_id() as domain, pytest.MonkeyPatch.context() as patch:
        patch.setenv('ROS_DOMAIN_ID', str(domain))
        patch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
        # A killed process may leave shared memory locked, and with it whoever shared it.
        patch.setenv('FASTDDS_BUILTIN_TRANSPORTS', 'UDPv4')
        patch.setenv('ROS_LOG_DIR', str(tmp_path_factory.mktemp('ros')))
        patch.setenv('ROS_PYTHON_CHECK_FIELDS', '1')
        patch.setenv('FASTDDS_DEFAULT_PROFILES_FILE', str(Path(__file__).with_name('fastdds.xml')))
        yield


@pytest.fixture(scope='module')
def session(ros: None) -> Iterator['Session']:
    from flightdyn.nodes.client import Session

    with Session() as session:
        yield session
