"""What our own recordings hold beside measurements: plans, and flights as they were flown."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from .. import frames
from ..environment.geodesy import GeodeticPoint
from ..errors import LogError
from ..trajectory import Columns, Trajectory, columns_of
from .mcap_container import McapFile
from .messages import (
    DEGREES,
    TRAJECTORY,
    VEHICLE_STATE,
    trajectory_from_message,
    typestore,
)
from .sources import METADATA_NAME, recorded_origin

_SCALARS = (
    *('x_e', 'y_e', 'z_e', 'u_e', 'v_e', 'w_e', 'p', 'q', 'r', 'speed', 'gamma', 'track'),
    *('bank', 'alpha', 'beta', 'airspeed', 'load_factor'),
)


def read_plans(path: str | Path) -> list[Trajectory]:
    """Return the trajectories that are recorded as messages in a log, in their order.

    Raises
    ------
    LogError
        If the file cannot be read or a message is damaged.
    """
    with McapFile(path) as log:
        origin = _origin(log)
        return [
            replace(trajectory_from_message(message), origin=origin)
            for _, message in _messages(log, TRAJECTORY)
        ]


def read_flights(path: str | Path) -> list[Trajectory]:
    """Return the runs recorded as VehicleState in a log, with the states and controls flown.

    A new run begins where the time since its start is set back or the vehicle changes. Outputs
    are those of the message that are numbers throughout and no states of the model.

    Raises
    ------
    LogError
        If the file cannot be read, a message is damaged, or no VehicleState is in it.
    """
    with McapFile(path) as log:
        origin = _origin(log)
        messages = list(_messages(log, VEHICLE_STATE))
    if not messages:
        raise LogError(f'{path}: no {VEHICLE_STATE} messages: no recording of a simulated flight')
    topics = {topic for topic, _ in messages}
    states = [message for topic, message in messages if topic == min(topics)]
    time = np.array([message.time for message in states])
    vehicle = np.array([message.vehicle for message in states])
    run = np.cumsum(np.append(0, (np.diff(time) < 0) | (vehicle[1:] != vehicle[:-1])))
    return [
        _flight([states[i] for _, i in group], origin)
        for _, group in groupby(
            zip(run, range(len(states)), strict=True), key=lambda pair: pair[0]
        )
    ]


def _flight(messages: list[Any], origin: GeodeticPoint | None) -> Trajectory:
    # a sample that is published twice, as at the end of a plan, is one
    time = np.array([message.time for message in messages])
    messages = [messages[i] for i in np.flatnonzero(np.append(True, np.diff(time) > 0))]
    time = np.array([message.time for message in messages])
    first = messages[0]
    states = columns_of(list(first.state_names), [message.states for message in messages])
    controls = (
        columns_of(list(first.control_names), [message.controls for message in messages])
        if len(first.control_names)
        else {}
    )
    values = {name: np.array([getattr(m, name) for m in messages]) for name in _SCALARS}
    if 'theta' not in states:  # else the model's own angles tell, which may count full turns
        w, x, y, z = np.array([message.q_eb for message in messages]).T
        attitude = frames.euler_from_rotation(frames.rotation_from_quaternion((w, x, y, z)))
        values |= dict(zip(('phi', 'theta', 'psi'), attitude, strict=True))
    outputs: Columns = {
        name: column
        for name, column in values.items()
        if name not in states and name not in controls and np.isfinite(column).all()
    }
    for columns in (states, controls, outputs):
        for name in set(DEGREES).intersection(columns):
            columns[name] = np.degrees(columns[name])
    stamp = first.header.stamp
    return Trajectory(
        time=time,
        states=states,
        controls=controls,
        outputs=outputs,
        model=first.model,
        vehicle=first.vehicle,
        control_interpolation='previous',
        start_ns=int(stamp.sec) * 10**9 + int(stamp.nanosec) - round(time[0] * 1e9),
        origin=origin,
    )


def _origin(log: McapFile) -> GeodeticPoint | None:
    return recorded_origin(log.metadata_record(METADATA_NAME), log.warnings)


def _messages(log: McapFile, msgtype: str) -> Iterator[tuple[str, Any]]:
    """Yield topic and message of every CDR message of a type, channel by channel."""
    from rosbags.serde import SerdeError

    for channel in log.channels.values():
        schema = log.schemas.get(channel.schema_id)
        if schema is None or schema.name != msgtype or channel.message_encoding != 'cdr':
            continue
        for batch in log.batches([channel.id]):
            for start, end in zip(batch.start, batch.end, strict=True):
                try:
                    data = batch.data[start:end].tobytes()
                    yield channel.topic, typestore().deserialize_cdr(data, msgtype)
                except SerdeError as error:
                    raise LogError(f'{log.path}: topic {channel.topic}: {error}') from None
