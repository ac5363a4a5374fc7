# SPDX-License-Identifier: Apache-2.0
"""Closed-form dynamics (29) of each decoupled subtask, compared with the recording.

For point masses M_i is constant and C~_i zero: M_i e'' + D_i e' + h_i(e) = tau~_i, where tau~_i is
the force of the scenario's object and pushes. A run that deviates by more than the effect of the
zero-order hold did not follow this law.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp

from noninteract_ros.arrays import Array
from noninteract_ros.control.law.decoupling import DECOUPLING_LAWS, TaskDynamics, task_dynamics
from noninteract_ros.control.law.impedance import stack_impedance
from noninteract_ros.reporting.checks.checks import Check, at_most, not_applicable
from noninteract_ros.reporting.metrics import intervals
from noninteract_ros.reporting.metrics.influences import CHANGE, MOTION, Influence
from noninteract_ros.reporting.metrics.storage_functions import storage_balance
from noninteract_ros.reporting.recording.recorded import FRICTION, Recorded, RecordedMotion, select
from noninteract_ros.simulation.subtask_object import SIGNS
from noninteract_ros.team.team import TeamState

# [m] at 1 kHz for errors up to 1 m: the effect of the zero-order hold is of first order in the
# tick, and the equations are linear (a saturating potential only weakens them).
LIMIT = 2e-3
RTOL, ATOL = 1e-10, 1e-12
SPACING = 0.005  # [s] smallest spacing of references at which rounding spoils no quintic


@dataclass(frozen=True)
class ClosedForm:
    """Prediction of (29) for one subtask while it is led.

    Attributes:
        start: Time at which it is first led [s].
        inertia: M_i, shape (p, p) [kg].
        t: Times of the compared states, shape (n,) [s].
        deviation: Recorded minus predicted, shape (n, p) [m].
        largest_error: Largest predicted error of a coordinate [m].
    """

    start: float
    inertia: Array
    t: Array
    deviation: Array
    largest_error: float


class NotApplicableError(Exception):
    """The closed form does not apply to this run; the message gives the reason."""


class DesiredPath:
    """Piecewise quintic through position, velocity and acceleration.

    Args:
        motion: At least two points.
    """

    def __init__(self, motion: RecordedMotion) -> None:
        self._t = motion.t
        h = np.diff(motion.t)[:, None]
        x, v, a = motion.position, motion.velocity, motion.acceleration
        gap = x[1:] - (x[:-1] + h * (v[:-1] + 0.5 * h * a[:-1]))
        rate = h * (v[1:] - (v[:-1] + h * a[:-1]))
        bend = h * h * (a[1:] - a[:-1])
        self._coefficients = np.stack(
            [
                x[:-1],
                v[:-1],
                0.5 * a[:-1],
                (10.0 * gap - 4.0 * rate + 0.5 * bend) / h**3,
                (-15.0 * gap + 7.0 * rate - bend) / h**4,
                (6.0 * gap - 3.0 * rate + 0.5 * bend) / h**5,
            ]
        )

    def __call__(self, t: Array | float) -> tuple[Array, Array, Array]:
        """Return position, velocity and acceleration at t, shape (..., p) each."""
        row = np.clip(np.searchsorted(self._t, t, side="right") - 1, 0, len(self._t) - 2)
        s = np.asarray(t - self._t[row])[..., None]
        c0, c1, c2, c3, c4, c5 = self._coefficients[:, row]
        return (
            c0 + s * (c1 + s * (c2 + s * (c3 + s * (c4 + s * c5)))),
            c1 + s * (2 * c2 + s * (3 * c3 + s * (4 * c4 + s * 5 * c5))),
            2 * c2 + s * (6 * c3 + s * (12 * c4 + s * 20 * c5)),
        )


class ErrorDynamics:
    """Error dynamics (29) of one subtask of a team of point masses.

    Args:
        recorded: Scenario and team.
        subtask: Name of the subtask.
    """

    def __init__(self, recorded: Recorded, subtask: str) -> None:
        self._part, self._team = recorded.part(subtask), recorded.team
        self._pushes = recorded.scenario.pushes.values()
        settings = [spec.impedance for spec in recorded.scenario.subtasks.values()]
        self._impedance = stack_impedance(recorded.stack.subtasks, settings)
        self._state = self._team.state(self._team.q0, np.zeros(self._team.n))
        dynamics = _dynamics(recorded, self._state)
        self.inertia = dynamics.inertias[recorded.stack.names.index(subtask)]
        # An object at subtask level acts through the natural inertia, whatever the desired M_i.
        self._compliance = np.linalg.inv(dynamics.inertia[self._part, self._part])
        self._of_push = dynamics.J[self._part] @ np.linalg.inv(dynamics.M)
        held = recorded.scenario.held
        carries, grasps = (
            (held.carried_by == subtask, held.grasped_by == subtask) if held else (False, False)
        )
        sign = SIGNS[held.sign] if held else 0.0
        self._mass = sign * held.mass if held and carries else 0.0
        self._stiffness = sign * held.stiffness if held and grasps else 0.0
        self._rest = np.array(held.rest) if held and self._stiffness else 0.0
        # (1 - m M_i^-1) x'' = all other terms: the object's mass acts on the acceleration.
        self._share = np.linalg.inv(np.eye(len(self.inertia)) - self._mass * self._compliance)

    def push(self, t: float) -> Array:
        """Return the acceleration due to scheduled pushes at a tick, shape (p,) [m/s^2]."""
        wrenches = np.zeros((len(self._team.names), 6))
        for push in self._pushes:
            wrenches[self._team.index(push.robot)] += push.wrench(t)
        return self._of_push @ self._team.external_torque(self._state, wrenches)

    def solve(self, path: DesiredPath, t: Array, x: Array, x_rate: Array) -> Array:
        """Integrate the errors over times t from x and x_rate at t[0], shape (n, p)."""
        desired, desired_rate, _ = path(t[0])
        state = np.concatenate((x - desired, x_rate - desired_rate))
        pushes = np.array([self.push(now) for now in t])
        changes = np.flatnonzero((pushes[1:] != pushes[:-1]).any(axis=1)) + 1
        segments = []
        for first, last in pairwise([0, *changes.tolist(), len(t) - 1]):
            solution = solve_ivp(
                lambda now, y, push=pushes[first]: self._rates(path, now, y, push),
                (t[first], t[last]),
                state,
                method="DOP853",
                t_eval=t[first : last + 1],
                rtol=RTOL,
                atol=ATOL,
            )
            state = solution.y[:, -1]
            segments.append(solution.y.T[: last - first])
        return np.concatenate([*segments, state[None]])[:, : len(x)]

    def _rates(self, path: DesiredPath, t: float, y: Array, push: Array) -> Array:
        e, e_rate = np.split(y, 2)
        desired, _, desired_acceleration = path(t)
        whole = np.zeros(self._team.n)
        whole[self._part] = e
        pull = self._impedance.force(whole)[self._part]
        pull = pull + self._impedance.damping[self._part] * e_rate
        strain = self._stiffness * (e + desired - self._rest)
        wanted = desired_acceleration - np.linalg.solve(self.inertia, pull)
        acceleration = self._share @ (wanted + self._compliance @ strain + push)
        return np.concatenate((e_rate, acceleration - desired_acceleration))


def _dynamics(recorded: Recorded, state: TeamState) -> TaskDynamics:
    settings = [spec.impedance for spec in recorded.scenario.subtasks.values()]
    inertias = stack_impedance(recorded.stack.subtasks, settings).inertias
    return task_dynamics(state, recorded.stack.evaluate(state), recorded.stack.slices, inertias)


def closed_form(recorded: Recorded, subtask: str, external: list[Influence]) -> ClosedForm:
    """Compare one subtask with its closed form wherever it is led without interruption.

    Raises:
        NotApplicableError: The closed form does not apply to this run.
    """
    _require(recorded, subtask, external)
    dynamics = ErrorDynamics(recorded, subtask)
    x, x_rate = (values[:, recorded.part(subtask)] for values in recorded.values)
    times, deviations, largest = [], [], 0.0
    for motion in _led_motions(recorded, subtask):
        first, last = np.searchsorted(recorded.t, motion.t[[0, -1]] + [-1e-9, 1e-9])
        if last - first < 2:
            continue
        t = recorded.t[first:last]
        path = DesiredPath(motion)
        errors = dynamics.solve(path, t, x[first], x_rate[first])
        times.append(t)
        deviations.append(x[first:last] - path(t)[0] - errors)
        largest = max(largest, float(np.abs(errors).max()))
    if not times:
        raise NotApplicableError("no two consecutive references")
    return ClosedForm(
        start=float(times[0][0]),
        inertia=dynamics.inertia,
        t=np.concatenate(times),
        deviation=np.concatenate(deviations),
        largest_error=largest,
    )


def closed_form_check(recorded: Recorded, subtask: str, found: ClosedForm | str) -> Check:
    """Return the check of the largest deviation, or of the reason why it does not apply."""
    name, limit = f"closed_form.{subtask}", LIMIT * 1000.0 / recorded.rate
    unit = ", ".join(sorted(set(recorded.task(subtask).units)))
    if isinstance(found, str):
        return not_applicable(name, limit, unit, found)
    limit *= max(1.0, found.largest_error)
    return at_most(name, float(np.abs(found.deviation).max()), limit, unit)


def _require(recorded: Recorded, subtask: str, external: list[Influence]) -> None:
    scenario, law = recorded.scenario, recorded.scenario.general.law
    shaped = scenario.subtasks[subtask].input.takeover == "shaped"
    # Shaped motions are known from the desired motion; transitions are excluded.
    known = (MOTION, CHANGE) if shaped else ()
    concerned = [item for item in external if item.subtask in ("", subtask)]
    foreign = [item.text for item in concerned if item.kind not in known]
    on_tools = all(push.on_tool(recorded.team) for push in scenario.pushes.values())
    changed = recorded.interventions()
    reasons = {
        f"law {law} does not decouple": law not in DECOUPLING_LAWS,
        "the team's inertia is not constant": not recorded.constant,
        "wall time: ticks are not evenly spaced": not recorded.lockstep,
        f"contact with {', '.join(scenario.surroundings)}": bool(scenario.surroundings),
        "a push acts on a link, not on a tool": not on_tools,
        FRICTION: recorded.team.friction.any(),
        f"joint limits or energy gates changed the torque in {changed} ticks": changed > 0,
        f"external influence: {'; '.join(foreign)}": bool(foreign),
    }
    for reason, holds in reasons.items():
        if holds:
            raise NotApplicableError(reason)


def _led_motions(recorded: Recorded, subtask: str) -> Iterator[RecordedMotion]:
    """Yield the desired motion in segments without jumps.

    With direct takeover these are the references themselves. With shaped takeover it is the
    published desired motion, wherever a decoupling law alone determined the torques.
    """
    settings = recorded.scenario.subtasks[subtask].input
    if settings.takeover == "shaped":
        found = storage_balance(recorded, subtask)
        jumped = intervals.reference_jumps(recorded.task(subtask).layout, found.desired)
        where = found.in_force & intervals.decoupling_in_force(found.law) & ~jumped
        for first, last in intervals.segments(where):
            yield select(found.desired, slice(first, last + 1))
        return
    topic = recorded.reference_topic(subtask)
    if topic is None:
        return
    motion = recorded.motion(topic, subtask)
    motion = select(motion, np.argsort(motion.t))
    if np.isnan(motion.acceleration).any() or np.isnan(motion.velocity).any():
        raise NotApplicableError(f"references without derivatives on {topic} are shaped")
    breaks = np.flatnonzero(np.diff(motion.t) > settings.timeout) + 1
    for first, last in pairwise([0, *breaks.tolist(), len(motion.t)]):
        if last - first > 1:
            yield _thinned(select(motion, slice(first, last)))


def _thinned(motion: RecordedMotion) -> RecordedMotion:
    """Return the motion at fewer times, keeping both ends."""
    step = max(1, round(SPACING / float(np.median(np.diff(motion.t)))))
    rows = np.arange(0, len(motion.t) - 1, step)
    return select(motion, [*rows.tolist(), len(motion.t) - 1])
