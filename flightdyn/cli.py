"""The `flightdyn` command: plan, sim, replay, view, batch, info, convert, and lists of all.

Only results go to stdout; progress and errors go to stderr.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from . import cli_batch, cli_logs, cli_view, export
from .console import interruptible, iterations, print_rows
from .environment.turbulence import SEVERITIES
from .errors import EXIT_CODES, FlightdynError, InputError, ResultCode

if TYPE_CHECKING:
    from collections.abc import Callable

    from .planning.alternatives import Alternative
    from .planning.problem import Problem
    from .simulation.simulator import Simulator
    from .trajectory import Trajectory
    from .vehicles.vehicle import Vehicle


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
    plan.add_argument(
        '--multistart',
        type=int,
        metavar='N',
        help='start from N guesses and list the local optima found',
    )
    plan.add_argument('--seed', type=int, default=0, help='of the guesses besides the first')
    plan.add_argument(
        '--live',
        nargs='?',
        const=cli_view.VIEWER,
        metavar='URL',
        help='show the iterations in a running viewer, by default at %(const)s',
    )
    _add_output(plan, export.FLIGHT_FORMATS)

    sim = command('sim', _sim, 'Simulate a scenario, or fly a plan.')
    sim.add_argument('scenario', help='name in config/scenarios, .yaml file, or plan .json file')
    sim.add_argument(
        '--track',
        action='store_true',
        help='keep to the plan by feedback, instead of flying its controls open-loop',
    )
    sim.add_argument(
        '--set',
        action='append',
        default=[],
        metavar='KEY=VALUE',
        help='override an entry of the vehicle that flies the plan, such as mass=0.105; a '
        'controller does not know of it',
    )
    sim.add_argument('--gusts', choices=SEVERITIES[1:], help='fly the plan in Dryden turbulence')
    sim.add_argument('--seed', type=int, default=0, help='of the gusts')
    sim.add_argument('--rate', type=float, help="samples a second (the scenario's, else 200)")
    _add_output(sim, export.FLIGHT_FORMATS)

    replay = command(
        'replay', cli_logs.replay, 'Turn flight logs into flight states.', config=False
    )
    replay.add_argument('log', nargs='+', help=_LOG_HELP)
    replay.add_argument('--source', metavar='TOPIC', help='use this topic, not the best one')
    replay.add_argument('--start', type=float, metavar='S', help='seconds from the log start')
    replay.add_argument('--end', type=float, metavar='S', help='seconds from the log start')
    replay.add_argument(
        '--flight',
        type=int,
        metavar='N',
        help='only the N-th flight of the log, from take-off to landing',
    )
    replay.add_argument(
        '--wind',
        choices=('auto', 'circling', 'airspeed'),
        help='estimate the wind, from full turns or from a recorded airspeed',
    )
    _add_output(replay, export.REPLAY_FORMATS, "; with several logs '{log}' stands for their name")

    info = command(
        'info', cli_logs.info, 'Show what is in a log and what can be replayed.', config=False
    )
    info.add_argument('log', nargs='+', help=_LOG_HELP)

    convert = command('convert', cli_logs.convert, 'Write a flight log as MCAP.', config=False)
    convert.add_argument('log', nargs='+', help=_LOG_HELP.replace('MCAP, ', ''))
    convert.add_argument(
        'output', help="MCAP file to write; with several logs '{log}' stands for their name"
    )
    convert.add_argument('--source', metavar='TOPIC', help='convert this topic, not the best one')

    view = command('view', cli_view.view, 'Show flights, or draw pictures of them.', config=False)
    cli_view.add_arguments(view)

    cli_batch.add_commands(commands, command)
    command('models', _models, 'List the Dynamics family.', config=False)
    command('problems', _problems, 'List the configured problems.')
    vehicles = command('vehicles', _vehicles, 'List the configured vehicles.')
    vehicles.add_argument('vehicle', nargs='*', help='tell all about these only')
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


def _plan(arguments: argparse.Namespace) -> int:
    from .planning.plan_file import plan_document
    from .planning.planner import Planner
    from .planning.problem_file import load_problem

    outputs = export.check_outputs(arguments.output, export.FLIGHT_FORMATS)
    settings = list(arguments.set)
    if arguments.multistart is not None:
        settings.append(f'multistart={arguments.multistart}')
    problem = load_problem(arguments.problem, settings, arguments.config_dir)
    with (
        interruptible() as interrupted,
        iterations() as console,
        cli_view.live_iterations(arguments.live, problem.name, console) as (on_iteration, on_plan),
    ):
        plan = Planner().plan(
            problem, seed=arguments.seed, on_iteration=on_iteration, should_stop=interrupted
        )
        on_plan(plan.trajectory)
    document = plan_document(plan)
    for path in outputs:
        export.write_flight(path, plan.trajectory, document, limits=_limits(problem))
    report = plan.report
    if arguments.json:
        print(json.dumps(document))
    else:
        print_rows(
            [
                ('problem', f'{problem.name} ({problem.vehicle.name})'),
                ('objective', f'{report.objective:.8g}'),
                ('final time', f'{report.final_time:.6g} s'),
                ('iterations', str(report.iterations)),
                ('solved in', f'{report.wall_s:.3g} s, {report.build_s:.3g} s of it building'),
                ('method', report.transcription),
                ('verified', 'yes' if report.verified else 'NO'),
                *((f'  error {k}', f'{v:.2g}') for k, v in report.verification.items()),
                *(
                    (f'optimum {i}', f'{each.report.objective:.8g}')
                    for i, each in enumerate([plan, *plan.others], start=1)
                    if plan.others
                ),
                *((f'alternative {each.name}', _alternative(each)) for each in plan.alternatives),
                *((f'arc {i}', _arc(arc)) for i, arc in enumerate(report.arcs, start=1)),
                *(('remedy', remedy) for remedy in report.remedies),
                *(('written', str(path)) for path in outputs),
            ]
        )
    for warning in report.warnings:
        print(f'flightdyn: warning: {warning}', file=sys.stderr)
    if report.code != ResultCode.SUCCESS:
        print(f'flightdyn: {report.message}', file=sys.stderr)
    return EXIT_CODES[report.code]


def _limits(problem: 'Problem') -> dict[str, tuple[float, float]]:
    """Return the bounds that hold all the way."""
    every = [problem.bounded(leg) for leg in range(len(problem.legs))]
    return {
        name: bounds
        for name, bounds in every[0].items()
        if all(others.get(name) == bounds for others in every)
    }


def _alternative(each: 'Alternative') -> str:
    return f'{each.objective:.8g}' if each.verified else f'not solved: {each.message}'


def _arc(arc: dict[str, Any]) -> str:
    limits = ', '.join(f'{name} {side}' for name, side in arc['limits'].items())
    return f'{arc["start"]:.6g} to {arc["end"]:.6g} s: {limits}'


def _sim(arguments: argparse.Namespace) -> int:
    from .planning.plan_file import read_plan
    from .simulation.scenario import RATE, load_scenario
    from .simulation.simulator import fly

    outputs = export.check_outputs(arguments.output, export.FLIGHT_FORMATS)
    planned, around = None, {}
    if arguments.scenario.endswith('.json'):
        planned, document = read_plan(arguments.scenario)
        around = {'surroundings': document['surroundings']} if document['surroundings'] else {}
        simulator = _on_plan(arguments, planned, document)
        duration, rate = planned.duration, RATE
    else:
        if arguments.track or arguments.set or arguments.gusts:
            raise InputError('--track, --set and --gusts are for plans (.json)')
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
    document = export.flight_document(flown, **summary, **around)
    for path in outputs:
        export.write_flight(path, flown, document, planned=planned)
    if arguments.json:
        print(json.dumps(document))
    else:
        print_rows(
            [
                ('flown', f'{duration:.6g} s, {len(flown)} samples'),
                *((f'  final {k}', f'{v[-1]:.6g}') for k, v in flown.states.items()),
                *((f'  {k} off the plan', f'{v:.2g}') for k, v in errors.items()),
                *(('written', str(path)) for path in outputs),
            ]
        )
    return 0


def _on_plan(
    arguments: argparse.Namespace, planned: 'Trajectory', document: dict[str, Any]
) -> 'Simulator':
    """Return a simulator at the start of a plan, of the vehicle as it was set."""
    from .control.tracker import track
    from .dynamics.stage import WIND_STRENGTH
    from .environment.wind_file import read_wind
    from .simulation.gusts import Gusts
    from .simulation.simulator import Simulator
    from .vehicles.vehicle import load_vehicle

    air = read_wind(document['wind'], f'{arguments.scenario}: wind')
    wind, free = document['wind_ned'], WIND_STRENGTH in planned.states
    believed, flown = (
        load_vehicle(planned.vehicle, arguments.config_dir, settings).with_model(planned.model)
        for settings in ((), arguments.set)
    )
    initial = {name: float(values[0]) for name, values in planned.states.items()}
    controls: Any = planned
    if arguments.track:
        controls = track(believed, planned, model=believed.model(air, free_wind=free), wind=wind)
    gusts = Gusts(arguments.gusts, arguments.seed) if arguments.gusts else None
    return Simulator(flown.model(air, free_wind=free), initial, controls, wind=wind, gusts=gusts)


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
        print_rows(
            [
                ('class', 'kind', 'states', 'controls'),
                *(
                    (r['class'], r['kind'], ' '.join(r['states']), ' '.join(r['controls']))
                    for r in rows
                ),
            ]
        )
    return 0


def _problems(arguments: argparse.Namespace) -> int:
    from .planning.problem_file import list_problems

    problems, wrong = list_problems(arguments.config_dir)
    rows = [(p.name, p.vehicle.name, p.description) for p in problems]
    if arguments.json:
        keys = ('problem', 'vehicle', 'description')
        print(json.dumps([dict(zip(keys, row, strict=True)) for row in rows]))
    else:
        print_rows([('problem', 'vehicle', 'description'), *rows])
    for error in wrong:
        print(f'flightdyn: {error}', file=sys.stderr)
    return max((error.exit_code for error in wrong), default=0)


def _vehicles(arguments: argparse.Namespace) -> int:
    from .vehicles.vehicle import list_vehicles, load_vehicle

    if arguments.vehicle:
        vehicles = [load_vehicle(name, arguments.config_dir) for name in arguments.vehicle]
    else:
        vehicles = list_vehicles(arguments.config_dir)
    if arguments.json:
        print(json.dumps([_vehicle_document(v) for v in vehicles]))
    elif arguments.vehicle:
        print('\n\n'.join(v.describe() for v in vehicles))
    else:
        print_rows(
            [
                ('vehicle', 'model', 'fit error', 'description'),
                *((v.name, v.model_name, _fit_error(v), v.description) for v in vehicles),
            ]
        )
    return 0


def _vehicle_document(vehicle: 'Vehicle') -> dict[str, Any]:
    return {
        'vehicle': vehicle.name,
        'model': vehicle.model_name,
        'mass': vehicle.mass_props.mass,
        'controls': list(vehicle.model().controls),
        'rates': dict(vehicle.rates),
        'fit_errors': {name: e._asdict() for name, e in vehicle.fit_errors.items()},
        'description': vehicle.description,
    }


def _fit_error(vehicle: 'Vehicle') -> str:
    """Return the largest errors of the lift and drag of a table."""
    errors = {name: e for name, e in vehicle.fit_errors.items() if name in ('CL', 'CD')}
    told = [f'{name} {e.largest:.1e}{" rel." * e.relative}' for name, e in errors.items()]
    return ', '.join(told) or '-'
