# SPDX-License-Identifier: Apache-2.0
"""Scenarios whose robots are described on topics, for who runs no program."""

from collections.abc import Mapping
from typing import Any

import rclpy
from rclpy.node import Node

from noninteract_ros.nodes.common.descriptions import RobotDescriptions
from noninteract_ros.nodes.common.node import NAMESPACE


def described(values: Mapping[str, Any], timeout: float) -> dict[str, Any]:
    """Nested values of a scenario with all descriptions in place.

    Args:
        values: Nested values.
        timeout: How long descriptions are waited for [s].

    Raises:
        ScenarioError: One does not come, or does not fit the scenario.
    """
    rclpy.init(signal_handler_options=rclpy.SignalHandlerOptions.ALL)
    try:
        node = Node("describe", namespace=NAMESPACE)
        descriptions = RobotDescriptions(node, values, lambda: None)
        return descriptions.wait(lambda text, refused: None, timeout)
    finally:
        rclpy.try_shutdown()
