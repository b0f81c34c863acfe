"""What happens in a flight besides its states: the ground, and the vehicle's limits; no ROS."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from ..vehicles.vehicle import Vehicle

HYSTERESIS = 1e-3
"""Of a limit's range, or of its value: how far inside a quantity is within it again."""


@dataclass(frozen=True)
class Event:
    """Something that happened in a run.

    Parameters
    ----------
    kind : str
        ground_contact, limit_left, limit_kept, controls_timed_out, plan_ended, run_began,
        diverged or recording_ended.
    time : float
        Since the start of the run [s].
    message : str
        One sentence for people.
    quantity : str
        What crossed its limit, if that is what happened; value and limit are in its unit.
    """

    kind: str
    time: float
    message: str
    quantity: str = ''
    value: float = math.nan
    limit: float = math.nan


class Watch:
    """Compares each sample with the one before.

    A crossing between two samples is seen if the second one is beyond; the ground's time is
    interpolated between them.

    Parameters
    ----------
    vehicle : Vehicle
        Whose `limits`, and the ranges in which its aerodynamics are known, are watched.
    ground_altitude : float
        Above the local origin [m].
    """

    def __init__(self, vehicle: Vehicle, ground_altitude: float) -> None:
        self._ground = ground_altitude
        self._limits = [
            *((name, limits, 'limit') for name, limits in vehicle.limits.items()),
            *(
                (name, limits, "range of the aerodynamics'")
                for name, limits in vehicle.box.items()
            ),
        ]
        self._outside = [False] * len(self._limits)
        self._before: tuple[float, float] | None = None  # time, height

    def look(self, time: float, values: Mapping[str, float]) -> Iterator[Event]:
        """Yield what has happened since the last sample.

        Parameters
        ----------
        values : mapping of name to float
            States, controls and outputs, in the library's units.
        """
        altitude = -values['z_e']
        yield from self._ground_contact(time, altitude - self._ground, values)
        for i, (name, (lower, upper), what) in enumerate(self._limits):
            value = altitude if name == 'altitude' else values.get(name)
            if value is None:
                continue
            limit = lower if value < lower else upper
            margin = HYSTERESIS * (
                upper - lower if math.isfinite(upper - lower) else max(abs(limit), 1.0)
            )
            if not self._outside[i] and not lower <= value <= upper:
                self._outside[i] = True
                yield Event(
                    'limit_left',
                    time,
                    f'{name} of {value:.5g} is beyond the {what} of {limit:.5g}',
                    name,
                    value,
                    limit,
                )
            elif self._outside[i] and lower + margin <= value <= upper - margin:
                self._outside[i] = False
                yield Event('limit_kept', time, f'{name} is within its {what} again', name, value)

    def _ground_contact(
        self, time: float, height: float, values: Mapping[str, float]
    ) -> Iterator[Event]:
        before, self._before = self._before, (time, height)
        if before is None or not (before[1] > 0 >= height):
            return
        at = before[0] + (time - before[0]) * before[1] / (before[1] - height)
        sink = values.get('w_e', math.nan)
        yield Event(
            'ground_contact',
            at,
            f'on the ground at x_e = {values["x_e"]:.5g} m, y_e = {values["y_e"]:.5g} m with '
            f'{values["speed"]:.4g} m/s, sinking {sink:.4g} m/s',
            'altitude',
            self._ground,
            self._ground,
        )
