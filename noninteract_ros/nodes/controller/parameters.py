# SPDX-License-Identifier: Apache-2.0
"""Law, gains and authority as parameters that may be changed while the controller runs."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.parameter import Parameter

from noninteract_ros.arrays import Array
from noninteract_ros.control.controller import TeamController
from noninteract_ros.control.law.impedance import ImpedanceSettings, stack_impedance
from noninteract_ros.control.stability.loop_guard import LoopGuard
from noninteract_ros.errors import ScenarioError
from noninteract_ros.nodes.common.node import ScenarioNode
from noninteract_ros.schema import convert

JUDGED = 100  # coordinates; of more, eigenvalues would keep whoever asks for a change waiting


class LiveParameters:
    """Checks a change when it is asked for, and has the loop take it before its next tick.

    Args:
        node: The controller's node.
        core: The controller.
        post: Has the thread of the core run something.
        changed: Takes the names of parameters that were changed.
        configuration: Where the team is, shape (nq,); None, while that is not known.
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
        self._following = False
        self._asked = self._done = 0  # Changes; each counted by one thread alone.
        self._rules = {
            name: (hint, rule) for name, hint, rule, _ in node.scenario.parameters() if rule.live
        }
        self._impedances = {name: spec.impedance for name, spec in node.scenario.subtasks.items()}
        self._law, self._tank = node.scenario.general.law, node.scenario.tank
        self._configuration = configuration
        self._guard = self._own_guard()
        node.add_on_set_parameters_callback(self._on_set)

    def _own_guard(self) -> LoopGuard | None:
        """With a team of its own: parameters are set in another thread than the loop's."""
        scenario = self._node.scenario
        if self._core.team.n > JUDGED:
            return None
        team = scenario.build_team()
        return LoopGuard(team, scenario.build_stack(team), scenario.general.rate)

    def _on_set(self, parameters: list[Parameter]) -> SetParametersResult:
        """Takes all changes or none; the reason names what is allowed."""
        if self._following:
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
                    self._plan(parameter.name, parameter.value, impedances, changes)
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
        self._asked += 1
        self._post(partial(self._run_all, changes))
        return SetParametersResult(successful=True)

    def _objection(self, law: str, impedances: dict[str, ImpedanceSettings]) -> str:
        """Why the sampled loop of law and gains would diverge here, or an empty text.

        Raises:
            ScenarioError: Gains do not fit their subtask.
        """
        subtasks = self._core.stack.subtasks
        wanted = stack_impedance(subtasks, list(impedances.values()))
        if self._guard is None or (law, impedances) == (self._law, self._impedances):
            return ""
        in_force = stack_impedance(subtasks, list(self._impedances.values()))
        q = self._configuration()
        q = self._core.team.q0 if q is None else q
        return self._guard.rejection(q, (law, wanted), (self._law, in_force))

    def follow_authority(self) -> None:
        """Has the parameters tell who leads, where it is not who was last asked for."""
        if self._asked != self._done:
            return
        for name, item in self._core.inputs.items():
            leads = item.authority
            if self._authorities[name] == leads:
                continue
            self._authorities[name] = leads
            self._following = True
            try:
                self._node.set_parameters([Parameter(f"{name}.authority", value=leads)])
            finally:
                self._following = False

    def _plan(
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

    def _run_all(self, changes: list[Callable[[], None]]) -> None:
        """Changes that were asked for together begin at the same tick."""
        for change in changes:
            change()
        self._done += 1
