# SPDX-License-Identifier: Apache-2.0
"""Base class of the nodes: scenario parameters, diagnostics, input rejection and threads."""

import threading
from collections.abc import Callable
from typing import Any

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.experimental import EventsExecutor
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.task import Future

from noninteract_ros.nodes.common.descriptions import RobotDescriptions
from noninteract_ros.nodes.common.guarded_node import GuardedNode
from noninteract_ros.nodes.common.loop_timing import LoopTiming
from noninteract_ros.nodes.common.message_time import ROUNDING, ClockMonitor, StampChecker
from noninteract_ros.nodes.common.parameter_files import EMPTY_LIST
from noninteract_ros.nodes.common.program import until_shutdown
from noninteract_ros.nodes.common.publisher_binding import PublisherWatch
from noninteract_ros.nodes.messages.messages import Level, to_diagnostics, to_status
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import nest

NAMESPACE = "team"
# Wall time: after a pause only the newest message counts.
NEWEST_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
DIAGNOSTICS_PERIOD = 0.5
JOIN_TIMEOUT = 1.0  # [s] to wait on shutdown for a callback that is still running
EMPTY_TYPES = {
    tuple[float, ...]: Parameter.Type.DOUBLE_ARRAY,
    tuple[str, ...]: Parameter.Type.STRING_ARRAY,
}


class ScenarioNode(GuardedNode):
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
        if self.mismatches:
            level, text = max(level, Level.WARN), f"{text}; {'; '.join(self.mismatches.values())}"
        self._publish_status(level, text, values)

    def on_description_changed(self) -> None:
        """React to a robot description that differs from the one the node was built from."""

    def _report_waiting(self, text: str, rejected: bool) -> None:
        self._publish_status(Level.ERROR if rejected else Level.WARN, text, {})

    def _publish_status(self, level: Level, text: str, values: dict[str, object]) -> None:
        matched = [(item.topic_name, item.get_subscription_count()) for item in self.publishers]
        values["subscribers"] = ", ".join(f"{topic} {count}" for topic, count in matched)
        values |= self.rejections()
        status = to_status(self.get_fully_qualified_name(), level, text, values)
        now = self.get_clock().now().nanoseconds
        self._diagnostics_publisher.publish(to_diagnostics(now, [status]))

    def _refuse_clock(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse another clock: times of the old one would be compared with those of the new."""
        if any(item.name == "use_sim_time" for item in parameters):
            reason = "use_sim_time: found a change, allowed: a value at the start of the program"
            return SetParametersResult(successful=False, reason=reason)
        return SetParametersResult(successful=True)

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


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def spin(executor: EventsExecutor, context: rclpy.Context) -> None:
    """Spin until the context is shut down.

    `EventsExecutor.spin` without a time-out busy-loops in the PyPI wheels; this form does not.
    """
    with until_shutdown(context):
        while context.ok():
            executor.spin_until_future_complete(Future(), 3600.0)
