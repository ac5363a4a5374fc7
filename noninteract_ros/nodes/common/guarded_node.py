# SPDX-License-Identifier: Apache-2.0
"""Node that rejects unusable messages and requests, so that none of them ends a program."""

from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import Any

from geometry_msgs.msg import PoseStamped, TwistStamped, WrenchStamped
from rcl_interfaces.msg import SetParametersResult
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_policy_name_from_kind
from sensor_msgs.msg import Joy

from noninteract_ros.errors import InputError, NoninteractError
from noninteract_ros.nodes.common.program import until_shutdown
from noninteract_ros.nodes.messages.cdr import deserialize

# Reliable, and deep enough that a subscriber that is blocked for a while misses no tick.
LOOP_QOS = QoSProfile(depth=1000)
# Connects to publishers of either reliability; a lost set-point is replaced by the next one.
SENSOR_QOS = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
SENSOR_TYPES = (PoseStamped, TwistStamped, WrenchStamped, Joy)
MAX_REASON = 200  # Characters of an unexpected error.
STEADY_CLOCK = Clock(clock_type=ClockType.STEADY_TIME)
LOG_PERIOD = 2.0


class GuardedNode(Node):
    """Node that counts, logs and reports rejected inputs.

    Args:
        name: Name of the node.
        kwargs: Arguments of `rclpy.node.Node`.

    Attributes:
        lockstep: True where each tick waits for the command that answers its state.
        mismatches: Publishers that DDS does not connect, in words, by topic.
    """

    lockstep: bool

    def __init__(self, name: str, **kwargs: Any) -> None:
        # Before the parameter services, which `create_service` guards.
        self._rejected: Counter[str] = Counter()
        self._last_rejection = "none"
        self.mismatches: dict[str, str] = {}
        super().__init__(name, **kwargs)

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
        self.mismatches[topic] = f"a publisher of {topic} is not received: its {policy} differs"
        self.get_logger().warning(self.mismatches[topic], once=True)

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

    def rejections(self) -> dict[str, object]:
        """Return the numbers of rejected inputs and the last reason, for `/diagnostics`."""
        rejected = dict(self._rejected)  # A copy, since the loop may reject inputs meanwhile.
        if not rejected:
            return {}
        counts = {f"rejected on {topic}": count for topic, count in rejected.items()}
        total = sum(rejected.values())
        return {"rejected inputs": total, "last rejection": self._last_rejection, **counts}


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
