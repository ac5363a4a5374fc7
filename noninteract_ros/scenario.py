# SPDX-License-Identifier: Apache-2.0
"""A scenario: the one file that every program of a run is started with."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any

from noninteract_ros.control.decoupling import LAWS
from noninteract_ros.control.impedance import ImpedanceSettings
from noninteract_ros.control.inputs import SOURCES
from noninteract_ros.control.subtask_input import InputSettings
from noninteract_ros.control.team_controller import TeamController
from noninteract_ros.errors import ScenarioError, SubtaskError, TeamError, one_of
from noninteract_ros.operator.haptic import HapticDevice, HapticSettings
from noninteract_ros.operator.planner import Formation, FormationPlanner, PlannerSettings
from noninteract_ros.schema import Key, convert, describe, join, key, keys_of, load
from noninteract_ros.simulation.plant import Plant
from noninteract_ros.simulation.push import ScheduledPush
from noninteract_ros.simulation.subtask_object import ObjectSettings, SubtaskObject
from noninteract_ros.simulation.team_simulation import TeamSimulation
from noninteract_ros.subtasks.registry import SubtaskBlock, kind_named
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.team.registry import ROBOT_MODELS, RobotBlock
from noninteract_ros.team.team import Team

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")  # What may be a part of a topic's name.
# Every ROS node has these of its own.
ROS_KEYS = ("use_sim_time", "start_type_description_service", "qos_overrides")


@dataclass(frozen=True)
class General:
    """The keys of a scenario that belong to no block."""

    robots: tuple[str, ...] = key("Names of the robots; each has a block of that name")
    subtasks: tuple[str, ...] = key("Names of the subtasks; each has a block of that name")
    rate: float = key("Ticks per second [Hz]", 1000.0, positive=True, maximum=10000.0)
    duration: float = key("How long a demo runs [s]", 20.0, positive=True)
    lockstep: bool = key("Step only when the command that answers a state has come", True)
    law: str = key("Control law", "noninteracting", choices=LAWS, live=True)
    gravity: tuple[float, ...] = key("Gravity in the world [m/s^2]", (0.0, 0.0, -9.81))
    telemetry_rate: float = key(
        "Rate of subtask states, energies and external wrenches [Hz]", 250.0, positive=True
    )
    lockstep_sources: tuple[str, ...] = key(
        "Sources that the controller waits for in lockstep, as <subtask>/<source>", ()
    )
    lockstep_timeout: float = key(
        "Wall time after which a lockstep source counts as absent [s]", 5.0, positive=True
    )
    force_sensors: tuple[str, ...] = key(
        "Robots whose external_wrench the controller's energy account uses", ()
    )
    state_timeout: float = key(
        "Gap between states after which the controller starts anew [s]", 0.2, positive=True
    )
    command_timeout: float = key(
        "Age of a command after which the team brakes, in wall time [s]", 0.1, positive=True
    )
    push_timeout: float = key("How long a push lasts unless repeated [s]", 0.1, positive=True)
    transition_time: float = key("Fade of a change of law or gains [s]", 0.2, positive=True)
    stop_rate: float = key("Decay rate of the velocity after a stop [1/s]", 10.0, positive=True)
    pushes: tuple[str, ...] = key("Names of pushes; each has a block of that name", ())
    publish_clock: bool = key("Whether robot_team publishes /clock", False)
    end_time: float = key(
        "Time at which robot_team stops for good, as a demo does [s]; 0: never", 0.0, minimum=0.0
    )
    start_paused: bool = key("Whether robot_team waits for ~/pause before its first tick", False)


@dataclass(frozen=True)
class SubtaskSpec:
    """One subtask: what it is, how it behaves, who leads it."""

    kind: SubtaskBlock
    impedance: ImpedanceSettings
    input: InputSettings


@dataclass(frozen=True)
class Scenario:
    """A checked scenario; `build_*` makes the parts of a run.

    Attributes:
        general: Keys of no block.
        robots: Blocks of the robots, by name.
        subtasks: Subtasks, by name.
        held: Object that the team holds, or None.
        haptic: The operator's emulated hand and device, or None.
        planner: The relative planner, or None.
        formations: The planner's formations, by name.
        pushes: Scheduled pushes, by name.
    """

    general: General
    robots: Mapping[str, RobotBlock]
    subtasks: Mapping[str, SubtaskSpec]
    held: ObjectSettings | None
    haptic: HapticSettings | None
    planner: PlannerSettings | None
    formations: Mapping[str, Formation]
    pushes: Mapping[str, ScheduledPush]

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> "Scenario":
        """Checks nested values, as in a parameter file, and everything they must fit together.

        Raises:
            ScenarioError: A key is wrong; the error names it, what was found and what is allowed.
        """
        values = {name: value for name, value in values.items() if name not in ROS_KEYS}
        named = _named_blocks(values)
        optional = ("object", "haptic", "planner")
        general = load(General, values, ignore=(*named, *optional))
        planner, formations = _load_planner(values)
        scenario = cls(
            general,
            {name: _load_robot(name, _block(values, name)) for name in general.robots},
            {name: _load_subtask(name, _block(values, name)) for name in general.subtasks},
            _load_optional(ObjectSettings, values, "object"),
            _load_optional(HapticSettings, values, "haptic"),
            planner,
            formations,
            {name: load(ScheduledPush, _block(values, name), name) for name in general.pushes},
        )
        scenario.check()
        return scenario

    def parameters(self) -> Iterator[tuple[str, Any, Key, Any]]:
        """Dotted key, type, rule and value of every key of every block."""
        blocks: list[tuple[str, object | None]] = [("", self.general)]
        blocks += [*self.robots.items(), *self.pushes.items()]
        blocks += [("object", self.held), ("haptic", self.haptic), ("planner", self.planner)]
        blocks += [(f"planner.{name}", block) for name, block in self.formations.items()]
        for name, spec in self.subtasks.items():
            blocks += [(name, part) for part in (spec.kind, spec.impedance, spec.input)]
        for name, block in blocks:
            if block is not None:
                yield from describe(block, name)

    def check(self) -> None:
        """Builds every part once, so that nothing is found wrong later.

        Raises:
            ScenarioError: Parts do not fit together.
        """
        if len(self.general.gravity) != 3:
            raise ScenarioError("gravity", list(self.general.gravity), "3 numbers")
        sources = [join_source(name, source) for name in self.subtasks for source in SOURCES]
        for source in self.general.lockstep_sources:
            if source not in sources:
                raise ScenarioError("lockstep_sources", repr(source), one_of(sources, source))
        for robot in self.general.force_sensors:
            if robot not in self.robots:
                raise ScenarioError("force_sensors", repr(robot), one_of(self.robots, robot))
        team = self.build_team()
        stack = self.build_stack(team)
        self.build_controller(team, stack)
        self.build_simulation(team, stack)
        for push_name, push in self.pushes.items():
            push.check(push_name, team)
        if self.haptic:
            self.build_haptic(stack)
        if self.planner:
            self.build_planner(stack)

    def build_team(self) -> Team:
        """The robots as one model."""
        robots = [block.build(name) for name, block in self.robots.items()]
        try:
            return Team(robots, self.general.gravity)
        except TeamError as error:
            raise ScenarioError("robots", list(self.robots), str(error)) from error

    def build_stack(self, team: Team) -> SubtaskStack:
        """The subtasks stacked, with the assumptions of the law checked."""
        subtasks: dict[str, Subtask] = {}
        for name, spec in self.subtasks.items():
            subtasks[name] = spec.kind.build(name, team, subtasks)
        try:
            return SubtaskStack(team, list(subtasks.values()))
        except SubtaskError as error:
            raise ScenarioError("subtasks", list(self.subtasks), str(error)) from error

    def build_controller(self, team: Team, stack: SubtaskStack) -> TeamController:
        """The controller, without ROS."""
        return TeamController(
            team,
            stack,
            self.general.law,
            [spec.impedance for spec in self.subtasks.values()],
            [spec.input for spec in self.subtasks.values()],
            self.general.transition_time,
            self.general.stop_rate,
            self.general.state_timeout,
        )

    def build_simulation(self, team: Team, stack: SubtaskStack) -> TeamSimulation:
        """The simulated team with its object and pushes."""
        held = SubtaskObject(self.held, stack) if self.held else None
        return TeamSimulation(Plant(team), self.general.rate, held, list(self.pushes.values()))

    def build_haptic(self, stack: SubtaskStack) -> HapticDevice:
        """The operator's emulated hand and device."""
        settings = self._required(self.haptic, "haptic")
        return HapticDevice(settings, self._commanded_dim(stack, settings.subtask, "haptic"))

    def build_planner(self, stack: SubtaskStack) -> FormationPlanner:
        """The relative planner."""
        settings = self._required(self.planner, "planner")
        dim = self._commanded_dim(stack, settings.subtask, "planner")
        return FormationPlanner(settings, self.formations, dim)

    @staticmethod
    def _required(block: Any, name: str) -> Any:
        if block is None:
            raise ScenarioError(name, "nothing", "a block of that name (required)")
        return block

    @staticmethod
    def _commanded_dim(stack: SubtaskStack, subtask: str, block: str) -> int:
        if subtask not in stack.names:
            raise ScenarioError(f"{block}.subtask", repr(subtask), one_of(stack.names, subtask))
        return stack.subtasks[stack.names.index(subtask)].dim


def join_source(subtask: str, source: str) -> str:
    """Name of a source of a subtask, as topics and `lockstep_sources` spell it."""
    return f"{subtask}/{source}"


def _named_blocks(values: Mapping[str, Any]) -> list[str]:
    """Names that `robots`, `subtasks` and `pushes` list, with what they clash with refused."""
    names: list[str] = []
    reserved = {item.name for item in fields(General)} | {"object", "haptic", "planner"}
    for listing in ("robots", "subtasks", "pushes"):
        for name in _listed(listing, values.get(listing, ())):
            if not NAME.fullmatch(name) or name in reserved:
                allowed = "names of letters, digits and _ that are no keys of a scenario"
                raise ScenarioError(listing, repr(name), allowed)
            if name in names:
                raise ScenarioError(listing, repr(name), "names that are used once")
            names.append(name)
    return names


def _listed(listing: str, names: Any) -> tuple[str, ...]:
    return tuple(convert(listing, names, tuple[str, ...], Key("Names")))


def _block(values: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    block = values.get(name)
    if not isinstance(block, Mapping):
        found = "nothing" if block is None else repr(block)
        raise ScenarioError(name, found, "a block of keys (required)")
    return block


def _load_optional(block: type, values: Mapping[str, Any], name: str) -> Any:
    return load(block, _block(values, name), name) if name in values else None


def _load_robot(name: str, values: Mapping[str, Any]) -> RobotBlock:
    model = values.get("model", "point_mass")
    if not isinstance(model, str) or model not in ROBOT_MODELS:
        raise ScenarioError(f"{name}.model", repr(model), one_of(ROBOT_MODELS, str(model)))
    return load(ROBOT_MODELS[model], values, name)


def _load_subtask(name: str, values: Mapping[str, Any]) -> SubtaskSpec:
    kind = kind_named(f"{name}.kind", values.get("kind"))
    blocks = (kind, ImpedanceSettings, InputSettings)
    known = tuple(item.name for block in blocks for item in keys_of(block))
    for item in values:
        if item not in known:
            raise ScenarioError(join(name, item), "an unknown key", one_of(known, item))
    return SubtaskSpec(
        load(kind, values, name, ignore=known),
        load(ImpedanceSettings, values, name, ignore=known),
        load(InputSettings, values, name, ignore=known),
    )


def _load_planner(
    scenario: Mapping[str, Any],
) -> tuple[PlannerSettings | None, dict[str, Formation]]:
    if "planner" not in scenario:
        return None, {}
    values = _block(scenario, "planner")
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
