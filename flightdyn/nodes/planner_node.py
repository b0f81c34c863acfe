"""The planner node: plans on request, and anew in flight; solvers run in processes of their own.

A goal is refused outright only where no plan is made of any: the node is not active, the queue is
full, or another goal is solved and `preempt` is `reject`. A goal with a mistake is accepted and
ends at once with BAD_REQUEST and what is wrong: ROS cannot carry a reason with a rejection.
"""

import contextlib
import time
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
from nav_msgs.msg import Path
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.task import Future

from flightdyn_msgs.action import PlanTrajectory
from flightdyn_msgs.msg import Trajectory as TrajectoryMsg
from flightdyn_msgs.msg import VehicleState
from flightdyn_msgs.srv import EvaluateModel, ListProblems

from ..errors import FlightdynError, InputError, ResultCode
from ..planning.solver import Iteration
from ..resources import config_dirs, list_configs
from ..trajectory import Trajectory
from .base import LATCHED, BaseNode
from .convert import (
    flat_table,
    path_msg,
    report_msg,
    trajectory_msg,
)
from .diagnostics import Level, Status
from .goals import evaluation_of_message, request_of_goal, sample_from_state_msg
from .parameters import NodeParameters, parameter
from .plan_queue import PlanQueue
from .plan_worker import Outcome
from .receding import ReplanRequest
from .replanner import Replanner, ReplanSettings
from .worker_process import Job, WorkerProcess, cancelled

COUNTS = ('accepted', 'rejected', 'succeeded', 'failed', 'cancelled', 'malformed')
WATCH_S = 0.05
REMEMBERED = 100  # solve times
PATH_POSES = 1000  # of ~/path: messages of poses are slow to make
LINGER_S = 0.1  # for the last results to leave
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Of states: one that was missed is of no use any more."""


@dataclass(frozen=True)
class PlannerParameters(NodeParameters):
    config_dir: str = parameter(
        '',
        'folder with problems/ and vehicles/ of your own, searched first; empty for none',
        read_only=True,
    )
    preempt: str = parameter(
        'replace',
        'what a goal does while others are planned: it waits its turn, it replaces them, which '
        'are aborted, or it is rejected',
        choices=('queue', 'replace', 'reject'),
    )
    queue_limit: int = parameter(
        16, 'how many goals may be under way or wait; more are rejected', lower=1, upper=1000
    )
    workers: int = parameter(
        1, 'how many goals are planned at a time', lower=1, upper=16, unconfigured_only=True
    )
    max_wall_time: float = parameter(
        600.0, 'most that one goal may take', unit='s', lower=0.1, upper=86400.0
    )
    warm_start: bool = parameter(
        True,
        'start from the last plan of the same problem; false makes equal goals give equal plans',
        unconfigured_only=True,
    )
    replan_problem: str = parameter(
        '', 'problem to plan anew in flight, from the states on state_topic; empty for none'
    )
    replan_settings: str = parameter(
        '', "entries of its file to override, such as 'nodes=30; wind_ned=[5, 0, 0]'"
    )
    replan_rate: float = parameter(
        1.0, 'how often it is planned anew', unit='Hz', lower=0.01, upper=100.0
    )
    replan_stop_before: float = parameter(
        5.0,
        'no new plan when less than this is left of the last one',
        unit='s',
        lower=0.0,
        upper=1e6,
    )
    state_topic: str = parameter(
        'sim/state', 'states of the vehicle to plan anew for', read_only=True
    )


class Goal:
    """A goal that was accepted: where it stands."""

    def __init__(self, handle: Any) -> None:
        self.handle = handle
        self.accepted = time.monotonic()
        self.job: Job | None = None
        self.reason = ''


class PlannerNode(BaseNode):
    """Takes goals, hands them to processes that plan, and tells what comes of them."""

    def __init__(self) -> None:
        super().__init__('planner', PlannerParameters)
        self._ending = False
        self._goals: dict[bytes, Goal] = {}
        self._checker: WorkerProcess | None = None
        self._workers: list[WorkerProcess] = []
        self._queue: PlanQueue | None = None
        self._replan_worker: WorkerProcess | None = None
        self._replanner: Replanner | None = None
        self._replan_job: Job | None = None
        self._states: Any = None
        self._listed: tuple[Any, Any] | None = None
        self._counts = dict.fromkeys(COUNTS, 0)
        self._solve_times: deque[float] = deque(maxlen=REMEMBERED)
        self._last: dict[str, Any] = {}
        self._level = Level.OK
        self._trajectory = self.advertise(TrajectoryMsg, '~/trajectory', LATCHED)
        self._path = self.advertise(Path, '~/path', LATCHED)
        self.serve(ListProblems, 'list_problems', self._list_problems, when='configured')
        self.serve(EvaluateModel, 'evaluate_model', self._evaluate_model, when='configured')
        self.every(WATCH_S, self._watch, when='configured')
        self._action = ActionServer(
            self,
            PlanTrajectory,
            '~/plan_trajectory',
            execute_callback=self._execute,
            goal_callback=self.guarded(self._take_goal, GoalResponse.REJECT),
            handle_accepted_callback=self.guarded(self._accept),
            cancel_callback=self.guarded(self._cancel, CancelResponse.REJECT),
        )

    # The life cycle. -----------------------------------------------------------------------------
    def configure(self) -> None:
        values = self.parameters.values
        config_dirs(values.config_dir)
        self._checker = WorkerProcess('checker', values.config_dir)
        self._workers = [
            WorkerProcess(f'worker {n + 1}', values.config_dir, warm_start=values.warm_start)
            for n in range(values.workers)
        ]
        self._queue = PlanQueue(self._workers)

    def activate(self) -> None:
        self._follow(self.parameters.values)
        self.get_logger().info('ready to plan')

    def deactivate(self) -> None:
        self._stop_goals('the planner was deactivated')
        self._follow(None)

    def clean_up(self) -> None:
        if self._queue is not None:
            self._queue.close()
        for worker in (self._checker, self._replan_worker):
            if worker is not None:
                worker.close()
        self._queue = self._checker = self._replan_worker = None
        self._workers = []
        self._listed = None

    def on_parameters(self, values: PlannerParameters) -> None:
        if self.is_active:
            self._follow(values)

    def on_clock_jump(self, delta_ns: int) -> None:
        if self._replanner is not None:
            self._replanner.forget()

    def wind_down(self, seconds: float) -> None:
        """Stop planning, and let clients have their results."""
        self._ending = True
        had_goals = bool(self._goals)
        until = time.monotonic() + seconds
        self._stop_goals('the planner is ending')
        if self._queue is not None and not self._queue.wait_until_idle(seconds / 2):
            self._queue.close()
        while self._goals and time.monotonic() < until:
            time.sleep(0.002)  # the spinning thread hands the results out
        if had_goals:
            time.sleep(LINGER_S)

    def _stop_goals(self, reason: str) -> None:
        for goal in list(self._goals.values()):
            self._stop(goal, reason)

    def _stop(self, goal: Goal, reason: str) -> None:
        goal.reason = goal.reason or reason
        if goal.job is not None and self._queue is not None:
            self._queue.stop(goal.job, reason)

    def _watch(self) -> None:
        if self._queue is not None:
            self._queue.watch()
        for worker in (self._checker, self._replan_worker):
            if worker is not None:
                worker.watch()

    # The action. ---------------------------------------------------------------------------------
    def _take_goal(self, _goal: Any) -> GoalResponse:
        values = self.parameters.values
        refusal = ''
        if self._ending:
            refusal = 'the planner is ending'
        elif not self.is_active:
            refusal = self.closed('plan_trajectory', 'active')
        elif values.preempt == 'reject' and self._goals:
            refusal = 'another goal is planned, and the parameter preempt is reject'
        elif len(self._goals) >= values.queue_limit:
            refusal = f'{len(self._goals)} goals are under way, the most that queue_limit allows'
        if not refusal:
            return GoalResponse.ACCEPT
        self._counts['rejected'] += 1
        self._last['last rejection'] = refusal
        self.get_logger().warning(f'goal rejected: {refusal}')
        return GoalResponse.REJECT

    def _accept(self, handle: Any) -> None:
        self._goals[bytes(handle.goal_id.uuid)] = Goal(handle)
        self._counts['accepted'] += 1
        handle.execute()

    def _cancel(self, handle: Any) -> CancelResponse:
        goal = self._goals.get(bytes(handle.goal_id.uuid))
        if goal is None:
            return CancelResponse.REJECT
        self._stop(goal, 'cancelled')
        return CancelResponse.ACCEPT

    async def _execute(self, handle: Any) -> Any:
        key = bytes(handle.goal_id.uuid)
        goal = self._goals[key]
        try:
            outcome = await self._outcome(goal)
            now_ns = self.get_clock().now().nanoseconds
            result = _result(outcome, now_ns)
            self._finish(handle, outcome, result, now_ns)
        except Exception as error:
            self.get_logger().error(f'{type(error).__name__}: {error}')
            result = _result(Outcome(ResultCode.INTERNAL, f'{type(error).__name__}: {error}'), 0)
            if handle.is_active:
                handle.abort()
        finally:
            del self._goals[key]
        return result

    async def _outcome(self, goal: Goal) -> Outcome:
        values = self.parameters.values
        try:
            request = request_of_goal(goal.handle.request, values.max_wall_time)
        except FlightdynError as error:
            return Outcome(error.result_code, str(error))
        checked = await self._ask('check', request)
        job = Job('plan', request, self._resume(goal_done := self._future()))
        job.reason = goal.reason
        if job.reason:
            return cancelled(job, 'not begun')
        if checked.code != ResultCode.SUCCESS or self._queue is None:
            return checked
        job.wall_time = checked.value
        job.on_iteration = lambda i: goal.handle.publish_feedback(_feedback(i, goal.accepted))
        job.on_flight = self.view.iteration if self.view is not None else None
        goal.job = job
        self.get_logger().info(f'planning {checked.message}')
        self._queue.submit(job, displace=self.parameters.values.preempt == 'replace')
        outcome: Outcome = await goal_done
        return outcome

    def _future(self) -> Future[Any]:
        future: Future[Any] = Future(executor=self.executor)
        # a set result alone does not wake an executor that waits for messages, a callback does
        future.add_done_callback(lambda _: None)
        return future

    @staticmethod
    def _resume(future: Future[Any]) -> Any:
        """Return a function that sets the result, from whatever thread."""

        def deliver(outcome: Outcome) -> None:
            with contextlib.suppress(RuntimeError):  # of an executor that is gone
                future.set_result(outcome)

        return deliver

    async def _ask(self, kind: str, body: Any) -> Outcome:
        """Return what the process that checks says."""
        if self._checker is None:
            return Outcome(ResultCode.CANCELLED, f'the node is {self.state_label}')
        answered = self._future()
        wall_time = self.parameters.values.max_wall_time
        self._checker.submit(Job(kind, body, self._resume(answered), wall_time=wall_time))
        outcome: Outcome = await answered
        return outcome

    def _finish(self, handle: Any, outcome: Outcome, result: Any, now_ns: int) -> None:
        """Publish a plan that is one, end the goal, and write the one line on it."""
        line = f'{outcome.code.name}: {outcome.message}'
        self._level = Level.OK
        if outcome.code == ResultCode.SUCCESS:
            assert outcome.trajectory is not None
            self._show(outcome.trajectory, result.trajectory, now_ns)
            handle.succeed()
            count = 'succeeded'
            self.get_logger().info(line)
        elif outcome.code == ResultCode.CANCELLED:
            if handle.is_cancel_requested:
                handle.canceled()
            else:
                handle.abort()
            count = 'cancelled'
            self.get_logger().info(line)
        elif outcome.code == ResultCode.INTERNAL:
            handle.abort()
            count, self._level = 'failed', Level.ERROR
            self.get_logger().error(f'{line} {outcome.fault}'.rstrip())
        else:
            handle.abort()
            count, self._level = 'failed', Level.WARN
            if outcome.code == ResultCode.BAD_REQUEST:
                count, self._level = 'malformed', Level.OK  # the client's mistake, not the node's
            self.get_logger().warning(line)
        self._counts[count] += 1
        self._last |= {'last code': outcome.code.name, 'last message': outcome.message}
        if outcome.report is not None:
            self._solve_times.append(outcome.report.wall_s)
            self._last |= {
                'last problem': outcome.trajectory.problem if outcome.trajectory else '',
                'last iterations': outcome.report.iterations,
                'last wall time [s]': outcome.report.wall_s,
            }

    def _show(self, plan: Trajectory, message: Any, start_ns: int) -> None:
        self._trajectory.publish(message)
        self._path.publish(path_msg(plan, start_ns, limit=PATH_POSES))
        if self.view is not None:
            self.view.trajectory(plan, entity='plan')

    # The services. -------------------------------------------------------------------------------
    async def _list_problems(self, _request: Any, response: Any) -> None:
        if self._listed is None or self._listed[0] != self._signature():
            await self._update_list()
        rows, wrong = ([], []) if self._listed is None else self._listed[1]
        for sentence in wrong:
            self.get_logger().warning(sentence)
        response.names = [row[0] for row in rows]
        response.vehicles = [row[1] for row in rows]
        response.descriptions = [row[2] for row in rows]

    async def _update_list(self) -> None:
        signature = self._signature()
        outcome = await self._ask('list', None)
        if outcome.code == ResultCode.SUCCESS:
            self._listed = signature, outcome.value
        else:
            self.get_logger().warning(f'list_problems: {outcome.message}')

    def _signature(self) -> list[Any]:
        """Return what changes when a configuration file does."""
        config_dir = self.parameters.values.config_dir
        found = []
        for kind in ('problems', 'vehicles'):
            for path in list_configs(kind, config_dir).values():
                with contextlib.suppress(OSError):
                    stat = path.stat()
                    found.append((path, stat.st_mtime_ns, stat.st_size))
        return found

    async def _evaluate_model(self, request: Any, response: Any) -> None:
        outcome = await self._ask('evaluate', evaluation_of_message(request))
        if outcome.code != ResultCode.SUCCESS:
            raise InputError(outcome.message)
        response.state_derivatives = flat_table(outcome.value.derivatives)
        response.output_names = list(outcome.value.outputs)
        response.outputs = flat_table(outcome.value.outputs)

    # Planning anew in flight. --------------------------------------------------------------------
    def _follow(self, values: PlannerParameters | None) -> None:
        """Plan anew what the parameters say, if anything."""
        if values is None or not values.replan_problem:
            if self._replan_job is not None and self._replan_worker is not None:
                self._replan_worker.stop(self._replan_job, 'no more plans are asked for')
            self._replanner = None
            return
        settings = ReplanSettings(
            problem=values.replan_problem,
            settings=tuple(s.strip() for s in values.replan_settings.split(';') if s.strip()),
            rate=values.replan_rate,
            stop_before=values.replan_stop_before,
            max_wall_time=values.max_wall_time,
        )
        if self._replanner is not None and self._replanner.settings == settings:
            return
        if self._replan_worker is None:
            self._replan_worker = WorkerProcess('replan', values.config_dir)
        if self._states is None:
            self._states = self.subscribe(
                VehicleState, values.state_topic, self._take_state, NEWEST
            )
        self._replanner = Replanner(
            settings,
            submit=self._submit_replan,
            publish=self._publish_replan,
            warn=self.get_logger().warning,
        )

    def _take_state(self, message: Any) -> None:
        if self._replanner is not None:
            now_ns = self.get_clock().now().nanoseconds
            self._replanner.take(sample_from_state_msg(message), now_ns)

    def _submit_replan(self, request: ReplanRequest, number: int) -> None:
        assert self._replan_worker is not None
        replanner = self._replanner

        def take(outcome: Outcome) -> None:
            if replanner is not None:
                replanner.done(number, outcome, self.get_clock().now().nanoseconds)

        def done(outcome: Outcome) -> None:
            if self.executor is not None:
                self.executor.create_task(self.guarded(take), outcome)

        self._replan_job = Job('replan', request, done, wall_time=request.max_wall_time)
        self._replan_worker.submit(self._replan_job)

    def _publish_replan(self, plan: Trajectory) -> None:
        self._show(plan, trajectory_msg(plan), plan.start_ns)

    # Diagnostics. --------------------------------------------------------------------------------
    def diagnose(self) -> list[Status]:
        queue = self._queue
        running, waiting = (queue.running, queue.waiting) if queue else (0, 0)
        others = [w for w in (self._checker, self._replan_worker) if w is not None]
        lost = sum(worker.restarts for worker in (*self._workers, *others))
        ended = self._counts['succeeded'] + self._counts['failed']
        times = np.array(self._solve_times) if self._solve_times else np.array([np.nan])
        values = {
            **self._counts,
            'success rate [%]': 100.0 * self._counts['succeeded'] / ended if ended else 'none yet',
            'median solve time [s]': float(np.median(times)),
            'longest solve time [s]': float(np.max(times)),
            'running': running,
            'waiting': waiting,
            'lost processes': lost,
            **self._last,
        }
        message = self._last.get('last code', 'waiting for goals')
        if running:
            message = f'planning, {waiting} wait'
        statuses = [Status('planning', message, self._level, values)]
        if self._replanner is not None:
            statuses.append(self._replanner.status(self.get_clock().now().nanoseconds))
        return statuses


def _feedback(iteration: Iteration, accepted: float) -> Any:
    return PlanTrajectory.Feedback(
        iteration=int(iteration.number),
        objective=float(iteration.objective),
        primal_infeasibility=float(iteration.primal_infeasibility),
        dual_infeasibility=float(iteration.dual_infeasibility),
        elapsed=time.monotonic() - accepted,
    )


def _result(outcome: Outcome, stamp_ns: int) -> Any:
    result = PlanTrajectory.Result(code=int(outcome.code), message=outcome.message)
    if outcome.trajectory is not None:
        result.trajectory = trajectory_msg(outcome.trajectory, stamp_ns)
    if outcome.report is not None:
        result.report = report_msg(outcome.report)
    result.report.message = outcome.message
    return result
