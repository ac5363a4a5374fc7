# SPDX-License-Identifier: Apache-2.0
"""Part `law` of `noninteract bench`: the law, the controller's step, and their baseline."""

from itertools import cycle

import numpy as np
import pinocchio as pin

from noninteract_ros.control.evaluator import make_evaluator
from noninteract_ros.control.fast.compiled_layout import CompiledLayout
from noninteract_ros.control.law.decoupling import TaskError, commanded_acceleration
from noninteract_ros.control.references.inputs import SOURCES
from noninteract_ros.subtasks.reference import Reference
from noninteract_ros.validation.benchmarks.bench import BenchCase, Row, Timed, time_alternately


class LawAlone:
    """The law alone, from state, references and gains to torque."""

    def __init__(self, case: BenchCase) -> None:
        scenario = case.scenario
        team = scenario.build_team()
        stack = scenario.build_stack(team)
        self._mode = scenario.build_controller(team, stack).mode
        self._evaluator = make_evaluator(team, stack)
        self._layout = CompiledLayout(stack.layout)
        history = case.history
        self._rows = cycle(list(zip(history.q, history.v, history.desired, strict=True)))
        self._zeros = np.zeros(team.n)

    def prepare(self) -> None:
        """Select the next state and its references."""
        self._q, self._v, self._desired = next(self._rows)

    def run(self) -> None:
        """Compute team terms, values and Jacobians, errors, decoupling, impedance and torque."""
        zeros, impedance = self._zeros, self._mode.impedance
        terms = self._evaluator.evaluate(self._q, self._v, impedance.inertias)
        dynamics, v = terms.dynamics, terms.state.v
        e = self._layout.difference(terms.task.x, self._desired)
        error = TaskError(e, dynamics.velocity(v) - zeros, zeros, zeros, zeros)
        acceleration = commanded_acceleration(self._mode.law, dynamics, error, impedance)
        dynamics.torque(v, dynamics.joint_acceleration(v, acceleration))


class LawCycle:
    """`TeamController.step` with a new reference of each leading source per tick."""

    def __init__(self, case: BenchCase) -> None:
        scenario = case.scenario
        team = scenario.build_team()
        self._stack = scenario.build_stack(team)
        self._core = scenario.build_controller(team, self._stack)
        self._rate = scenario.general.rate
        history = case.history
        self._rows = cycle(list(zip(history.q, history.v, history.desired, strict=True)))
        self._tick = -1

    def prepare(self) -> None:
        """Select the next state and its references."""
        self._tick += 1
        self._now = self._tick / self._rate
        self._q, self._v, desired = next(self._rows)
        for task, part in zip(self._stack.subtasks, self._stack.value_slices, strict=True):
            task_input = self._core.inputs[task.name]
            if task_input.authority in SOURCES:
                rest = np.zeros(task.dim)
                reference = Reference(desired[part], rest, rest)
                task_input.sources[task_input.authority].receive(self._now, reference, self._now)

    def run(self) -> None:
        """Run one step."""
        self._core.step(self._now, self._q, self._v)


class PinocchioTerms:
    """Baseline of the law: M, C, g, Jacobians and inverse dynamics of Pinocchio."""

    def __init__(self, case: BenchCase) -> None:
        self._model = case.scenario.build_team().model
        self._data = self._model.createData()
        self._rows = cycle(list(zip(case.history.q, case.history.v, strict=True)))

    def prepare(self) -> None:
        """Select the next state."""
        self._q, self._v = next(self._rows)

    def run(self) -> None:
        """Compute all terms once."""
        model, data = self._model, self._data
        pin.computeAllTerms(model, data, self._q, self._v)
        pin.computeCoriolisMatrix(model, data, self._q, self._v)
        pin.rnea(model, data, self._q, self._v, self._v)


def law_rows(name: str, case: BenchCase, count: int) -> list[Row]:
    """Time the law, the whole step, and their baseline on a scenario's team."""
    law, step, terms = (f"{task}, {name}" for task in ("law", "whole step", "Pinocchio's terms"))
    tasks: dict[str, Timed] = {
        law: LawAlone(case),
        step: LawCycle(case),
        terms: PinocchioTerms(case),
    }
    times = time_alternately(tasks, count)
    rows = [Row("law", task, times[task], terms) for task in (law, step)]
    return [*rows, Row("law", terms, times[terms])]
