# SPDX-License-Identifier: Apache-2.0
"""Robot descriptions from topics for commands that run no node."""

from collections.abc import Mapping
from typing import Any

import rclpy
from rclpy.node import Node

from noninteract_ros.nodes.common.descriptions import RobotDescriptions
from noninteract_ros.nodes.common.node import NAMESPACE


def with_descriptions(values: Mapping[str, Any], timeout: float) -> dict[str, Any]:
    """Return the nested values of a scenario with all robot descriptions filled in.

    Args:
        values: Nested values.
        timeout: Time to wait for the descriptions [s].

    Raises:
        ScenarioError: A description is not received or does not fit the scenario.
    """
    rclpy.init(signal_handler_options=rclpy.SignalHandlerOptions.ALL)
    try:
        node = Node("describe", namespace=NAMESPACE)
        descriptions = RobotDescriptions(node, values, lambda: None)
        return descriptions.wait(lambda text, refused: None, timeout)
    finally:
        rclpy.try_shutdown()
