"""Talking to the nodes from Python: for demos, tests and users' scripts.

with Session() as session:
    planner = PlannerClient(session)
    outcome = planner.plan('quadcopter_flip', final={'x_e': (2, 2)}, on_feedback=print)
    print(outcome.result.message, outcome.trajectory.duration)
"""

import contextlib
import threading
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from types import TracebackType
from typing import Any

import rclpy
from action_msgs.msg import GoalStatus
from rclpy.action import ActionClient
from rclpy.exceptions import InvalidHandle
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions

from flightdyn_msgs.action import PlanTrajectory
from flightdyn_msgs.msg import NamedBounds

from ..errors import FlightdynError, ResultCode
from ..trajectory import Trajectory
from .base import STATE
from .convert import to_message_unit, trajectory_from_message, trajectory_msg

TIMEOUT_S = 15.0

Bounds = Mapping[str, tuple[float, float] | float]


class NodeTimeout(FlightdynError):
    """Something that a node should have done did not happen in time."""


class Inbox:
    """Messages of one topic, in the order of their arrival."""

    def __init__(self, topic: str, keep: int | None = None) -> None:
        self.topic = topic
        self.messages: list[Any] = []
        self._keep = keep
        self._changed = threading.Condition()

    def put(self, message: Any) -> None:
        with self._changed:
            self.messages.append(message)
            if self._keep is not None:
                del self.messages[: -self._keep]
            self._changed.notify_all()

    def clear(self) -> None:
        with self._changed:
            self.messages.clear()

    def wait(
        self, ready: Callable[[list[Any]], Any] = len, timeout: float = TIMEOUT_S
    ) -> list[Any]:
        """Return the messages as soon as `ready(messages)` is true.

        Raises
        ------
        NodeTimeout
            If it does not become so.
        """
        with self._changed:
            if not self._changed.wait_for(lambda: ready(self.messages), timeout):
                raise NodeTimeout(
                    f'{self.topic}: not what was waited for within {timeout:g} s; '
                    f'{len(self.messages)} messages came'
                )
            return list(self.messages)


class Session:
    """A node of one's own, spun by a thread, in a context of its own; a context manager.

    Parameters
    ----------
    name, namespace : str
    use_sim_time : bool
        Whether `session.node.get_clock()` follows /clock.
    """

    def __init__(
        self, name: str = 'flightdyn_client', namespace: str = '', *, use_sim_time: bool = False
    ) -> None:
        self._context = rclpy.Context()
        rclpy.init(args=[], context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = rclpy.create_node(
            name,
            namespace=namespace,
            context=self._context,
            parameter_overrides=[Parameter('use_sim_time', value=use_sim_time)],
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._clients: dict[str, Any] = {}
        self._thread = threading.Thread(target=self._spin, name='client', daemon=True)
        self._thread.start()

    def __enter__(self) -> 'Session':
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Leave ROS; in this order, or rclpy ends the process."""
        self._executor.shutdown(timeout_sec=0)
        self._thread.join(TIMEOUT_S)
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)

    def _spin(self) -> None:
        # a callback may wake what is being taken down
        with contextlib.suppress(ExternalShutdownException, InvalidHandle):
            self._executor.spin()

    def made(self, make: Callable[[], Any]) -> Any:
        """Return what a function makes of the node, in the session's thread.

        Made in another while that one waits for messages, an action client once never came to be.
        """
        return self.wait(self._executor.create_task(make), 'the session', TIMEOUT_S)

    def subscribe(
        self,
        kind: Any,
        topic: str,
        qos: QoSProfile = STATE,
        *,
        keep: int | None = None,
        timeout: float = TIMEOUT_S,
    ) -> Inbox:
        """Return an inbox that is connected to at least one publisher.

        Raises
        ------
        NodeTimeout
            If nobody publishes.
        """
        inbox = Inbox(topic, keep)
        subscription = self.made(
            lambda: self.node.create_subscription(kind, topic, inbox.put, qos)
        )
        self.wait_until(subscription.get_publisher_count, f'a publisher of {topic}', timeout)
        return inbox

    def publisher(
        self, kind: Any, topic: str, qos: QoSProfile = STATE, timeout: float = TIMEOUT_S
    ) -> Any:
        """Return a publisher that is connected to at least one subscription."""
        publisher = self.made(lambda: self.node.create_publisher(kind, topic, qos))
        self.wait_until(publisher.get_subscription_count, f'a subscriber of {topic}', timeout)
        return publisher

    def call(self, kind: Any, name: str, request: Any = None, timeout: float = TIMEOUT_S) -> Any:
        """Return a service's response.

        Raises
        ------
        NodeTimeout
            If the service is not there or does not answer.
        """
        if name not in self._clients:
            self._clients[name] = self.made(lambda: self.node.create_client(kind, name))
        client = self._clients[name]
        if not client.wait_for_service(timeout):
            raise NodeTimeout(f'service {name} is not there after {timeout:g} s')
        return self.wait(client.call_async(request or kind.Request()), name, timeout)

    @staticmethod
    def wait(future: Any, what: str, timeout: float | None) -> Any:
        """Return the result of an rclpy future that the spinning thread completes."""
        done: Future[None] = Future()
        future.add_done_callback(lambda _: done.set_result(None))
        try:
            done.result(timeout)
        except TimeoutError:
            raise NodeTimeout(f'{what} did not answer within {timeout:g} s') from None
        return future.result()

    @staticmethod
    def wait_until(ready: Callable[[], Any], what: str, timeout: float = TIMEOUT_S) -> None:
        """Wait until a condition of the graph is true; the graph has to be asked for it."""
        pause = threading.Event()
        for _ in range(max(1, round(timeout / 0.005))):
            if ready():
                return
            pause.wait(0.005)
        raise NodeTimeout(f'{what} is not there after {timeout:g} s')


@dataclass(frozen=True)
class PlanOutcome:
    """What came back: the action's status and its result message."""

    status: int
    result: Any

    @property
    def code(self) -> ResultCode:
        return ResultCode(self.result.code)

    @property
    def succeeded(self) -> bool:
        return self.status == int(GoalStatus.STATUS_SUCCEEDED)

    @property
    def cancelled(self) -> bool:
        return self.status == int(GoalStatus.STATUS_CANCELED)

    @property
    def trajectory(self) -> Trajectory | None:
        """The plan, or the last iterate; None if there is none."""
        message = self.result.trajectory
        return trajectory_from_message(message) if len(message.time) else None


class GoalRejected(FlightdynError):
    """The planner did not accept a goal; its log says why."""

    result_code = ResultCode.BAD_REQUEST


class PlanRequest:
    """A goal that the planner works on."""

    def __init__(self, handle: Any) -> None:
        self._handle = handle
        self._result = handle.get_result_async()

    @property
    def is_done(self) -> bool:
        """Whether the result is there."""
        return bool(self._result.done())

    def cancel(self, timeout: float = TIMEOUT_S) -> bool:
        """Ask to stop; return whether the planner agreed."""
        response = Session.wait(self._handle.cancel_goal_async(), 'cancelling', timeout)
        return bool(response.goals_canceling)

    def result(self, timeout: float | None = None) -> PlanOutcome:
        """Wait for the end."""
        response = Session.wait(self._result, 'the planner', timeout)
        return PlanOutcome(int(response.status), response.result)


class PlannerClient:
    """Asks a planner node for plans."""

    def __init__(self, session: Session, planner: str = 'planner') -> None:
        self._session = session
        name = f'{planner}/plan_trajectory'
        self._client = session.made(lambda: ActionClient(session.node, PlanTrajectory, name))

    def send(
        self,
        problem: str = '',
        *,
        goal: Any = None,
        on_feedback: Callable[[Any], None] | None = None,
        timeout: float = TIMEOUT_S,
        **changes: Any,
    ) -> PlanRequest:
        """Send a goal and return as soon as it is accepted.

        Parameters
        ----------
        problem : str
            Name of a configured problem.
        goal : PlanTrajectory.Goal, optional
            Instead of `problem` and `changes`.
        on_feedback : function of PlanTrajectory.Feedback, optional
            Called in the session's thread.
        **changes
            See `goal_msg`.

        Raises
        ------
        GoalRejected
            If the planner does not accept it.
        NodeTimeout
            If there is no planner.
        """
        if not self._client.wait_for_server(timeout):
            raise NodeTimeout(f'no planner is there after {timeout:g} s')
        callback = on_feedback
        handle = Session.wait(
            self._client.send_goal_async(
                goal_msg(problem, **changes) if goal is None else goal,
                None if callback is None else lambda message: callback(message.feedback),
            ),
            'the planner',
            timeout,
        )
        if not handle.accepted:
            raise GoalRejected(f"the planner rejected '{problem}'; its log says why")
        return PlanRequest(handle)

    def plan(
        self, problem: str = '', *, result_timeout: float | None = None, **kw: Any
    ) -> PlanOutcome:
        """Send a goal and wait for its end; arguments as of `send`."""
        return self.send(problem, **kw).result(result_timeout)


def goal_msg(
    problem: str,
    *,
    initial: Bounds | None = None,
    final: Bounds | None = None,
    path: Bounds | None = None,
    duration: tuple[float, float] | None = None,
    wind_ned: Sequence[float] = (),
    guess: Trajectory | None = None,
    nodes: int = 0,
    tolerance: float = 0.0,
    max_wall_time: float = 0.0,
) -> Any:
    """Return a PlanTrajectory goal; what is left out stays as the problem's file says.

    Bounds are (lower, upper) or one fixed value, in the library's units.
    """
    goal = PlanTrajectory.Goal(
        problem=problem,
        nodes=int(nodes),
        tolerance=float(tolerance),
        max_wall_time=float(max_wall_time),
        initial_bounds=_bounds_msgs(initial),
        final_bounds=_bounds_msgs(final),
        path_bounds=_bounds_msgs(path),
        wind_ned=[float(w) for w in wind_ned],
    )
    if duration is not None:
        goal.duration_lower, goal.duration_upper = map(float, duration)
    if guess is not None:
        goal.guess = trajectory_msg(guess)
    return goal


def _bounds_msgs(given: Bounds | None) -> list[Any]:
    result = []
    for name, value in (given or {}).items():
        lower, upper = value if isinstance(value, tuple) else (value, value)
        result.append(
            NamedBounds(
                name=name, lower=to_message_unit(name, lower), upper=to_message_unit(name, upper)
            )
        )
    return result
