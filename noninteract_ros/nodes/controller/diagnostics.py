# SPDX-License-Identifier: Apache-2.0
"""What people are told of the controller: changes in the log, its condition in /diagnostics."""

from collections import deque
from collections.abc import Iterable, Sequence

import numpy as np

from noninteract_ros.control.controller import TeamController
from noninteract_ros.control.tick import Tick
from noninteract_ros.nodes.common.node import ScenarioNode
from noninteract_ros.nodes.controller.telemetry import Telemetry
from noninteract_ros.nodes.messages.messages import Level

AGE_LIMIT = 1.0  # [s] states older than this are an error, however patient the scenario is


class ControllerDiagnostics:
    """Follows the ticks and says what changed and how things are.

    Args:
        node: The controller's node.
        core: The controller.
        telemetry: What is published of it.

    Attributes:
        cycle_times: How long the last answers took [s].
        problem: Why the team is held still, or an empty text.
        changed: Parameters that were changed since the start.
    """

    def __init__(self, node: ScenarioNode, core: TeamController, telemetry: Telemetry) -> None:
        self._node, self._core, self._telemetry = node, core, telemetry
        self._age_limit = max(AGE_LIMIT, node.scenario.general.state_timeout)
        self._restart = ""
        self._silent: dict[str, bool] = {}
        self._conditions: list[str] = []
        self.cycle_times: deque[float] = deque(maxlen=1000)
        self.problem = ""
        self.changed: set[str] = set()

    def note(self, now: float, tick: Tick) -> None:
        """Logs what changed: a new start, a source that went silent or came back, limits."""
        logger = self._node.get_logger()
        conditions = self._telemetry.safety.conditions(now)
        if conditions != self._conditions:
            self._conditions = conditions
            logger.warning("; ".join(conditions) or "within all limits again")
        if tick.restarted:
            self._restart = tick.restarted
            logger.info(f"every subtask holds where it is: {tick.restarted}")
        silent = {name: led.silent for name, led in zip(self._core.inputs, tick.led, strict=True)}
        for name, is_silent in silent.items():
            if is_silent != self._silent.get(name, is_silent):
                source = self._core.inputs[name].authority
                text = "is silent: the subtask holds" if is_silent else "speaks again"
                logger.info(f"{name}: {source} {text}")
        self._silent = silent

    def status(
        self,
        now: float,
        age: float | None,
        standing: str,
        waiting: Sequence[str],
        absent: Iterable[str],
    ) -> tuple[Level, str, dict[str, object]]:
        """Level, sentence and values for /diagnostics.

        Args:
            now: The team's time [s].
            age: Age of its newest state in wall time [s]; None before the first one.
            standing: Why the team's time stands on purpose, or an empty text.
            waiting: What the tick has been waiting for so long that it is worth a word; before
                the first state, robots that have not spoken.
            absent: Lockstep sources that were given up.
        """
        values = self._values(now, float("inf") if age is None else age)
        if age is None:
            whom = ", ".join(waiting) or "the team"
            return Level.WARN, f"waiting for the first state of {whom}", values
        if age > self._age_limit and not standing:
            return Level.ERROR, "holding: no states of the team", values
        if self.problem:
            return Level.ERROR, f"holding: {self.problem}", values
        if problem := self._telemetry.problem():
            return Level.ERROR, problem, values
        if self._core.mode.stopped:
            return Level.WARN, "stopped", values
        if standing:
            return Level.WARN, f"waiting: {standing}", values
        if waiting:
            return Level.WARN, f"waiting for {', '.join(waiting)}", values
        if absent:
            return Level.WARN, f"running without {', '.join(sorted(absent))}", values
        if conditions := self._telemetry.safety.conditions(now):
            return Level.WARN, "; ".join(conditions), values
        if (progress := self._core.springs_waiting) is not None:
            text = f"stiffer springs wait for energy: {100.0 * progress:.0f} % of the change made"
            return Level.WARN, text, values
        silent_ones = [name for name, is_silent in self._silent.items() if is_silent]
        if silent_ones:
            return Level.WARN, f"holding {', '.join(silent_ones)}: source silent", values
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
        return values | self._telemetry.condition()
