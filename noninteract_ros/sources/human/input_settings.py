# SPDX-License-Identifier: Apache-2.0
"""What a scenario, or a mapping file beside it, can say about people's devices."""

from dataclasses import dataclass

from noninteract_ros.schema import key


@dataclass(frozen=True)
class OperatorSettings:
    """The block `operator`: what all devices have in common."""

    subtask: str = key("Subtask that the operator leads", "cooperative")
    linear_speed: float = key("Speed at full deflection [m/s]", 0.2, positive=True)
    angular_speed: float = key("Rate of turning at full deflection [rad/s]", 0.5, positive=True)
    linear_scale: float = key("Motion of the subtask per motion of the device", 1.0, positive=True)
    angular_scale: float = key(
        "Turning of the subtask per turning of the device", 1.0, positive=True
    )
    workspace: tuple[float, ...] = key(
        "Edges of the box that the operator can lead to [m]; by default it has no end",
        (),
        positive=True,
    )
    workspace_centre: tuple[float, ...] = key("Its centre [m]; by default the origin", ())
    hold_timeout: float = key("Silence of the device that lets go [s]", 0.25, positive=True)
    update_rate: float = key("Rate of set-points and rates [Hz]", 50.0, positive=True)


@dataclass(frozen=True)
class JoySettings:
    """The block `joy`: what the axes and buttons of a gamepad or space mouse mean.

    A direction is a sum of terms such as `axis1`, `-axis0` or `button5-button4`.
    """

    topic: str = key("Topic of sensor_msgs/Joy", "/joy")
    x: str = key("What moves along x", "axis1")
    y: str = key("What moves along y", "axis0")
    z: str = key("What moves along z", "")
    roll: str = key("What turns about x", "")
    pitch: str = key("What turns about y", "")
    yaw: str = key("What turns about z", "")
    enable_button: int = key("Button that has to be held; -1: none", 4, minimum=-1)
    slow_button: int = key("Button that makes all slow; -1: none", -1, minimum=-1)
    slow_factor: float = key("How slow", 0.25, positive=True, maximum=1.0)
    deadzone: float = key("Deflection below which an axis counts as at rest", 0.1, minimum=0.0)
    exponent: float = key("How gently an axis begins: 1 proportional, 2 square", 1.5, minimum=1.0)


@dataclass(frozen=True)
class TrackerSettings:
    """The block `tracker`: a haptic device or tracker that tells its pose."""

    pose_topic: str = key("Topic of geometry_msgs/PoseStamped", "device/pose")
    clutch_topic: str = key(
        "Topic of std_msgs/Bool: true while the clutch is held", "device/clutch"
    )
    joy_topic: str = key("Topic of sensor_msgs/Joy with the clutch; empty: none", "")
    clutch_button: int = key("Its button", 0, minimum=0)
    mounting: tuple[float, ...] = key(
        "Rotation from the device's axes to the world's, quaternion x, y, z, w",
        (0.0, 0.0, 0.0, 1.0),
    )
    largest_jump: float = key(
        "Way between two poses beyond which the clutch lets go [m]", 0.1, positive=True
    )


@dataclass(frozen=True)
class KeyboardSettings:
    """The block `keyboard`: keys of a terminal, which tells presses but no releases."""

    key_hold: float = key(
        "How long a key counts as held after it was last heard [s]; longer than the keyboard waits"
        " before it repeats",
        0.6,
        positive=True,
    )
    step: float = key("Factor of the keys that make all faster and slower", 1.25, minimum=1.01)
