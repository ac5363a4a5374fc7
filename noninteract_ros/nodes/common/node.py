# SPDX-License-Identifier: Apache-2.0
"""What every program shares: the scenario as parameters, diagnostics, refusals, its threads."""

import threading
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.clock import Clock, ClockType
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.task import Future

from noninteract_ros.errors import InputError
from noninteract_ros.nodes.common.descriptions import Descriptions
from noninteract_ros.nodes.common.program import until_shutdown
from noninteract_ros.nodes.messages.messages import Level, to_diagnostics, to_status
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import nest

NAMESPACE = "team"
# Reliable, and so deep that a reader who is kept waiting, as a recorder may be, misses no tick.
LOOP_QOS = QoSProfile(depth=1000)
DIAGNOSTICS_PERIOD = 0.5
STEADY = Clock(clock_type=ClockType.STEADY_TIME)
LOG_PERIOD = 2.0
JOIN_TIMEOUT = 1.0  # [s] given to a callback that runs when the program ends
EMPTY_TYPES = {
    tuple[float, ...]: Parameter.Type.DOUBLE_ARRAY,
    tuple[str, ...]: Parameter.Type.STRING_ARRAY,
}


class ScenarioNode(Node):
    """A node that is started with a scenario.

    All keys of the scenario become its parameters; they are read-only but for the live ones of a
    node that sets `LIVE`.

    Args:
        name: Name of the node.
        kwargs: Passed on to `rclpy.node.Node`.

    Raises:
        ScenarioError: The parameters are no valid scenario.

    Attributes:
        values: The scenario, nested.
        scenario: The scenario, checked.
        lockstep: Whether the team waits for its commands.
        descriptions: URDFs that came on topics.
        told_to_stop: Whether the program was, asked by a loop with last words.
    """

    LIVE = False

    def __init__(self, name: str, **kwargs: Any) -> None:
        kwargs.setdefault("namespace", NAMESPACE)
        super().__init__(name, automatically_declare_parameters_from_overrides=True, **kwargs)
        given = {key: item.value for key, item in self.get_parameters_by_prefix("").items()}
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.descriptions = Descriptions(self, nest(given), self.on_description_changed)
        # Nothing of a node can be built before the robots are known, so it is waited here.
        self.told_to_stop: Callable[[], bool] = lambda: False
        self._refused: Counter[str] = Counter()
        self._last_refusal = "none"
        self.values = self.descriptions.wait(self._tell_of_waiting)
        self.scenario = Scenario.from_dict(self.values)
        self._declare()
        self.lockstep = self.scenario.general.lockstep
        self.every(DIAGNOSTICS_PERIOD, self.publish_diagnostics)

    def _declare(self) -> None:
        """Declares every key of the scenario: typed, described, read-only unless live here."""
        for name, hint, rule, value in self.scenario.parameters():
            if self.has_parameter(name):
                self.undeclare_parameter(name)
            descriptor = ParameterDescriptor(
                description=rule.doc,
                additional_constraints=" | ".join(rule.choices) or rule.numbers_allowed(),
                read_only=not (rule.live and self.LIVE),
                # What changes live is checked by the rule, which says more than ROS does.
                dynamic_typing=rule.live and self.LIVE,
            )
            # An empty list has no type of its own: it is declared, but left unset.
            empty = None if descriptor.dynamic_typing else EMPTY_TYPES.get(hint)
            typed = empty if value == () else _plain(value)
            self.declare_parameter(name, typed, descriptor, ignore_override=True)

    def status(self) -> tuple[Level, str, dict[str, object]]:
        """Level, one line and values for `/diagnostics`."""
        raise NotImplementedError

    def publish_diagnostics(self) -> None:
        """Says how the node is."""
        level, text, values = self.status()
        if problem := self.descriptions.problem:
            level, text = Level.ERROR, text if problem in text else f"{problem}; {text}"
        self._tell(level, text, values)

    def on_description_changed(self) -> None:
        """A robot's description is another one than that which the node was built from."""

    def _tell_of_waiting(self, text: str, refused: bool) -> None:
        self._tell(Level.ERROR if refused else Level.WARN, text, {})

    def _tell(self, level: Level, text: str, values: dict[str, object]) -> None:
        matched = [(item.topic_name, item.get_subscription_count()) for item in self.publishers]
        values["subscribers"] = ", ".join(f"{topic} {count}" for topic, count in matched)
        if refused := dict(self._refused):  # The loop may refuse something meanwhile.
            values["refused inputs"] = sum(refused.values())
            values["last refusal"] = self._last_refusal
            values |= {f"refused on {topic}": count for topic, count in refused.items()}
        status = to_status(self.get_fully_qualified_name(), level, text, values)
        now = self.get_clock().now().nanoseconds
        self._diagnostics.publish(to_diagnostics(now, [status]))

    def subscribe(
        self,
        kind: type,
        topic: str,
        take: Callable[[Any], None],
        *,
        raw: bool = False,
        qos: QoSProfile = LOOP_QOS,
    ) -> None:
        """Subscribes; what `take` refuses with an InputError is counted, named and dropped."""

        def checked(message: Any) -> None:
            with until_shutdown(self.context):
                try:
                    take(message)
                except InputError as error:
                    self.refuse(topic, str(error))

        self.create_subscription(kind, topic, checked, qos, raw=raw)

    def every(self, period: float, work: Callable[[], None]) -> None:
        """Has something done again and again, each period [s] of wall time."""

        def guarded() -> None:
            with until_shutdown(self.context):
                work()

        self.create_timer(period, guarded, clock=STEADY)

    def refuse(self, topic: str, reason: str) -> None:
        """Counts and names an input that is refused whole."""
        self._refused[topic] += 1
        self._last_refusal = f"{topic}: {reason}"
        self.get_logger().warning(f"refused {topic}: {reason}", throttle_duration_sec=LOG_PERIOD)

    @property
    def has_loop(self) -> bool:
        """Whether the main thread has a loop of its own; in lockstep callbacks do everything."""
        return not self.lockstep

    def loop(self) -> None:
        """What the main thread does where it has a loop."""

    @property
    def has_last_words(self) -> bool:
        """Whether the loop has something to say after it was told to stop."""
        return False

    def run(self) -> None:
        """Runs until the context is shut down; with last words, until it is told to stop."""
        executor = EventsExecutor(context=self.context)
        executor.add_node(self)
        if self.has_loop:
            self._run_loop(executor)
        else:
            spin(executor, self.context)

    def _run_loop(self, executor: EventsExecutor) -> None:
        """The loop here and the callbacks beside it; where one of them fails, both end."""
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


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def spin(executor: EventsExecutor, context: rclpy.Context) -> None:
    """Spins until the context is shut down.

    `EventsExecutor.spin` without a time-out busy-loops in the PyPI wheels; this form does not.
    """
    with until_shutdown(context):
        while context.ok():
            executor.spin_until_future_complete(Future(), 3600.0)


class Ticker:
    """Absolute sleeping at a rate; periods that were missed are skipped, not made up for."""

    def __init__(self, rate: float) -> None:
        self._period = 1.0 / rate
        self._next = time.monotonic()
        self.missed = 0

    def wait(self) -> None:
        """Sleeps until the next period begins."""
        self._next += self._period
        now = time.monotonic()
        if self._next > now:
            time.sleep(self._next - now)
        elif now - self._next > self._period:
            skipped = int((now - self._next) / self._period)
            self.missed += skipped
            self._next += skipped * self._period
