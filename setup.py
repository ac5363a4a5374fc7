# SPDX-License-Identifier: Apache-2.0
"""Build script of an ament_python package that plain pip installs as well."""

from glob import glob

from setuptools import find_packages, setup

NAME = "noninteract_ros"
NODES = {
    "robot_team": "team",
    "haptic_emulator": "sources",
    "relative_planner": "sources",
    "controller": "controller",
    "operator_console": "console",
    "joy_operator": "sources",
    "pose_operator": "sources",
    "keyboard_operator": "sources",
    "recorder": "recording",
}
PROGRAMS = {node: f"{NAME}.nodes.{room}.{node}:main" for node, room in NODES.items()}
PROGRAMS["noninteract"] = f"{NAME}.cli:main"
ROBOTS = ["example-robot-data>=6.0"]  # Models of arms: 130 MB to download, 440 MB on disk.
PEER = ["mujoco>=4.0"]  # Another simulator's dynamics, to test against: 20 MB to download.
RUFF = ["ruff>=0.17,<0.18"]  # Another minor release formats differently.
# MkDocs 2 drops plugins and themes, and Material is made for MkDocs 1 alone.
DOCS = [
    "mkdocs>=1.6.1,<2",
    "mkdocs-material>=9.7.5,<10",
    "mkdocstrings[python]>=1.0,<2",
    *RUFF,  # Breaks the lines of signatures.
]

setup(
    name=NAME,
    version="0.1.0",
    description="Passive noninteracting control of robot teams led by a human",
    license="Apache-2.0",
    maintainer="The noninteract_ros maintainers",
    maintainer_email="maintainers@example.org",
    python_requires=">=3.11,<3.13",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={NAME: ["py.typed", "console/static/*", "nodes/udp.xml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", sorted(glob("config/*.yaml"))),
        (f"share/{NAME}/config/devices", sorted(glob("config/devices/*.yaml"))),
        (f"share/{NAME}/launch", sorted(glob("launch/*.py"))),
        # pip puts entry points into bin/ only, while `ros2 run` looks into lib/<package>/.
        (f"lib/{NAME}", [f"scripts/{program}" for program in PROGRAMS]),
    ],
    entry_points={"console_scripts": [f"{name} = {main}" for name, main in PROGRAMS.items()]},
    install_requires=[
        "ros-jazzy-rclpy[fastrtps]>=7.1.6",
        "ros-jazzy-common-interfaces>=5.3.6",
        "numpy>=2.4",
        "numba>=0.68",
        "pin>=4.1",
        "pyyaml>=6.0",
        "ruckig>=0.19",
        "mcap>=1.6",
        "mcap-ros2-support>=0.6",
        "scipy>=1.17",
        "matplotlib>=3.11",
        "pillow>=12.0",
        "typer>=0.29",
        "rich>=15.0",
        "websockets>=15.0",
    ],
    extras_require={
        "robots": ROBOTS,
        "peer": PEER,
        "docs": DOCS,
        "dev": [
            *ROBOTS,
            *PEER,
            *DOCS,
            "hypothesis>=6.150",
            "mypy>=2.4",
            "playwright>=1.60",  # Drives the console's page in Chromium, where that is installed.
            "pytest>=9.2",
            "pytest-xdist>=3.8",
            "types-PyYAML>=6.0",
            "colcon-common-extensions>=0.3",
            "setuptools>=70.1,<80",  # 70.1 builds wheels by itself; colcon refuses 80.
        ],
    },
)
