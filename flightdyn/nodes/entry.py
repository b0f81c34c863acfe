"""Starting and ending a node: signals, exit codes, and teardown in the order that rclpy bears.

Nothing of ROS is imported before `run`, so that a user without it reads a sentence.
"""

import argparse
import contextlib
import importlib
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from typing import Any, NoReturn

from ..errors import FlightdynError, InputError

WIND_DOWN_S = 0.8
JOIN_S = 0.5
END_S = 1.9  # after the signal


class _Interrupted(KeyboardInterrupt):
    """A signal to end, before the node spins."""


class _Signals:
    """SIGINT and SIGTERM: they interrupt the main thread where that is safe, else they wait."""

    def __init__(self) -> None:
        self.stop = threading.Event()
        self.interrupting = True
        self._told = 0.0
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._take)

    def _take(self, _number: int, _frame: Any) -> None:
        self._told = self._told or time.monotonic()
        self.stop.set()
        if self.interrupting:
            raise _Interrupted

    @property
    def left(self) -> float:
        """How long the end may still take [s]; a little if that is over."""
        return max(END_S - (time.monotonic() - self._told), 0.1) if self._told else END_S

    @contextlib.contextmanager
    def interrupt(self, interrupting: bool) -> Iterator[None]:
        """Let signals interrupt the block or not; a signal of before interrupts at once."""
        before, self.interrupting = self.interrupting, interrupting
        try:
            if interrupting and self.stop.is_set():
                raise _Interrupted
            yield
        finally:
            self.interrupting = before


def run(name: str, module: str, node_class: str, description: str) -> int:
    """Run a node until SIGINT, SIGTERM or its own end; return the exit code.

    Parameters
    ----------
    name : str
        What the executable is called.
    module, node_class : str
        Where the class of the node is; a `flightdyn.nodes.base.BaseNode`.
    description : str
        Shown by `--help`.

    Returns
    -------
    int
        0 after a signal or a planned end, 2 after a user's mistake, which is one line on stderr.
    """
    signals = _Signals()
    try:
        require_ros()
        _parse(name, description)
        found = getattr(importlib.import_module(f'flightdyn.nodes.{module}'), node_class)
        with signals.interrupt(False):
            return _run(name, found, signals)
    except InputError as error:
        print(f'{name}: {error}', file=sys.stderr)
        return 2
    except _Interrupted:
        return 0


def _run(name: str, node_class: Any, signals: _Signals) -> int:
    import rclpy
    from rclpy.signals import SignalHandlerOptions

    try:
        rclpy.init(args=sys.argv, signal_handler_options=SignalHandlerOptions.NO)
    except Exception as error:  # of many kinds: bad arguments, no folder for logs
        raise _no_start(error) from None
    try:
        session = _Session(node_class(), signals)
    except InputError as error:
        error.__traceback__ = None  # it would keep what there is of the node
        rclpy.try_shutdown()
        raise
    return session.run()


def require_ros() -> None:
    """Check that rclpy and the built messages can be imported.

    Raises
    ------
    InputError
        If not; the message says what to do.
    """
    try:
        import rclpy  # noqa: F401
    except ImportError as error:
        raise InputError(
            f'ROS 2 is not there ({error}): source its setup file, or run `make setup` and start '
            'through tools/run'
        ) from None
    try:
        # the bare folder of a checkout can be imported, too, but has nothing in it
        from flightdyn_msgs.msg import Trajectory  # noqa: F401
    except ImportError as error:
        raise InputError(
            f'flightdyn_msgs is not built or not sourced: run `colcon build`, then source '
            f'install/setup.bash ({error})'
        ) from None


def _parse(name: str, description: str) -> None:
    from rclpy.utilities import remove_ros_args

    try:
        own = remove_ros_args(sys.argv)[1:]
    except Exception as error:  # rclpy's own kinds are private
        raise _no_start(error) from None
    parser = argparse.ArgumentParser(
        name,
        description=description,
        epilog='Parameters follow as ROS arguments: --ros-args -p NAME:=VALUE',
    )
    parser.parse_args(own)


def _no_start(error: Exception) -> InputError:
    return InputError(f'ROS 2 does not start: {" ".join(str(error).split())}')


def _leave(code: int) -> NoReturn:
    """End at once: threads of half-started middleware may not survive an orderly exit."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


class _Session:
    """A node, and a thread that spins it: the main thread has to be free to take signals."""

    def __init__(self, node: Any, signals: _Signals) -> None:
        from rclpy.executors import SingleThreadedExecutor

        self._signals = signals
        self._failure: BaseException | None = None
        self._node = node
        self._node.end = signals.stop.set
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin, name='spin', daemon=True)

    def run(self) -> int:
        """Start the node, spin it until the end, and take everything down.

        Raises
        ------
        InputError
            If what was asked for at start cannot be; the node is down then.
        """
        try:
            with self._signals.interrupt(True):
                self._node.autostart()
        except _Interrupted:
            return self._end(0)
        except InputError:
            self._end(2)
            raise
        except FlightdynError as error:
            self._node.get_logger().fatal(str(error))
            return self._end(1)
        self._thread.start()
        self._signals.stop.wait()
        code = 0
        if self._failure is not None:
            failure = f'{type(self._failure).__name__}: {self._failure}'
            self._node.get_logger().fatal(failure)
            code = 1
        self._node.wind_down(WIND_DOWN_S)
        self._executor.shutdown(timeout_sec=0)
        self._thread.join(JOIN_S)
        if self._thread.is_alive():
            _leave(code)  # a callback is deep in native code: what it uses cannot be destroyed
        return self._end(code)

    def _end(self, code: int) -> int:
        import rclpy

        self._node.finalize()
        # What a killed peer left locked can hold the middleware up for good; no Python runs then.
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.setitimer(signal.ITIMER_REAL, self._signals.left)
        self._node.destroy_node()
        rclpy.try_shutdown()
        return code

    def _spin(self) -> None:
        from rclpy.executors import ExternalShutdownException

        try:
            self._executor.spin()
        except ExternalShutdownException:
            pass
        except BaseException as error:
            self._failure = error
        finally:
            self._signals.stop.set()
