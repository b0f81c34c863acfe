"""What the document of a plan, a simulation or a replay tells beside its trajectory."""

from collections.abc import Mapping
from typing import Any

from ..environment.surroundings import Surroundings
from .events import Event, Lane

FIGURES = (
    *('objective', 'final_time', 'iterations', 'wall_s', 'build_s', 'nodes', 'transcription'),
    *('status', 'converged', 'verified', 'constraint_violation', 'verification'),
    *('source', 'schema', 'altitude_datum', 'messages', 'used', 'dropped', 'clock'),
    *('distance_m', 'max_speed', 'max_altitude', 'wind', 'scenario', 'deviation_from_plan'),
)
"""Of a document, what is kept as properties of a recording."""


def run_properties(document: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figures of a run by name."""
    return {
        name: document[name] for name in FIGURES if document.get(name) not in (None, {}, [], '')
    }


def run_events(document: Mapping[str, Any], start: float = 0.0) -> list[Event]:
    """Return what the solver or the replay said, as events at the start [s].

    Arcs of a bang-bang plan are at their own times.
    """
    events = []
    if 'iterations' in document:
        solved = (
            f'planner: {document.get("status")}, {document["iterations"]} iterations in '
            f'{document.get("wall_s", 0.0):.3g} s, objective {document.get("objective", 0.0):.6g}'
        )
        verified = bool(document.get('verified'))
        events.append(Event(start, solved, 'INFO' if verified else 'WARN'))
        events.append(Event(start, f'planner: {document.get("message")}'))
        remedies = document.get('remedies') or []
        events += [Event(start, f'planner tried: {remedy}', 'WARN') for remedy in remedies]
    for warning in document.get('warnings') or []:
        events.append(Event(start, str(warning), 'WARN'))
    for reason, count in (document.get('dropped') or {}).items():
        if count:
            events.append(Event(start, f'replay: {count} samples dropped: {reason}', 'WARN'))
    for number, flight in enumerate(document.get('flights') or [], start=1):
        for key, text in (('start', 'take-off'), ('end', 'landing')):
            if flight.get('takeoff' if key == 'start' else 'landing'):
                events.append(Event(float(flight[key]), f'{text}, flight {number}'))
    return events


def run_surroundings(document: Mapping[str, Any]) -> Surroundings | None:
    """Return what stands around a plan, None if nothing does.

    Raises
    ------
    InputError
        If the document's `surroundings` are not such.
    """
    found = document.get('surroundings')
    return Surroundings.from_dict(found) if found else None


def run_lanes(document: Mapping[str, Any]) -> list[Lane]:
    """Return lanes of a plan's phases and arcs, and of the flights in a log."""
    lanes = []
    phases = document.get('phases') or []
    gates = (document.get('surroundings') or {}).get('gates')
    if phases and not gates:  # the phases of a flight through gates are in the lane of these
        begins = tuple(float(phase['start']) for phase in phases)
        lanes.append(Lane('phase', begins, tuple(str(phase['name']) for phase in phases)))
    arcs = document.get('arcs') or []
    if arcs:
        states = [', '.join(f'{n} {side}' for n, side in arc['limits'].items()) for arc in arcs]
        times = tuple(float(arc['start']) for arc in arcs)
        lanes.append(Lane('arc', times, tuple(state or 'free' for state in states)))
    flights = document.get('flights') or []
    if flights:
        changes: dict[float, str | None] = {}
        for number, flight in enumerate(flights, start=1):
            changes[float(flight['start'])] = f'flight {number}'
            changes.setdefault(
                float(flight['end']), 'on the ground' if flight['landing'] else None
            )
        ordered = sorted(changes)
        lanes.append(Lane('flight', tuple(ordered), tuple(changes[t] for t in ordered)))
    return lanes
