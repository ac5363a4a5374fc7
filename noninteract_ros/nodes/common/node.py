# SPDX-License-Identifier: Apache-2.0
"""Base class of the nodes: scenario parameters, diagnostics, input rejection and threads."""

import threading
import time
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_policy_name_from_kind
from rclpy.task import Future
from sensor_msgs.msg import Joy

from noninteract_ros.errors import InputError, NoninteractError
from noninteract_ros.nodes.common.descriptions import RobotDescriptions
from noninteract_ros.nodes.common.loop_timing import LoopTiming
from noninteract_ros.nodes.common.message_time import ROUNDING, ClockMonitor, StampChecker
from noninteract_ros.nodes.common.parameter_files import EMPTY_LIST
from noninteract_ros.nodes.common.program import until_shutdown
from noninteract_ros.nodes.common.publisher_binding import PublisherWatch
from noninteract_ros.nodes.messages.cdr import deserialize
from noninteract_ros.nodes.messages.messages import Level, to_diagnostics, to_status
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import nest

NAMESPACE = "team"
# Reliable, and deep enough that a subscriber that is blocked for a while misses no tick.
LOOP_QOS = QoSProfile(depth=1000)
# Connects to publishers of either reliability; a lost set-point is replaced by the next one.
SENSOR_QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
SENSOR_TYPES = (PoseStamped, TwistStamped, WrenchStamped, Joy)
MAX_REASON = 200  # Characters of an unexpected error.
# Wall time: after a pause only the newest message counts.
NEWEST_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
DIAGNOSTICS_PERIOD = 0.5
STEADY_CLOCK = Clock(clock_type=ClockType.STEADY_TIME)
LOG_PERIOD = 2.0
JOIN_TIMEOUT = 1.0  # [s] to wait on shutdown for a callback that is still running
EMPTY_TYPES = {
    tuple[float, ...]: Parameter.Type.DOUBLE_ARRAY,
    tuple[str, ...]: Parameter.Type.STRING_ARRAY,
}


class ScenarioNode(Node):
    """Node whose parameters are the keys of a scenario.

    Parameters are read-only, except for the live ones of a node that sets `LIVE`.

    Args:
        name: Name of the node.
        kwargs: Arguments of `rclpy.node.Node`.

    Raises:
        ScenarioError: The parameters are not a valid scenario.

    Attributes:
        values: Nested values of the scenario.
        scenario: Checked scenario.
        lockstep: True where each tick waits for the command that answers its state.
        descriptions: Robot descriptions received on topics.
        loop_inputs: Inputs that the loop polls itself.
        publisher_watch: Lockstep: report of a second publisher, where the node has one.
        timing: Wall time: answers to states, recorded by controller and team.
        shutdown_requested: Return True after SIGINT or SIGTERM; for loops of nodes that handle
            their own shutdown.
    """

    LIVE = False

    def __init__(self, name: str, **kwargs: Any) -> None:
        kwargs.setdefault("namespace", NAMESPACE)
        # Before the parameter services, which `create_service` guards.
        self._rejected: Counter[str] = Counter()
        self._last_rejection = "none"
        self._mismatches: dict[str, str] = {}
        super().__init__(name, automatically_declare_parameters_from_overrides=True, **kwargs)
        given = {
            key: [] if item.value == EMPTY_LIST else item.value
            for key, item in self.get_parameters_by_prefix("").items()
        }
        self._diagnostics_publisher = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.descriptions = RobotDescriptions(self, nest(given), self.on_description_changed)
        self.shutdown_requested: Callable[[], bool] = lambda: False
        self.loop_inputs: list[Any] = []
        self.publisher_watch: PublisherWatch | None = None
        self._destroyed = False
        # Nothing of a node can be built before its robots are known.
        self.values = self.descriptions.wait(self._report_waiting)
        self.scenario = Scenario.from_dict(self.values)
        self._declare_parameters()
        self.lockstep = self.scenario.general.lockstep
        self._clock_monitor = ClockMonitor(self.now_ns)
        general = self.scenario.general
        self.timing = LoopTiming(general.rate, general.state_timeout)
        self.add_on_set_parameters_callback(self._refuse_clock)
        self.create_wall_timer(DIAGNOSTICS_PERIOD, self.publish_diagnostics)

    def _declare_parameters(self) -> None:
        """Declare every key of the scenario with type, description and read-only flag."""
        for name, hint, rule, value in self.scenario.parameters():
            if self.has_parameter(name):
                self.undeclare_parameter(name)
            descriptor = ParameterDescriptor(
                description=rule.doc,
                additional_constraints=" | ".join(rule.choices) or rule.numbers_allowed(),
                read_only=not (rule.live and self.LIVE),
                # The rule checks live changes with a better error text than ROS.
                dynamic_typing=rule.live and self.LIVE,
            )
            if value == ():
                self._declare_empty(name, EMPTY_TYPES[hint], descriptor)
            else:
                self.declare_parameter(name, _plain(value), descriptor, ignore_override=True)

    def _declare_empty(
        self, name: str, type_: Parameter.Type, descriptor: ParameterDescriptor
    ) -> None:
        """Declare an empty list, whose type rclpy cannot infer from its value.

        A parameter that is left unset would empty every answer of the parameter services.
        """
        self.declare_parameter(name, type_, ignore_override=True)
        self.set_parameters([Parameter(name, type_, [])])
        descriptor.type = type_.value
        self.set_descriptor(name, descriptor)

    def now_ns(self) -> int:
        """Return the time of the clock of the node [ns]."""
        now: int = self.get_clock().now().nanoseconds
        return now

    def stamp_checker(self, team_time: Callable[[], int | None]) -> StampChecker:
        """Return a checker of stamps with the bounds of the scenario.

        Args:
            team_time: Return the stamp of the newest state [ns], or None before the first one; the
                time of the robots in lockstep.
        """
        general = self.scenario.general
        period = 1.0 / general.rate
        if self.lockstep:
            return StampChecker(team_time, period + ROUNDING)
        return StampChecker(self.now_ns, period + general.clock_tolerance, general.max_age)

    def status(self) -> tuple[Level, str, dict[str, object]]:
        """Return level, message and values for `/diagnostics`."""
        raise NotImplementedError

    def publish_diagnostics(self) -> None:
        """Publish the status of the node."""
        for item in self.loop_inputs:
            item.refresh()
        level, text, values = self.status()
        if self.publisher_watch is not None:
            self.publisher_watch.refresh()
            if second := self.publisher_watch.problem():
                level, text = Level.ERROR, f"{text}; {second}"
        if not self.lockstep:
            self._clock_monitor.update()
            values |= self.timing.values()
            late_level, late = self.timing.problem()
            if late:
                level, text = max(level, late_level), f"{text}; {late}"
            if jump := self._clock_monitor.problem():
                level, text = max(level, Level.WARN), f"{text}; {jump}"
        if problem := self.descriptions.problem:
            level, text = Level.ERROR, text if problem in text else f"{problem}; {text}"
        if mismatches := list(self._mismatches.values()):
            level, text = max(level, Level.WARN), f"{text}; {'; '.join(mismatches)}"
        self._publish_status(level, text, values)

    def on_description_changed(self) -> None:
        """React to a robot description that differs from the one the node was built from."""

    def _report_waiting(self, text: str, rejected: bool) -> None:
        self._publish_status(Level.ERROR if rejected else Level.WARN, text, {})

    def _publish_status(self, level: Level, text: str, values: dict[str, object]) -> None:
        matched = [(item.topic_name, item.get_subscription_count()) for item in self.publishers]
        values["subscribers"] = ", ".join(f"{topic} {count}" for topic, count in matched)
        if rejected := dict(self._rejected):  # A copy, since the loop may reject inputs meanwhile.
            values["rejected inputs"] = sum(rejected.values())
            values["last rejection"] = self._last_rejection
            values |= {f"rejected on {topic}": count for topic, count in rejected.items()}
        status = to_status(self.get_fully_qualified_name(), level, text, values)
        now = self.get_clock().now().nanoseconds
        self._diagnostics_publisher.publish(to_diagnostics(now, [status]))

    def subscribe(
        self,
        message_type: type,
        topic: str,
        callback: Callable[[Any], None],
        *,
        raw: bool = False,
        qos: QoSProfile | None = None,
    ) -> None:
        """Subscribe to a topic; reject messages for which the callback raises an InputError.

        Args:
            message_type: Message type.
            topic: Topic name.
            callback: Called with each message; with serialized bytes if `raw`.
            raw: True to skip deserialization.
            qos: Quality of service; by default reliable, but best effort in wall time for the
                types of sensors and devices, whose drivers publish so.
        """
        if qos is None:
            sensor = message_type in SENSOR_TYPES and not self.lockstep
            qos = SENSOR_QOS if sensor else LOOP_QOS

        def received(data: bytes) -> None:
            def handle() -> None:
                callback(data if raw else deserialize(data, message_type))

            self._guard(topic, handle)

        events = SubscriptionEventCallbacks(incompatible_qos=partial(self._on_mismatch, topic))
        # Deserialization is behind the guard too.
        self.create_subscription(
            message_type, topic, received, qos, raw=True, event_callbacks=events
        )

    def _on_mismatch(self, topic: str, event: Any) -> None:
        """Report a publisher that DDS does not connect."""
        policy = _policy_name(event.last_policy_kind)
        self._mismatches[topic] = f"a publisher of {topic} is not received: its {policy} differs"
        self.get_logger().warning(self._mismatches[topic], once=True)

    def create_service(self, srv_type: Any, srv_name: str, callback: Any, **kwargs: Any) -> Any:
        """Create a service that answers each request, whatever the callback raises.

        It also guards the parameter services, which `rclpy.node.Node` creates by this method.
        """

        def answer(request: Any, response: Any) -> Any:
            answered = [_refusal(srv_type, request)]

            def handle() -> None:
                if srv_type is SetParameters:
                    answered[0].results = [
                        self._set_one(callback, item) for item in request.parameters
                    ]
                else:
                    answered[0] = callback(request, response)

            self._guard(srv_name, handle)
            return answered[0]

        return super().create_service(srv_type, srv_name, answer, **kwargs)

    def _set_one(self, callback: Any, item: Any) -> SetParametersResult:
        """Set one parameter of a request; a malformed one is refused by itself."""
        results = [SetParametersResult(successful=False, reason="not a parameter")]

        def handle() -> None:
            request = SetParameters.Request(parameters=[item])
            results[0] = callback(request, SetParameters.Response()).results[0]

        self._guard("set_parameters", handle)
        return results[0]

    def _refuse_clock(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse another clock: times of the old one would be compared with those of the new."""
        if any(item.name == "use_sim_time" for item in parameters):
            reason = "use_sim_time: found a change, allowed: a value at the start of the program"
            return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

    def create_wall_timer(self, period: float, callback: Callable[[], None]) -> None:
        """Create a timer with a period [s] of wall time, whatever clock the node uses."""
        self.create_timer(period, partial(self._guard, "a timer", callback), clock=STEADY_CLOCK)

    def _guard(self, source: str, work: Callable[[], None]) -> None:
        """Do work for a message, a request or a timer; nothing that is received ends a program.

        Args:
            source: Topic or service, for diagnostics.
            work: Called once. What it raises is counted and reported as a rejection.
        """
        with until_shutdown(self.context):
            try:
                work()
            except InputError as error:
                self.reject_input(source, str(error))
            except (NoninteractError, ExternalShutdownException):
                raise
            except Exception as error:
                if not self.context.ok():
                    raise
                self.reject_input(source, f"{type(error).__name__}: {error}"[:MAX_REASON])

    def reject_input(self, topic: str, reason: str) -> None:
        """Count and log a rejected input."""
        self._rejected[topic] += 1
        self._last_rejection = f"{topic}: {reason}"
        text = f"rejected input on {topic}: {reason}"
        self.get_logger().warning(text, throttle_duration_sec=LOG_PERIOD)

    def destroy_node(self) -> None:
        """Destroy the node and its inputs, and end its loop."""
        self._destroyed = True
        for item in self.loop_inputs:
            item.destroy()
        self.loop_inputs.clear()
        super().destroy_node()

    @property
    def running(self) -> bool:
        """True until the context is shut down or the node is destroyed."""
        return self.context.ok() and not self._destroyed

    @property
    def has_loop(self) -> bool:
        """True where the main thread runs `loop`; in lockstep the callbacks do all work."""
        return not self.lockstep

    def loop(self) -> None:
        """Run the main thread of a node that has a loop."""

    @property
    def handles_shutdown(self) -> bool:
        """True where the loop still publishes after SIGINT or SIGTERM and then returns."""
        return False

    def run(self) -> None:
        """Run until the context is shut down, or until a loop that handles shutdown returns."""
        executor = EventsExecutor(context=self.context)
        executor.add_node(self)
        if self.has_loop:
            self._run_loop(executor)
        else:
            spin(executor, self.context)

    def _run_loop(self, executor: EventsExecutor) -> None:
        """Run the loop in this thread and the callbacks in another; a failure ends both."""
        failures: list[Exception] = []

        def serve() -> None:
            try:
                spin(executor, self.context)
            except Exception as error:
                failures.append(error)
                self.context.try_shutdown()

        thread = threading.Thread(target=serve, daemon=True)
        thread.start()
        try:
            with until_shutdown(self.context):
                self.loop()
        finally:
            self.context.try_shutdown()
            thread.join(JOIN_TIMEOUT)
        if failures:
            raise failures[0]


def _refusal(srv_type: Any, request: Any) -> Any:
    """Return the response that refuses a request."""
    response = srv_type.Response()
    if srv_type is SetParametersAtomically:
        response.result = SetParametersResult(successful=False, reason="not parameters")
    elif hasattr(response, "message"):
        response.message = "the request failed"
    return response


def _policy_name(kind: Any) -> str:
    """Return the name of a QoS policy, as in `reliability`."""
    return qos_policy_name_from_kind(int(kind)).lower()


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def spin(executor: EventsExecutor, context: rclpy.Context) -> None:
    """Spin until the context is shut down.

    `EventsExecutor.spin` without a time-out busy-loops in the PyPI wheels; this form does not.
    """
    with until_shutdown(context):
        while context.ok():
            executor.spin_until_future_complete(Future(), 3600.0)


class WallRate:
    """Rate in wall time [Hz]. Missed periods are skipped.

    Attributes:
        missed: Number of missed periods.
    """

    def __init__(self, rate: float) -> None:
        self._period = 1.0 / rate
        self._next = time.monotonic()
        self.missed = 0

    def sleep(self) -> None:
        """Sleep until the next period begins."""
        self._next += self._period
        now = time.monotonic()
        if self._next > now:
            time.sleep(self._next - now)
        elif now - self._next > self._period:
            skipped = int((now - self._next) / self._period)
            self.missed += skipped
            self._next += skipped * self._period
