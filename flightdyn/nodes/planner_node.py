"""The planner node: one action, two services, the last plan for whoever comes late.

Goals are checked before they are accepted. ROS cannot carry a reason with a rejection, so it goes
to the node's log as a warning, and the `last rejection` of /diagnostics has it as well.
"""

import contextlib
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from nav_msgs.msg import Path
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.task import Future

from flightdyn_msgs.action import PlanTrajectory
from flightdyn_msgs.msg import Trajectory as TrajectoryMsg
from flightdyn_msgs.srv import EvaluateModel, ListProblems

from ..dynamics.stage import WIND
from ..errors import FlightdynError, ResultCode
from ..planning.problem import Problem
from ..planning.problem_file import list_problems
from ..planning.report import Plan
from ..planning.solver import Iteration
from ..resources import config_dirs
from ..trajectory import Trajectory
from .base import LATCHED, BaseNode
from .convert import path_msg, report_msg, trajectory_msg
from .parameters import Parameters, parameter
from .plan_worker import Job, Outcome, PlanWorker, summary
from .requests import evaluate_model, problem_of_goal

COUNTS = ('accepted', 'rejected', 'succeeded', 'failed', 'cancelled')


@dataclass(frozen=True)
class PlannerParameters:
    config_dir: str = parameter(
        '',
        'folder with problems/ and vehicles/ of your own, searched first; empty for none',
        read_only=True,
    )
    preempt: str = parameter(
        'replace',
        'what a goal does while another is being solved: it replaces that one, which is '
        'aborted, or it is rejected',
        choices=('replace', 'reject'),
    )
    max_wall_time: float = parameter(
        600.0, 'most that one goal may take', unit='s', lower=0.1, upper=86400.0
    )


class PlannerNode(BaseNode):
    """Plans on a thread of its own, so that services and cancelling are answered meanwhile."""

    def __init__(self) -> None:
        super().__init__('planner')
        self.parameters = Parameters(self, PlannerParameters)
        config_dirs(self.parameters.values.config_dir)
        self._worker = PlanWorker()
        self._ending = False
        self._jobs: dict[bytes, tuple[Job, Future]] = {}
        self._checked: Problem | None = None
        self._counts = dict.fromkeys(COUNTS, 0)
        self._last: dict[str, str] = {}
        self._level = DiagnosticStatus.OK
        self._trajectory = self.create_publisher(TrajectoryMsg, '~/trajectory', LATCHED)
        self._path = self.create_publisher(Path, '~/path', LATCHED)
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self.serve(ListProblems, 'list_problems', self._list_problems)
        self.serve(EvaluateModel, 'evaluate_model', self._evaluate_model)
        self.every(1.0, self._diagnose)
        self._action = ActionServer(
            self,
            PlanTrajectory,
            '~/plan_trajectory',
            execute_callback=self._execute,
            goal_callback=self.guarded(self._check_goal, GoalResponse.REJECT),
            handle_accepted_callback=self.guarded(self._accept),
            cancel_callback=self._cancel,
        )
        self.get_logger().info('ready to plan')

    # The action. ---------------------------------------------------------------------------------
    def _check_goal(self, goal: Any) -> GoalResponse:
        values = self.parameters.values
        try:
            if self._ending:
                raise FlightdynError('the planner is ending')
            if values.preempt == 'reject' and self._worker.busy:
                raise FlightdynError('another goal is being solved, and preempt is reject')
            self._checked = problem_of_goal(goal, values.config_dir, values.max_wall_time)
        except FlightdynError as error:
            self._counts['rejected'] += 1
            self._last['last rejection'] = str(error)
            self.get_logger().warning(f'goal rejected: {error}')
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _accept(self, handle: Any) -> None:
        # goals are checked and accepted in one go by the one spinning thread
        problem, self._checked = self._checked, None
        assert problem is not None
        done = Future(executor=self.executor)
        job = Job(
            problem,
            on_iteration=lambda iteration: handle.publish_feedback(_feedback(iteration)),
            on_done=lambda outcome: _deliver(done, outcome),
        )
        # a set result alone does not wake an executor that waits for messages, a callback does
        done.add_done_callback(lambda _: None)
        self._jobs[bytes(handle.goal_id.uuid)] = job, done
        self._counts['accepted'] += 1
        self.get_logger().info(f'planning {problem.name} with {problem.nodes} nodes')
        self._worker.submit(job, displace=self.parameters.values.preempt == 'replace')
        handle.execute()

    def _cancel(self, handle: Any) -> CancelResponse:
        job, _ = self._jobs.get(bytes(handle.goal_id.uuid), (None, None))
        if job is None:
            return CancelResponse.REJECT
        job.stop('cancelled')
        return CancelResponse.ACCEPT

    async def _execute(self, handle: Any) -> Any:
        key = bytes(handle.goal_id.uuid)
        _, done = self._jobs[key]
        outcome: Outcome = await done
        now_ns = self.get_clock().now().nanoseconds
        try:
            result = _result(outcome, now_ns)
            self._finish(handle, outcome, result, now_ns)
        except Exception as error:
            self.get_logger().error(f'{type(error).__name__}: {error}')
            result = _result(Outcome(ResultCode.INTERNAL, str(error)), 0)
            if handle.is_active:
                handle.abort()
        finally:
            del self._jobs[key]
        return result

    def _finish(self, handle: Any, outcome: Outcome, result: Any, now_ns: int) -> None:
        """Publish a plan that is one, end the goal, and write the one line on it."""
        line = f'{outcome.code.name}: {outcome.message}'
        self._level = DiagnosticStatus.OK
        if outcome.code == ResultCode.SUCCESS:
            assert outcome.plan is not None
            self._trajectory.publish(result.trajectory)
            self._path.publish(path_msg(outcome.plan.trajectory, now_ns))
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
            count, self._level = 'failed', DiagnosticStatus.ERROR
            self.get_logger().error(line)
        else:
            handle.abort()
            count, self._level = 'failed', DiagnosticStatus.WARN
            self.get_logger().warning(line)
        self._counts[count] += 1
        self._last |= summary(outcome)

    # The services. -------------------------------------------------------------------------------
    def _list_problems(self, _request: Any, response: Any) -> None:
        problems, wrong = list_problems(self.parameters.values.config_dir)
        for error in wrong:
            self.get_logger().warning(str(error))
        response.names = [problem.name for problem in problems]
        response.vehicles = [problem.vehicle.name for problem in problems]
        response.descriptions = [problem.description for problem in problems]

    def _evaluate_model(self, request: Any, response: Any) -> None:
        evaluate_model(request, self.parameters.values.config_dir, response)

    def _diagnose(self) -> None:
        busy = self._worker.busy
        status = DiagnosticStatus(
            level=self._level,
            name=f'{self.get_name()}: planning',
            message='solving' if busy else self._last.get('last code', 'waiting for goals'),
        )
        figures = {**{key: str(n) for key, n in self._counts.items()}, **self._last}
        status.values = [KeyValue(key=key, value=value) for key, value in figures.items()]
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)

    # The end. ------------------------------------------------------------------------------------
    def wind_down(self, seconds: float) -> None:
        """Stop solving, and let clients have their results."""
        self._ending = True
        if self._worker.stop('the planner is ending', seconds):
            # the spinning thread hands the results out: once it has dealt with what was queued
            # before, the results are set, and once more, they are sent
            until = time.monotonic() + seconds
            for _ in range(2):
                turn = self.executor.create_task(lambda: None)
                while not (turn.done() and not self._jobs) and time.monotonic() < until:
                    time.sleep(0.002)

    def close(self) -> None:
        self._action.destroy()

    def is_busy(self) -> bool:
        return self._worker.busy


def _deliver(done: Future, outcome: Outcome) -> None:
    with contextlib.suppress(RuntimeError):  # of an executor that is gone: nobody waits any more
        done.set_result(outcome)


def _feedback(iteration: Iteration) -> Any:
    return PlanTrajectory.Feedback(
        iteration=int(iteration.number),
        objective=float(iteration.objective),
        primal_infeasibility=float(iteration.primal_infeasibility),
        dual_infeasibility=float(iteration.dual_infeasibility),
        elapsed=float(iteration.elapsed),
    )


def _result(outcome: Outcome, stamp_ns: int) -> Any:
    result = PlanTrajectory.Result(code=int(outcome.code), message=outcome.message)
    if outcome.plan is not None:
        result.trajectory = trajectory_msg(with_wind(outcome.plan), stamp_ns)
        result.report = report_msg(outcome.plan.report)
    else:
        result.report.message = outcome.message
    return result


def with_wind(plan: Plan) -> Trajectory:
    """Return the plan's trajectory with the wind among its outputs.

    The message has no field for it, and who flies the plan needs the same air.
    """
    trajectory = plan.trajectory
    wind = {
        name: np.full(len(trajectory), float(value))
        for name, value in zip(WIND, plan.wind_ned, strict=True)
    }
    return replace(trajectory, outputs={**trajectory.outputs, **wind})
