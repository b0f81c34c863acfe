"""Recordings that other tools can read: MCAP with ROS 2 messages and their definitions.

A recorder that is killed leaves a readable file: chunks are small and reach the disk at least
every half second of the messages' own time. The same messages make the same file.
"""

import contextlib
import threading
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import TracebackType

from mcap.writer import CompressionType, Writer

from ..errors import InputError
from ..trajectory import Trajectory
from .messages import (
    NAV_SAT_FIX,
    ODOMETRY,
    TRAJECTORY,
    VEHICLE_STATE,
    fix_messages,
    geodetic_columns,
    kinematics,
    odometry_messages,
    schema_text,
    serialize,
    trajectory_message,
    vehicle_state_messages,
)

MAX_CHUNK_BYTES = 60_000
FLUSH_EVERY_NS = 500_000_000

_FOREVER = '{sec: 9223372036, nsec: 854775807}'


def _qos(depth: int, durability: str) -> str:
    """Return a reliable QoS profile as rosbag2 keeps it."""
    return (
        '- history: keep_last\n'
        f'  depth: {depth}\n'
        '  reliability: reliable\n'
        f'  durability: {durability}\n'
        f'  deadline: {_FOREVER}\n'
        f'  lifespan: {_FOREVER}\n'
        '  liveliness: automatic\n'
        f'  liveliness_lease_duration: {_FOREVER}\n'
        '  avoid_ros_namespace_conventions: false\n'
    )


class McapRecorder:
    """Writes CDR messages to an MCAP file; a context manager.

    An existing file of that name is replaced. Leaving the context finishes the file, after an
    error too.

    Parameters
    ----------
    path : path
    metadata : mapping of str to str
        Kept in a metadata record `flightdyn` at the beginning of the file: `vehicle`, `model`,
        `problem`, and `origin_lat`, `origin_lon` [deg], `origin_altitude` [m] of the local frame.
    live : bool
        Whether messages come as a flight goes on: then no more than the last half second is lost
        if the process is killed, at the price of many small chunks.

    Raises
    ------
    InputError
        If the file cannot be created there.
    OSError
        If it cannot be written to, as on a full disk.
    """

    def __init__(
        self,
        path: str | Path,
        metadata: Mapping[str, str] | None = None,
        *,
        live: bool = True,
    ) -> None:
        self._live = live
        self.path = Path(path)
        if not self.path.parent.is_dir():
            raise InputError(f'cannot record to {path}: there is no folder {self.path.parent}')
        try:
            self._stream = self.path.open('wb')
        except OSError as error:
            raise InputError(f'cannot record to {path}: {error.strerror or error}') from None
        self._lock = threading.Lock()
        self._writer = Writer(
            self._stream, chunk_size=MAX_CHUNK_BYTES, compression=CompressionType.ZSTD
        )
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, tuple[int, str]] = {}
        self._sequence: dict[int, int] = {}
        self._flushed: int | None = None  # log time [ns]
        self._finished = False
        try:
            self._writer.start(profile='ros2', library='flightdyn')
            self._writer.add_metadata('flightdyn', dict(metadata or {}))
            self._writer.flush()  # type: ignore[no-untyped-call]
        except OSError:
            with contextlib.suppress(OSError):  # closing writes once more
                self._stream.close()
            raise

    def __enter__(self) -> 'McapRecorder':
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.finish()

    def write(
        self,
        topic: str,
        msgtype: str,
        cdr: bytes | memoryview,
        log_time_ns: int,
        publish_time_ns: int | None = None,
    ) -> None:
        """Record one message; may be called from any thread.

        Parameters
        ----------
        topic : str
        msgtype : str
            `pkg/msg/Type`, one of the standard types or of flightdyn_msgs.
        cdr : bytes
            The message, encapsulation word included.
        log_time_ns, publish_time_ns : int
            Unix time [ns]; the publish time is the log time if omitted.

        Raises
        ------
        InputError
            If the type is not known, the topic has another type already, the time is negative
            or the recording is finished.
        """
        if log_time_ns < 0:
            raise InputError(f'cannot record a message at {log_time_ns} ns: before 1970')
        with self._lock:
            if self._finished:
                raise InputError(f'the recording {self.path} is finished')
            channel = self._channel(topic, msgtype)
            self._sequence[channel] += 1
            self._writer.add_message(
                channel,
                log_time_ns,
                bytes(cdr),
                log_time_ns if publish_time_ns is None else publish_time_ns,
                self._sequence[channel],
            )
            if self._flushed is None:
                self._flushed = log_time_ns
            if self._live and abs(log_time_ns - self._flushed) >= FLUSH_EVERY_NS:
                self._writer.flush()  # type: ignore[no-untyped-call]
                self._flushed = log_time_ns

    def flush(self) -> None:
        """Write everything so far to the file; for a timer, when messages may stop coming."""
        with self._lock:
            if not self._finished:
                self._writer.flush()  # type: ignore[no-untyped-call]

    def finish(self) -> None:
        """Write the index and close the file; nothing if that is done already."""
        with self._lock:
            if not self._finished:
                self._finished = True
                try:
                    self._writer.finish()  # type: ignore[no-untyped-call]
                finally:
                    self._stream.close()

    def _channel(self, topic: str, msgtype: str) -> int:
        if topic in self._channels:
            channel, known = self._channels[topic]
            if known != msgtype:
                raise InputError(f'topic {topic} is recorded as {known}, not as {msgtype}')
            return channel
        if msgtype not in self._schemas:
            text = schema_text(msgtype)
            self._schemas[msgtype] = self._writer.register_schema(
                msgtype, 'ros2msg', text.encode()
            )
        latched = msgtype == 'flightdyn_msgs/msg/Trajectory'
        qos = _qos(1, 'transient_local') if latched else _qos(10, 'volatile')
        channel = self._writer.register_channel(
            topic, 'cdr', self._schemas[msgtype], {'offered_qos_profiles': qos}
        )
        self._channels[topic] = (channel, msgtype)
        self._sequence[channel] = 0
        return channel


def write_flight_mcap(
    trajectory: Trajectory, path: str | Path, planned: Trajectory | None = None
) -> None:
    """Write a trajectory as a recording of a flight.

    Topics: `/sim/state` (VehicleState), `/odom` (Odometry, ENU in `odom`, FLU in `base_link`),
    `/fix` (NavSatFix, if it is known where on earth it is) and `/plan` (Trajectory, everything).

    Parameters
    ----------
    trajectory : Trajectory
    path : path
        An existing file is replaced.
    planned : Trajectory
        What it was to be; the same unless given.

    Raises
    ------
    InputError
        If the file cannot be created or times are before 1970.
    """
    unix_ns = trajectory.unix_ns
    if unix_ns.min() < 0:
        raise InputError('a trajectory that begins before 1970 cannot be recorded')
    metadata = {
        'vehicle': trajectory.vehicle,
        'model': trajectory.model,
        'problem': trajectory.problem,
    }
    if trajectory.origin is not None:
        metadata['origin_lat'] = repr(float(trajectory.origin.lat))
        metadata['origin_lon'] = repr(float(trajectory.origin.lon))
        metadata['origin_altitude'] = repr(float(trajectory.origin.altitude))
    motion = kinematics(trajectory)
    with McapRecorder(path, metadata, live=False) as recorder:
        # they begin together, whenever the plan was made
        plan = replace(planned or trajectory, start_ns=trajectory.start_ns)
        message = serialize(TRAJECTORY, trajectory_message(plan))
        recorder.write('/plan', TRAJECTORY, message, int(unix_ns[0]))
        streams = [
            ('/sim/state', VEHICLE_STATE, vehicle_state_messages(trajectory, motion)),
            ('/odom', ODOMETRY, odometry_messages(trajectory, motion)),
        ]
        fixes = geodetic_columns(trajectory, motion)
        if fixes is not None:
            streams.append(('/fix', NAV_SAT_FIX, fix_messages(trajectory, *fixes)))
        together = zip(*(stream for _, _, stream in streams), strict=True)
        for time_ns, messages in zip(unix_ns.tolist(), together, strict=True):
            for (topic, msgtype, _), message in zip(streams, messages, strict=True):
                recorder.write(topic, msgtype, serialize(msgtype, message), time_ns)
