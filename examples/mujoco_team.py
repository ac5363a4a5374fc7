# SPDX-License-Identifier: Apache-2.0
"""A plant of one's own in the place of robot_team: MuJoCo's dynamics of a scenario's URDF robots.

MuJoCo reads the URDF by itself; nothing touches anything. `_on_command` is all of lockstep.
With the extra `peer`: python examples/mujoco_team.py config/dual_panda_free.yaml
"""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import rclpy
from geometry_msgs.msg import WrenchStamped
from rclpy.node import Node
from rclpy.time import Time
from sensor_msgs.msg import JointState

from noninteract_ros.scenario.files import find_scenario, read_parameters
from noninteract_ros.team.models.urdf_files import read_urdf

SUBSTEPS = 2  # of MuJoCo in a tick
RESEND = 0.2  # [s] after which a state that nobody has answered is sent again
DEPTH = 1000  # of the queues


def team_model(values: Mapping[str, Any]) -> mujoco.MjModel:
    """All robots of a scenario on their bases; joints are named `<robot>/<joint>`."""
    team = mujoco.MjSpec()
    team.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    team.option.timestep = 1.0 / values["rate"] / SUBSTEPS
    for name in values["robots"]:
        x, y, z, *imaginary, real = values[name]["base_pose"]
        base = team.worldbody.add_frame(pos=[x, y, z], quat=[real, *imaginary])
        team.attach(robot_spec(values[name]), prefix=f"{name}/", frame=base)
    return team.compile()


def robot_spec(block: Mapping[str, Any]) -> mujoco.MjSpec:
    """One robot from its block in the scenario, whose friction and armature are one number."""
    spec = mujoco.MjSpec.from_string(read_urdf("urdf", block["urdf"]))
    for item in (*spec.geoms, *spec.meshes):
        spec.delete(item)
    locked = dict(zip(block["locked_joints"], block["locked_positions"], strict=True))
    for joint in spec.joints:
        if joint.name in locked:  # A body without its joint would stay at zero.
            body, axis = joint.parent, np.zeros(3)
            mujoco.mju_rotVecQuat(axis, joint.axis, body.quat)
            body.pos = body.pos + locked[joint.name] * axis
            spec.delete(joint)
            continue
        joint.limited = joint.actfrclimited = False
        joint.damping = [*block.get("friction", [0.0]), 0.0, 0.0]
        joint.armature = block.get("armature", [0.0])[0]
    return spec


class MujocoTeam(Node):
    """Steps when the command that answers its state has come, until `end_time`."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        super().__init__("robot_team", namespace="team")
        self.model = team_model(values)
        self.data = mujoco.MjData(self.model)
        self.data.qpos = np.concatenate([values[r]["initial_position"] for r in values["robots"]])
        self.names = [self.model.joint(number).name for number in range(self.model.njnt)]
        self.rate, self.end_time = values["rate"], values.get("end_time", np.inf)
        self.tick = 0
        self.finished = rclpy.task.Future()
        self.publisher = self.create_publisher(JointState, "joint_states", DEPTH)
        self.wrenches = [  # Whoever waits for force sensors hears that nothing touches them.
            self.create_publisher(WrenchStamped, f"{robot}/external_wrench", DEPTH)
            for robot in values.get("force_sensors", [])
        ]
        self.create_subscription(JointState, "joint_commands", self._on_command, DEPTH)
        self.resend = self.create_timer(RESEND, self._publish)

        self._publish()

    def _publish(self) -> None:
        state = JointState(name=self.names)
        self.stamp = Time(nanoseconds=round(self.tick * 1e9 / self.rate)).to_msg()
        state.header.stamp = self.stamp
        state.position, state.velocity = self.data.qpos.tolist(), self.data.qvel.tolist()
        state.effort = self.data.qfrc_applied.tolist()
        wrench = WrenchStamped(header=state.header)
        wrench.header.frame_id = "world"
        for publisher in self.wrenches:
            publisher.publish(wrench)
        self.publisher.publish(state)
        self.resend.reset()

    def _on_command(self, command: JointState) -> None:
        if command.header.stamp != self.stamp:
            return  # A second answer to a state that was sent twice.
        if self.tick >= self.end_time * self.rate:
            self.finished.set_result(None)
            return
        torque = dict(zip(command.name, command.effort, strict=True))
        self.data.qfrc_applied = [torque[name] for name in self.names]
        mujoco.mj_step(self.model, self.data, SUBSTEPS)
        self.tick += 1
        self._publish()


def main() -> None:
    path = find_scenario(Path(sys.argv[1]).as_posix() if len(sys.argv) > 1 else "dual_panda_free")
    rclpy.init()
    node = MujocoTeam(read_parameters(path))
    rclpy.spin_until_future_complete(node, node.finished)
    print(f"MuJoCo moved {node.model.nv} joints for {node.tick / node.rate:g} s.")


if __name__ == "__main__":
    main()
