"""What the three nodes share."""

from collections.abc import Callable
from typing import Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_srvs.srv import Trigger

from ..errors import FlightdynError

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""For plans and what else changes rarely: who comes late gets the last one."""
STATE = QoSProfile(depth=10)
SENSOR = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)


class BaseNode(Node):
    """A node whose callbacks never end its spinning, run by `entry.run`."""

    end: Callable[[], None] = staticmethod(lambda: None)
    """Ends the process; set by whoever runs the node."""

    def wind_down(self, seconds: float) -> None:
        """Bring work to an end within a time, while the node still spins."""

    def close(self) -> None:
        """Finish files; nothing spins any more."""

    def is_busy(self) -> bool:
        """Return whether a thread of the node is still at work."""
        return False

    def guarded(self, callback: Callable[..., Any], otherwise: Any = None) -> Callable[..., Any]:
        """Return a callback whose errors become one log line instead of the end of spinning."""

        def call(*args: Any) -> Any:
            try:
                return callback(*args)
            except FlightdynError as error:
                self.get_logger().warning(str(error))
            except Exception as error:
                self.get_logger().error(f'{type(error).__name__}: {error}')
            return otherwise

        return call

    def serve(self, kind: Any, name: str, handler: Callable[[Any, Any], None]) -> None:
        """Offer a service; an error becomes `success = False` and the message.

        Parameters
        ----------
        handler : function of (request, response)
            Fills in the response; `success`, if there is one, is True already.
        """

        def call(request: Any, response: Any) -> Any:
            if hasattr(response, 'success'):
                response.success = True
            try:
                handler(request, response)
            except FlightdynError as error:
                _refuse(response, str(error))
            except Exception as error:
                self.get_logger().error(f'{name}: {type(error).__name__}: {error}')
                _refuse(response, f'internal error: {error}')
            return response

        self.create_service(kind, f'~/{name}', call)

    def serve_trigger(self, name: str, action: Callable[[], str]) -> None:
        """Offer a std_srvs/Trigger service; the action returns what to say."""

        def handler(_request: Any, response: Any) -> None:
            response.message = action()

        self.serve(Trigger, name, handler)

    def every(self, seconds: float, callback: Callable[[], None]) -> Any:
        """Call back in wall time, whatever /clock says: some nodes make /clock themselves."""
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        return self.create_timer(seconds, self.guarded(callback), clock=clock)


def _refuse(response: Any, message: str) -> None:
    if hasattr(response, 'success'):
        response.success = False
    if hasattr(response, 'message'):
        response.message = message
