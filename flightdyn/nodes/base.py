"""What the nodes share: life cycle, gates, QoS that can be overridden, diagnostics, clock jumps.

rclpy's life cycle switches publishers alone. Here everything a node offers is switched with it:
what is made by `advertise`, `subscribe`, `serve` and `every` works in the states that it is meant
for, and says so in the others.
"""

import copy
import importlib
import inspect
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Literal

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, JumpThreshold
from rclpy.clock_type import ClockType
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.exceptions import ParameterException
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import DurabilityPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from std_srvs.srv import Trigger

from ..errors import FlightdynError, InputError
from .diagnostics import Level, Status, diagnostics_msg
from .parameters import NodeParameters, Parameters

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""For plans and what else changes rarely: who comes late gets the last one."""
STATE = QoSProfile(depth=10)
SENSOR = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)

DIAGNOSTICS_S = 1.0
OVERRIDABLE = (
    QoSPolicyKind.HISTORY,
    QoSPolicyKind.DEPTH,
    QoSPolicyKind.RELIABILITY,
    QoSPolicyKind.DURABILITY,
)

When = Literal['active', 'configured', 'always']
"""In which states something works; `configured` is inactive or active."""

SUCCESS = TransitionCallbackReturn.SUCCESS
FAILURE = TransitionCallbackReturn.FAILURE
ERROR = TransitionCallbackReturn.ERROR


class BaseNode(LifecycleNode):
    """A managed node whose callbacks never end its spinning, run by `entry.run`.

    A node makes its topics, services and timers in `__init__`; what its parameters name it loads
    in `configure`, so that a mistake leaves it unconfigured and running.

    Parameters
    ----------
    name : str
    kind : type
        Dataclass of the node's parameters.
    context : rclpy.context.Context, optional
        Another than the process's own.

    Raises
    ------
    InputError
        If a parameter given at start is not allowed.
    """

    end: Callable[[], None] = staticmethod(lambda: None)
    """Ends the process; set by whoever runs the node."""

    def __init__(
        self, name: str, kind: type[NodeParameters], *, context: Context | None = None
    ) -> None:
        super().__init__(name, context=context)
        # On one thread callbacks exclude each other anyhow; one that awaits lets the others run.
        self._default_callback_group = ReentrantCallbackGroup()
        self.is_configured = self.is_active = False
        self.view: Any = None
        """The viewer, a `flightdyn.viewing.live.LiveView`, if there is one."""
        self._failure: Exception | None = None
        self._is_starting = False
        self._ignored = 0
        self._timers_when: list[tuple[Any, When]] = []
        self.parameters = Parameters(
            self, kind, self.on_parameters, is_configured=lambda: self.is_configured
        )
        self._diagnostics = self.advertise(DiagnosticArray, '/diagnostics', STATE, when='always')
        self.every(DIAGNOSTICS_S, self._diagnose, when='always')
        self._jumps = self.get_clock().create_jump_callback(
            JumpThreshold(
                min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=True
            ),
            post_callback=self.guarded(lambda jump: self.on_clock_jump(jump.delta.nanoseconds)),
        )

    # What nodes fill in. -------------------------------------------------------------------------
    def configure(self) -> None:
        """Load what the parameters name; a FlightdynError leaves the node unconfigured."""

    def activate(self) -> None:
        """Begin; publishers are on already. A FlightdynError leaves the node inactive."""

    def deactivate(self) -> None:
        """End what is under way; publishers are still on."""

    def clean_up(self) -> None:
        """Let go of what `configure` loaded, and finish files; it may have failed half-way."""

    def on_parameters(self, values: Any) -> None:
        """Take new values of parameters."""

    def on_clock_jump(self, delta_ns: int) -> None:
        """Forget what depends on time: the node's clock has gone back, or became another one.

        Parameters
        ----------
        delta_ns : int
            New time less old time [ns].
        """

    def diagnose(self) -> Iterable[Status]:
        """Return how the node is; asked once a second in every state."""
        return ()

    def wind_down(self, seconds: float) -> None:
        """Bring work to an end within a time, while the node still spins."""

    # The life cycle. -----------------------------------------------------------------------------
    @property
    def state_label(self) -> str:
        """unconfigured, inactive, active, finalized, or a state in between."""
        return str(self._state_machine.current_state[1])

    def autostart(self) -> None:
        """Configure and activate the node, if its parameters say so.

        Raises
        ------
        FlightdynError
            What kept it from that.
        """
        if not self.parameters.values.autostart:
            self.get_logger().info('waiting to be configured and activated')
            return
        self._is_starting = True
        try:
            for trigger in (self.trigger_configure, self.trigger_activate):
                if trigger() != SUCCESS:
                    assert self._failure is not None
                    raise self._failure
        finally:
            self._is_starting = False

    def finalize(self) -> None:
        """Go through the shutdown transition, if the node has not been shut down yet."""
        if self.state_label in ('unconfigured', 'inactive', 'active'):
            self.trigger_shutdown()

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Open the viewer and call `configure`."""
        code = self._attempt('configured', self._open_view, self.configure)
        if code == SUCCESS:
            self.is_configured = True
            self._switch_timers()
        else:
            self._attempt('cleaned up', self.clean_up, self._close_view, first=False)
        return code

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Switch publishers on, call `activate`, and switch the rest on."""
        super().on_activate(state)
        code = self._attempt('activated', self.activate)
        if code == SUCCESS:
            self.is_active = True
            self._switch_timers()
            self.get_logger().info('active')
        else:
            super().on_deactivate(state)
        return code

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Switch all but publishers off, call `deactivate`, then publishers."""
        self.is_active = False
        self._switch_timers()
        code = self._attempt('deactivated', self.deactivate)
        super().on_deactivate(state)
        return code if code == SUCCESS else ERROR

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Call `clean_up` and close the viewer."""
        self.is_configured = False
        self._switch_timers()
        code = self._attempt('cleaned up', self.clean_up, self._close_view)
        return code if code == SUCCESS else ERROR

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Deactivate and clean up, as far as the node is active and configured."""
        if self.is_active:
            self.on_deactivate(state)
        if self.is_configured:
            self.on_cleanup(state)
        return SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Become unconfigured after an error in a transition."""
        return self.on_shutdown(state)

    def _attempt(
        self, what: str, *steps: Callable[[], None], first: bool = True
    ) -> TransitionCallbackReturn:
        """Call the steps of a transition; rclpy would swallow what they raise."""
        try:
            for step in steps:
                step()
        except Exception as error:
            known = isinstance(error, FlightdynError)
            said = str(error) if known else f'{type(error).__name__}: {error}'
            if first:
                self._failure = error if known else FlightdynError(said)
            if not self._is_starting:  # who starts the node hears of it
                self.get_logger().error(f'cannot be {what}: {said}')
            return FAILURE if known else ERROR
        return SUCCESS

    def _open_view(self) -> None:
        url = self.parameters.values.viewer
        if url:
            try:
                from ..viewing.live import LiveView
            except ImportError as error:
                raise InputError(
                    f"parameter viewer: needs the extra 'view': pip install 'flightdyn[view]' "
                    f'({error})'
                ) from None
            self.view = LiveView(url, name=self.get_fully_qualified_name())

    def _close_view(self) -> None:
        view, self.view = self.view, None
        if view is not None:
            view.close()

    # Gates. --------------------------------------------------------------------------------------
    def works(self, when: When) -> bool:
        """Return whether what works `when` does now."""
        return when == 'always' or (self.is_active if when == 'active' else self.is_configured)

    def closed(self, what: str, when: When) -> str:
        """Return why something does not work now, and what would open it."""
        name = self.get_fully_qualified_name()
        steps = ['configure'] if not self.is_configured else []
        steps += ['activate'] if when == 'active' else []
        cure = ' and '.join(f'`ros2 lifecycle set {name} {step}`' for step in steps)
        return f'{what}: the node is {self.state_label}; first {cure}'

    def advertise(self, kind: Any, topic: str, qos: QoSProfile, *, when: When = 'active') -> Any:
        """Return a publisher whose QoS parameters `qos_overrides.TOPIC.publisher.*` override.

        What is published while it is off is dropped.

        Raises
        ------
        InputError
            If an override is not a QoS.
        """
        create = self.create_publisher if when == 'always' else self.create_lifecycle_publisher
        return self._with_qos(create, kind, topic, copy.copy(qos))

    def advertise_transforms(self) -> tuple[Any, Any, Any] | None:
        """Return TFMessage and publishers of moving and of fixed transforms; None without tf2."""
        try:
            kind = importlib.import_module('tf2_msgs.msg').TFMessage
        except ImportError:
            return None
        dynamic = self.advertise(kind, '/tf', STATE)
        return kind, dynamic, self.advertise(kind, '/tf_static', LATCHED)

    def subscribe(
        self,
        kind: Any,
        topic: str,
        callback: Callable[[Any], None],
        qos: QoSProfile,
        *,
        when: When = 'active',
    ) -> Any:
        """Return a subscription, with QoS as of `advertise`; messages that come while it is off
        are counted."""
        guarded = self.guarded(callback)

        def take(message: Any) -> None:
            if self.works(when):
                guarded(message)
            else:
                self._ignored += 1

        return self._with_qos(
            partial(self.create_subscription, callback=take), kind, topic, copy.copy(qos)
        )

    def _with_qos(self, create: Callable[..., Any], kind: Any, topic: str, qos: QoSProfile) -> Any:
        try:
            return create(
                kind,
                topic,
                qos_profile=qos,
                qos_overriding_options=QoSOverridingOptions(OVERRIDABLE),
            )
        except (RuntimeError, ValueError, ParameterException) as error:
            raise InputError(f'qos_overrides of {topic}: {error}') from None

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

    def serve(
        self,
        kind: Any,
        name: str,
        handler: Callable[[Any, Any], Any],
        *,
        when: When = 'active',
    ) -> None:
        """Offer a service; an error becomes `success = False` and the message.

        Parameters
        ----------
        handler : function or coroutine function of (request, response)
            Fills in the response; `success`, if there is one, is True already.
        """

        async def call(request: Any, response: Any) -> Any:
            if hasattr(response, 'success'):
                response.success = True
            try:
                if not self.works(when):
                    raise InputError(self.closed(name, when))
                waited = handler(request, response)
                if inspect.isawaitable(waited):
                    await waited
            except FlightdynError as error:
                self._refuse(name, response, str(error))
            except Exception as error:
                self.get_logger().error(f'{name}: {type(error).__name__}: {error}')
                self._refuse(name, response, f'internal error: {error}')
            return response

        self.create_service(kind, f'~/{name}', call)

    def serve_trigger(
        self, name: str, action: Callable[[], str], *, when: When = 'active'
    ) -> None:
        """Offer a std_srvs/Trigger service; the action returns what to say."""

        def handler(_request: Any, response: Any) -> None:
            response.message = action()

        self.serve(Trigger, name, handler, when=when)

    def _refuse(self, name: str, response: Any, message: str) -> None:
        """Say no in the response, or in the log where it has no room for that."""
        if hasattr(response, 'success'):
            response.success = False
        if hasattr(response, 'message'):
            response.message = message
        else:
            self.get_logger().warning(f'{name}: {message}')

    def every(self, seconds: float, callback: Callable[[], None], *, when: When = 'active') -> Any:
        """Call back in wall time, whatever /clock says: some nodes make /clock themselves."""
        clock = Clock(clock_type=ClockType.STEADY_TIME)
        timer = self.create_timer(seconds, self.guarded(callback), clock=clock)
        self._timers_when.append((timer, when))
        self._switch_timers()
        return timer

    def _switch_timers(self) -> None:
        for timer, when in self._timers_when:
            if not self.works(when):
                timer.cancel()
            elif timer.is_canceled():
                timer.reset()

    # Diagnostics. --------------------------------------------------------------------------------
    def _diagnose(self) -> None:
        state = Status(
            'lifecycle', self.state_label, values={'messages ignored while off': self._ignored}
        )
        try:
            statuses = [state, *self.diagnose()]
        except Exception as error:
            said = f'{type(error).__name__}: {error}'
            statuses = [state, Status('diagnostics', said, Level.ERROR)]
        stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(
            diagnostics_msg(self.get_fully_qualified_name(), stamp, statuses)
        )
