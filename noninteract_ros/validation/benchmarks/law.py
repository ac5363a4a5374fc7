# SPDX-License-Identifier: Apache-2.0
"""The part `law` of `noninteract bench`: the law alone, the controller's step, and their floor."""

from itertools import cycle

import numpy as np
import pinocchio as pin

from noninteract_ros.control.evaluator import make_evaluator
from noninteract_ros.control.fast.compiled_layout import CompiledLayout
from noninteract_ros.control.law.decoupling import TaskError, commanded_acceleration
from noninteract_ros.control.references.inputs import SOURCES
from noninteract_ros.subtasks.reference import Reference
from noninteract_ros.validation.benchmarks.bench import BenchCase, Row, Timed, take_turns


class LawAlone:
    """From state, references and gains to torque, and nothing else."""

    def __init__(self, material: BenchCase) -> None:
        scenario = material.scenario
        team = scenario.build_team()
        stack = scenario.build_stack(team)
        self._mode = scenario.build_controller(team, stack).mode
        self._view = make_evaluator(team, stack)
        self._layout = CompiledLayout(stack.layout)
        history = material.history
        self._rows = cycle(list(zip(history.q, history.v, history.desired, strict=True)))
        self._still = np.zeros(team.n)

    def prepare(self) -> None:
        """The next state and its references."""
        self._q, self._v, self._desired = next(self._rows)

    def run(self) -> None:
        """Team terms, values and Jacobians, errors, decoupling, impedance, torque."""
        still, impedance = self._still, self._mode.impedance
        seen = self._view.evaluate(self._q, self._v, impedance.inertias)
        dynamics, v = seen.dynamics, seen.state.v
        e = self._layout.difference(seen.task.x, self._desired)
        error = TaskError(e, dynamics.velocity(v) - still, still, still, still)
        wanted = commanded_acceleration(self._mode.law, dynamics, error, impedance)
        dynamics.torque(v, dynamics.joint_acceleration(v, wanted))


class LawCycle:
    """`TeamController.step`, all sources in force speaking at each tick."""

    def __init__(self, material: BenchCase) -> None:
        scenario = material.scenario
        team = scenario.build_team()
        self._stack = scenario.build_stack(team)
        self._core = scenario.build_controller(team, self._stack)
        self._rate = scenario.general.rate
        history = material.history
        self._rows = cycle(list(zip(history.q, history.v, history.desired, strict=True)))
        self._tick = -1

    def prepare(self) -> None:
        """The next state and its references."""
        self._tick += 1
        self._now = self._tick / self._rate
        self._q, self._v, desired = next(self._rows)
        for task, part in zip(self._stack.subtasks, self._stack.value_slices, strict=True):
            heard = self._core.inputs[task.name]
            if heard.authority in SOURCES:
                still = np.zeros(task.dim)
                reference = Reference(desired[part], still, still)
                heard.sources[heard.authority].receive(self._now, reference, self._now)

    def run(self) -> None:
        """One step."""
        self._core.step(self._now, self._q, self._v)


class PinocchioTerms:
    """The floor of the law: M, C, g, Jacobians and inverse dynamics by Pinocchio itself."""

    def __init__(self, material: BenchCase) -> None:
        self._model = material.scenario.build_team().model
        self._data = self._model.createData()
        self._rows = cycle(list(zip(material.history.q, material.history.v, strict=True)))

    def prepare(self) -> None:
        """The next state."""
        self._q, self._v = next(self._rows)

    def run(self) -> None:
        """All terms once."""
        model, data = self._model, self._data
        pin.computeAllTerms(model, data, self._q, self._v)
        pin.computeCoriolisMatrix(model, data, self._q, self._v)
        pin.rnea(model, data, self._q, self._v, self._v)


def law_rows(name: str, material: BenchCase, count: int) -> list[Row]:
    """The law on a scenario's team, the whole step, and the floor of both."""
    law, step, terms = (f"{what}, {name}" for what in ("law", "whole step", "Pinocchio's terms"))
    things: dict[str, Timed] = {
        law: LawAlone(material),
        step: LawCycle(material),
        terms: PinocchioTerms(material),
    }
    times = take_turns(things, count)
    floored = [Row("law", thing, times[thing], terms) for thing in (law, step)]
    return [*floored, Row("law", terms, times[terms])]
