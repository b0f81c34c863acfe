"""The planner as a process, asked over DDS."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from ros_support import command, need_ros

need_ros()

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from nav_msgs.msg import Path  # noqa: E402
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue  # noqa: E402
from rcl_interfaces.srv import DescribeParameters, SetParameters  # noqa: E402

from flightdyn.errors import ResultCode  # noqa: E402
from flightdyn.nodes.base import LATCHED  # noqa: E402
from flightdyn.nodes.client import (  # noqa: E402
    GoalRejected,
    Inbox,
    PlannerClient,
    PlanRequest,
    Session,
    goal_msg,
)
from flightdyn.nodes.process import NodeProcess  # noqa: E402
from flightdyn_msgs.msg import NamedBounds  # noqa: E402
from flightdyn_msgs.msg import Trajectory as TrajectoryMsg  # noqa: E402
from flightdyn_msgs.srv import EvaluateModel, ListProblems  # noqa: E402

FLIP = 'quadcopter_flip'
# hundreds of iterations of some 10 ms each: time enough to cut in
LONG: dict[str, Any] = {'final': {'x_e': 300.0}, 'nodes': 300}


@pytest.fixture(scope='module')
def planner(ros: None) -> Iterator[NodeProcess]:
    with NodeProcess('planner', command=command('planner')) as process:
        yield process
        process.check()


@pytest.fixture(scope='module')
def client(planner: NodeProcess, session: Session) -> PlannerClient:
    return PlannerClient(session)


def start(client: PlannerClient, **changes: Any) -> tuple[PlanRequest, Inbox]:
    """Send a long goal and return when it is being solved."""
    heard = Inbox('feedback')
    request = client.send(FLIP, on_feedback=heard.put, **{**LONG, **changes})
    heard.wait()
    return request, heard


def parameter(session: Session, name: str, value: Any) -> Any:
    kinds = {
        str: (ParameterType.PARAMETER_STRING, 'string_value'),
        float: (ParameterType.PARAMETER_DOUBLE, 'double_value'),
        int: (ParameterType.PARAMETER_INTEGER, 'integer_value'),
    }
    kind, field = kinds[type(value)]
    request = SetParameters.Request(
        parameters=[Parameter(name=name, value=ParameterValue(type=kind, **{field: value}))]
    )
    return session.call(SetParameters, '/planner/set_parameters', request).results[0]


def test_goal_feedback_and_result(client: PlannerClient) -> None:
    heard = Inbox('feedback')
    outcome = client.plan(FLIP, on_feedback=heard.put, result_timeout=30)
    assert outcome.succeeded
    assert outcome.code == ResultCode.SUCCESS
    report, trajectory = outcome.result.report, outcome.trajectory
    assert report.converged
    assert report.verified
    assert trajectory is not None
    assert trajectory.duration == pytest.approx(report.final_time)
    assert trajectory['x_e'][-1] == pytest.approx(1.0, abs=1e-6)
    assert trajectory['theta'][-1] == pytest.approx(-2 * math.pi, abs=1e-6)
    numbers = [item.iteration for item in heard.messages]
    assert numbers == sorted(numbers)
    assert numbers[0] == 0
    assert heard.messages[-1].elapsed > heard.messages[0].elapsed


def test_overrides_reach_the_plan(client: PlannerClient) -> None:
    outcome = client.plan(
        FLIP,
        final={'x_e': (1.2, 1.5)},
        path={'thrust_left': (0.0, 0.9)},
        wind_ned=[1.0, 2.0, 3.0],
        nodes=60,
        result_timeout=30,
    )
    trajectory = outcome.trajectory
    assert trajectory is not None
    assert len(trajectory) > 60
    assert 1.2 - 1e-6 <= trajectory['x_e'][-1] <= 1.5 + 1e-6
    assert trajectory['thrust_left'].max() <= 0.9 + 1e-6
    assert [trajectory[f'wind_{axis}_e'][0] for axis in 'xyz'] == [1.0, 2.0, 3.0]


def test_earlier_plan_serves_as_guess(client: PlannerClient) -> None:
    first = client.plan(FLIP, result_timeout=30).trajectory
    assert first is not None
    second = client.plan(FLIP, guess=first, result_timeout=30)
    assert second.succeeded


def test_last_plan_waits_for_latecomers(client: PlannerClient, ros: None) -> None:
    outcome = client.plan(FLIP, result_timeout=30)
    with Session('latecomer') as late:
        plan = late.subscribe(TrajectoryMsg, '/planner/trajectory', LATCHED).wait()[0]
        path = late.subscribe(Path, '/planner/path', LATCHED).wait()[0]
    assert plan == outcome.result.trajectory
    assert path.header.frame_id == 'map'
    last = path.poses[-1].pose.position
    assert (last.x, last.y, last.z) == pytest.approx((0, 1, 0), abs=1e-6)


def test_failure_is_aborted_with_a_code_and_not_published(
    client: PlannerClient, session: Session
) -> None:
    assert client.plan(FLIP, result_timeout=30).succeeded
    plans = session.subscribe(TrajectoryMsg, '/planner/trajectory', LATCHED)
    plans.wait()
    outcome = client.plan(FLIP, duration=(0.1, 0.3), result_timeout=90)
    assert not outcome.succeeded
    assert outcome.code == ResultCode.INFEASIBLE
    assert 'no flight was found that keeps all conditions' in outcome.result.message
    assert 'duration is ' in outcome.result.message
    assert ' above 0.3;' in outcome.result.message
    assert not outcome.result.report.converged
    assert outcome.trajectory is not None  # the last iterate
    assert len(plans.messages) == 1


def test_cancel_takes_effect_within_an_iteration(client: PlannerClient) -> None:
    request, heard = start(client)
    assert request.cancel()
    heard_before = heard.messages[-1].iteration
    outcome = request.result(10)
    assert outcome.cancelled
    assert outcome.code == ResultCode.CANCELLED
    assert outcome.trajectory is not None
    assert not outcome.result.report.converged
    # one iteration was under way, and one more may have been while feedback was on its way
    assert heard.messages[-1].iteration <= heard_before + 2


def test_services_are_answered_while_solving(client: PlannerClient, session: Session) -> None:
    request, _ = start(client)
    problems = session.call(ListProblems, '/planner/list_problems')
    row = dict(zip(problems.names, problems.vehicles, strict=True))
    assert row[FLIP] == 'quadcopter'
    assert len(problems.descriptions) == len(problems.names)

    # hovering upright, and falling nose down: free fall along the body's x axis
    asked = EvaluateModel.Request(vehicle='quadcopter')
    asked.state_names = ['theta', 'x_e', 'z_e', 'u_b', 'w_b', 'q']
    asked.states = [0.0] * 6 + [-math.pi / 2] + [0.0] * 5
    asked.control_names = ['thrust_left', 'thrust_right']
    asked.controls = [0.4905, 0.4905, 0.0, 0.0]
    answer = session.call(EvaluateModel, '/planner/evaluate_model', asked)
    assert answer.success, answer.message
    rows = np.array(answer.state_derivatives).reshape(2, 6)
    assert rows[0] == pytest.approx(np.zeros(6), abs=1e-9)
    assert rows[1] == pytest.approx([0, 0, 0, 9.81, 0, 0], abs=1e-9)
    outputs = np.array(answer.outputs).reshape(2, -1)
    assert outputs[0, answer.output_names.index('load_factor')] == pytest.approx(1.0)

    assert not request.is_done, 'the solve was over too soon to tell'
    request.cancel()
    request.result(10)


@pytest.mark.parametrize(
    ('changes', 'words'),
    [
        ({'vehicle': 'nope'}, 'nope'),
        ({'state_names': ['x_e']}, 'missing'),
        ({'states': [1.0]}, 'rows'),
        ({'states': [math.nan] * 6}, 'finite'),
        ({'control_names': ['thrust_left', 'lift']}, 'lift'),
    ],
)
def test_malformed_evaluations_are_refused(
    client: PlannerClient, session: Session, changes: dict[str, Any], words: str
) -> None:
    asked = EvaluateModel.Request(
        vehicle='quadcopter',
        state_names=['theta', 'x_e', 'z_e', 'u_b', 'w_b', 'q'],
        states=[0.0] * 6,
        control_names=['thrust_left', 'thrust_right'],
        controls=[0.0] * 2,
    )
    for key, value in changes.items():
        setattr(asked, key, value)
    answer = session.call(EvaluateModel, '/planner/evaluate_model', asked)
    assert not answer.success
    assert words in answer.message


def odd_goals() -> Iterator[Any]:
    def goal(words: str, problem: str = FLIP, **fields: Any) -> Any:
        message = goal_msg(problem)
        for key, value in fields.items():
            setattr(message, key, value)
        return pytest.param(message, words, id=words)

    bound = NamedBounds
    yield goal('nope', 'nope')
    yield goal('no problem', '/etc/passwd.yaml')
    yield goal('did you mean', initial_bounds=[bound(name='x_f', lower=0.0, upper=0.0)])
    yield goal('NaN', final_bounds=[bound(name='x_e', lower=math.nan, upper=0.0)])
    yield goal('above the upper', path_bounds=[bound(name='x_e', lower=1.0, upper=0.0)])
    yield goal('twice', path_bounds=[bound(name='x_e')] * 2)
    yield goal('can do', path_bounds=[bound(name='thrust_left', lower=2.0, upper=3.0)])
    yield goal('nodes', nodes=100_000)
    yield goal('wind_ned', wind_ned=[1.0, 2.0])
    yield goal('duration', duration_lower=2.0, duration_upper=1.0)
    yield goal('tolerance', tolerance=math.nan)
    yield goal("planner's limit", max_wall_time=1e6)
    yield goal('max_wall_time must be positive', max_wall_time=-1.0)
    yield goal('a name is empty', problem='')
    yield goal('10000 characters', problem='x' * 10_000)
    yield goal('at most 1000', path_bounds=[bound(name='x_e')] * 1001)
    yield goal('no times', guess=TrajectoryMsg(states=[1.0]))
    yield goal('values, at most', guess=TrajectoryMsg(time=[0.0], states=[0.0] * 100_001))
    guess = TrajectoryMsg(time=[0.0, 1.0], state_names=['x_e'], states=[1.0])
    yield goal('1 values for 2 times', guess=guess)
    guess = TrajectoryMsg(time=[0.0, 1.0], state_names=['x'], states=[1.0, 2.0])
    yield goal("unknown 'x'", guess=guess)


@pytest.mark.parametrize(('goal', 'words'), list(odd_goals()))
def test_malformed_goals_end_with_a_code_and_the_reason(
    client: PlannerClient, planner: NodeProcess, session: Session, goal: Any, words: str
) -> None:
    before = len(planner.output)
    outcome = client.plan(goal=goal, result_timeout=10)
    assert not outcome.succeeded
    assert outcome.code == ResultCode.BAD_REQUEST
    assert words in outcome.result.message
    assert outcome.trajectory is None
    session.wait_until(lambda: words in planner.output[before:], 'the reason in the log')
    (line,) = [line for line in planner.output[before:].splitlines() if words in line]
    assert '[WARN]' in line


def test_second_goal_is_rejected_or_replaces_the_first(
    client: PlannerClient, session: Session
) -> None:
    first, _ = start(client)
    assert parameter(session, 'preempt', 'reject').successful
    try:
        with pytest.raises(GoalRejected):
            client.send(FLIP)
    finally:
        assert parameter(session, 'preempt', 'replace').successful
    second = client.send(FLIP)
    displaced = first.result(10)
    assert displaced.code == ResultCode.CANCELLED
    assert not displaced.cancelled  # aborted: nobody asked to cancel it
    assert 'displaced' in displaced.result.message
    assert second.result(30).succeeded


def test_parameters_are_described_checked_and_take_whole_numbers(
    client: PlannerClient, session: Session
) -> None:
    request = DescribeParameters.Request(names=['max_wall_time', 'preempt', 'config_dir'])
    wall, preempt, config_dir = session.call(
        DescribeParameters, '/planner/describe_parameters', request
    ).descriptors
    assert '[s]' in wall.description
    assert wall.floating_point_range[0].from_value > 0
    assert 'replace' in preempt.additional_constraints
    assert config_dir.read_only
    refused = parameter(session, 'preempt', 'sometimes')
    assert not refused.successful
    assert 'replace or reject' in refused.reason
    assert not parameter(session, 'max_wall_time', -1.0).successful
    assert parameter(session, 'max_wall_time', 300).successful


def test_time_limit(client: PlannerClient) -> None:
    outcome = client.plan(FLIP, max_wall_time=0.2, result_timeout=30, **LONG)
    assert outcome.code == ResultCode.TIME_LIMIT


def test_diagnostics_tell_the_last_outcome(client: PlannerClient, session: Session) -> None:
    client.plan(FLIP, result_timeout=30)
    inbox = session.subscribe(DiagnosticArray, '/diagnostics')
    inbox.clear()
    (status,) = [s for s in inbox.wait()[-1].status if s.name == 'planner: planning']
    values = {item.key: item.value for item in status.values}
    assert values['last code'] == 'SUCCESS'
    assert int(values['succeeded']) >= 1
