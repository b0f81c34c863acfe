"""When a solve fails: other ways, other guesses, and what is in the way if none helps."""

import numpy as np
import pytest

from flightdyn.errors import ResultCode
from flightdyn.planning import planner as planning
from flightdyn.planning.planner import COMPARED, REMEDIES, Planner
from flightdyn.planning.problem_file import load_problem
from flightdyn.planning.remedies import perturbed

# 1.2 m in 0.3 s is beyond a thrust of twice the weight; nothing else asks for much
TOO_FAR = ['final={x_e: 1.2}', 'duration=0.3', 'guess={x_e: [0, 1]}']


@pytest.fixture(scope='module')
def planner() -> Planner:
    return Planner()


def test_what_is_too_far_is_named_with_what_can_be_reached(planner: Planner) -> None:
    plan = planner.plan(load_problem('quadcopter_flip', TOO_FAR))
    report = plan.report
    assert report.code == ResultCode.INFEASIBLE
    assert not report.verified
    (missed,) = report.missed
    assert missed['quantity'] == 'x_e'
    assert missed['time'] == pytest.approx(0.3)
    assert missed['bound'] == 1.2
    # what is handed out is the nearest flight: it ends as far as the report says
    assert plan.trajectory['x_e'][-1] == pytest.approx(missed['value'], abs=1e-9)
    assert missed['amount'] == pytest.approx(1.2 - missed['value'])
    assert f'x_e at 0.3 s is {missed["value"]:.4g}' in report.message
    # no other guess comes nearer: maximizing the distance gives the same
    farthest = planner.plan(
        load_problem(
            'quadcopter_flip',
            [
                *('final={}', 'duration=0.3', 'objective={maximize: final.x_e}'),
                *('sharpen=false', 'refine=false'),  # the nearest flight is one on the first mesh
            ],
        )
    ).report
    assert missed['value'] == pytest.approx(farthest.objective, abs=1e-3)


def test_a_start_that_contradicts_itself_is_named(planner: Planner) -> None:
    """In next to no wind the speed over the ground and through the air are one."""
    problem = load_problem('cessna152_turnback', ['wind_ned=[0, 0, 1e-9]'])
    report = planner.plan(problem.with_changes(initial={'speed': (36.0, 36.0)})).report
    assert report.code == ResultCode.INFEASIBLE
    (missed,) = report.missed
    assert (missed['quantity'], missed['time']) == ('airspeed', 0.0)
    assert missed['value'] == pytest.approx(36, abs=1e-3)


def test_a_path_that_conflicts_is_named(planner: Planner) -> None:
    """Ten metres up within 3 m/s and 2 s: 6 m is what that gives."""
    report = planner.plan(
        load_problem(
            'quadcopter_flip',
            [
                'final={altitude: 10}',
                'path={airspeed: [null, 3], theta: [-5 deg, 5 deg]}',
                'duration=2',
                'guess={}',
            ],
        )
    ).report
    assert report.code == ResultCode.INFEASIBLE
    assert {each['quantity'] for each in report.missed} <= {'z_e', 'airspeed'}
    assert report.missed


def test_a_flight_that_meets_all_conditions_is_where_the_next_solve_starts(
    planner: Planner, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With plain solves that give up at once only the detour is left."""
    run = planning.Run
    solve = run.solve

    def giving_up(self, problem, mesh, start=None, **more):  # type: ignore[no-untyped-def]
        found = solve(self, problem, mesh, start, **more)
        if start is None and 'structure' not in more:
            failed = planning.replace(found.attempt.solution, code=ResultCode.INFEASIBLE)
            attempt = planning.replace(found.attempt, solution=failed)
            return planning.replace(found, attempt=attempt, verification=None)
        return found

    monkeypatch.setattr(run, 'solve', giving_up)
    settings = ['nodes=20', 'sharpen=false', 'transcription=multiple_shooting']
    report = planner.plan(load_problem('quadcopter_flip', settings)).report
    assert report.verified, report.message
    assert report.remedies == list(REMEDIES[:1])
    assert report.missed == []
    assert report.final_time == pytest.approx(0.8285, abs=2e-3)


@pytest.mark.parametrize('seed', [0, 5, 7])
def test_far_guesses_lead_to_the_best_turn_back(seed: int) -> None:
    """They ended in loops that cost 71, 54 and 77 m of height."""
    report = Planner().plan(perturbed(load_problem('cessna152_turnback'), seed)).report
    assert report.verified
    assert report.remedies == [COMPARED]
    assert report.objective == pytest.approx(45.642, abs=0.005)


def test_another_guess_that_leads_to_the_same_plan_is_proof_enough(planner: Planner) -> None:
    settings = ['sharpen=false', 'refine=false']
    direct = planner.plan(load_problem('quadcopter_flip', [*settings, 'tolerance=0.1'])).report
    begun: list[int] = []
    report = planner.plan(
        load_problem('quadcopter_flip', [*settings, 'tolerance=1.0e-6']),
        on_iteration=lambda each: begun.append(each.number) if each.number == 0 else None,
    ).report
    assert report.remedies == [COMPARED]
    assert len(begun) == 2  # of the three guesses that may be tried, one
    assert direct.remedies == []
    assert report.objective == pytest.approx(direct.objective, rel=1e-3)


def test_other_guesses_are_the_same_for_the_same_seed() -> None:
    problem = load_problem('quadcopter_flip')
    one, same, other = (perturbed(problem, seed) for seed in (1, 1, 2))
    assert one.guess == same.guess
    assert one.guess != other.guess
    assert one.duration_guess == same.duration_guess != other.duration_guess
    for name, points in one.guess.items():
        assert len(points) == 13
        lower, upper = problem.limits(name)
        if np.isfinite([lower, upper]).all():
            assert lower <= min(points) <= max(points) <= upper


def test_several_starts_find_several_optima(planner: Planner) -> None:
    """Up and a little back there is a second best way to flip."""
    problem = load_problem('quadcopter_flip', ['final.x_e=-0.16', 'final.z_e=-0.72'])
    plan = planner.plan(problem, multistart=6)
    assert plan.report.verified
    times = [each.report.final_time for each in (plan, *plan.others)]
    assert times == sorted(times)
    assert len(times) > 1
    assert all(each.report.verified for each in plan.others)
    again = planner.plan(problem, multistart=6)
    assert [each.report.final_time for each in (again, *again.others)] == times
    single = planner.plan(problem)
    assert plan.report.final_time <= single.report.final_time + 1e-6


def test_cancelling_ends_the_search(planner: Planner) -> None:
    calls = []

    def stop() -> bool:
        calls.append(1)
        return len(calls) > 30

    for more in ({'multistart': 50}, {}):
        calls.clear()
        problem = load_problem('quadcopter_flip', [] if more else TOO_FAR)
        plan = planner.plan(problem, should_stop=stop, **more)  # type: ignore[arg-type]
        assert plan.report.code == ResultCode.CANCELLED
        assert len(calls) < 100
