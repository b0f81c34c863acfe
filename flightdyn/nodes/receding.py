"""Planning again and again from where the vehicle will be; no ROS."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import casadi as cas
import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..planning.planner import Planner
from ..planning.problem import Problem
from ..planning.problem_file import load_problem
from ..planning.report import Plan
from ..resources import find_config
from ..simulation.integrator import rk4_step
from ..trajectory import Trajectory

Array = NDArray[np.float64]

MAX_BEGUN = 4  # plans; the newest may begin only after the one before has been flown for a while
MAX_STEP = 0.05  # s, of the prediction; well below the time scales of what flies


@dataclass(frozen=True, kw_only=True)
class ReplanRequest:
    """A new plan, from where the vehicle will be when it is ready.

    Parameters
    ----------
    problem : str
        Name of a configured problem.
    settings : sequence of 'KEY=VALUE'
        Override entries of its file.
    state : mapping of name to value
        As measured, in the library's units; it may name more than the model's states.
    controls : mapping of name to value
        In force at that instant, held for want of an earlier plan.
    time : float
        Of the state [s], on any clock that all requests share.
    lead : float
        How far ahead the plan begins [s].
    max_wall_time : float [s]
    fresh : bool
        Whether to forget the plans before.
    prepare : bool
        Only to get ready: the problem is built, and planned as it is written.
    """

    problem: str
    settings: tuple[str, ...]
    state: Mapping[str, float]
    controls: Mapping[str, float]
    time: float
    lead: float
    max_wall_time: float
    fresh: bool = False
    prepare: bool = False


class Horizon:
    """Plans of one problem, each from the neighbourhood of the one before.

    Raises
    ------
    InputError
        If there is no such problem, its settings are wrong, or it is in phases.
    """

    def __init__(self, planner: Planner, request: ReplanRequest, config_dir: str) -> None:
        self._planner = planner
        self._key = request.problem, request.settings
        find_config('problems', request.problem, config_dir)
        self._problem = load_problem(request.problem, request.settings, config_dir)
        if self._problem.phases:
            raise InputError(
                f'{request.problem}: a flight in phases cannot be planned anew from a state in '
                'the midst of them'
            )
        self._written: Plan | None = None
        self._plan: Plan | None = None
        self._begun: deque[tuple[float, Trajectory]] = deque(maxlen=MAX_BEGUN)
        self._step: cas.Function = rk4_step(self._problem.stage)

    def differs(self, request: ReplanRequest) -> bool:
        """Return whether a request is for another problem."""
        return (request.problem, request.settings) != self._key

    def plan(self, request: ReplanRequest, should_stop: Callable[[], bool]) -> Plan:
        """Return the plan; only a verified one is what the next starts from."""
        if request.prepare:
            as_written = replace(self._problem, max_wall_time=request.max_wall_time)
            plan = self._planner.plan(as_written, should_stop=should_stop)
            if plan.report.verified:
                self._written = self._plan = plan
            return plan
        if request.fresh:
            self._plan = self._written
            self._begun.clear()
        start = self.predicted(request)
        problem = replace(self.from_state(start), max_wall_time=request.max_wall_time)
        plan = self._planner.plan(problem, near=self._plan, should_stop=should_stop)
        if plan.report.verified:
            self._plan = plan
            self._begun.append((request.time + request.lead, plan.trajectory))
        return plan

    def predicted(self, request: ReplanRequest) -> dict[str, float]:
        """Return the model's states `lead` after a measured one, flown as planned so far.

        Raises
        ------
        InputError
            If a state of the model is missing.
        """
        stage, wind = self._problem.stage, np.asarray(self._problem.wind_ned, dtype=float)
        start = {name: request.state.get(name, np.nan) for name in stage.states}
        missing = [name for name, value in start.items() if not np.isfinite(value)]
        if missing:
            raise InputError(
                f'the state has no {", ".join(missing)}: a state of {self._problem.vehicle.name}'
            )
        steps = int(np.ceil(request.lead / MAX_STEP))
        x = np.array([start[name] for name in stage.states])
        edges = np.linspace(0.0, request.lead, steps + 1)
        for begin, end in pairwise(edges):
            u0, u1 = (self._controls(request, t) for t in (begin, end))
            p = [*wind, begin]
            x = self._step(x, u0, u1, p, end - begin).full().ravel()
        if not np.isfinite(x).all():
            raise InputError(f'the state cannot be flown on for {request.lead:g} s')
        return dict(zip(stage.states, map(float, x), strict=True))

    def _controls(self, request: ReplanRequest, after: float) -> Array:
        """Return the controls a while after the state: of the plan that is in force then.

        Before there are plans the controls stay as they are.
        """
        names = self._problem.stage.controls
        now = request.time + after
        if self._begun:
            begins, plan = next(
                (each for each in reversed(self._begun) if each[0] <= now), self._begun[0]
            )
            flown = plan.control_at(now - begins)
            return np.array([float(flown[name]) for name in names])
        limits = (self._problem.limits(name) for name in names)
        return np.array(
            [
                float(np.clip(request.controls.get(name, 0.0), *bounds))
                for name, bounds in zip(names, limits, strict=True)
            ]
        )

    def from_state(self, start: Mapping[str, float]) -> Problem:
        """Return the problem from a state, moved into the problem's bounds if it is beyond.

        What else the problem fixes at its start, a state in flight would contradict.
        """
        initial: dict[str, Any] = {}
        for name, value in start.items():
            lower, upper = self._problem.limits(name)
            inside = float(np.clip(value, lower, upper))
            initial[name] = inside, inside
        return replace(self._problem, initial=initial)
