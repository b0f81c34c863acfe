"""What nodes share: the life cycle and its gates, QoS overrides, diagnostics, clock jumps."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

import pytest
from ros_support import need_ros

need_ros()

import rclpy  # noqa: E402
from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from lifecycle_msgs.msg import Transition, TransitionEvent  # noqa: E402
from lifecycle_msgs.srv import ChangeState, GetState  # noqa: E402
from rcl_interfaces.msg import Parameter, ParameterValue  # noqa: E402
from rcl_interfaces.srv import SetParameters  # noqa: E402
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor  # noqa: E402
from rclpy.qos import ReliabilityPolicy  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from flightdyn.errors import FlightdynError, InputError  # noqa: E402
from flightdyn.nodes.base import STATE, BaseNode  # noqa: E402
from flightdyn.nodes.client import Inbox, Session  # noqa: E402
from flightdyn.nodes.diagnostics import Level, Status, diagnostics_msg  # noqa: E402
from flightdyn.nodes.parameters import NodeParameters, parameter  # noqa: E402


@dataclass(frozen=True)
class SpyParameters(NodeParameters):
    load: str = parameter('', 'what to load', unconfigured_only=True)
    fault: str = parameter('', 'which hook fails, and how')


class SpyNode(BaseNode):
    """Writes down what happens to it."""

    def __init__(self, context: rclpy.Context) -> None:
        super().__init__('spy', SpyParameters, context=context)
        self.calls: list[Any] = []
        self.heard = Inbox('heard')
        self.ticks = Inbox('ticks')
        self.jumps = Inbox('jumps')
        self.out = self.advertise(String, '~/out', STATE)
        self.subscribe(String, '~/in', self.heard.put, STATE)
        self.serve_trigger('ask', lambda: 'an answer')
        self.serve_trigger('ask_configured', lambda: 'an answer', when='configured')
        self.serve_trigger('crash', self._crash, when='always')
        self.every(0.01, lambda: self.ticks.put(None))

    def _crash(self) -> str:
        raise ZeroDivisionError

    def _call(self, name: str) -> None:
        self.calls.append(name)
        kind, _, hook = self.parameters.values.fault.partition(' ')
        if hook == name:
            raise InputError('as asked') if kind == 'refuse' else ZeroDivisionError

    def configure(self) -> None:
        self._call('configure')

    def activate(self) -> None:
        self._call('activate')
        self.out.publish(String(data='begun'))

    def deactivate(self) -> None:
        self._call('deactivate')
        self.out.publish(String(data='ended'))

    def clean_up(self) -> None:
        self._call('clean_up')

    def on_clock_jump(self, delta_ns: int) -> None:
        self.jumps.put(delta_ns)

    def diagnose(self) -> list[Status]:
        return [Status('spying', 'well', Level.WARN, {'length [m]': 1 / 3, 'calls': 2})]


@contextmanager
def spinning(*arguments: str) -> Iterator[SpyNode]:
    context = rclpy.Context()
    rclpy.init(args=['--ros-args', *arguments], context=context)
    node = SpyNode(context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def spin() -> None:
        with suppress(ExternalShutdownException):
            executor.spin()

    thread = threading.Thread(target=spin)
    thread.start()
    yield node
    executor.shutdown(timeout_sec=0)
    thread.join(5)
    node.finalize()
    node.destroy_node()
    rclpy.shutdown(context=context)


@pytest.fixture(scope='module')
def one_spy(ros: None) -> Iterator[SpyNode]:
    with spinning('-p', 'autostart:=false') as node:
        yield node


@pytest.fixture
def spy(one_spy: SpyNode, session: Session) -> SpyNode:
    """Return a node that is unconfigured and has not been called."""
    for label in ('deactivate', 'cleanup'):
        if state(session) in ('active', 'inactive'):
            change(session, label)
    assert state(session) == 'unconfigured'
    one_spy.calls.clear()
    one_spy.heard.clear()
    one_spy.ticks.clear()
    return one_spy


@pytest.fixture
def started(ros: None, request: pytest.FixtureRequest) -> Iterator[SpyNode]:
    """Spin a node with a test's ROS arguments."""
    with spinning(*request.param) as node:
        yield node


def change(session: Session, label: str) -> bool:
    request = ChangeState.Request(transition=Transition(label=label))
    return bool(session.call(ChangeState, '/spy/change_state', request).success)


def state(session: Session) -> str:
    return str(session.call(GetState, '/spy/get_state').current_state.label)


def set_text(session: Session, name: str, value: str) -> Any:
    value_msg = ParameterValue(type=4, string_value=value)
    request = SetParameters.Request(parameters=[Parameter(name=name, value=value_msg)])
    return session.call(SetParameters, '/spy/set_parameters', request).results[0]


def test_transitions_call_hooks_and_are_told(spy: SpyNode, session: Session) -> None:
    events = session.subscribe(TransitionEvent, '/spy/transition_event')
    out = session.subscribe(String, '/spy/out')
    assert state(session) == 'unconfigured'
    for label, after in (
        ('configure', 'inactive'),
        ('activate', 'active'),
        ('deactivate', 'inactive'),
        ('cleanup', 'unconfigured'),
        ('configure', 'inactive'),
        ('activate', 'active'),
    ):
        assert change(session, label)
        assert state(session) == after
    assert spy.calls == [
        'configure',
        'activate',
        'deactivate',
        'clean_up',
        'configure',
        'activate',
    ]
    # publishers are on during activate and deactivate
    said = out.wait(lambda m: len(m) == 3)
    assert [m.data for m in said] == ['begun', 'ended', 'begun']
    ends = ['inactive', 'active', 'inactive', 'unconfigured', 'inactive', 'active']

    def all_told(messages: list[Any]) -> bool:
        return [m.goal_state.label for m in messages if m.goal_state.id < 10] == ends

    events.wait(all_told)


@pytest.mark.parametrize('started', [[]], indirect=True)
def test_shutting_down_ends_what_was_begun(started: SpyNode) -> None:
    started.autostart()
    started.finalize()
    assert started.calls == ['configure', 'activate', 'deactivate', 'clean_up']
    assert started.state_label == 'finalized'
    started.finalize()  # at the end of the process: there is nothing left to do


def test_gates(spy: SpyNode, session: Session) -> None:
    into = session.publisher(String, '/spy/in')
    refused = session.call(Trigger, '/spy/ask')
    assert not refused.success
    assert 'ros2 lifecycle set /spy configure` and `ros2 lifecycle set /spy activate' in (
        refused.message
    )
    into.publish(String(data='too early'))
    spy.out.publish(String(data='dropped'))
    assert change(session, 'configure')
    assert session.call(Trigger, '/spy/ask_configured').success
    assert not session.call(Trigger, '/spy/ask').success
    assert not spy.ticks.messages
    assert change(session, 'activate')
    assert session.call(Trigger, '/spy/ask').success
    into.publish(String(data='in time'))
    assert [m.data for m in spy.heard.wait()] == ['in time']
    spy.ticks.wait()
    assert change(session, 'deactivate')
    spy.ticks.clear()
    assert not session.call(Trigger, '/spy/ask').success
    assert not spy.ticks.messages
    told = session.subscribe(DiagnosticArray, '/diagnostics').wait()[-1]
    values = {v.key: v.value for v in told.status[0].values}
    assert values['messages ignored while off'] == '1'


@pytest.mark.parametrize(
    ('fault', 'labels', 'after'),
    [
        ('refuse configure', ['configure'], 'unconfigured'),
        ('crash configure', ['configure'], 'unconfigured'),
        ('refuse activate', ['configure', 'activate'], 'inactive'),
        ('crash activate', ['configure', 'activate'], 'unconfigured'),
        ('crash deactivate', ['configure', 'activate', 'deactivate'], 'unconfigured'),
        ('crash clean_up', ['configure', 'cleanup'], 'unconfigured'),
    ],
)
def test_failing_transition_leaves_a_node_that_works(
    spy: SpyNode, session: Session, fault: str, labels: list[str], after: str
) -> None:
    assert set_text(session, 'fault', fault).successful
    assert [change(session, label) for label in labels] == [True] * (len(labels) - 1) + [False]
    assert state(session) == after
    assert not session.call(Trigger, '/spy/ask').success
    assert set_text(session, 'fault', '').successful
    if after == 'unconfigured':
        assert change(session, 'configure')
    assert change(session, 'activate')
    assert session.call(Trigger, '/spy/ask').success


def test_impossible_transition_is_refused(spy: SpyNode, session: Session) -> None:
    assert not change(session, 'activate')
    assert not change(session, 'fly')
    assert state(session) == 'unconfigured'


def test_crashing_service_answers(spy: SpyNode, session: Session) -> None:
    answer = session.call(Trigger, '/spy/crash')
    assert (answer.success, answer.message) == (False, 'internal error: ')


@pytest.mark.parametrize('started', [[]], indirect=True)
def test_autostart(started: SpyNode) -> None:
    started.autostart()
    assert started.state_label == 'active'


def test_without_autostart_a_node_waits(spy: SpyNode) -> None:
    spy.autostart()
    assert spy.state_label == 'unconfigured'


@pytest.mark.parametrize('started', [['-p', 'fault:=refuse activate']], indirect=True)
def test_autostart_tells_what_kept_it(started: SpyNode) -> None:
    with pytest.raises(InputError, match='as asked'):
        started.autostart()


@pytest.mark.parametrize('started', [['-p', 'fault:=crash configure']], indirect=True)
def test_autostart_tells_of_an_error_in_the_node(started: SpyNode) -> None:
    with pytest.raises(FlightdynError, match='ZeroDivisionError'):
        started.autostart()


@pytest.mark.parametrize('started', [['-p', 'viewer:=nonsense']], indirect=True)
def test_viewer_that_cannot_be_is_refused(started: SpyNode) -> None:
    with pytest.raises(InputError, match='viewer'):
        started.autostart()


def test_parameters_of_configuring_stay_while_configured(spy: SpyNode, session: Session) -> None:
    assert set_text(session, 'load', 'a').successful
    assert change(session, 'configure')
    refused = set_text(session, 'load', 'b')
    assert not refused.successful
    assert "stays 'a' while the node is configured" in refused.reason
    assert set_text(session, 'load', 'a').successful
    assert change(session, 'cleanup')
    assert set_text(session, 'load', 'b').successful


QOS = 'qos_overrides./spy/out.publisher'


@pytest.mark.parametrize(
    'started', [['-p', f'{QOS}.reliability:=best_effort', '-p', f'{QOS}.depth:=3']], indirect=True
)
def test_qos_is_overridden_for_one_topic(started: SpyNode) -> None:
    assert started.out.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT
    assert started.out.qos_profile.depth == 3
    assert STATE.reliability == ReliabilityPolicy.RELIABLE  # the profile itself is untouched
    assert started.get_parameter('qos_overrides./spy/in.subscription.depth').value == STATE.depth


def test_wrong_qos_is_refused(ros: None) -> None:
    with (
        pytest.raises(InputError, match=r'qos_overrides of ~/out: .*perhaps'),
        spinning('-p', f'{QOS}.reliability:=perhaps'),
    ):
        pass


def test_diagnostics(spy: SpyNode, session: Session) -> None:
    told = session.subscribe(DiagnosticArray, '/diagnostics').wait()[-1]
    assert [s.name for s in told.status] == ['spy: lifecycle', 'spy: spying']
    assert told.status[1].level == bytes([Level.WARN])
    assert {v.key: v.value for v in told.status[1].values} == {
        'length [m]': '0.3333',
        'calls': '2',
    }


def test_diagnostics_tell_instances_apart() -> None:
    message = diagnostics_msg('/left/spy', DiagnosticArray().header.stamp, [Status('a', 'b')])
    assert message.status[0].name == 'left/spy: a'


@pytest.mark.parametrize('started', [['-p', 'use_sim_time:=true']], indirect=True)
def test_backward_jump_of_the_clock_is_told(started: SpyNode, session: Session) -> None:
    clock = session.publisher(Clock, '/clock')
    message = Clock()

    def is_told() -> bool:
        clock.publish(message)  # best effort: what comes before all is connected is lost
        return bool(started.get_clock().now().nanoseconds == message.clock.sec * 10**9)

    for seconds in (100, 101, 40):
        message.clock.sec = seconds
        session.wait_until(is_told, f'{seconds} s')
    assert started.jumps.messages[-1] == -61 * 10**9
    assert all(delta <= 0 for delta in started.jumps.messages)
