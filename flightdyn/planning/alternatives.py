"""Problems that differ in what is asked for, the best of which is flown: any of some fields."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ..errors import ResultCode

if TYPE_CHECKING:
    from .problem import Problem
    from .report import Plan


@dataclass(frozen=True)
class Alternative:
    """What came of one alternative.

    Parameters
    ----------
    name : str
    objective : float
        In the user's units and sign.
    final_time : float [s]
    verified : bool
    message : str
        Of its plan.
    """

    name: str
    objective: float
    final_time: float
    verified: bool
    message: str


def best_alternative(problem: 'Problem', plan: Callable[['Problem'], 'Plan']) -> 'Plan':
    """Return the best verified plan of a problem's alternatives, and what came of each.

    If none is verified, it is the first. Alternatives after a cancelled one are not tried.

    Parameters
    ----------
    plan : function of a Problem
        Plans one.

    Returns
    -------
    Plan
        With `alternatives`, the best first, those that are not verified last.
    """
    found: list[tuple[Alternative, Plan]] = []
    for name, each in problem.alternatives:
        made = plan(each)
        report = made.report
        summary = Alternative(
            name, report.objective, report.final_time, report.verified, report.message
        )
        found.append((summary, made))
        if report.code == ResultCode.CANCELLED:
            break
    sign = problem.objective.sign
    found.sort(
        key=lambda pair: (not pair[0].verified, pair[0].verified * sign * pair[0].objective)
    )
    best = found[0][1]
    told = f'{found[0][0].name}: {best.report.message}'
    return replace(
        best,
        report=replace(best.report, message=told),
        alternatives=[summary for summary, _ in found],
    )
