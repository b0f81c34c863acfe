"""Sweeps of plans: a job for each case, and what is done for it wherever it is run.

What a case gives depends on the case and on few neighbours alone, leaders, of which the first
that has a plan is where its solve starts. A leader's plan starts from its own guess, and a process
that has not got it makes it. So neither the number of processes, nor their order, nor an
interruption changes a result.
"""

import hashlib
from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .batch import Batch, Job, Row, installed_version
from .errors import EXIT_CODES, InputError, NotConvergedError, ResultCode
from .export import write_flight
from .planning.conditions import structure
from .planning.expression import Expression
from .planning.plan_file import plan_document
from .planning.plan_values import REPORTED, check_value, quantities_of, value_of
from .planning.planner import Planner
from .planning.problem import Problem
from .planning.problem_file import load_problem
from .planning.refinement import first_mesh
from .planning.report import Plan
from .planning.sampling import neighbourhoods
from .planning.sweep import ENDS, Case, Footprint, Sweep, is_number
from .tables import SUFFIXES, read_table

if TYPE_CHECKING:
    from .viewing.footprint import Area

PICTURE, FOOTPRINT = 'sweep.png', 'footprint.rrd'
NEIGHBOURS = 16
"""Most cases that start from one: as many solves for one from the problem's guess."""
LEADERS = 3
"""How many of them are tried, from the middle outwards, for a plan to start the others from."""
MAX_KEPT = 2 * LEADERS  # plans that a process keeps to start others from
PASSING = (ResultCode.TIME_LIMIT, ResultCode.CANCELLED, ResultCode.INTERNAL)
"""Failures that another time or a faster machine may not see: they are tried again."""


def sweep_jobs(sweep: Sweep) -> list[Job]:
    """Return a job for each case of a sweep.

    Raises
    ------
    InputError
        If no case is a problem, or a value that is asked for is none of the plans'.
    """
    cases = list(sweep.cases())
    problems: list[str | None] = [None] * len(cases)
    kinds: dict[Any, list[int]] = {}
    wrong: InputError | None = None
    for case in cases:
        try:
            problem = sweep.load(case)
            kind = _kind(problem)
        except InputError as error:  # said once more where it is done, in the table
            wrong = wrong or error
            continue
        if kind not in kinds:
            for formula in sweep.values.values():
                check_value(formula, quantities_of(problem), case.parameters)
        problems[case.number] = digest(problem)
        kinds.setdefault(kind, []).append(case.number)
    if wrong is not None and not kinds:
        raise wrong
    leaders = _leaders(sweep, kinds.values())
    width = len(str(len(cases) - 1))
    return [
        _job(sweep, case, [cases[n] for n in leaders[case.number]], problems, width)
        for case in cases
    ]


def _kind(problem: Problem) -> Any:
    """Return what problems have in common that can start from one another's plans."""
    lean = problem.without_limits()
    return repr(problem.vehicle), structure(lean, first_mesh(lean))


def _leaders(sweep: Sweep, kinds: Iterable[list[int]]) -> dict[int, list[int]]:
    """Return the cases whose plans each one may start from."""
    leaders: dict[int, list[int]] = {number: [] for number in range(sweep.samples)}
    if sweep.start == 'cold':
        return leaders
    for members in kinds:
        for group in neighbourhoods(sweep.places[members], NEIGHBOURS):
            numbers = [members[each] for each in group]
            leaders |= dict.fromkeys(numbers, numbers[:LEADERS])
    return leaders


def _job(
    sweep: Sweep, case: Case, leaders: Sequence[Case], problems: Sequence[str | None], width: int
) -> Job:
    values = {name: formula.source for name, formula in sweep.values.items()}
    # of what is no problem nothing is left to tell it by
    what = [problems[each.number] or each.settings for each in (case, *leaders)]
    key = f'{case.number:0{width}}'
    return Job(
        key=key,
        output=f'plans/{key}{sweep.plans}',
        arguments={
            'problem': sweep.problem,
            'settings': case.settings,
            'known': problems[case.number],
            'leaders': [leader.settings for leader in leaders],
            'start': sweep.start,
            'values': values,
            'parameters': dict(case.parameters),
            'config_dir': sweep.config_dir,
        },
        columns=sweep.told(case),
        fingerprint=digest([what, sweep.start, values, installed_version()]),
        group=f'{leaders[0].number}' if leaders else '',
    )


def plan_job(
    output: Path,
    *,
    problem: str,
    settings: Sequence[str],
    known: str | None,
    leaders: Sequence[Sequence[str]],
    start: str,
    values: Mapping[str, str],
    parameters: Mapping[str, Any],
    config_dir: str | None,
) -> Row:
    """Plan a case, write its flight, and return its row of the table.

    Parameters
    ----------
    settings : sequence of 'KEY=VALUE'
        Of the case.
    leaders : sequence of settings
        Of those of which the first that has a plan is where this one starts, if it is not among
        these before.
    known : str or None
        Digest of what the problem was when the sweep was laid out.
    values : mapping of name to formula

    Raises
    ------
    InputError
        If it is no problem, or not the one that it was.
    NotConvergedError
        If it may go well another time: when time was up.
    """
    made = load_problem(problem, settings, config_dir)
    if known is not None and known != digest(made):
        raise InputError(
            f'{problem}: not what it was when the sweep was started: its files, or those of its '
            'vehicle, have changed or are others here'
        )
    leading = (load_problem(problem, each, config_dir) for each in leaders)
    plan = _planned(made, leading, start)
    report = plan.report
    if report.code in PASSING:
        raise NotConvergedError(report.message, report.code, plan)
    write_flight(output, plan.trajectory, plan_document(plan))
    figures = {name: getattr(report, name) for name in REPORTED}
    if not report.verified:  # the last iterate's figures are no results
        figures |= {'objective': None, 'final_time': None}
    return {
        'exit_code': EXIT_CODES[report.code],
        'code': report.code.name,
        'error': None if report.code == ResultCode.SUCCESS else report.message,
        'converged': report.converged,
        'verified': report.verified,
        **{
            name: value_of(Expression(formula, name), plan, parameters)
            if report.verified
            else None
            for name, formula in values.items()
        },
        **figures,
        'start': 'near' if plan.near else 'cold',
        'warnings': report.warnings,
    }


def _planned(problem: Problem, leaders: Iterable[Problem], start: str) -> Plan:
    """Return the plan of a case; of two, the better one that is verified."""
    key = digest(problem)
    leading = None
    for leader in leaders:
        if digest(leader) == key:  # those before it are of no use to it
            return _leading(problem, again=True)
        found = _leading(leader)
        if found.report.verified:
            leading = found
            break
    if leading is None:
        return _planner().plan(problem)
    near = _planner().plan(problem, near=leading)
    if start == 'near' or not near.near:
        return near
    cold = _planner().plan(problem)
    if not cold.report.verified:
        return near
    gain = problem.objective.sign * (cold.report.objective - near.report.objective)
    return near if gain > problem.tolerance * abs(cold.report.objective) else cold


_kept: OrderedDict[str, Plan] = OrderedDict()


def _leading(problem: Problem, *, again: bool = False) -> Plan:
    """Return the plan of a problem from its own guess; the last few are kept.

    Parameters
    ----------
    again : bool
        Whether to try anew if it failed for a reason that passes.
    """
    key = digest(problem)
    plan = _kept.get(key)
    if plan is None or (again and plan.report.code in PASSING):
        plan = _kept[key] = _planner().plan(problem)
        while len(_kept) > MAX_KEPT:
            _kept.popitem(last=False)
    return plan


@cache
def _planner() -> Planner:
    """Return this process's planner, which keeps what it has built."""
    return Planner()


def digest(value: Any) -> str:
    """Return a hash of a problem, or any nested data: what `repr` shows, arrays in full."""
    found = hashlib.sha256()
    _feed(found, value)
    return found.hexdigest()[:32]


def _feed(found: Any, value: Any) -> None:
    if is_dataclass(value) and not isinstance(value, type):
        found.update(type(value).__name__.encode())
        for each in fields(value):
            if each.repr:
                found.update(each.name.encode())
                _feed(found, getattr(value, each.name))
    elif isinstance(value, Mapping):
        _feed(found, list(value.items()))
    elif isinstance(value, list | tuple):
        found.update(f'[{len(value)}'.encode())
        for item in value:
            _feed(found, item)
    elif isinstance(value, frozenset | set):
        _feed(found, sorted(value))
    elif isinstance(value, np.ndarray):
        found.update(f'{value.dtype}{value.shape}'.encode())
        found.update(np.ascontiguousarray(value).tobytes())
    else:
        found.update(repr(value).encode() + b'\0')


def check_pictures(sweep: Sweep) -> None:
    """Raise MissingExtraError if what a sweep's pictures take is not installed."""
    if sweep.picture is not None:
        from .viewing import sweep_figures  # noqa: F401
    if sweep.footprint is not None:
        from .viewing import footprint  # noqa: F401


def draw_pictures(sweep: Sweep, batch: Batch) -> list[Path]:
    """Write the pictures that a sweep asks for into the folder of its results."""
    rows = [batch.rows[job.key] for job in batch.jobs if job.key in batch.rows]
    drawn = []
    if (picture := sweep.picture) is not None:
        from .viewing.figures import save_figure
        from .viewing.sweep_figures import sweep_figure

        figure = sweep_figure(
            {**_columns(rows, picture.over), **_numbers(rows, (picture.value,))}
            | {'verified': np.array([row.get('verified') is True for row in rows])},
            picture.over,
            picture.value,
            units=picture.units,
            labels=picture.labels,
            title=picture.title or sweep.description,
        )
        drawn.append(batch.folder / PICTURE)
        save_figure(figure, drawn[-1])
    if sweep.footprint is not None:
        from .viewing.footprint import save_footprint

        drawn.append(batch.folder / FOOTPRINT)
        areas = _areas(sweep, sweep.footprint, rows, batch.folder)
        save_footprint(drawn[-1], areas, place=sweep.footprint.place, title=sweep.description)
    return drawn


def _areas(sweep: Sweep, footprint: Footprint, rows: Sequence[Row], folder: Path) -> list['Area']:
    """Return what verified plans that share all parameters but one bound."""
    from .viewing.footprint import Area

    others = [p.key for p in sweep.parameters if p.key != footprint.around]
    found: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        if row.get('verified'):
            found.setdefault(tuple(row[key] for key in others), []).append(row)
    areas = []
    for shared, members in found.items():
        once_round = sorted(members, key=lambda row: row[footprint.around])
        words = (
            f'{key} {value:g}' if is_number(value) else f'{key} {value}'
            for key, value in zip(others, shared, strict=True)
        )
        flights = []
        if sweep.plans in SUFFIXES:
            for row in once_round:
                columns, _ = read_table(folder / row['output'])
                flights.append(np.column_stack([columns[name] for name in ('x_e', 'y_e', 'z_e')]))
        ends = np.array([[row[name] for name in ENDS] for row in once_round])
        areas.append(Area(', '.join(words), ends, flights))
    return areas


def _columns(rows: Sequence[Row], names: Sequence[str]) -> dict[str, Any]:
    return {name: np.array([row[name] for row in rows]) for name in names}


def _numbers(rows: Sequence[Row], names: Sequence[str]) -> dict[str, Any]:
    """Return columns of numbers; what a row lacks is NaN."""
    found = {}
    for name in names:
        column = [row.get(name) for row in rows]
        found[name] = np.array([np.nan if v is None else v for v in column], float)
    return found
