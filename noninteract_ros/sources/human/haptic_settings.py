# SPDX-License-Identifier: Apache-2.0
"""What a scenario can say about the operator's hand and device."""

from dataclasses import dataclass

from noninteract_ros.schema import key


@dataclass(frozen=True)
class HapticSettings:
    """The block `haptic` of a scenario."""

    subtask: str = key("Subtask that the operator commands", "cooperative")
    motion: str = key(
        "Motion that the hand intends",
        "paper",
        choices=("paper", "circle", "waypoints", "replay", "still"),
    )
    start_time: float = key("Time from which the device speaks [s]", 0.0, minimum=0.0)
    stop_time: float = key("Time from which it is silent for good [s]; 0: never", 0.0, minimum=0.0)
    update_rate: float = key("Rate of its references [Hz]", 1000.0, positive=True)
    amplitude: tuple[float, ...] = key("paper: amplitude of each coordinate [m]", (2.0, 0.0))
    frequency: float = key("paper, circle: angular frequency [rad/s]", 0.79)
    offset: tuple[float, ...] = key("paper: value around which it swings [m]", (0.0, 1.0))
    centre: tuple[float, ...] = key("circle: its centre; still: the place of rest [m]", ())
    orientation: tuple[float, ...] = key(
        "Of a subtask with rotations: quaternion x, y, z, w of each, held or swung about;"
        " by default no turn",
        (),
    )
    rotation: tuple[float, ...] = key(
        "paper, circle: rotation vector of each rotation, swung with the motion's sine [rad]; by"
        " default none",
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
        "waypoints: when each is reached, counted from start_time [s]", (), minimum=0.0
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
    hand_damping: float = key("Damping of the hand's grip [N s/m]", 20.0, minimum=0.0)
    hand_stiffness: float = key("Stiffness of the hand's grip [N/m]", 300.0, minimum=0.0)
    hand_inertia: float = key(
        "Inertia of a turning hand, with the device in it [kg m^2]", 0.01, positive=True
    )
    hand_turning_damping: float = key(
        "Damping of the grip against turning [N m s/rad]", 0.2, minimum=0.0
    )
    hand_turning_stiffness: float = key(
        "Stiffness of the grip against turning [N m/rad]", 3.0, minimum=0.0
    )
    device_mass: float = key(
        "Mass of the device in translation, which the hand has to move along [kg]",
        0.0,
        minimum=0.0,
    )
    device_damping: float = key("Damping of the device in translation [N s/m]", 0.0, minimum=0.0)
    force_limit: float = key("Most force of the device [N]; 0: any", 0.0, minimum=0.0)
    torque_limit: float = key("Most torque of the device [N m]; 0: any", 0.0, minimum=0.0)
    workspace: tuple[float, ...] = key(
        "Edges of the device's workspace, a box [m]; by default it has no end", (), positive=True
    )
    workspace_centre: tuple[float, ...] = key("Its centre [m]; by default the origin", ())
    workspace_stiffness: float = key("Stiffness of its ends [N/m]", 2000.0, positive=True)
    reaction_stiffness: float = key(
        "How the operator makes good a deviation in place on noticing it [N/m]", 0.0, minimum=0.0
    )
    reaction_delay: float = key("How late the operator notices [s]", 0.2, minimum=0.0)
    dropout_times: tuple[float, ...] = key(
        "Start, end, start, end, ... of the dropouts of the connection [s]", (), minimum=0.0
    )
