# SPDX-License-Identifier: Apache-2.0
"""Hand-overs by topic: `<subtask>/authority` sets the parameter of that name."""

from collections.abc import Iterable
from functools import partial

from rclpy.parameter import Parameter
from std_msgs.msg import String

from noninteract_ros.errors import InputError
from noninteract_ros.nodes.common.node import ScenarioNode


class AuthorityTopics:
    """Lets programs hand subtasks over that cannot or will not call a service.

    The parameter `<subtask>.authority` stays the one place that tells who leads.

    Args:
        node: The controller's node, with its parameters declared.
        subtasks: Names of the subtasks.
    """

    def __init__(self, node: ScenarioNode, subtasks: Iterable[str]) -> None:
        self._node = node
        for name in subtasks:
            node.subscribe(String, f"{name}/authority", partial(self._take, name))

    def _take(self, subtask: str, message: String) -> None:
        wanted = Parameter(f"{subtask}.authority", value=message.data)
        (result,) = self._node.set_parameters([wanted])
        if not result.successful:
            raise InputError(result.reason)
