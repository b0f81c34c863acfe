"""Planning anew in flight, over DDS: a vehicle that flies the plans as they come."""

import math
from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from ros_support import need_ros

need_ros()

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from nav_msgs.msg import Path  # noqa: E402
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue  # noqa: E402
from rcl_interfaces.srv import SetParameters  # noqa: E402

from flightdyn.logs.messages import trajectory_from_message  # noqa: E402
from flightdyn.nodes.base import LATCHED, STATE  # noqa: E402
from flightdyn.nodes.client import Inbox, Session  # noqa: E402
from flightdyn.nodes.convert import nanoseconds, time_msg  # noqa: E402
from flightdyn.nodes.process import NodeProcess  # noqa: E402
from flightdyn.trajectory import Trajectory  # noqa: E402
from flightdyn_msgs.msg import Trajectory as TrajectoryMsg  # noqa: E402
from flightdyn_msgs.msg import VehicleState  # noqa: E402

GLIDE = 'cessna152_glide'
RATE = 2.0
STATES = ('x_e', 'z_e', 'speed', 'gamma')
FIRST = {'x_e': 0.0, 'z_e': -1000.0, 'speed': 55.0, 'gamma': 0.0}


class Glider:
    """Publishes the states of a vehicle that flies each plan from its stamp on."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.plans: list[Trajectory] = []
        self._begun = self.now_ns
        self._out = session.node.create_publisher(VehicleState, '/state', STATE)
        session.node.create_subscription(
            TrajectoryMsg,
            '/planner/trajectory',
            lambda m: self.plans.append(trajectory_from_message(m)),
            LATCHED,
        )
        self._timer = session.node.create_timer(0.02, self._tick)

    @property
    def now_ns(self) -> int:
        return int(self.session.node.get_clock().now().nanoseconds)

    def state(self, ns: int) -> dict[str, float]:
        """Return where it is: on the newest plan that has begun, before that at its begin."""
        for plan in reversed(self.plans):
            if plan.start_ns <= ns:
                t = (ns - plan.start_ns) / 1e9
                return {name: float(plan.sample(name, t)) for name in STATES}
        if self.plans:
            return {name: float(self.plans[0][name][0]) for name in STATES}
        return FIRST

    def _tick(self) -> None:
        ns = self.now_ns
        message = VehicleState(time=(ns - self._begun) / 1e9, state_names=list(STATES))
        message.header.stamp = time_msg(ns)
        message.states = list(self.state(ns).values())
        message.control_names, message.controls = ['alpha'], [math.radians(4.0)]
        self._out.publish(message)

    def land(self) -> None:
        self._timer.cancel()


@pytest.fixture(scope='module')
def glider(ros: None) -> Iterator[Glider]:
    with (
        NodeProcess(
            'planner', replan_problem=GLIDE, replan_rate=RATE, state_topic='state'
        ) as node,
        Session('glider') as session,
    ):
        glider = Glider(session)
        session.wait_until(lambda: len(glider.plans) >= 1, 'a first plan', 60)
        yield glider
        glider.land()
        node.check()


def status(inbox: Inbox) -> dict[str, Any]:
    """Return the next status of planning anew."""
    inbox.clear()

    def found(messages: list[Any]) -> list[Any]:
        return [s for m in messages for s in m.status if s.name == 'planner: planning anew']

    last = found(inbox.wait(found))[-1]
    return {'level': last.level, 'message': last.message} | {
        item.key: item.value for item in last.values
    }


def test_plans_keep_coming_and_each_begins_on_the_one_before(glider: Glider) -> None:
    # until the first plan begins the glider hangs in the air, which the next two may start from
    glider.session.wait_until(lambda: len(glider.plans) >= 7, 'six more plans', 60)
    plans = glider.plans[3:7]
    starts = np.array([plan.start_ns for plan in plans]) / 1e9
    assert (np.diff(starts) > 0).all()
    for before, after in pairwise(plans):
        t = (after.start_ns - before.start_ns) / 1e9
        for name in STATES:
            span = float(np.ptp(before[name]))
            # plans are good for 1e-3 of each range, their bends are sampled linearly, and on a
            # busy machine the glider hears late of the plan that it is to be on
            assert after[name][0] == pytest.approx(
                float(before.sample(name, t)), abs=1e-2 * span
            ), name
        # nothing disturbs the glide, so the end it is to reach stays where it was
        assert after['x_e'][-1] == pytest.approx(before['x_e'][-1], rel=2e-3)


def test_path_has_the_stamps_of_the_plan(glider: Glider) -> None:
    path = glider.session.subscribe(Path, '/planner/path', LATCHED).wait()[-1]
    starts = {plan.start_ns for plan in glider.plans}
    assert nanoseconds(path.poses[0].header.stamp) in starts


def test_failure_keeps_the_plan_and_is_told_with_its_age(glider: Glider) -> None:
    session = glider.session
    told = session.subscribe(DiagnosticArray, '/diagnostics')

    def is_well() -> bool:
        now = status(told)
        return bool(now['level'] == b'\x00' and float(now['plan age [s]']) < 2 / RATE)

    # a loaded machine may be late at times
    assert any(is_well() for _ in range(10))
    set_settings(session, 'final.x_e=1.0e+6')  # no glide reaches that far
    kept = len(glider.plans)
    told.clear()

    def has_failed(messages: list[Any]) -> bool:
        return any('INFEASIBLE' in s.message for m in messages for s in m.status)

    told.wait(has_failed, 60)
    assert len(glider.plans) <= kept + 1  # one may have been on its way
    set_settings(session, '')
    session.wait_until(lambda: len(glider.plans) >= kept + 2, 'plans again', 60)


def set_settings(session: Session, settings: str) -> None:
    value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=settings)
    request = SetParameters.Request(parameters=[Parameter(name='replan_settings', value=value)])
    answer = session.call(SetParameters, '/planner/set_parameters', request)
    assert answer.results[0].successful


def test_states_that_begin_again_begin_a_new_flight(glider: Glider) -> None:
    session, count = glider.session, len(glider.plans)
    glider._begun = glider.now_ns
    plans, glider.plans = glider.plans, []
    session.wait_until(lambda: len(glider.plans) >= 1, 'a plan of the new flight', 60)
    # from where it began the first time, not from where it had got
    assert glider.plans[0]['x_e'][0] < plans[-1]['x_e'][0]
    assert count > 0
