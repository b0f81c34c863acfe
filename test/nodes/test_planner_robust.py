"""The planner under load, with processes killed, by hostile clients, through its life cycle."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ros_support import need_ros

need_ros()

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from lifecycle_msgs.msg import Transition  # noqa: E402
from lifecycle_msgs.srv import ChangeState, GetState  # noqa: E402
from std_msgs.msg import String  # noqa: E402

from flightdyn.errors import ResultCode  # noqa: E402
from flightdyn.nodes.client import (  # noqa: E402
    GoalRejected,
    Inbox,
    PlannerClient,
    PlanOutcome,
    PlanRequest,
    Session,
)
from flightdyn.nodes.process import NodeProcess  # noqa: E402
from flightdyn_msgs.action import PlanTrajectory  # noqa: E402
from flightdyn_msgs.msg import VehicleState  # noqa: E402
from flightdyn_msgs.srv import ListProblems  # noqa: E402

FLIP = 'quadcopter_flip'
# hundreds of iterations of some 10 ms each: time enough to cut in
LONG: dict[str, Any] = {'final': {'x_e': 300.0}, 'nodes': 300}


@pytest.fixture(scope='module')
def planner(ros: None) -> Iterator[NodeProcess]:
    with NodeProcess(
        'planner', preempt='queue', queue_limit=100, replan_problem=FLIP, state_topic='state'
    ) as process:
        yield process
        process.check()


@pytest.fixture(scope='module')
def client(planner: NodeProcess, session: Session) -> PlannerClient:
    return PlannerClient(session)


def start(client: PlannerClient, **changes: Any) -> PlanRequest:
    """Send a long goal and return when it is being solved."""
    heard = Inbox('feedback')
    request = client.send(FLIP, on_feedback=heard.put, **{**LONG, **changes})
    heard.wait(timeout=60)
    return request


def workers(process: NodeProcess) -> list[int]:
    """Return the processes in which a node plans."""
    found = []
    for path in Path('/proc').glob('[0-9]*'):
        try:
            parent = path.joinpath('stat').read_text().rpartition(')')[2].split()[1]
        except OSError:  # it has just ended
            continue
        if parent == str(process.process.pid):
            found.append(int(path.name))
    return found


def is_running(pid: int) -> bool:
    try:
        state = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0]
    except OSError:
        return False
    return state != 'Z'  # what nobody waits for stays a zombie where there is no init


def rss(pid: int) -> int:
    """Return the memory that a process holds [kB]."""
    status = Path(f'/proc/{pid}/status').read_text()
    return int(status.partition('VmRSS:')[2].split()[0])


def figures(session: Session, name: str) -> dict[str, str]:
    """Return the values of a status of /diagnostics, and its message as `message`."""

    def found(messages: list[Any]) -> list[Any]:
        return [s for m in messages for s in m.status if s.name == name]

    status = found(session.subscribe(DiagnosticArray, '/diagnostics').wait(found))[-1]
    return {'message': status.message} | {item.key: item.value for item in status.values}


# Load. -------------------------------------------------------------------------------------------
KINDS = {
    'good': ResultCode.SUCCESS,
    'cancelled': ResultCode.CANCELLED,
    'malformed': ResultCode.BAD_REQUEST,
    'infeasible': ResultCode.INFEASIBLE,
}


def ask(client: PlannerClient, kind: str, number: int) -> PlanOutcome:
    """Send a goal of a kind and return how it ended."""
    if kind == 'cancelled':
        request = start(client) if number % 2 else client.send(FLIP, **LONG)
        assert request.cancel()
        outcome = request.result(120)
        assert outcome.cancelled
        return outcome
    changes: dict[str, Any] = {
        'good': {'final': {'x_e': 1.0 + 0.05 * (number % 8)}},
        'malformed': {'final': {'x_f': 1.0}} if number % 2 else {'nodes': 10**6},
        'infeasible': {'duration': (0.1, 0.3), 'nodes': 20},
    }[kind]
    return client.plan(FLIP, result_timeout=120, **changes)


@contextmanager
def asking() -> Iterator[list[float]]:
    """Call list_problems again and again meanwhile; has the answers' times afterwards [s]."""
    took: list[float] = []
    with subprocess.Popen(
        [sys.executable, str(Path(__file__).with_name('ask_often.py'))],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == 'asking\n'
        try:
            yield took
        finally:
            printed, _ = process.communicate(timeout=30)
            took += json.loads(printed)


def load(count: int, clients: int, seed: int) -> list[tuple[str, ResultCode]]:
    """Send goals by several clients at a time: half of them good, 20 % cancelled, 20 % malformed,
    10 % infeasible."""
    names = ['good'] * 5 + ['cancelled'] * 2 + ['malformed'] * 2 + ['infeasible']
    kinds = names * (count // len(names))
    random.Random(seed).shuffle(kinds)
    with ExitStack() as stack:
        ours = [PlannerClient(stack.enter_context(Session(f'client_{n}'))) for n in range(clients)]
        with ThreadPoolExecutor(clients) as pool:

            def work(n: int) -> list[tuple[str, ResultCode]]:
                mine = kinds[n::clients]
                return [(kind, ask(ours[n], kind, n + i).code) for i, kind in enumerate(mine)]

            return [each for done in pool.map(work, range(clients)) for each in done]


def check_codes(ended: list[tuple[str, ResultCode]]) -> None:
    assert [code for _, code in ended] == [KINDS[kind] for kind, _ in ended]


def test_mixed_goals_of_several_clients_end_with_the_right_codes(planner: NodeProcess) -> None:
    check_codes(load(20, 4, seed=1))


def test_services_answer_at_once_while_a_goal_is_planned(
    client: PlannerClient, planner: NodeProcess
) -> None:
    with asking() as idle:
        time.sleep(1.0)
    request = start(client, nodes=1000)  # some 20 s
    with asking() as busy:
        time.sleep(2.0)
    assert not request.is_done
    request.cancel()
    request.result(30)
    print(f'idle {np.percentile(idle, (50, 99))} s, busy {np.percentile(busy, (50, 99))} s')
    # what other processes take of the machine, they take of both
    assert np.percentile(busy, 99) < 0.1 + np.percentile(idle, 99)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_200_goals_leave_no_trace(planner: NodeProcess) -> None:
    with asking() as idle:
        time.sleep(5.0)
    check_codes(load(80, 8, seed=2))  # programmes are built and kept once
    pids = [planner.process.pid, *workers(planner)]
    before = {pid: rss(pid) for pid in pids}
    with asking() as busy:
        check_codes(load(200, 8, seed=3))
    after = {pid: rss(pid) for pid in pids}
    print(f'idle {np.percentile(idle, (50, 99))} s, busy {np.percentile(busy, (50, 99))} s')
    print(f'kB {before} {after}')
    assert np.percentile(busy, 99) < 0.1 + np.percentile(idle, 99)
    assert sum(after.values()) < 1.05 * sum(before.values())


def test_feedback_comes_at_once(client: PlannerClient) -> None:
    arrived: list[tuple[float, float]] = []
    request = client.send(
        FLIP, on_feedback=lambda f: arrived.append((time.monotonic(), f.elapsed)), **LONG
    )
    Session.wait_until(lambda: len(arrived) > 30, '30 iterations', 60)
    request.cancel()
    request.result(30)
    late = np.array([at - elapsed for at, elapsed in arrived])
    # against the fastest of them; an iteration takes some 10 ms
    assert np.percentile(late - late.min(), 90) < 0.1


@pytest.mark.slow
def test_queue_that_is_full_rejects(client: PlannerClient, ros: None) -> None:
    with (
        NodeProcess('planner', namespace='/small', preempt='queue', queue_limit=2),
        Session('crowd') as session,
    ):
        small = PlannerClient(session, '/small/planner')
        first = start(small)
        second = small.send(FLIP)
        with pytest.raises(GoalRejected):
            small.send(FLIP)
        first.cancel()
        assert first.result(30).cancelled
        assert second.result(60).succeeded


# Processes that die. -----------------------------------------------------------------------------
def test_killed_workers_fail_their_goal_and_the_next_succeeds(
    client: PlannerClient, planner: NodeProcess, session: Session
) -> None:
    request = start(client)
    pids = workers(planner)
    assert len(pids) == 3  # one checks, one plans, one plans anew
    for pid in pids:
        os.kill(pid, signal.SIGKILL)
    outcome = request.result(30)
    assert not outcome.succeeded
    assert outcome.code == ResultCode.INTERNAL
    assert 'ended by SIGKILL' in outcome.result.message
    assert client.plan(FLIP, result_timeout=60).succeeded
    assert not set(pids) & set(workers(planner))
    values = figures(session, 'planner: planning')
    assert values['lost processes'] == '3'


def test_workers_end_with_a_node_that_is_killed(ros: None, session: Session) -> None:
    with NodeProcess('planner', namespace='/doomed') as process:
        start(PlannerClient(session, '/doomed/planner'))
        pids = workers(process)
        assert len(pids) == 2
        process.kill()
        Session.wait_until(lambda: not any(map(is_running, pids)), 'the end of the workers')


# Life cycle. -------------------------------------------------------------------------------------
def change(session: Session, label: str) -> None:
    request = ChangeState.Request(transition=Transition(label=label))
    assert session.call(ChangeState, '/planner/change_state', request).success


def test_goals_are_planned_while_the_node_is_active_only(
    client: PlannerClient, planner: NodeProcess, session: Session
) -> None:
    request = start(client)
    change(session, 'deactivate')
    outcome = request.result(30)
    assert outcome.code == ResultCode.CANCELLED
    assert 'deactivated' in outcome.result.message
    before = len(planner.output)
    with pytest.raises(GoalRejected):
        client.send(FLIP)
    assert 'ros2 lifecycle set /planner activate' in planner.output[before:]
    assert FLIP in session.call(ListProblems, '/planner/list_problems').names
    change(session, 'cleanup')
    assert workers(planner) == []
    assert session.call(ListProblems, '/planner/list_problems').names == []
    with pytest.raises(GoalRejected):
        client.send(FLIP)
    change(session, 'configure')
    change(session, 'activate')
    assert client.plan(FLIP, result_timeout=60).succeeded


# Hostile clients. --------------------------------------------------------------------------------
@pytest.mark.parametrize(
    'name',
    [
        '../../../../etc/passwd',
        '/etc/hostname',
        'problems/../quadcopter_flip',
        '!!python/object/apply:os.system [id]',
        'quadcopter_flip.yaml',
        '\u202egnp.exe',
        '%s%n{0.__class__}',
    ],
)
def test_names_that_are_paths_or_tags_are_refused(client: PlannerClient, name: str) -> None:
    outcome = client.plan(name, result_timeout=30)
    assert outcome.code == ResultCode.BAD_REQUEST
    assert 'no problem' in outcome.result.message


def test_oversized_goal_is_refused(client: PlannerClient) -> None:
    goal = PlanTrajectory.Goal(problem=FLIP)
    goal.guess.time = [float(i) for i in range(1_000_000)]  # 8 MB
    outcome = client.plan(goal=goal, result_timeout=30)
    assert outcome.code == ResultCode.BAD_REQUEST
    assert '1000000 values, at most 100000' in outcome.result.message


def test_wrong_types_and_garbage_leave_the_node_alive(
    client: PlannerClient, session: Session, planner: NodeProcess
) -> None:
    with Session('hostile') as hostile:
        other = hostile.node.create_client(GetState, '/planner/list_problems')
        other.call_async(GetState.Request())
        text = hostile.node.create_publisher(String, '/state', 10)
        for _ in range(10):
            text.publish(String(data='x'))
    states = session.publisher(VehicleState, '/state')
    for garbage in (b'', b'\x00\x01\x00\x00' + b'\xff' * 400, os.urandom(1000)):
        states.publish(garbage)
    message = VehicleState(state_names=['x_e'], states=[1.0, 2.0])

    def is_told() -> bool:
        states.publish(message)
        return '2 values for 1 names' in planner.output

    session.wait_until(is_told, 'the warning')
    assert client.plan(FLIP, result_timeout=60).succeeded
