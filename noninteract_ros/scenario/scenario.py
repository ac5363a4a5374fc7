# SPDX-License-Identifier: Apache-2.0
"""Scenario: the settings shared by all programs of a run."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

from noninteract_ros.control.controller import TeamController
from noninteract_ros.control.energy.tank import TankSettings
from noninteract_ros.control.references.inputs import SOURCES
from noninteract_ros.control.safety.settings import SafetySettings
from noninteract_ros.control.walls.settings import WallSettings
from noninteract_ros.errors import ScenarioError, SubtaskError, TeamError, one_of
from noninteract_ros.scenario.blocks import (
    OPTIONAL,
    ROS_KEYS,
    General,
    SubtaskSpec,
    block_of,
    load_optional,
    load_planner,
    load_robot,
    load_subtask,
    load_surrounding,
    named_blocks,
)
from noninteract_ros.scenario.console_settings import ConsoleSettings
from noninteract_ros.schema import Key, describe, join, load
from noninteract_ros.simulation.environment import SurroundingBlock
from noninteract_ros.simulation.plant import Plant
from noninteract_ros.simulation.push import ScheduledPush
from noninteract_ros.simulation.subtask_object import ObjectSettings, SubtaskObject
from noninteract_ros.simulation.team_simulation import TeamSimulation
from noninteract_ros.sources.autonomy.planner import Formation, FormationPlanner, PlannerSettings
from noninteract_ros.sources.human.haptic_device import HapticDevice, HapticSettings
from noninteract_ros.sources.human.input_settings import (
    JoySettings,
    KeyboardSettings,
    OperatorSettings,
    TrackerSettings,
)
from noninteract_ros.sources.link.bilateral import BilateralLink
from noninteract_ros.sources.link.settings import LinkSettings
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.subtasks.subtask import Subtask
from noninteract_ros.team.models.registry import RobotBlock
from noninteract_ros.team.team import Team

if TYPE_CHECKING:
    from noninteract_ros.control.walls.walls import Walls
    from noninteract_ros.team.geometry.clearance import CollisionGeometry


@dataclass(frozen=True)
class Scenario:
    """Validated scenario, with methods that build the parts of a run.

    Attributes:
        general: Keys that belong to no block.
        robots: Robot blocks, by name.
        subtasks: Subtask settings, by name.
        held: Object held by the team, or None.
        haptic: Emulated hand and haptic device, or None.
        link: Link between device and team, or None.
        planner: Formation planner, or None.
        formations: Formations of the planner, by name.
        pushes: Scheduled pushes, by name.
        surroundings: Objects, doors and walls, by name.
        safety: Behaviour at singularities and joint limits.
        walls: Distances that bodies and joints keep, or None.
        console: Operator's console, or None.
        tank: Energy tank.
        operator: Settings common to all input devices, or None.
        joy: Axes and buttons of a gamepad or space mouse, or None.
        tracker: Pose tracker, or None.
        keyboard: Keys of a terminal, or None.

    Raises:
        ScenarioError: Parts do not fit together.
    """

    general: General
    robots: Mapping[str, RobotBlock]
    subtasks: Mapping[str, SubtaskSpec]
    held: ObjectSettings | None
    haptic: HapticSettings | None
    link: LinkSettings | None
    planner: PlannerSettings | None
    formations: Mapping[str, Formation]
    pushes: Mapping[str, ScheduledPush]
    surroundings: Mapping[str, SurroundingBlock]
    safety: SafetySettings
    walls: WallSettings | None
    console: ConsoleSettings | None
    tank: TankSettings
    operator: OperatorSettings | None
    joy: JoySettings | None
    tracker: TrackerSettings | None
    keyboard: KeyboardSettings | None

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> "Scenario":
        """Build a scenario from nested values, as read from a parameter file.

        Raises:
            ScenarioError: A key is invalid; the error gives its name, value and allowed values.
        """
        try:
            return cls._from_dict(values)
        except (ArithmeticError, ValueError, RuntimeError) as error:
            # numpy and Pinocchio name no key.
            found = f"{type(error).__name__}: {error}"
            allowed = "masses, lengths, gains and positions with which the law can be evaluated"
            raise ScenarioError("(scenario)", found, allowed) from error

    @classmethod
    def _from_dict(cls, values: Mapping[str, Any]) -> "Scenario":
        values = {name: value for name, value in values.items() if name not in ROS_KEYS}
        named = named_blocks(values)
        general = load(General, values, ignore=(*named, *OPTIONAL))
        planner, formations = load_planner(values)
        return cls(
            general=general,
            robots={name: load_robot(name, block_of(values, name)) for name in general.robots},
            subtasks={
                name: load_subtask(name, block_of(values, name)) for name in general.subtasks
            },
            held=load_optional(ObjectSettings, values, "object"),
            haptic=load_optional(HapticSettings, values, "haptic"),
            link=load_optional(LinkSettings, values, "link"),
            planner=planner,
            formations=formations,
            pushes={
                name: load(ScheduledPush, block_of(values, name), name) for name in general.pushes
            },
            surroundings={
                name: load_surrounding(name, block_of(values, name))
                for name in general.surroundings
            },
            safety=load_optional(SafetySettings, values, "safety") or SafetySettings(),
            walls=load_optional(WallSettings, values, "walls"),
            console=load_optional(ConsoleSettings, values, "console"),
            tank=load_optional(TankSettings, values, "tank") or TankSettings(),
            operator=load_optional(OperatorSettings, values, "operator"),
            joy=load_optional(JoySettings, values, "joy"),
            tracker=load_optional(TrackerSettings, values, "tracker"),
            keyboard=load_optional(KeyboardSettings, values, "keyboard"),
        )

    def parameters(self) -> Iterator[tuple[str, Any, Key, Any]]:
        """Iterate over dotted key, type, `schema.Key` and value of every key of every block."""
        blocks: list[tuple[str, object | None]] = [("", self.general)]
        blocks += [*self.robots.items(), *self.pushes.items(), *self.surroundings.items()]
        blocks += [("object", self.held), ("haptic", self.haptic), ("link", self.link)]
        blocks.append(("tank", self.tank))
        blocks += [("planner", self.planner), ("safety", self.safety), ("console", self.console)]
        blocks += [("walls", self.walls)]
        blocks += [("operator", self.operator), ("joy", self.joy), ("tracker", self.tracker)]
        blocks += [("keyboard", self.keyboard)]
        blocks += [(f"planner.{name}", block) for name, block in self.formations.items()]
        for name, spec in self.subtasks.items():
            blocks += [(name, part) for part in (spec.kind, spec.impedance, spec.input)]
        for name, block in blocks:
            if block is not None:
                yield from describe(block, name)

    def __post_init__(self) -> None:
        """Build every part once, so that errors appear here and not later."""
        self.safety.check()
        self.tank.check()
        if len(self.general.gravity) != 3:
            raise ScenarioError("gravity", list(self.general.gravity), "3 numbers")
        sources = [join_source(name, source) for name in self.subtasks for source in SOURCES]
        for source in self.general.lockstep_sources:
            if source not in sources:
                raise ScenarioError("lockstep_sources", repr(source), one_of(sources, source))
        for robot in self.general.force_sensors:
            if robot not in self.robots:
                raise ScenarioError("force_sensors", repr(robot), one_of(self.robots, robot))
        self._check_topics()
        team, stack = self.team, self.stack
        self.build_controller(team, stack)
        for push_name, push in self.pushes.items():
            push.check(push_name, team)
        self.build_simulation(team, stack)
        if self.haptic or self.link:
            self.build_haptic(stack)
        if self.planner:
            self.build_planner(stack)

    @property
    def has_robot_state_topics(self) -> bool:
        """True if each robot publishes its state on a topic of its own."""
        return any(block.topics.joint_states_topic for block in self.robots.values())

    def _check_topics(self) -> None:
        for name, block in self.robots.items():
            if self.has_robot_state_topics and not block.topics.joint_states_topic:
                path, found = join(name, "joint_states_topic"), "nothing"
                raise ScenarioError(path, found, "a topic for every robot, or for none")

    def __getstate__(self) -> dict[str, Any]:
        """Return the blocks alone, since models cannot be pickled cheaply."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @cached_property
    def team(self) -> Team:
        """Robot team of this scenario, built once; not for use in several threads."""
        return self.build_team()

    @cached_property
    def stack(self) -> SubtaskStack:
        """Subtasks of `team`, built once."""
        return self.build_stack(self.team)

    def build_team(self) -> Team:
        """Build the robots as one model."""
        robots = [block.build(name) for name, block in self.robots.items()]
        try:
            return Team(robots, self.general.gravity)
        except TeamError as error:
            raise ScenarioError("robots", list(self.robots), str(error)) from error

    def build_stack(self, team: Team) -> SubtaskStack:
        """Build the stack of subtasks, and check the assumptions of the law."""
        subtasks: dict[str, Subtask] = {}
        for name, spec in self.subtasks.items():
            subtasks[name] = spec.kind.build(name, team, subtasks)
        try:
            return SubtaskStack(team, list(subtasks.values()))
        except SubtaskError as error:
            raise ScenarioError("subtasks", list(self.subtasks), str(error)) from error

    def build_scene(self, team: Team) -> "CollisionGeometry":
        """Return the bodies of robots and surroundings, and the pairs that can collide."""
        from noninteract_ros.scenario.collision import collision_geometry  # Loads the compiler.

        return collision_geometry(self.robots, self.surroundings, team)

    def build_walls(self, team: Team, stack: SubtaskStack) -> "Walls | None":
        """Return the walls between these bodies and at the joints' limits, if there are any."""
        if self.walls is None:
            return None
        from noninteract_ros.control.walls.walls import Walls  # Loads the compiler.

        orders = [spec.order for spec in self.subtasks.values()]
        scene = self.build_scene(team)
        return Walls(team, stack, orders, scene, self.walls, 1.0 / self.general.rate)

    def build_controller(self, team: Team, stack: SubtaskStack) -> TeamController:
        """Build the controller."""
        return TeamController(
            team,
            stack,
            self.general.law,
            [spec.impedance for spec in self.subtasks.values()],
            [spec.input for spec in self.subtasks.values()],
            self.general.transition_time,
            min(self.general.stop_rate, 0.125 * self.general.rate),
            self.general.state_timeout,
            self.safety,
            self.tank,
            measured=bool(self.general.force_sensors),
            walls=self.build_walls(team, stack),
        )

    def build_simulation(self, team: Team, stack: SubtaskStack) -> TeamSimulation:
        """Build the simulated team with its object, surroundings and pushes."""
        held = SubtaskObject(self.held, stack) if self.held else None
        parts = [item.build(name, team) for name, item in self.surroundings.items()]
        bodies = [body for bodies, _ in parts for body in bodies]
        if held and bodies:
            raise ScenarioError("object", "a block", "nothing, if surroundings have bodies")
        plant = Plant(team, bodies, [coupling for _, couplings in parts for coupling in couplings])
        return TeamSimulation(plant, self.general.rate, held, list(self.pushes.values()))

    def build_haptic(self, stack: SubtaskStack) -> HapticDevice | BilateralLink:
        """Build the emulated hand and device, behind its link if there is one."""
        settings = self._required(self.haptic, "haptic")
        layout = self._subtask(stack, settings.subtask, "haptic").layout
        device = HapticDevice(settings, layout)
        return BilateralLink(device, settings, self.link, layout) if self.link else device

    def build_planner(self, stack: SubtaskStack) -> FormationPlanner:
        """Build the formation planner."""
        settings = self._required(self.planner, "planner")
        task = self._subtask(stack, settings.subtask, "planner")
        return FormationPlanner(settings, self.formations, task.layout)

    @staticmethod
    def _required(block: Any, name: str) -> Any:
        if block is None:
            raise ScenarioError(name, "nothing", "a block of that name (required)")
        return block

    @staticmethod
    def _subtask(stack: SubtaskStack, subtask: str, block: str) -> Subtask:
        """Return the subtask that a block names."""
        if subtask not in stack.names:
            raise ScenarioError(f"{block}.subtask", repr(subtask), one_of(stack.names, subtask))
        return stack.subtasks[stack.names.index(subtask)]


def join_source(subtask: str, source: str) -> str:
    """Return the name of a source of a subtask, as in topics and in `lockstep_sources`."""
    return f"{subtask}/{source}"
