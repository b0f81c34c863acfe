"""Scenarios: what to simulate when there is no plan to follow."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..config import check_keys, load_yaml, number, text
from ..environment.wind import Wind
from ..environment.wind_file import read_wind
from ..errors import InputError
from ..resources import find_config
from ..trajectory import Trajectory
from ..vehicles.vehicle import Vehicle, load_vehicle
from .gusts import Gusts
from .simulator import MAX_STEP, Simulator

KEYS = (
    *('description', 'vehicle', 'duration', 'initial', 'controls', 'wind_ned', 'wind', 'gusts'),
    *('max_step', 'rate'),
)
RATE = 200.0  # Hz
GUST_KEYS = ('severity', 'seed', 'wind_at_20_ft')


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """A vehicle, its initial state, and controls that are held; `simulator()` flies it.

    `max_step` is the longest integration step [s], `rate` how often a flight is sampled [Hz].
    """

    name: str
    description: str
    vehicle: Vehicle
    duration: float
    initial: dict[str, float]
    controls: dict[str, float]
    wind_ned: tuple[float, ...]
    wind: Wind | None
    gusts: Gusts | None
    max_step: float
    rate: float

    def simulator(self) -> Simulator:
        """Return a simulator at the scenario's start."""
        held = Trajectory(
            time=np.zeros(1),
            states={},
            controls={name: np.full(1, value) for name, value in self.controls.items()},
            control_interpolation='previous',
        )
        return Simulator(
            self.vehicle.model(self.wind),
            self.initial,
            held,
            wind=self.wind_ned,
            gusts=self.gusts,
            max_step=self.max_step,
        )


def load_scenario(name: str, config_dir: str | Path | None = None) -> Scenario:
    """Return a scenario by the path of its YAML file or its name in config/scenarios.

    Raises
    ------
    InputError
        If it is not there, or has an unknown key or a value out of range.
    """
    path = Path(name) if name.endswith(('.yaml', '.yml')) else None
    path = path or find_config('scenarios', name, config_dir)
    document = check_keys(load_yaml(path), KEYS, str(path))
    for key in ('vehicle', 'duration'):
        if key not in document:
            raise InputError(f"{path}: '{key}' is missing")
    vehicle = load_vehicle(text(document['vehicle'], f'{path}: vehicle'), config_dir)
    model = vehicle.model()
    wind = document.get('wind_ned', [0, 0, 0])
    if not isinstance(wind, list) or len(wind) != 3:
        raise InputError(f'{path}: wind_ned: expected [north, east, down], got {wind!r}')
    positive = {'max_step': MAX_STEP, 'rate': RATE} | {
        key: number(document[key], f'{path}: {key}')
        for key in ('duration', 'max_step', 'rate')
        if key in document
    }
    for key, value in positive.items():
        if value <= 0:
            raise InputError(f'{path}: {key}: must be positive, got {value:g}')
    controls = check_keys(document.get('controls', {}), tuple(model.controls), f'{path}: controls')
    for control in model.controls:
        if control not in controls:
            raise InputError(f'{path}: controls: {control!r} is missing')
    held = {k: number(v, f'{path}: controls.{k}') for k, v in controls.items()}
    for control, value in held.items():
        lower, upper = model.controls[control]
        if not lower <= value <= upper:
            raise InputError(
                f'{path}: controls.{control}: {value:g} is outside [{lower:g}, {upper:g}]'
            )
    initial = check_keys(document.get('initial', {}), model.states, f'{path}: initial')
    return Scenario(
        name=path.stem,
        description=text(document.get('description', ''), f'{path}: description'),
        vehicle=vehicle,
        **positive,
        initial={k: number(v, f'{path}: initial.{k}') for k, v in initial.items()},
        controls=held,
        wind_ned=tuple(number(w, f'{path}: wind_ned') for w in wind),
        wind=read_wind(document.get('wind', []), f'{path}: wind'),
        gusts=_gusts(document['gusts'], f'{path}: gusts') if 'gusts' in document else None,
    )


def _gusts(value: Any, where: str) -> Gusts:
    given = check_keys(value, GUST_KEYS, where)
    if 'severity' in given:
        given['severity'] = text(given['severity'], f'{where}.severity')
    if 'wind_at_20_ft' in given:
        given['wind_at_20_ft'] = number(given['wind_at_20_ft'], f'{where}.wind_at_20_ft')
    seed = given.get('seed', 0)
    if isinstance(seed, bool) or not isinstance(seed, int):
        raise InputError(f'{where}.seed: expected a whole number, got {seed!r}')
    try:
        return Gusts(**given)
    except InputError as error:
        raise InputError(f'{where}: {error}') from None
