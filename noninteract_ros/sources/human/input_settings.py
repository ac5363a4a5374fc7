# SPDX-License-Identifier: Apache-2.0
"""Settings of operators' input devices, in a scenario or in a mapping file beside it."""

from dataclasses import dataclass

from noninteract_ros.schema import key


@dataclass(frozen=True)
class OperatorSettings:
    """Block `operator`: settings that all devices share."""

    subtask: str = key("Subtask that the operator commands", "cooperative")
    linear_speed: float = key("Speed at full deflection [m/s]", 0.2, positive=True)
    angular_speed: float = key("Angular velocity at full deflection [rad/s]", 0.5, positive=True)
    linear_scale: float = key(
        "Translation of the subtask per translation of the device", 1.0, positive=True
    )
    angular_scale: float = key(
        "Rotation of the subtask per rotation of the device", 1.0, positive=True
    )
    workspace: tuple[float, ...] = key(
        "Edge lengths of the operator's workspace, a box [m]; by default unbounded",
        (),
        positive=True,
    )
    workspace_centre: tuple[float, ...] = key(
        "Centre of the workspace [m]; by default the origin", ()
    )
    hold_timeout: float = key(
        "Time without messages of the device after which it is released [s]", 0.25, positive=True
    )
    update_rate: float = key(
        "Publishing rate of set-points and velocities [Hz]", 50.0, positive=True
    )


@dataclass(frozen=True)
class JoySettings:
    """Block `joy`: mapping of the axes and buttons of a gamepad or space mouse.

    A direction is a sum of terms such as `axis1`, `-axis0` or `button5-button4`.
    """

    topic: str = key("Topic of sensor_msgs/Joy", "/joy")
    x: str = key("Translation along x", "axis1")
    y: str = key("Translation along y", "axis0")
    z: str = key("Translation along z", "")
    roll: str = key("Rotation about x", "")
    pitch: str = key("Rotation about y", "")
    yaw: str = key("Rotation about z", "")
    enable_button: int = key("Dead-man's switch, a button; -1: none", 4, minimum=-1)
    slow_button: int = key("Button that reduces all speeds; -1: none", -1, minimum=-1)
    slow_factor: float = key("Factor of the reduced speeds", 0.25, positive=True, maximum=1.0)
    deadzone: float = key("Deflection below which an axis counts as zero", 0.1, minimum=0.0)
    exponent: float = key("Exponent of an axis: 1 proportional, 2 quadratic", 1.5, minimum=1.0)


@dataclass(frozen=True)
class TrackerSettings:
    """Block `tracker`: a haptic device or tracker that publishes its pose."""

    pose_topic: str = key("Topic of geometry_msgs/PoseStamped", "device/pose")
    clutch_topic: str = key(
        "Topic of std_msgs/Bool: true while the clutch is engaged", "device/clutch"
    )
    joy_topic: str = key("Topic of sensor_msgs/Joy with the clutch; empty: none", "")
    clutch_button: int = key("Button of the clutch on joy_topic", 0, minimum=0)
    mounting: tuple[float, ...] = key(
        "Rotation from the device's axes to the world's, quaternion x, y, z, w",
        (0.0, 0.0, 0.0, 1.0),
    )
    largest_jump: float = key(
        "Distance between two poses beyond which the clutch is released [m]", 0.1, positive=True
    )
    largest_turn: float = key(
        "Rotation between two poses beyond which the clutch is released [rad]", 0.5, positive=True
    )


@dataclass(frozen=True)
class KeyboardSettings:
    """Block `keyboard`: keys of a terminal, which reports presses but no releases."""

    key_hold: float = key(
        "Time for which a key counts as held after its last press [s]; longer than the keyboard's"
        " repeat delay",
        0.6,
        positive=True,
    )
    step: float = key("Factor of the keys that raise and lower the speed", 1.25, minimum=1.01)
