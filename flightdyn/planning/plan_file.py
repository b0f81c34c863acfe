"""Plans as JSON documents, and back."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ..environment.wind_file import wind_document
from ..errors import InputError
from ..trajectory import Trajectory
from .report import Plan

FLIGHT = ('time', 'states', 'controls', 'outputs')
KEYS = (
    *('problem', 'vehicle', 'model', 'converged', 'verified', 'status', 'message', 'objective'),
    *('final_time', 'iterations', 'wall_s', 'build_s', 'nodes', 'transcription', 'verification'),
    *('constraint_violation', 'warnings', 'arcs', 'phases', 'remedies', 'missed', 'optima'),
    'alternatives',
    *('control_interpolation', 'wind_ned', 'wind', 'surroundings'),
    *FLIGHT,
)


def plan_document(plan: Plan) -> dict[str, Any]:
    """Return a plan as what JSON can hold; arrays become lists."""
    report = asdict(plan.report)
    trajectory = plan.trajectory
    values: dict[str, Any] = {
        **report,
        'problem': trajectory.problem,
        'vehicle': trajectory.vehicle,
        'model': trajectory.model,
        'control_interpolation': trajectory.control_interpolation,
        'wind_ned': list(plan.wind_ned),
        'wind': wind_document(plan.wind),
        'surroundings': plan.surroundings.to_dict(),
        'optima': [
            {'objective': each.report.objective, 'final_time': each.report.final_time}
            for each in (plan, *plan.others)
        ],
        'alternatives': [asdict(each) for each in plan.alternatives],
        'time': trajectory.time.tolist(),
    }
    for group in ('states', 'controls', 'outputs'):
        values[group] = {k: v.tolist() for k, v in getattr(trajectory, group).items()}
    return {key: values[key] for key in KEYS}


def read_plan(path: str | Path) -> tuple[Trajectory, dict[str, Any]]:
    """Return the trajectory of a plan file and the rest of its document.

    Raises
    ------
    InputError
        If the file cannot be read or is not a plan; the message says what is missing.
    """
    return plan_of(read_document(path), path)


def read_document(path: str | Path) -> Any:
    """Return what a JSON file holds.

    Raises
    ------
    InputError
        If it cannot be read or is not JSON.
    """
    try:
        return json.loads(Path(path).read_text(encoding='utf-8'))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f'cannot read {path}: {error}') from error
    except json.JSONDecodeError as error:
        raise InputError(f'{path} is not JSON: {error}') from error


def plan_of(document: Any, path: str | Path) -> tuple[Trajectory, dict[str, Any]]:
    """Return the trajectory of a plan's document and the rest of it, see `read_plan`."""
    needed = [key for key in KEYS if key != 'phases']  # which older files do not tell
    flight = flight_of(document, needed, path, 'is not a plan')
    return flight, {key: value for key, value in document.items() if key not in FLIGHT}


def flight_of(document: Any, needed: Sequence[str], path: str | Path, told: str) -> Trajectory:
    """Return the trajectory in a document.

    Parameters
    ----------
    needed : keys
        That it must have, those of the trajectory among them.
    path, told : str
        What messages begin with: the file, and what is wrong with it as a whole.

    Raises
    ------
    InputError
        If a key is missing or its value is none; the message says which.
    """
    missing = [key for key in needed if not isinstance(document, dict) or key not in document]
    if missing:
        raise InputError(f'{path} {told}: it lacks {", ".join(missing)}')
    try:
        states, controls, outputs = (
            {name: np.array(v, float) for name, v in document[group].items()}
            for group in ('states', 'controls', 'outputs')
        )
        return Trajectory(
            time=np.array(document['time'], float),
            states=states,
            controls=controls,
            outputs=outputs,
            model=document['model'],
            vehicle=document['vehicle'],
            problem=document.get('problem', ''),
            control_interpolation=document.get('control_interpolation', 'linear'),
        )
    except (AttributeError, TypeError, ValueError) as error:
        raise InputError(f'{path} {told}: {error}') from error
    except InputError as error:
        raise InputError(f'{path}: {error}') from error
