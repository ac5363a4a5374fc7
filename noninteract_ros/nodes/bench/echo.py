# SPDX-License-Identifier: Apache-2.0
"""Baseline of lockstep: a node that publishes every received JointState unchanged."""

import sys
from collections.abc import Sequence

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.node import Node
from sensor_msgs.msg import JointState

from noninteract_ros.nodes.common.guarded_node import LOOP_QOS
from noninteract_ros.nodes.common.node import spin


def main(arguments: Sequence[str] | None = None) -> int:
    """Echo `ping` on `pong` until the context is shut down."""
    rclpy.init(args=list(sys.argv if arguments is None else arguments))
    node = Node("echo", start_parameter_services=False, enable_rosout=False)
    publisher = node.create_publisher(JointState, "pong", LOOP_QOS)
    node.create_subscription(JointState, "ping", publisher.publish, LOOP_QOS, raw=True)
    executor = EventsExecutor()
    executor.add_node(node)
    try:
        spin(executor, node.context)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main())
