# SPDX-License-Identifier: Apache-2.0
"""The programs: thin rclpy nodes around the core."""

import os
from pathlib import Path

# Matrices of a team are small; BLAS threads would only fight over the cores with other nodes.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
# Fast DDS's shared memory has locks that a killed program keeps: whoever speaks to it, a
# controller for instance, then stands still for seconds. Limited to this machine, ROS adds that
# transport whatever FASTDDS_BUILTIN_TRANSPORTS says; only a profile keeps data away from it.
if "FASTDDS_DEFAULT_PROFILES_FILE" not in os.environ:
    os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(Path(__file__).parent / "udp.xml"))

# Module of each program, below this package; setup.py names the same entry points.
PROGRAMS = {
    "robot_team": "team.robot_team",
    "haptic_emulator": "sources.haptic_emulator",
    "relative_planner": "sources.relative_planner",
    "controller": "controller.controller",
    "operator_console": "console.operator_console",
    "joy_operator": "sources.joy_operator",
    "pose_operator": "sources.pose_operator",
    "keyboard_operator": "sources.keyboard_operator",
    "recorder": "recording.recorder",
}
