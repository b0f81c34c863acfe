"""The process that plans, with a pipe held by the test: answers, stopping, what a client hears."""

import threading
from collections.abc import Iterator
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
import pytest

from flightdyn.errors import InputError, ResultCode
from flightdyn.nodes.plan_worker import (
    Answer,
    Call,
    PlanWorker,
    Progress,
    Progressed,
    Ready,
    Stop,
    Taken,
    with_wind,
)
from flightdyn.nodes.receding import ReplanRequest
from flightdyn.nodes.requests import EvaluateRequest, PlanRequest
from flightdyn.planning.planner import Planner
from flightdyn.planning.problem_file import load_problem
from flightdyn.planning.solver import Iteration

FLIP = 'quadcopter_flip'


def iteration(number: int) -> Iteration:
    return Iteration(number, 1.0, 2.0, 3.0, 99.0)


def test_progress_passes_first_and_last_and_thins_between() -> None:
    heard: list[Iteration] = []
    now = 100.0
    progress = Progress(heard.append, rate=64.0, clock=lambda: now)
    for number in range(10):  # four times as often as asked for; exact in binary
        progress(iteration(number))
        now += 1 / 256
    progress.flush()
    assert [item.number for item in heard] == [0, 4, 8, 9]
    assert [item.elapsed for item in heard[:2]] == [0.0, 4 / 256]


def test_last_iteration_is_not_said_twice() -> None:
    heard: list[Iteration] = []
    progress = Progress(heard.append, clock=lambda: 0.0)
    progress(iteration(0))
    progress.flush()
    progress.flush()
    assert len(heard) == 1


def test_refinement_counts_on() -> None:
    heard: list[Iteration] = []
    now = 0.0
    progress = Progress(heard.append, clock=lambda: now)
    for number in (0, 1, 2, 0, 1, 0):
        progress(iteration(number))
        now += 1.0
    assert [item.number for item in heard] == [0, 1, 2, 2, 3, 3]


class Faulty:
    """Fails as the request asks, or runs until it is told to stop."""

    def plan(self, problem: Any, *, should_stop: Any, **_: Any) -> Any:
        if problem.nodes == 13:
            raise InputError('no such thing')
        if problem.nodes == 14:
            raise ZeroDivisionError
        while not should_stop():
            pass
        raise InputError('stopped')


def served(planner: Any = None) -> Iterator[Connection]:
    ours, theirs = Pipe()
    thread = threading.Thread(target=PlanWorker(theirs, planner).run)
    thread.start()
    assert isinstance(ours.recv(), Ready)
    yield ours
    ours.close()
    thread.join(10)
    assert not thread.is_alive(), 'a worker has to end with its pipe'


@pytest.fixture(scope='module')
def pipe() -> Iterator[Connection]:
    yield from served()


@pytest.fixture
def faulty() -> Iterator[Connection]:
    yield from served(Faulty())


def ask(pipe: Connection, kind: str, body: Any, number: int = 7) -> Any:
    """Return the outcome, and on the way there the iterations."""
    pipe.send(Call(number, kind, body))
    assert pipe.recv() == Taken(number)
    heard = []
    while not isinstance(message := pipe.recv(), Answer):
        assert isinstance(message, Progressed)
        heard.append(message.iteration)
    assert message.number == number
    return message.outcome, heard


def request(**changes: Any) -> PlanRequest:
    return PlanRequest(problem=FLIP, most_wall_time=50.0, **changes)


def test_problems_are_listed(pipe: Connection) -> None:
    outcome, _ = ask(pipe, 'list', None)
    rows, wrong = outcome.value
    assert FLIP in [row[0] for row in rows]
    assert wrong == []


def test_checking_tells_the_time_limit_and_plans_nothing(pipe: Connection) -> None:
    outcome, heard = ask(pipe, 'check', request(nodes=30))
    assert outcome.code == ResultCode.SUCCESS
    assert outcome.message == 'quadcopter_flip with 30 nodes'
    assert outcome.value == 50.0  # the problem's own limit is above the most that is allowed
    assert heard == []
    outcome, _ = ask(pipe, 'check', request(max_wall_time=2.0))
    assert outcome.value == 2.0


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'initial': {'x_f': (0.0, 0.0)}}, 'did you mean'),
        ({'path': {'thrust_left': (2.0, 3.0)}}, 'can do'),
        ({'nodes': 100_000}, 'nodes'),
        ({'duration': (2.0, 1.0)}, 'duration'),
        ({'tolerance': float('nan')}, 'tolerance'),
        ({'max_wall_time': -1.0}, 'max_wall_time'),
        ({'settings': ('nodes=[1]',)}, 'nodes'),
    ],
)
def test_checking_refuses_with_words(pipe: Connection, changes: Any, words: str) -> None:
    outcome, _ = ask(pipe, 'check', request(**changes))
    assert outcome.code == ResultCode.BAD_REQUEST
    assert words in outcome.message


@pytest.mark.parametrize(
    'name', ['../problems/quadcopter_flip', '/etc/passwd', 'nope.yaml', 'quadcopter_flip\0', '']
)
def test_problems_are_names_not_paths(pipe: Connection, name: str) -> None:
    for kind, body in (
        ('check', PlanRequest(problem=name, most_wall_time=1.0)),
        ('plan', PlanRequest(problem=name, most_wall_time=1.0)),
        ('evaluate', EvaluateRequest(name, {}, {})),
        ('replan', replan_request(problem=name)),
    ):
        outcome, _ = ask(pipe, kind, body)
        assert outcome.code == ResultCode.BAD_REQUEST
        assert 'known: ' in outcome.message


def replan_request(**changes: Any) -> ReplanRequest:
    given: dict[str, Any] = {
        'problem': FLIP,
        'settings': (),
        'state': {},
        'controls': {},
        'time': 0.0,
        'lead': 0.0,
        'max_wall_time': 5.0,
    }
    return ReplanRequest(**{**given, **changes})


def test_plan_comes_with_wind_report_and_iterations(pipe: Connection) -> None:
    outcome, heard = ask(pipe, 'plan', request(wind_ned=(1.0, 2.0, 3.0)))
    assert outcome.code == ResultCode.SUCCESS
    assert outcome.report.verified
    assert [outcome.trajectory[f'wind_{axis}_e'][0] for axis in 'xyz'] == [1.0, 2.0, 3.0]
    assert heard[0].number == 0
    # the second time it starts from the plan before, and has less to do
    again, _ = ask(pipe, 'plan', request(wind_ned=(1.0, 2.0, 3.1)))
    assert again.code == ResultCode.SUCCESS
    assert again.report.build_s < outcome.report.build_s
    assert again.report.iterations < outcome.report.iterations


def test_wind_that_varies_comes_as_it_is_on_the_way() -> None:
    plan = Planner().plan(load_problem('dynamic_soaring', ['nodes=40', 'wind_ned=[1, 0, 0]']))
    flight = with_wind(plan)
    shear = 0.1 * flight['wind_strength']  # from the west, by the height
    np.testing.assert_allclose(flight['wind_x_e'], 1.0, atol=1e-12)
    np.testing.assert_allclose(flight['wind_y_e'], -shear * flight['z_e'], atol=1e-9)
    np.testing.assert_allclose(flight['wind_z_e'], 0.0, atol=1e-12)


def test_some_iterates_come_as_flights_if_asked_for(pipe: Connection) -> None:
    """Iterations that carry a function used to end the plan: it cannot go through a pipe."""
    pipe.send(Call(1, 'plan', request(final={'x_e': (1.7, 1.7)}), with_flights=True))
    assert isinstance(pipe.recv(), Taken)
    flights, iterations = [], 0
    while isinstance(message := pipe.recv(), Progressed):
        iterations += 1
        if message.flight is not None:
            flights.append(message.flight)
    assert message.outcome.code == ResultCode.SUCCESS
    assert 1 <= len(flights) <= iterations
    assert set(flights[0].states) == set(message.outcome.trajectory.states)


def test_without_warm_start_equal_requests_give_equal_plans(pipe: Connection) -> None:
    def plan(x_e: float) -> Any:
        call = Call(1, 'plan', request(final={'x_e': (x_e, x_e)}), warm_start=False)
        pipe.send(call)
        while not isinstance(message := pipe.recv(), Answer):
            pass
        return message.outcome.trajectory

    first = plan(1.3)
    plan(2.0)
    again = plan(1.3)
    assert (first['theta'] == again['theta']).all()


def test_infeasible_plan_brings_the_last_iterate(pipe: Connection) -> None:
    outcome, _ = ask(pipe, 'plan', request(duration=(0.1, 0.3)))
    assert outcome.code == ResultCode.INFEASIBLE
    assert not outcome.report.converged
    assert outcome.trajectory is not None


def test_errors_become_codes_and_the_worker_goes_on(faulty: Connection) -> None:
    outcome, _ = ask(faulty, 'plan', request(nodes=13))
    assert (outcome.code, outcome.message) == (ResultCode.BAD_REQUEST, 'no such thing')
    outcome, _ = ask(faulty, 'plan', request(nodes=14))
    assert outcome.code == ResultCode.INTERNAL
    assert 'ZeroDivisionError' in outcome.message
    assert 'test_plan_worker.py:' in outcome.fault


def test_stopping_is_for_one_call(faulty: Connection) -> None:
    faulty.send(Call(1, 'plan', request()))
    assert faulty.recv() == Taken(1)
    faulty.send(Stop(0))  # of a call that is over
    assert not faulty.poll(0.05)
    faulty.send(Stop(1))
    assert faulty.recv().outcome.message == 'stopped'


def test_worker_ends_with_its_pipe_in_the_midst_of_a_plan(faulty: Connection) -> None:
    faulty.send(Call(1, 'plan', request()))  # the fixture closes the pipe and waits
