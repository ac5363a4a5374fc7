# SPDX-License-Identifier: Apache-2.0
"""Controller diagnostics: changes in the log, status in `/diagnostics`."""

from collections import deque
from collections.abc import Iterable, Sequence

import numpy as np

from noninteract_ros.control.controller import TeamController
from noninteract_ros.control.tick import Tick
from noninteract_ros.nodes.common.node import ScenarioNode
from noninteract_ros.nodes.controller.telemetry import Telemetry
from noninteract_ros.nodes.messages.messages import Level

MIN_AGE_LIMIT = 1.0  # [s] lower bound of the state age that is an error


class ControllerDiagnostics:
    """Log lines and status of the controller node.

    Args:
        node: Controller node.
        core: Controller.
        telemetry: Telemetry of the controller.

    Attributes:
        cycle_times: Computation times of the last ticks [s].
        problem: Reason why the team is held, or "".
        stop_reason: Reason why the team was stopped without a request, or "".
        changed: Names of parameters changed since the start.
    """

    def __init__(self, node: ScenarioNode, core: TeamController, telemetry: Telemetry) -> None:
        self._node, self._core, self._telemetry = node, core, telemetry
        self._age_limit = max(MIN_AGE_LIMIT, node.scenario.general.state_timeout)
        self._restart = ""
        self._silent: dict[str, bool] = {}
        self._warnings: list[str] = []
        self.cycle_times: deque[float] = deque(maxlen=1000)
        self.problem = self.stop_reason = ""
        self.changed: set[str] = set()

    def update(self, now: float, tick: Tick) -> None:
        """Log what has changed: limits, restarts, sources that time out or return.

        Args:
            now: Time of the team [s].
            tick: Result of the last tick.
        """
        logger = self._node.get_logger()
        warnings = self._telemetry.safety.conditions(now)
        if warnings != self._warnings:
            self._warnings = warnings
            logger.warning("; ".join(warnings) or "all limits respected again")
        if tick.restarted:
            self._restart = tick.restarted
            logger.info(f"restarted, all subtasks hold: {tick.restarted}")
        silent = {name: led.silent for name, led in zip(self._core.inputs, tick.led, strict=True)}
        for name, is_silent in silent.items():
            if is_silent != self._silent.get(name, is_silent):
                source = self._core.inputs[name].authority
                text = "is silent, holding" if is_silent else "is active again"
                logger.info(f"{name}: source {source} {text}")
        self._silent = silent

    def status(
        self,
        now: float,
        age: float | None,
        team_status: str,
        waiting: Sequence[str],
        absent: Iterable[str],
    ) -> tuple[Level, str, dict[str, object]]:
        """Return level, message and values for `/diagnostics`.

        Args:
            now: Time of the team [s].
            age: Age of the newest state in wall time [s]; None before the first one.
            team_status: Reason why the team sends no states on purpose, or "".
            waiting: Inputs that the tick has waited for longer than the minimum reported wait;
                before the first state, robots without a state.
            absent: Lockstep sources that have timed out.
        """
        values = self._values(now, float("inf") if age is None else age)
        if age is None:
            missing = ", ".join(waiting) or "the team"
            return Level.WARN, f"waiting for the first state of {missing}", values
        if age > self._age_limit and not team_status:
            return Level.ERROR, "holding: no states from the team", values
        if self.problem:
            return Level.ERROR, f"holding: {self.problem}", values
        if problem := self._telemetry.problem():
            return Level.ERROR, problem, values
        if self._core.mode.stopped and self.stop_reason:
            return Level.ERROR, f"stopped: {self.stop_reason}", values
        if self._core.mode.stopped:
            return Level.WARN, "stopped", values
        if team_status:
            return Level.WARN, f"waiting: {team_status}", values
        if waiting:
            return Level.WARN, f"waiting for {', '.join(waiting)}", values
        if absent:
            return Level.WARN, f"running without {', '.join(sorted(absent))}", values
        if warnings := self._telemetry.safety.conditions(now):
            return Level.WARN, "; ".join(warnings), values
        if (progress := self._core.springs_waiting) is not None:
            text = f"stiffness ramp limited by the energy tank: {100.0 * progress:.0f} % done"
            return Level.WARN, text, values
        silent = [name for name, is_silent in self._silent.items() if is_silent]
        if silent:
            return Level.WARN, f"holding {', '.join(silent)}: source silent", values
        return Level.OK, "running", values

    def _values(self, now: float, age: float) -> dict[str, object]:
        values: dict[str, object] = {
            "law": self._core.mode.law,
            "time [s]": now,
            "state age [s]": age,
            "last start": self._restart or "none",
            "changed parameters": ", ".join(sorted(self.changed)) or "none",
        }
        if self.cycle_times:
            times = 1e6 * np.array(self.cycle_times)
            values["cycle time, median [us]"] = float(np.median(times))
            values["cycle time, maximum [us]"] = float(times.max())
        for name, item in self._core.inputs.items():
            silent = self._silent.get(name, False)
            values[f"{name} led by"] = item.authority + (", silent" if silent else "")
        return values | self._telemetry.values()
