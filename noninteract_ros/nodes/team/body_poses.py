# SPDX-License-Identifier: Apache-2.0
"""Where the simulated objects and doors are, for people who look on."""

from geometry_msgs.msg import PoseStamped

from noninteract_ros.nodes.common.node import LOOP_QOS, ScenarioNode
from noninteract_ros.nodes.messages.messages import WORLD, to_stamp
from noninteract_ros.simulation.team_simulation import TeamSimulation


class BodyPoses:
    """Publishes `<body>/pose` of each passive body.

    Args:
        node: The simulated team's node.
        simulation: What it simulates.
    """

    def __init__(self, node: ScenarioNode, simulation: TeamSimulation) -> None:
        self._simulation = simulation
        self._publishers = {
            name: node.create_publisher(PoseStamped, f"{name}/pose", LOOP_QOS)
            for name in simulation.plant.body_names
        }

    def publish(self, stamp: int) -> None:
        """Tells the poses, stamped as the state that they belong to [ns]."""
        if not self._publishers:
            return
        poses = self._simulation.plant.body_poses(self._simulation.plant_q)
        for name, publisher in self._publishers.items():
            message = PoseStamped()
            message.header.stamp, message.header.frame_id = to_stamp(stamp), WORLD
            position, orientation = message.pose.position, message.pose.orientation
            position.x, position.y, position.z = poses[name][:3].tolist()
            orientation.x, orientation.y, orientation.z, orientation.w = poses[name][3:].tolist()
            publisher.publish(message)
