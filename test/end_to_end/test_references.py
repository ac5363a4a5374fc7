# SPDX-License-Identifier: Apache-2.0
"""References and set-points from another process."""

import numpy as np
import pytest
from harness import Ros, paper
from programs import Programs
from waiting import until

PLACE = (0.25, -0.15)
# As from a terminal: no stamp, no clock of the team, 10 Hz.
TARGET = f"""
import time, rclpy
from geometry_msgs.msg import PoseStamped

rclpy.init()
node = rclpy.create_node("person", namespace="team")
publisher = node.create_publisher(PoseStamped, "cooperative/human/target_pose", 10)
message = PoseStamped()
message.pose.position.x, message.pose.position.y = {PLACE}
while True:
    publisher.publish(message)
    time.sleep(0.1)
"""
REFERENCE = f"""
import time, rclpy
from geometry_msgs.msg import Transform, Twist
from trajectory_msgs.msg import MultiDOFJointTrajectory, MultiDOFJointTrajectoryPoint

rclpy.init()
node = rclpy.create_node("person", namespace="team")
publisher = node.create_publisher(MultiDOFJointTrajectory, "cooperative/human/reference", 10)
place = Transform()
place.translation.x, place.translation.y = {PLACE}
point = MultiDOFJointTrajectoryPoint(transforms=[place])
point.velocities, point.accelerations = [Twist()], [Twist()]
message = MultiDOFJointTrajectory(joint_names=["cooperative"], points=[point])
while True:
    publisher.publish(message)
    time.sleep(0.1)
"""


@pytest.mark.parametrize("lockstep", [True, False], ids=["lockstep", "wall"])
@pytest.mark.parametrize("program", [TARGET, REFERENCE], ids=["target_pose", "reference"])
def test_the_team_follows_another_process(
    ros: Ros, programs: Programs, program: str, lockstep: bool
) -> None:
    """The cooperative value reaches the reference without a jump; the relative one stays."""
    stiff = {"stiffness": [400.0, 400.0], "takeover": "shaped", "timeout": 3.0}
    values = paper(
        rate=200.0,
        lockstep=lockstep,
        lockstep_sources=["relative/autonomy"],
        haptic=None,
        object=None,
        force_sensors=None,
        cooperative=stiff,
        relative={"takeover": "shaped"},
        robot_1={"initial_position": [0.5, 0.5]},
        robot_2={"initial_position": [-0.5, -0.5]},
    )
    stack = ros.stack(values).start()
    stack.monitor.wait_for_status("controller", "holding cooperative: source silent")
    programs.python("person", "-c", program)

    def reached() -> bool:
        positions = np.reshape(stack.monitor.newest().position, (2, 2))
        return bool(np.abs(positions.mean(axis=0) - PLACE).max() < 2e-3)

    until(reached, "the reference reached")
    positions = np.reshape(stack.monitor.history(dict(stack.monitor.states))[1], (-1, 2, 2))
    apart = positions[:, 0] - positions[:, 1]
    np.testing.assert_allclose(apart, np.ones_like(apart), atol=1e-3 if not lockstep else 1e-9)
    # A jump of the reference would move the team by at least half of it at once.
    assert np.abs(np.diff(positions.mean(axis=1), axis=0)).max() < 0.02
