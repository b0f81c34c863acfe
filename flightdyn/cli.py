"""The `flightdyn` command: plan, sim, replay, batch, info, convert, models, vehicles.

Only results go to stdout; progress and errors go to stderr.
"""

import argparse
import json
import signal
import sys
import time
from collections.abc import Sequence
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import export
from .errors import EXIT_CODES, FlightdynError, InputError, ResultCode

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from .batch import Batch
    from .planning.solver import Iteration


_Rows = Sequence[tuple[str, ...]]

_LOG_HELP = 'flight log: MCAP, ROS bag, PX4 .ulg, ArduPilot .bin, .tlog, IGC, GPX, CSV'


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    arguments = _parser().parse_args(argv)
    try:
        code: int = arguments.run(arguments)
        sys.stdout.flush()
        return code
    except FlightdynError as error:
        print(f'flightdyn: {error}', file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print('flightdyn: interrupted', file=sys.stderr)
        return EXIT_CODES[ResultCode.CANCELLED]
    except BrokenPipeError:
        # whoever read stdout has seen enough; keep the interpreter from flushing into the pipe
        sys.stdout = open('/dev/null', 'w')  # noqa: SIM115
        return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog='flightdyn', description='Plan, simulate, replay and view flights.'
    )
    commands = parser.add_subparsers(required=True, metavar='COMMAND')

    def command(
        name: str,
        run: 'Callable[[argparse.Namespace], int]',
        text: str,
        *,
        config: bool = True,
        among: Any = commands,
    ) -> argparse.ArgumentParser:
        sub: argparse.ArgumentParser = among.add_parser(name, help=text, description=text)
        sub.set_defaults(run=run)
        sub.add_argument('--json', action='store_true', help='print the result as JSON')
        if config:
            sub.add_argument(
                '--config-dir', metavar='DIR', help='folder searched before the shipped config'
            )
        return sub

    plan = command('plan', _plan, 'Plan a trajectory and verify it.')
    plan.add_argument('problem', help='name in config/problems, or path of a .yaml file')
    plan.add_argument(
        '--set',
        action='append',
        default=[],
        metavar='KEY=VALUE',
        help='override an entry of the problem, such as final.x_e=2 or nodes=160',
    )
    _add_output(plan, export.FLIGHT_FORMATS)

    sim = command('sim', _sim, 'Simulate a scenario, or fly a plan open-loop.')
    sim.add_argument('scenario', help='name in config/scenarios, .yaml file, or plan .json file')
    sim.add_argument('--rate', type=float, help="samples a second (the scenario's, else 200)")
    _add_output(sim, export.FLIGHT_FORMATS)

    replay = command('replay', _replay, 'Turn flight logs into flight states.', config=False)
    replay.add_argument('log', nargs='+', help=_LOG_HELP)
    replay.add_argument('--source', metavar='TOPIC', help='use this topic, not the best one')
    replay.add_argument('--start', type=float, metavar='S', help='seconds from the log start')
    replay.add_argument('--end', type=float, metavar='S', help='seconds from the log start')
    _add_output(replay, export.REPLAY_FORMATS, "; with several logs '{log}' stands for their name")

    info = command('info', _info, 'Show what is in a log and what can be replayed.', config=False)
    info.add_argument('log', nargs='+', help=_LOG_HELP)

    convert = command('convert', _convert, 'Write a flight log as MCAP.', config=False)
    convert.add_argument('log', nargs='+', help=_LOG_HELP.replace('MCAP, ', ''))
    convert.add_argument(
        'output', help="MCAP file to write; with several logs '{log}' stands for their name"
    )
    convert.add_argument('--source', metavar='TOPIC', help='convert this topic, not the best one')

    text = 'Do many at once, on all cores or on a Dask cluster.'
    batch = commands.add_parser('batch', help=text, description=text)
    batches = batch.add_subparsers(required=True, metavar='COMMAND')
    logs = command(
        'replay',
        _batch_replay,
        'Replay many flight logs, each into a table; a second run goes on where this one ended.',
        config=False,
        among=batches,
    )
    logs.add_argument('pattern', nargs='+', help="logs, such as 'logs/**/*.mcap'")
    logs.add_argument('--source', metavar='TOPIC', help='use this topic, not the best of each log')
    _add_batch(logs)

    command('models', _models, 'List the Dynamics family.', config=False)
    command('vehicles', _vehicles, 'List the configured vehicles.')
    return parser


def _add_output(sub: argparse.ArgumentParser, formats: tuple[str, ...], more: str = '') -> None:
    sub.add_argument(
        '-o',
        '--output',
        action='extend',
        nargs='+',
        default=[],
        metavar='FILE',
        help=f'write the result, format by suffix: {" ".join(formats)}{more}',
    )


def _add_batch(sub: argparse.ArgumentParser) -> None:
    sub.add_argument(
        '-o',
        '--output',
        required=True,
        metavar='DIR',
        help='folder of the results and of the table of all, summary.parquet',
    )
    where = sub.add_mutually_exclusive_group()
    where.add_argument(
        '--workers', type=_count, metavar='N', help='processes; default: one for each core'
    )
    where.add_argument('--scheduler', metavar='ADDR', help='run on Dask, such as tcp://host:8786')


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) == 0:
        raise argparse.ArgumentTypeError(f'{text!r} is not a number above 0')
    return int(text)


def _plan(arguments: argparse.Namespace) -> int:
    from .planning.plan_file import plan_document
    from .planning.planner import Planner
    from .planning.problem import load_problem

    outputs = export.check_outputs(arguments.output, export.FLIGHT_FORMATS)
    problem = load_problem(arguments.problem, arguments.set, arguments.config_dir)
    with _interruptible() as interrupted, _iterations() as on_iteration:
        plan = Planner().plan(problem, on_iteration=on_iteration, should_stop=interrupted)
    document = plan_document(plan)
    for path in outputs:
        export.write_flight(path, plan.trajectory, document)
    report = plan.report
    if arguments.json:
        print(json.dumps(document))
    else:
        _print_rows(
            [
                ('problem', f'{problem.name} ({problem.vehicle.name})'),
                ('objective', f'{report.objective:.8g}'),
                ('final time', f'{report.final_time:.6g} s'),
                ('iterations', str(report.iterations)),
                ('solved in', f'{report.wall_s:.3g} s, {report.build_s:.3g} s of it building'),
                ('method', report.transcription),
                ('verified', 'yes' if report.verified else 'NO'),
                *((f'  error {k}', f'{v:.2g}') for k, v in report.verification.items()),
                *(('written', str(path)) for path in outputs),
            ]
        )
    for warning in report.warnings:
        print(f'flightdyn: warning: {warning}', file=sys.stderr)
    if report.code != ResultCode.SUCCESS:
        print(f'flightdyn: {report.message}', file=sys.stderr)
    return EXIT_CODES[report.code]


@contextmanager
def _interruptible() -> 'Iterator[Callable[[], bool]]':
    """Give a function that tells whether Ctrl-C was pressed.

    IPOPT swallows KeyboardInterrupt, so that the signal sets a flag which is asked for at each
    iteration; a second one ends at once.
    """
    pressed: list[int] = []

    def handle(signum: int, frame: Any) -> None:
        if pressed:
            raise KeyboardInterrupt
        pressed.append(signum)

    previous = signal.signal(signal.SIGINT, handle)
    try:
        yield lambda: bool(pressed)
    finally:
        signal.signal(signal.SIGINT, previous)


@contextmanager
def _iterations() -> "Iterator[Callable[['Iteration'], None] | None]":
    """Give a function that shows the solver's iterations on a terminal, None if there is none."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console

    with Console(stderr=True).status('building') as status:

        def show(iteration: 'Iteration') -> None:
            status.update(
                f'iteration {iteration.number}: objective {iteration.objective:.6g}, '
                f'infeasibility {iteration.primal_infeasibility:.1e}'
            )

        yield show


def _sim(arguments: argparse.Namespace) -> int:
    from .planning.plan_file import read_plan
    from .simulation.scenario import RATE, load_scenario
    from .simulation.simulator import Simulator, fly
    from .vehicles.vehicle import load_vehicle

    outputs = export.check_outputs(arguments.output, export.FLIGHT_FORMATS)
    planned = None
    if arguments.scenario.endswith('.json'):
        planned, document = read_plan(arguments.scenario)
        model = load_vehicle(planned.vehicle, arguments.config_dir).model()
        initial = {name: float(values[0]) for name, values in planned.states.items()}
        simulator = Simulator(model, initial, planned, wind=document['wind_ned'])
        duration, rate = planned.duration, RATE
    else:
        scenario = load_scenario(arguments.scenario, arguments.config_dir)
        simulator, duration, rate = scenario.simulator(), scenario.duration, scenario.rate
    also_at = None if planned is None else planned.time
    flown = fly(simulator, duration, rate if arguments.rate is None else arguments.rate, also_at)
    errors = {} if planned is None else export.deviation(flown, planned)
    summary = {
        'scenario': arguments.scenario,
        'duration_s': duration,
        'samples': len(flown),
        'final': {name: float(values[-1]) for name, values in flown.states.items()},
        'deviation_from_plan': errors,
    }
    document = export.flight_document(flown, **summary)
    for path in outputs:
        export.write_flight(path, flown, document, planned=planned)
    if arguments.json:
        print(json.dumps(document))
    else:
        _print_rows(
            [
                ('flown', f'{duration:.6g} s, {len(flown)} samples'),
                *((f'  final {k}', f'{v[-1]:.6g}') for k, v in flown.states.items()),
                *((f'  {k} off the plan', f'{v:.2g}') for k, v in errors.items()),
                *(('written', str(path)) for path in outputs),
            ]
        )
    return 0


def _replay(arguments: argparse.Namespace) -> int:
    for name in arguments.output:
        _check_apart(name, arguments.log)
    return _each(arguments.log, lambda log: _replay_one(log, arguments), arguments.json)


def _replay_one(log: str, arguments: argparse.Namespace) -> tuple[dict[str, Any], _Rows]:
    from .logs.any_log import is_mcap
    from .logs.recorded import read_plans
    from .replay import replay_log

    names = [_named(name, log) for name in arguments.output]
    outputs = export.check_outputs(names, export.REPLAY_FORMATS)
    replay = replay_log(log, source=arguments.source, start=arguments.start, end=arguments.end)
    summary = replay.summary()
    # our own recordings hold what was meant to be flown
    plans = read_plans(log) if outputs and is_mcap(log) else []
    planned = plans[-1] if plans else None
    flight = replace(replay.trajectory, vehicle=planned.vehicle if planned else '')
    for path in outputs:
        export.write_replay(path, flight, summary, planned=planned)
    rows = [
        ('source', f'{summary["source"]} ({summary["schema"]})'),
        ('used', f'{summary["used"]} of {summary["messages"]} messages'),
        *((f'  {reason}', str(n)) for reason, n in summary['dropped'].items()),
        ('segments', str(len(summary['segments']))),
        ('duration', f'{summary["duration_s"]:.6g} s'),
        ('distance', f'{summary["distance_m"] / 1e3:.6g} km'),
        ('max speed', f'{summary["max_speed"]:.4g} m/s'),
        ('max altitude', _altitude(summary)),
        *(('written', str(path)) for path in outputs),
    ]
    return summary, rows


def _each(
    logs: Sequence[str], do: 'Callable[[str], tuple[dict[str, Any], _Rows]]', as_json: bool
) -> int:
    """Do something with each log and print what comes of it; a bad log stops no other.

    Returns
    -------
    int
        The highest exit code.
    """
    results: list[dict[str, Any]] = []
    code = 0
    for log in logs:
        try:
            with _busy(log):
                result, rows = do(log)
        except FlightdynError as error:
            if len(logs) == 1:
                raise
            print(f'flightdyn: {error}', file=sys.stderr)
            code = max(code, error.exit_code)
            results.append({'file': log, 'error': str(error), 'exit_code': error.exit_code})
            continue
        for warning in result['warnings']:
            print(f'flightdyn: {log}: warning: {warning}', file=sys.stderr)
        results.append(result)
        if not as_json:
            if len(logs) > 1:
                print(f'{log}:')
            _print_rows(rows)
    if as_json:
        print(json.dumps(results[0] if len(logs) == 1 else results))
    return code


def _named(name: str, log: str) -> str:
    return name.replace('{log}', Path(log).stem)


def _check_apart(name: str, logs: Sequence[str]) -> None:
    if len(logs) > 1 and '{log}' not in name:
        suffix = Path(name).suffix
        raise InputError(
            f"several logs need '{{log}}' in the output name, such as {{log}}{suffix}"
        )
    names = [_named(name, log) for log in logs]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f'several logs would be written to {twice}: their names must differ')


@contextmanager
def _busy(text: str) -> 'Iterator[None]':
    """Show on a terminal what is being worked on, and for how long."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = SpinnerColumn(), TextColumn('{task.description}'), TimeElapsedColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as progress:
        progress.add_task(escape(text), total=None)
        yield


def _altitude(summary: dict[str, Any]) -> str:
    return f'{summary["max_altitude"]:.6g} m ({summary["altitude_datum"]})'


def _batch_replay(arguments: argparse.Namespace) -> int:
    from .batch import Batch
    from .batch_replay import replay_job, replay_jobs

    jobs = replay_jobs(arguments.pattern, arguments.output, source=arguments.source)
    return _run_batch(Batch(arguments.output, jobs, replay_job), 'logs', arguments)


def _run_batch(batch: 'Batch', what: str, arguments: argparse.Namespace) -> int:
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, Progress, TimeRemainingColumn

    start = time.monotonic()
    console = Console(stderr=True)
    columns = (*Progress.get_default_columns()[:2], MofNCompleteColumn(), TimeRemainingColumn())
    with batch:
        kept = len(batch.rows)
        try:
            with (
                Progress(*columns, console=console, disable=not console.is_terminal) as progress,
                closing(
                    batch.run(workers=arguments.workers, scheduler=arguments.scheduler)
                ) as run,
            ):
                task = progress.add_task(what, total=len(batch.jobs), completed=kept)
                for row in run:
                    progress.advance(task)
                    if row['error'] is not None:
                        line = f'flightdyn: {row["key"]}: {row["error"]}'
                        progress.console.print(line, markup=False, highlight=False, soft_wrap=True)
        except KeyboardInterrupt:
            print(
                f'flightdyn: interrupted: {len(batch.jobs) - len(batch.pending)} of '
                f'{len(batch.jobs)} {what} are done; run the same command again to go on',
                file=sys.stderr,
            )
            return EXIT_CODES[ResultCode.CANCELLED]
        summary = batch.write_summary()
        failed = [row for row in batch.rows.values() if row['exit_code'] != 0]
    figures = {
        what: len(batch.jobs),
        'done': len(batch.jobs) - len(failed) - kept,
        'kept': kept,
        'failed': len(failed),
        'wall_s': time.monotonic() - start,
        'summary': str(summary),
    }
    if arguments.json:
        print(json.dumps(figures))
    else:
        _print_rows(
            [
                (what, str(figures[what])),
                ('  done', str(figures['done'])),
                ('  done before', str(kept)),
                ('  failed', str(len(failed))),
                ('in', f'{figures["wall_s"]:.3g} s'),
                ('written', str(summary)),
            ]
        )
    return max((row['exit_code'] for row in failed), default=0)


def _info(arguments: argparse.Namespace) -> int:
    return _each(arguments.log, _info_one, arguments.json)


def _info_one(log: str) -> tuple[dict[str, Any], _Rows]:
    from .logs.any_log import describe

    info = describe(log).to_dict()
    rows = [
        (t['topic'], t['schema'], str(t['messages']), t['kind'] if t['usable'] else '-')
        for t in info['topics']
    ]
    return info, [('topic', 'schema', 'messages', 'replay as'), *rows]


def _convert(arguments: argparse.Namespace) -> int:
    _check_apart(arguments.output, arguments.log)
    return _each(arguments.log, lambda log: _convert_one(log, arguments), arguments.json)


def _convert_one(log: str, arguments: argparse.Namespace) -> tuple[dict[str, Any], _Rows]:
    from .logs.convert import convert

    summary = convert(log, _named(arguments.output, log), arguments.source)
    rows = [
        ('format', summary['format']),
        ('source', f'{summary["source"]} ({summary["schema"]})'),
        ('used', f'{summary["used"]} of {summary["messages"]} messages'),
        *((f'  {reason}', str(n)) for reason, n in summary['dropped'].items()),
        ('altitude', summary['altitude_datum']),
        *((t['topic'], f'{t["schema"]}, {t["messages"]}') for t in summary['topics']),
        ('written', summary['output']),
    ]
    return summary, rows


def _models(arguments: argparse.Namespace) -> int:
    from .dynamics import FAMILY

    rows: list[dict[str, Any]] = [
        {
            'class': name,
            'kind': 'rigid body' if hasattr(cls, 'add_moment') else 'point mass',
            'states': list(cls.states),
            'controls': [*cls.indirect_controls, *cls.loads, *cls.rotor_momenta],
        }
        for name, cls in FAMILY.items()
    ]
    if arguments.json:
        print(json.dumps(rows))
    else:
        _print_rows(
            [
                ('class', 'kind', 'states', 'controls'),
                *(
                    (r['class'], r['kind'], ' '.join(r['states']), ' '.join(r['controls']))
                    for r in rows
                ),
            ]
        )
    return 0


def _vehicles(arguments: argparse.Namespace) -> int:
    from .vehicles.vehicle import list_vehicles

    vehicles = list_vehicles(arguments.config_dir)
    if arguments.json:
        rows = [
            {
                'vehicle': v.name,
                'model': v.model_name,
                'mass': v.mass_props.mass,
                'controls': list(v.model().controls),
                'description': v.description,
            }
            for v in vehicles
        ]
        print(json.dumps(rows))
    else:
        _print_rows(
            [
                ('vehicle', 'model', 'description'),
                *((v.name, v.model_name, v.description) for v in vehicles),
            ]
        )
    return 0


def _print_rows(rows: _Rows) -> None:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        print('  '.join(f'{cell:<{w}}' for cell, w in zip(row, widths, strict=True)).rstrip())


if __name__ == '__main__':
    sys.exit(main())
