"""How nodes begin and end: exit codes, clear sentences, no tracebacks, in time."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from ros_support import DISCUS, NODES, ROOT, command, need_ros

need_ros()

from lifecycle_msgs.srv import GetState  # noqa: E402
from rcl_interfaces.srv import ListParameters  # noqa: E402

from flightdyn.nodes.client import Inbox, PlannerClient, Session  # noqa: E402
from flightdyn.nodes.process import NodeProcess  # noqa: E402
from flightdyn_msgs.msg import VehicleState  # noqa: E402

SIGNALS = (signal.SIGINT, signal.SIGTERM)
LIMIT_S = 2.0


def end(process: NodeProcess, number: int) -> None:
    """Send a signal; the node has to end well."""
    began = time.monotonic()
    assert process.stop(number) == 0, process.output
    assert time.monotonic() - began < LIMIT_S
    assert 'Traceback' not in process.output
    assert 'terminate called' not in process.output


@pytest.mark.parametrize('number', SIGNALS)
@pytest.mark.parametrize('name', NODES)
def test_idle_node_ends_on_a_signal(ros: None, session: Session, name: str, number: int) -> None:
    parameters: dict[str, Any] = {'log': str(DISCUS), 'end': 10.0} if name == 'replay' else {}
    with NodeProcess(name, command=command(name, installed=True), **parameters) as process:
        listed = session.call(ListParameters, f'/{name}/list_parameters').result.names
        assert 'use_sim_time' in listed
        end(process, number)


def shared_memory(pid: int | str) -> set[str]:
    """Return the segments in shared memory that a process has mapped; ports are everybody's."""
    with contextlib.suppress(OSError):  # it may end meanwhile, or be another user's
        lines = Path(f'/proc/{pid}/maps').read_text().splitlines()
        names = {line.split()[-1] for line in lines}
        return {name for name in names if re.match('/dev/shm/fastdds_[0-9a-f]{16}', name)}
    return set()


def left_behind(mapped: set[str]) -> list[str]:
    """Return what is still there of a process that has ended, and nobody else's."""
    others = set().union(*(shared_memory(p.name) for p in Path('/proc').glob('[0-9]*')))
    return [file for file in mapped - others if Path(file).exists()]


@pytest.mark.parametrize('name', NODES)
@pytest.mark.parametrize('number', [signal.SIGINT, None])
def test_nothing_is_left_in_shared_memory(
    ros: None, session: Session, name: str, number: int | None
) -> None:
    """Nodes that end on a signal, or on a mistake in their parameters (None)."""
    parameters: dict[str, Any] = {'log': str(DISCUS), 'end': 10.0} if name == 'replay' else {}
    if number is None:
        parameters['qos_overrides./diagnostics.publisher.reliability'] = 'perhaps'
    mapped: set[str] = set()
    with NodeProcess(
        name,
        env={'FASTDDS_BUILTIN_TRANSPORTS': None, 'FASTDDS_DEFAULT_PROFILES_FILE': None},
        **parameters,
    ) as process:
        if number is None:
            while process.process.poll() is None:
                mapped |= shared_memory(process.process.pid)
            assert process.process.wait() == 2
        else:
            session.call(GetState, f'/{name}/get_state')
            mapped = shared_memory(process.process.pid)
            end(process, number)
    assert mapped
    assert left_behind(mapped) == []


def test_planner_that_is_stopped_in_mid_solve_leaves_nothing(ros: None, session: Session) -> None:
    with NodeProcess('planner', env={'FASTDDS_BUILTIN_TRANSPORTS': None}) as process:
        heard = Inbox('feedback')
        PlannerClient(session).send(
            'quadcopter_flip', final={'x_e': 300.0}, nodes=300, on_feedback=heard.put
        )
        heard.wait(timeout=60)
        mapped = shared_memory(process.process.pid)
        end(process, signal.SIGTERM)
    assert mapped
    assert left_behind(mapped) == []


def test_node_waits_to_be_configured(ros: None, session: Session) -> None:
    with NodeProcess('planner', autostart=False) as process:
        state = session.call(GetState, '/planner/get_state').current_state.label
        assert state == 'unconfigured'
        end(process, signal.SIGINT)


@pytest.mark.parametrize('number', SIGNALS)
def test_planner_ends_while_solving_and_the_client_hears_of_it(
    ros: None, session: Session, number: int
) -> None:
    with NodeProcess('planner') as process:
        heard = Inbox('feedback')
        request = PlannerClient(session).send(
            'quadcopter_flip', final={'x_e': 300.0}, on_feedback=heard.put
        )
        heard.wait()
        end(process, number)
        assert request.result(5).result.message.startswith('the planner is ending')


@pytest.mark.parametrize('number', SIGNALS)
def test_replay_ends_while_playing(ros: None, session: Session, number: int) -> None:
    with NodeProcess('replay', log=str(DISCUS), rate=100.0, loop=True) as process:
        session.subscribe(VehicleState, '/replay/state').wait()
        end(process, number)


@pytest.mark.parametrize(
    ('name', 'parameters', 'words'),
    [
        ('replay', {}, 'which flight log'),
        ('replay', {'log': '/nope.mcap'}, 'no file /nope.mcap'),
        ('replay', {'log': str(DISCUS), 'log_root': str(ROOT / 'config')}, 'is outside'),
        ('replay', {'log': str(ROOT / 'setup.py')}, 'setup.py'),
        ('replay', {'log': str(DISCUS), 'rate': 0}, 'rate'),
        ('replay', {'log': str(DISCUS), 'start_at': 'noon'}, 'noon'),
        ('sim', {'vehicle': 'nope'}, "no vehicle 'nope'"),
        ('sim', {'origin_lat': 91.0}, 'origin_lat'),
        ('sim', {'wind_ned': [1.0]}, '3 finite numbers'),
        ('sim', {'record': '/nope/a.mcap'}, 'no folder'),
        ('planner', {'preempt': 'maybe'}, 'replace or reject'),
        ('planner', {'config_dir': '/nope'}, '/nope'),
        ('planner', {'max_wall_time': 'long'}, 'max_wall_time'),
    ],
)
def test_mistakes_end_with_2_and_one_sentence(
    ros: None, name: str, parameters: dict[str, Any], words: str
) -> None:
    with NodeProcess(name, **parameters) as process:
        assert process.process.wait(20) == 2, process.output
        (line,) = process.output.splitlines()
        assert line.startswith(f'{name}: ')
        assert words in line


def test_malformed_ros_arguments_end_with_2_and_one_sentence(ros: None) -> None:
    with NodeProcess('sim', command=[*command('sim'), '--ros-args', '-p', 'x']) as process:
        assert process.process.wait(20) == 2, process.output
        assert process.output.splitlines()[-1].startswith('sim: ROS 2 does not start')
        assert 'Traceback' not in process.output


def test_missing_ros_is_named() -> None:
    hide = "import sys; sys.modules['rclpy'] = None; from flightdyn.nodes.sim import main; main()"
    done = subprocess.run([sys.executable, '-c', hide], capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith('sim: ROS 2 is not there')
    assert len(done.stderr.splitlines()) == 1


def test_missing_messages_are_named(ros: None, tmp_path: Path) -> None:
    # the checkout has a folder flightdyn_msgs, which must not pass for the built package
    paths = os.environ.get('PYTHONPATH', '').split(os.pathsep)
    kept = [p for p in paths if p and not (Path(p) / 'flightdyn_msgs/msg/__init__.py').exists()]
    env = {'PYTHONPATH': os.pathsep.join([str(ROOT), *kept])}
    with NodeProcess('planner', env=env) as process:
        assert process.process.wait(20) == 2, process.output
        assert process.output.startswith('planner: flightdyn_msgs is not built or not sourced')


def test_signal_while_starting_is_no_traceback(ros: None) -> None:
    with NodeProcess('planner') as process:
        wait_for(lambda: handles_signals(process.process.pid))
        assert process.stop(signal.SIGINT) == 0
        assert 'Traceback' not in process.output


def handles_signals(pid: int) -> bool:
    """Return whether a process has set its own handler for SIGTERM; Python itself has none."""
    status = Path(f'/proc/{pid}/status').read_text()
    caught = int(status.partition('SigCgt:')[2].split()[0], 16)
    return bool(caught >> (signal.SIGTERM - 1) & 1)


def wait_for(ready: Callable[[], bool]) -> None:
    Session.wait_until(ready, 'the condition')
