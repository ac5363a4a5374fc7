# SPDX-License-Identifier: Apache-2.0
"""Start the programs of one scenario.

`ros2 launch noninteract_ros team.launch.py scenario:=paper namespace:=team record:=false`
"""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch import LaunchContext, LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

PACKAGE = "noninteract_ros"


def generate_launch_description() -> LaunchDescription:
    """Return the launch arguments, and the nodes that depend on them."""
    return LaunchDescription(
        [
            DeclareLaunchArgument(
                "scenario",
                default_value="paper",
                description="Name of an installed scenario or path of a parameter file",
            ),
            DeclareLaunchArgument(
                "namespace", default_value="team", description="Namespace of all nodes"
            ),
            DeclareLaunchArgument(
                "record", default_value="true", description="Start the recorder"
            ),
            OpaqueFunction(function=start_nodes),
        ]
    )


def start_nodes(context: LaunchContext) -> list[Node]:
    """Return one node per program, all with the scenario's parameter file."""
    common = {
        "package": PACKAGE,
        "namespace": LaunchConfiguration("namespace"),
        "parameters": [str(scenario_file(LaunchConfiguration("scenario").perform(context)))],
        "output": "screen",
    }
    others = ("haptic_emulator", "relative_planner", "controller")
    return [
        # The run ends with its robots, or if robot_team rejects the scenario.
        Node(executable="robot_team", on_exit=Shutdown(reason="robot_team ended"), **common),
        *(Node(executable=name, **common) for name in others),
        Node(
            executable="recorder", condition=IfCondition(LaunchConfiguration("record")), **common
        ),
    ]


def scenario_file(scenario: str) -> Path:
    """Return the parameter file of a path or of an installed name.

    Uses no code of the package, because `ros2 launch` may run in another Python.

    Raises:
        FileNotFoundError: The file does not exist; the text lists the installed names.
    """
    installed = Path(get_package_share_directory(PACKAGE)) / "config"
    for candidate in (Path(scenario), installed / f"{scenario}.yaml"):
        if candidate.is_file():
            return candidate.resolve()
    names = " | ".join(sorted(file.stem for file in installed.glob("*.yaml")))
    raise FileNotFoundError(f"scenario: found {scenario!r}, allowed: a path or {names}")
