"""Sweeps: a problem, what is varied, and what to make of the plans."""

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..config import suggestion
from ..environment.geodesy import GeodeticPoint
from ..errors import InputError
from . import sampling
from .expression import Expression
from .plan_values import REPORTED, evaluated
from .problem import Problem
from .problem_file import KEYS as PROBLEM_KEYS
from .problem_file import load_problem

Array = NDArray[np.float64]

SAMPLINGS = ('grid', 'random', 'latin_hypercube')
STARTS = ('near', 'cold', 'both')
"""Near the plan of a neighbouring case, at the problem's own guess, or both, for the better."""
COLUMNS = (
    *('key', 'output', 'exit_code', 'code', 'error', 'wall_s', 'converged', 'verified'),
    *(*REPORTED, 'start', 'warnings'),
)
"""What a table has beside parameters and values."""
ENDS = ('final.x_e', 'final.y_e')
"""Values that a footprint is made of [m]."""
PLACEHOLDER = re.compile(r'\{([^{}]*)\}')
"""A formula of parameters in the text of a setting."""


@dataclass(frozen=True)
class Parameter:
    """What is varied.

    Parameters
    ----------
    key : str
        An entry of the problem, as in `flightdyn plan --set`, or a name that the sweep's
        settings use.
    values : tuple
        What it is set to in turn: numbers (SI, angles in radians but alpha and beta in degrees),
        or anything else that YAML has. Empty for a range.
    lower, upper : float
        Of a range.
    """

    key: str
    values: tuple[Any, ...] = ()
    lower: float = 0.0
    upper: float = 0.0

    @property
    def is_own(self) -> bool:
        """Whether it is a name of the sweep's, and no entry of a problem."""
        return entry_of(self.key) not in PROBLEM_KEYS

    @property
    def numeric(self) -> bool:
        """Whether all of its values are numbers."""
        return all(is_number(value) for value in self.values)

    def at(self, share: float) -> Any:
        """Return the value at a share 0..1 of the way."""
        if self.values:
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        return self.lower + share * (self.upper - self.lower)

    def told(self, value: Any) -> float | str:
        """Return one of its values as a table has it: a number, or words."""
        if self.numeric:
            return value if isinstance(value, int) else float(value)
        return value if isinstance(value, str) else json.dumps(value)


@dataclass(frozen=True)
class Case:
    """One problem of a sweep.

    Parameters
    ----------
    number : int
        From 0, in the order of the table.
    parameters : mapping of key to value
    settings : tuple of 'KEY=VALUE'
        What makes the problem of the one that the sweep names.
    """

    number: int
    parameters: Mapping[str, Any]
    settings: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Picture:
    """A value over parameters, see `viewing.sweep_figures.sweep_figure`."""

    over: tuple[str, ...]
    value: str
    title: str
    units: Mapping[str, str]
    labels: Mapping[str, str]


@dataclass(frozen=True)
class Footprint:
    """Where plans end, drawn on the ground.

    Parameters
    ----------
    around : str
        The parameter that goes once round; plans that share the others bound one area.
    place : GeodeticPoint or None
        Where on earth the problem's origin is, for a map.
    """

    around: str
    place: GeodeticPoint | None


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """Many problems that differ in some values, see docs/sweeps.md.

    Parameters
    ----------
    name : str
    problem : str
        Name of a problem, or path of its file.
    settings : mapping
        Entries of the problem that differ in all cases; text in braces is a formula of
        parameters.
    parameters : tuple of Parameter
    samples : int
        How many cases; of a grid, the product of its values.
    start : str
        Where solves start: one of STARTS.
    values : mapping of name to Expression
        What the table has of each plan.
    plans : str
        Suffix of the files of the plans.
    """

    name: str
    description: str
    problem: str
    settings: Mapping[str, Any]
    parameters: tuple[Parameter, ...]
    sampling: str
    samples: int
    seed: int
    start: str
    values: Mapping[str, Expression]
    picture: Picture | None
    footprint: Footprint | None
    plans: str
    config_dir: str | None = None

    @cached_property
    def _shares(self) -> Array:
        """Where in the unit cube each case is (n, d)."""
        d = len(self.parameters)
        if self.sampling == 'grid':
            counts = [len(parameter.values) for parameter in self.parameters]
            # in the middle of each value's part of the axis
            middles: Array = (sampling.grid(counts) + 0.5) / np.array(counts, float)
            return middles
        draw = sampling.random if self.sampling == 'random' else sampling.latin_hypercube
        return draw(self.samples, d, self.seed)

    @property
    def places(self) -> Array:
        """Where each case is (n, d), in steps from one to the next along each parameter."""
        dense = self.samples ** (1 / len(self.parameters))
        steps: Array = self._shares * [len(p.values) or dense for p in self.parameters]
        return steps

    def cases(self) -> Iterator[Case]:
        """Yield the cases; of a grid with the last parameter fastest.

        Raises
        ------
        InputError
            If a formula in the settings comes to no number; the message has the case.
        """
        for n, shares in enumerate(self._shares.tolist()):
            given = {p.key: p.at(share) for p, share in zip(self.parameters, shares, strict=True)}
            try:
                settings = self._settings(given)
            except InputError as error:
                raise InputError(f'{error}, in the case {given}') from None
            yield Case(n, given, settings)

    def load(self, case: Case) -> Problem:
        """Return the problem of a case.

        Raises
        ------
        InputError
            If it is none.
        """
        return load_problem(self.problem, case.settings, self.config_dir)

    def told(self, case: Case) -> dict[str, float | str]:
        """Return the parameters of a case as a table has them."""
        return {p.key: p.told(case.parameters[p.key]) for p in self.parameters}

    def _settings(self, given: Mapping[str, Any]) -> tuple[str, ...]:
        entries = {
            key: _filled(
                value, given, f'{self.name}: settings.{key}', entry_of(key) == 'objective'
            )
            for key, value in self.settings.items()
        }
        entries |= {p.key: given[p.key] for p in self.parameters if not p.is_own}
        return tuple(f'{key}={json.dumps(value)}' for key, value in entries.items())


def entry_of(key: str) -> str:
    """Return which entry of a problem a setting is about, or is a part of."""
    return re.split(r'[.\[]', key)[0]


def is_number(value: Any) -> bool:
    """Return whether a value is one that formulas can be made of."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def _filled(value: Any, given: Mapping[str, Any], where: str, in_formula: bool) -> Any:
    """Return a setting with its formulas in braces replaced by what they come to."""
    if isinstance(value, Mapping):
        return {k: _filled(v, given, f'{where}.{k}', in_formula) for k, v in value.items()}
    if isinstance(value, list):
        return [_filled(v, given, where, in_formula) for v in value]
    if not isinstance(value, str):
        return value
    alone = PLACEHOLDER.fullmatch(value.strip())
    if alone:
        return _worth(alone.group(1), given, where)

    def text_of(match: re.Match[str]) -> str:
        found = _worth(match.group(1), given, where)
        words = str(found) if isinstance(found, str) else json.dumps(found)
        return f'({words})' if in_formula and is_number(found) else words

    return PLACEHOLDER.sub(text_of, value)


def _worth(formula: str, given: Mapping[str, Any], where: str) -> Any:
    """Return what a formula of parameters comes to; a parameter alone may be no number."""
    if formula.strip() in given:
        return given[formula.strip()]

    def value(name: str) -> float:
        if name not in given:
            raise InputError(f"unknown '{name}'{suggestion(name, tuple(given))}")
        if not is_number(given[name]):
            raise InputError(f"'{name}' is no number but {given[name]!r}")
        return float(given[name])

    return evaluated(Expression(formula, where), value)
