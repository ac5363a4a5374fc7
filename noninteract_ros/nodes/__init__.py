# SPDX-License-Identifier: Apache-2.0
"""ROS 2 nodes: thin rclpy wrappers around the core."""

import os
from pathlib import Path

# Matrices of a team are small; BLAS threads would only compete with other nodes for the cores.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")
# A killed process keeps its locks in the shared memory of Fast DDS, and its peers then block for
# seconds. With discovery limited to localhost, ROS adds that transport regardless of
# FASTDDS_BUILTIN_TRANSPORTS; only a profile excludes it.
if "FASTDDS_DEFAULT_PROFILES_FILE" not in os.environ:
    os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(Path(__file__).parent / "udp.xml"))

# Module of each program, relative to this package; setup.py has the same entry points.
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
