# SPDX-License-Identifier: Apache-2.0
"""Plant node that replaces robot_team: MuJoCo dynamics of a scenario's URDF robots.

MuJoCo loads the URDF itself; there are no contacts. `_on_command` implements lockstep.
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

SUBSTEPS = 2  # MuJoCo steps per tick
RESEND_PERIOD = 0.2  # [s] after which a state without a command is published again
QUEUE_DEPTH = 1000


def team_model(values: Mapping[str, Any]) -> mujoco.MjModel:
    """Return a model of all robots on their bases, with joints named `<robot>/<joint>`."""
    team = mujoco.MjSpec()
    team.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    team.option.timestep = 1.0 / values["rate"] / SUBSTEPS
    for name in values["robots"]:
        x, y, z, *imaginary, real = values[name]["base_pose"]
        base = team.worldbody.add_frame(pos=[x, y, z], quat=[real, *imaginary])
        team.attach(robot_spec(values[name]), prefix=f"{name}/", frame=base)
    return team.compile()


def robot_spec(block: Mapping[str, Any]) -> mujoco.MjSpec:
    """Return one robot from its block, whose friction and armature are the same for all joints."""
    spec = mujoco.MjSpec.from_string(read_urdf("urdf", block["urdf"]))
    for item in (*spec.geoms, *spec.meshes):
        spec.delete(item)
    locked = dict(zip(block["locked_joints"], block["locked_positions"], strict=True))
    for joint in spec.joints:
        if joint.name in locked:  # Without its joint, the body would stay at position zero.
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
    """Plant in lockstep: step on the command with the stamp of the state, until `end_time`."""

    def __init__(self, values: Mapping[str, Any]) -> None:
        super().__init__("robot_team", namespace="team")
        self.model = team_model(values)
        self.data = mujoco.MjData(self.model)
        self.data.qpos = np.concatenate([values[r]["initial_position"] for r in values["robots"]])
        self.names = [self.model.joint(number).name for number in range(self.model.njnt)]
        self.rate, self.end_time = values["rate"], values.get("end_time", np.inf)
        self.tick = 0
        self.finished = rclpy.task.Future()
        self.state_publisher = self.create_publisher(JointState, "joint_states", QUEUE_DEPTH)
        self.wrench_publishers = [  # Zero wrenches, which the controller waits for.
            self.create_publisher(WrenchStamped, f"{robot}/external_wrench", QUEUE_DEPTH)
            for robot in values.get("force_sensors", [])
        ]
        self.create_subscription(JointState, "joint_commands", self._on_command, QUEUE_DEPTH)
        self.resend_timer = self.create_timer(RESEND_PERIOD, self._publish)
        self._publish()

    def _publish(self) -> None:
        state = JointState(name=self.names)
        self.stamp = Time(nanoseconds=round(self.tick * 1e9 / self.rate)).to_msg()
        state.header.stamp = self.stamp
        state.position, state.velocity = self.data.qpos.tolist(), self.data.qvel.tolist()
        state.effort = self.data.qfrc_applied.tolist()
        wrench = WrenchStamped(header=state.header)
        wrench.header.frame_id = "world"
        for publisher in self.wrench_publishers:
            publisher.publish(wrench)
        self.state_publisher.publish(state)
        self.resend_timer.reset()

    def _on_command(self, command: JointState) -> None:
        if command.header.stamp != self.stamp:
            return  # Duplicate command for a state that was published twice.
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
    print(f"MuJoCo simulated {node.model.nv} joints for {node.tick / node.rate:g} s.")


if __name__ == "__main__":
    main()
