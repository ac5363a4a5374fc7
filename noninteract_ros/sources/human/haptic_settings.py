# SPDX-License-Identifier: Apache-2.0
"""Settings of the operator's hand and device."""

from dataclasses import dataclass

from noninteract_ros.schema import key


@dataclass(frozen=True)
class HapticSettings:
    """Block `haptic` of a scenario."""

    subtask: str = key("Subtask that the operator commands", "cooperative")
    motion: str = key(
        "Motion that the hand intends",
        "paper",
        choices=("paper", "circle", "waypoints", "replay", "still"),
    )
    start_time: float = key("Time of the first reference [s]", 0.0, minimum=0.0)
    stop_time: float = key(
        "Time after which there are no more references [s]; 0: never", 0.0, minimum=0.0
    )
    update_rate: float = key("Rate of its references [Hz]", 1000.0, positive=True)
    amplitude: tuple[float, ...] = key("paper: amplitude of each coordinate [m]", (2.0, 0.0))
    frequency: float = key("paper, circle: angular frequency [rad/s]", 0.79)
    offset: tuple[float, ...] = key("paper: mean value [m]", (0.0, 1.0))
    centre: tuple[float, ...] = key("circle: centre; still: position of rest [m]", ())
    orientation: tuple[float, ...] = key(
        "Orientation of each rotation, held or oscillated about, quaternion x, y, z, w; by default"
        " no rotation",
        (),
    )
    rotation: tuple[float, ...] = key(
        "paper, circle: amplitude of each rotation vector, in phase with the motion's sine [rad];"
        " by default none",
        (),
    )
    radius: float = key("circle: radius [m]", 0.5, minimum=0.0)
    ramp_time: float = key("circle: time to reach full rate from rest [s]", 1.0, minimum=0.0)
    points: tuple[float, ...] = key("waypoints: the points one after the other [m]", ())
    orientations: tuple[float, ...] = key(
        "waypoints: quaternions x, y, z, w at the points one after the other; by default the"
        " orientation at all",
        (),
    )
    times: tuple[float, ...] = key(
        "waypoints: time of arrival at each, counted from start_time [s]", (), minimum=0.0
    )
    file: str = key(
        "replay: CSV file with the columns t [s], x, y, ... [m] and, of a rotation, qx, qy, qz,"
        " qw; its first row is at start_time",
        "",
    )
    tremor_amplitude: float = key("Bound of the tremor in each coordinate [m]", 0.0, minimum=0.0)
    tremor_angle: float = key(
        "Bound of the tremor in each component of a rotation [rad]", 0.0, minimum=0.0
    )
    tremor_seed: int = key("Seed of the tremor's phases", 0, minimum=0)
    hand_mass: float = key("Mass of hand and device [kg]; 0: a rigid hand", 0.0, minimum=0.0)
    hand_damping: float = key("Damping of the hand [N s/m]", 20.0, minimum=0.0)
    hand_stiffness: float = key("Stiffness of the hand [N/m]", 300.0, minimum=0.0)
    hand_inertia: float = key(
        "Rotational inertia of hand and device [kg m^2]", 0.01, positive=True
    )
    hand_turning_damping: float = key(
        "Rotational damping of the hand [N m s/rad]", 0.2, minimum=0.0
    )
    hand_turning_stiffness: float = key(
        "Rotational stiffness of the hand [N m/rad]", 3.0, minimum=0.0
    )
    device_mass: float = key(
        "Translational mass of the device, moved by the hand [kg]",
        0.0,
        minimum=0.0,
    )
    device_damping: float = key("Damping of the device in translation [N s/m]", 0.0, minimum=0.0)
    force_limit: float = key("Largest force of the device [N]; 0: no limit", 0.0, minimum=0.0)
    torque_limit: float = key("Largest torque of the device [N m]; 0: no limit", 0.0, minimum=0.0)
    workspace: tuple[float, ...] = key(
        "Edge lengths of the device's workspace, a box [m]; by default unbounded",
        (),
        positive=True,
    )
    workspace_centre: tuple[float, ...] = key(
        "Centre of the workspace [m]; by default the origin", ()
    )
    workspace_stiffness: float = key(
        "Stiffness of the workspace's boundary [N/m]", 2000.0, positive=True
    )
    reaction_stiffness: float = key(
        "Stiffness of the operator's delayed correction of a position deviation [N/m]",
        0.0,
        minimum=0.0,
    )
    reaction_delay: float = key("Reaction delay of the operator [s]", 0.2, minimum=0.0)
    dropout_times: tuple[float, ...] = key(
        "Dropouts of the connection: start, end, start, end, ... [s]", (), minimum=0.0
    )
