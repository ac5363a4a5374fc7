# SPDX-License-Identifier: Apache-2.0
"""Blocks of a scenario file, each validated separately."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from noninteract_ros.control.law.decoupling import LAWS
from noninteract_ros.control.law.impedance import ImpedanceSettings
from noninteract_ros.control.references.subtask_input import InputSettings
from noninteract_ros.errors import ScenarioError, one_of
from noninteract_ros.schema import Key, convert, join, key, keys_of, load
from noninteract_ros.simulation.environment import SURROUNDINGS, SurroundingBlock
from noninteract_ros.sources.autonomy.planner import Formation, PlannerSettings
from noninteract_ros.subtasks.kinds.registry import SubtaskBlock, kind_named
from noninteract_ros.team.models.registry import ROBOT_MODELS, RobotBlock
from noninteract_ros.team.models.urdf_robot import TOPIC
from noninteract_ros.team.state_assembler import PREDICTIONS

DEVICES = ("operator", "joy", "tracker", "keyboard")
OPTIONAL = ("object", "haptic", "link", "planner", "safety", "walls", "console", "tank", *DEVICES)
# Order of giving way by kind of subtask: a grasp last, postures first.
ORDERS = {
    "relative_position": 0,
    "relative_orientation": 0,
    "relative_pose": 0,
    "posture": 2,
    "elbow_angle": 2,
}
ORDER = 1
LISTINGS = ("robots", "subtasks", "pushes", "surroundings")
# Valid as a token of a topic name, and short enough for DDS with all that is appended.
NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
# Parameters that every ROS node declares itself.
ROS_KEYS = ("use_sim_time", "start_type_description_service", "qos_overrides")


@dataclass(frozen=True)
class General:
    """Keys of a scenario that belong to no block."""

    robots: tuple[str, ...] = key("Names of the robots; each has a block of that name")
    subtasks: tuple[str, ...] = key("Names of the subtasks; each has a block of that name")
    rate: float = key("Control rate [Hz]", 1000.0, positive=True, maximum=10000.0)
    duration: float = key("Duration of a demo [s]", 20.0, positive=True)
    lockstep: bool = key(
        "Lockstep of simulation and controller: each state waits for its command", True
    )
    real_time: bool = key("Limit of lockstep to wall time: never faster than real time", False)
    law: str = key("Control law", "energy_gated", choices=LAWS, live=True)
    gravity: tuple[float, ...] = key(
        "Gravitational acceleration in the world [m/s^2]", (0.0, 0.0, -9.81)
    )
    telemetry_rate: float = key(
        "Publishing rate of subtask states, energies and external wrenches [Hz]",
        250.0,
        positive=True,
    )
    lockstep_sources: tuple[str, ...] = key(
        "Sources that the controller waits for in lockstep, as <subtask>/<source>", ()
    )
    lockstep_timeout: float = key(
        "Wall time after which a silent lockstep source or sensor is no longer waited for [s]",
        5.0,
        positive=True,
    )
    force_sensors: tuple[str, ...] = key(
        "Robots with a force sensor: their external_wrench is used by the energy account", ()
    )
    state_timeout: float = key(
        "Gap between states after which the controller resets [s]", 0.2, positive=True
    )
    max_age: float = key(
        "Age beyond which states, commands, pushes and wrenches are rejected, in wall time [s]",
        0.1,
        positive=True,
    )
    clock_tolerance: float = key(
        "Lead of a stamp over the clock of the receiver that is accepted beyond one period, in"
        " wall time [s]",
        0.01,
        minimum=0.0,
    )
    max_state_skew: float = key(
        "Largest age difference of robot states on separate topics that is bridged by prediction;"
        " beyond it the team is held [s]",
        0.02,
        positive=True,
    )
    state_prediction: str = key(
        "Quantity assumed constant in that prediction; acceleration is measured and amplifies"
        " noise",
        "velocity",
        choices=PREDICTIONS,
    )
    command_timeout: float = key(
        "Age of a command after which the team brakes, in wall time [s]", 0.1, positive=True
    )
    push_timeout: float = key("Duration of a push unless repeated [s]", 0.1, positive=True)
    transition_time: float = key(
        "Duration of the transition to another law or other gains [s]", 0.2, positive=True
    )
    stop_rate: float = key(
        "Decay rate of the velocity after a stop, reached 4 / stop_rate after it and up to twice"
        " as high for slow motions; limited to an eighth of the control rate [1/s]",
        30.0,
        positive=True,
    )
    pushes: tuple[str, ...] = key("Names of the pushes; each has a block of that name", ())
    surroundings: tuple[str, ...] = key(
        "Names of the objects, doors and walls; each has a block of that name", ()
    )
    publish_clock: bool = key("Publication of /clock by robot_team", False)
    end_time: float = key(
        "Time at which robot_team ends the run, as in a demo [s]; 0: never", 0.0, minimum=0.0
    )
    start_paused: bool = key("Paused start: robot_team waits for ~/pause before tick 1", False)


@dataclass(frozen=True)
class SubtaskSpec:
    """Settings of one subtask.

    Attributes:
        kind: Block of the kind of subtask.
        impedance: Impedance of the subtask.
        input: Sources, authority and bounds of the reference.
    """

    kind: SubtaskBlock
    impedance: ImpedanceSettings
    input: InputSettings

    @property
    def order(self) -> int:
        """Order of giving way at walls: of a later one first."""
        given = self.input.priority
        return given if given >= 0 else ORDERS.get(getattr(self.kind, "kind", ""), ORDER)


def named_blocks(values: Mapping[str, Any]) -> list[str]:
    """Return the names of all listed blocks.

    Raises:
        ScenarioError: A name is invalid, reserved or repeated.
    """
    names: list[str] = []
    reserved = {item.name for item in fields(General)} | set(OPTIONAL)
    for listing in LISTINGS:
        for name in _listed(listing, values.get(listing, ())):
            if not NAME.fullmatch(name) or name in reserved:
                allowed = (
                    "names of at most 64 letters, digits and _ that are not keys of a scenario"
                )
                raise ScenarioError(listing, repr(name), allowed)
            if name in names:
                raise ScenarioError(listing, repr(name), "unique names")
            names.append(name)
    return names


def _listed(listing: str, names: Any) -> tuple[str, ...]:
    return tuple(convert(listing, names, tuple[str, ...], Key("Names")))


def block_of(values: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """Return the required block of a name.

    Raises:
        ScenarioError: The block is missing or is no mapping.
    """
    block = values.get(name)
    if not isinstance(block, Mapping):
        found = "nothing" if block is None else repr(block)
        raise ScenarioError(name, found, "a block of keys (required)")
    return block


def load_optional(block: type, values: Mapping[str, Any], name: str) -> Any:
    """Load an optional block; return None if it is missing."""
    return load(block, block_of(values, name), name) if name in values else None


def load_robot(name: str, values: Mapping[str, Any]) -> RobotBlock:
    """Load the block of a robot, of the class selected by its key `model`."""
    model = values.get("model", "point_mass")
    if not isinstance(model, str) or model not in ROBOT_MODELS:
        raise ScenarioError(f"{name}.model", repr(model), one_of(ROBOT_MODELS, str(model)))
    return load(ROBOT_MODELS[model], values, name)


def description_topics(values: Mapping[str, Any]) -> dict[str, str]:
    """Return the topics of robot descriptions that were not received yet, by robot."""
    blocks = {name: values.get(name) for name in values.get("robots", ())}
    return {
        name: block["urdf"].removeprefix(TOPIC)
        for name, block in blocks.items()
        if isinstance(block, Mapping)
        and str(block.get("urdf", "")).startswith(TOPIC)
        and not block.get("urdf_text")
    }


def load_surrounding(name: str, values: Mapping[str, Any]) -> SurroundingBlock:
    """Load the block of an object, a door or a wall."""
    kind = values.get("kind")
    if not isinstance(kind, str) or kind not in SURROUNDINGS:
        found = "nothing" if kind is None else repr(kind)
        raise ScenarioError(f"{name}.kind", found, one_of(SURROUNDINGS, str(kind)))
    return load(SURROUNDINGS[kind], values, name)


def load_subtask(name: str, values: Mapping[str, Any]) -> SubtaskSpec:
    """Load the settings of a subtask: kind, impedance and input."""
    kind = kind_named(f"{name}.kind", values.get("kind"))
    blocks = (kind, ImpedanceSettings, InputSettings)
    known = tuple(item.name for block in blocks for item in keys_of(block))
    for item in values:
        if item not in known:
            raise ScenarioError(join(name, item), "an unknown key", one_of(known, item))
    return SubtaskSpec(
        kind=load(kind, values, name, ignore=known),
        impedance=load(ImpedanceSettings, values, name, ignore=known),
        input=load(InputSettings, values, name, ignore=known),
    )


def load_planner(
    scenario: Mapping[str, Any],
) -> tuple[PlannerSettings | None, dict[str, Formation]]:
    """Load the block of the planner, or None, and the blocks of its formations."""
    if "planner" not in scenario:
        return None, {}
    values = block_of(scenario, "planner")
    names = _listed("planner.formations", values.get("formations", ()))
    settings = load(PlannerSettings, values, "planner", ignore=names)
    formations = {}
    for name in settings.formations:
        path = f"planner.{name}"
        block = values.get(name)
        if not isinstance(block, Mapping):
            raise ScenarioError(path, "nothing", "a formation (required)")
        formations[name] = load(Formation, block, path)
    return settings, formations
