# SPDX-License-Identifier: Apache-2.0
"""Live parameters of the controller: law, gains, tank and authority."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter
from std_msgs.msg import String

from noninteract_ros.arrays import Array
from noninteract_ros.control.controller import TeamController
from noninteract_ros.control.law.impedance import ImpedanceSettings, stack_impedance
from noninteract_ros.control.stability.loop_guard import LoopGuard
from noninteract_ros.errors import InputError, ScenarioError
from noninteract_ros.nodes.common.node import ScenarioNode
from noninteract_ros.schema import convert

MAX_GUARDED_COORDINATES = 100  # Eigenvalues of larger teams would block the parameter service.


class LiveParameters:
    """Parameters that may be changed while the controller runs.

    Changes are checked when they are requested, and applied before the next tick.

    Args:
        node: Controller node.
        core: Controller.
        post: Queues work for the thread of the core.
        changed: Set to which the names of changed parameters are added.
        configuration: Returns the configuration of the team, shape (nq,), or None if unknown.
    """

    def __init__(
        self,
        node: ScenarioNode,
        core: TeamController,
        post: Callable[[Callable[[], None]], None],
        changed: set[str],
        configuration: Callable[[], Array | None],
    ) -> None:
        self._node, self._core, self._post, self._changed = node, core, post, changed
        self._authorities = {name: item.authority for name, item in core.inputs.items()}
        self._syncing = False
        self._requested = self._applied = 0  # Changes; each counter is written by one thread.
        self._rules = {
            name: (hint, rule) for name, hint, rule, _ in node.scenario.parameters() if rule.live
        }
        self._impedances = {name: spec.impedance for name, spec in node.scenario.subtasks.items()}
        self._law, self._tank = node.scenario.general.law, node.scenario.tank
        self._configuration = configuration
        self._guard = self._build_guard()
        node.add_on_set_parameters_callback(self._on_set_parameters)

    def _build_guard(self) -> LoopGuard | None:
        """Return a guard with its own data, since parameters are set in another thread."""
        if self._core.team.n > MAX_GUARDED_COORDINATES:
            return None
        scenario, team = self._node.scenario, self._core.team.with_own_data()
        return LoopGuard(team, scenario.build_stack(team), scenario.general.rate)

    def _on_set_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        """Accept all changes or none; the reason of a rejection has the allowed values."""
        if self._syncing:
            return SetParametersResult(successful=True)
        impedances, tank = dict(self._impedances), self._tank
        changes: list[Callable[[], None]] = []
        try:
            for parameter in parameters:
                block, _, item = parameter.name.rpartition(".")
                if parameter.name not in self._rules:
                    continue
                if block == "tank":
                    value = convert(parameter.name, parameter.value, *self._rules[parameter.name])
                    tank = replace(tank, **{item: value})
                else:
                    self._add_change(parameter.name, parameter.value, impedances, changes)
            law = next((item.value for item in parameters if item.name == "law"), self._law)
            objection = self._objection(law, impedances)
            tank.check()
        except ScenarioError as error:
            return SetParametersResult(successful=False, reason=str(error))
        if objection:
            return SetParametersResult(successful=False, reason=objection)
        self._changed |= {item.name for item in parameters} & self._rules.keys()
        for parameter in parameters:
            subtask, _, item = parameter.name.rpartition(".")
            if item == "authority" and subtask in self._authorities:
                self._authorities[subtask] = parameter.value
        for name, settings in impedances.items():
            if settings != self._impedances[name]:
                changes.append(partial(self._core.set_impedance, name, settings))
        if tank != self._tank:
            changes.append(partial(setattr, self._core.gate, "settings", tank))
        self._law, self._impedances, self._tank = law, impedances, tank
        self._requested += 1
        self._post(partial(self._apply, changes))
        return SetParametersResult(successful=True)

    def _objection(self, law: str, impedances: dict[str, ImpedanceSettings]) -> str:
        """Return why the sampled loop with this law and these gains would diverge, or "".

        Raises:
            ScenarioError: Gains do not fit their subtask.
        """
        subtasks = self._core.stack.subtasks
        requested = stack_impedance(subtasks, list(impedances.values()))
        if self._guard is None or (law, impedances) == (self._law, self._impedances):
            return ""
        in_force = stack_impedance(subtasks, list(self._impedances.values()))
        q = self._configuration()
        q = self._core.team.q0 if q is None else q
        return self._guard.rejection(q, (law, requested), (self._law, in_force))

    def sync_authority(self) -> None:
        """Set the authority parameters to the sources in force, as after a planned hand-over."""
        if self._requested != self._applied:
            return
        for name, item in self._core.inputs.items():
            authority = item.authority
            if self._authorities[name] == authority:
                continue
            self._authorities[name] = authority
            self._syncing = True
            try:
                self._node.set_parameters([Parameter(f"{name}.authority", value=authority)])
            finally:
                self._syncing = False

    def _add_change(
        self,
        name: str,
        value: Any,
        impedances: dict[str, ImpedanceSettings],
        changes: list[Callable[[], None]],
    ) -> None:
        hint, rule = self._rules[name]
        checked = convert(name, value, hint, rule)
        subtask, _, item = name.rpartition(".")
        if item == "law":
            changes.append(partial(self._core.set_law, checked))
        elif item == "authority":
            changes.append(partial(self._core.set_authority, subtask, checked))
        else:
            impedances[subtask] = replace(impedances[subtask], **{item: checked})

    def _apply(self, changes: list[Callable[[], None]]) -> None:
        """Apply changes that were requested together at the same tick."""
        for change in changes:
            change()
        self._applied += 1


class AuthorityTopics:
    """Subscriptions to `<subtask>/authority`, which set the parameter of that name.

    For programs that do not call services. The parameter stays the only record of the authority.

    Args:
        node: Controller node, with its parameters declared.
        subtasks: Names of the subtasks.
    """

    def __init__(self, node: ScenarioNode, subtasks: Iterable[str]) -> None:
        self._node = node
        for name in subtasks:
            node.subscribe(String, f"{name}/authority", partial(self._on_authority, name))

    def _on_authority(self, subtask: str, message: String) -> None:
        requested = Parameter(f"{subtask}.authority", value=message.data)
        (result,) = self._node.set_parameters([requested])
        if not result.successful:
            raise InputError(result.reason)
