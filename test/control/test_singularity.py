# SPDX-License-Identifier: Apache-2.0
"""Near singularities: continuous, bounded, out again by itself; and states that jump there."""

import numpy as np
import pytest

from noninteract_ros.control.controller import TeamController
from noninteract_ros.control.law.decoupling import LAWS
from noninteract_ros.control.law.impedance import ImpedanceSettings
from noninteract_ros.control.references.inputs import Rate
from noninteract_ros.control.references.subtask_input import InputSettings
from noninteract_ros.control.safety.settings import SafetySettings
from noninteract_ros.control.safety.singularity import (
    SingularityGuard,
    best_regularity,
    regularity,
)
from noninteract_ros.simulation.plant import Plant
from noninteract_ros.simulation.team_simulation import TeamSimulation
from noninteract_ros.subtasks.kinds.cooperative_position import CooperativePosition
from noninteract_ros.subtasks.kinds.relative_position import RelativePosition
from noninteract_ros.subtasks.reference import Reference
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.models.planar_arm import PlanarArm
from noninteract_ros.team.team import Team

STEP = 1e-3
BENT = ((1.9, -1.6), (1.3, 1.6))
SETTINGS = SafetySettings()


def team(count: int = 2, start: tuple = BENT, **keys) -> Team:
    """Unlike planar arms side by side."""
    arms = [
        PlanarArm(
            (0.5, 0.5),
            (1.0 + 2.0 * k, 1.0 + k),
            initial_position=start[k % len(start)],
            base_pose=(1.2 * k - 0.6, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0),
            **keys,
        )
        for k in range(count)
    ]
    return Team([arm.build(f"arm_{k}") for k, arm in enumerate(arms)])


def stack_of(given: Team) -> SubtaskStack:
    kinds = CooperativePosition("cooperative_position"), RelativePosition("relative_position")
    names = ("cooperative", "relative")
    return SubtaskStack(
        given, [kind.build(name, given) for kind, name in zip(kinds, names, strict=True)]
    )


def controller(given: Team, law: str = "noninteracting", **keys) -> TeamController:
    impedances = [ImpedanceSettings((300.0,), (120.0,)), ImpedanceSettings((900.0,), (90.0,))]
    inputs = [InputSettings("human", takeover="direct"), InputSettings("autonomy")]
    return TeamController(given, stack_of(given), law, impedances, inputs, **keys)


class SingularityLoop:
    """A team with its controller at 1 kHz, its mean led to and fro by the human."""

    def __init__(self, given: Team, law: str = "noninteracting", **keys) -> None:
        self.controller = controller(given, law, **keys)
        self.simulation = TeamSimulation(Plant(given), 1.0 / STEP)

    def tick(self, target: np.ndarray | None = None):
        now = self.simulation.now
        if target is not None:
            source = self.controller.inputs["cooperative"].sources["human"]
            source.receive(now, Reference.at_rest(target), now)
        found = self.controller.step(now, self.simulation.q, self.simulation.v)
        self.simulation.step(found.torque)
        return found

    def answer(self):
        """Return the tick of the controller at the present state; call once a tick."""
        return self.controller.step(self.simulation.now, self.simulation.q, self.simulation.v)


def led(loop: SingularityLoop, ticks: int, goal: tuple[float, float]) -> list:
    """The mean led from where it is to a goal, smoothly."""
    start = loop.controller.stack.evaluate(
        loop.controller.team.state(loop.simulation.q, loop.simulation.v)
    ).x[:2]
    ramp = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, ticks + 1) / ticks)
    return [loop.tick(start + r * (np.array(goal) - start)) for r in ramp]


def test_regularity_is_a_lower_bound_of_the_smallest_singular_value():
    """And no less than it over sqrt(n); zero of what is no matrix of numbers."""
    rng = np.random.default_rng(0)
    for _ in range(50):
        J = rng.uniform(-1.0, 1.0, (5, 5))
        smallest = np.linalg.svd(J, compute_uv=False)[-1]
        found = regularity(np.linalg.inv(J))
        assert smallest / np.sqrt(5.0) <= found <= smallest
    for bad in (np.nan, np.inf):
        assert regularity(np.array([[1.0, bad], [0.0, 1.0]])) == 0.0


def test_the_measure_does_not_depend_on_where_a_team_starts():
    """A team that starts stretched knows as well as another how regular it can be."""
    best = best_regularity(team(), stack_of(team()))
    stretched = team(start=((0.3, 0.0), (0.4, 0.0)))
    assert best_regularity(stretched, stack_of(stretched)) == pytest.approx(best, rel=0.2)


def test_the_measure_is_taken_within_joint_limits():
    """Joints that cannot bend make a team less regular than joints that can."""
    stiff = team(start=((1.0, 0.1), (1.0, 0.1)), lower_limit=(-3.0, 0.0), upper_limit=(3.0, 0.2))
    assert best_regularity(stiff, stack_of(stiff)) < 0.3 * best_regularity(
        team(), stack_of(team())
    )


def test_the_law_s_share_is_smooth():
    """1 from the first threshold on, 0 below the second, without a step or a kink."""
    guard = SingularityGuard(team(), SETTINGS, 1.0)
    at = np.arange(0.0, 0.5, 1e-5)
    shares = np.array([guard.law_share(value) for value in at])
    assert (shares[at >= 0.3] == 1.0).all()
    assert (shares[at <= 0.1] == 0.0).all()
    slopes = np.diff(shares) / 1e-5
    assert (slopes >= 0.0).all()
    assert np.abs(np.diff(slopes)).max() < 0.01


def through_a_singularity(law: str, step: float) -> tuple[np.ndarray, np.ndarray]:
    """Torques and shares of the law while one elbow goes from bent to bent the other way."""
    core = controller(team(), law)
    torques, shares = [], []
    for k, bend in enumerate(np.arange(-1.6, 1.6, step)):
        q, now = core.team.q0.copy(), k * STEP
        q[1] = bend
        source = core.inputs["cooperative"].sources["human"]
        source.receive(now, Reference.at_rest(np.array([0.1, 0.8])), now)
        tick = core.step(now, q, np.array([0.0, 0.5, 0.0, 0.0]))
        assert not tick.restarted or k == 0
        torques.append(tick.torque)
        shares.append(tick.law_share)
    return np.array(torques[1:]), np.array(shares[1:])


@pytest.mark.parametrize("law", LAWS)
def test_torque_is_continuous_along_a_path_through_a_singularity(law):
    """Half the way between states has half the change, and nothing is larger than elsewhere."""
    steps = []
    for step in (2e-3, 1e-3, 5e-4):
        torques, shares = through_a_singularity(law, step)
        assert np.isfinite(torques).all()
        assert np.abs(torques[shares < 1.0]).max() < np.abs(torques[shares == 1.0]).max()
        assert shares.min() == 0.0
        assert shares[0] == shares[-1] == 1.0
        steps.append(np.abs(np.diff(torques, axis=0)).max())
    assert steps[2] < 0.6 * steps[1] < 0.36 * steps[0]


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("count", [2, 3, 5])
def test_an_exactly_singular_team_gets_a_finite_torque(law, count):
    """Stretched or folded to the last bit, at rest and moving: gravity, damping, no more."""
    given = team(count)
    for bend in (0.0, np.pi):
        for speed in (0.0, 1.0):
            core = controller(given, law)
            q = np.tile([0.4, bend], count)
            v = np.full(2 * count, speed)
            tick = core.step(0.0, q, v)
            state = given.state(q, v)
            expected = state.g - SETTINGS.recovery_damping * state.M @ v
            np.testing.assert_allclose(tick.torque, expected, atol=1e-9)
            assert tick.law_share == 0.0
            energies = core.energy(tick, np.zeros(2 * count))
            assert np.isfinite([energies.storage, energies.rate]).all()


@pytest.mark.parametrize("law", LAWS)
def test_a_team_led_out_of_reach_waits_and_comes_back_by_itself(law):
    """It never turns over, holds still near the singularity, and tracks again in the end."""
    loop = SingularityLoop(team(), law)
    start = loop.tick().task.x[:2]
    ticks = led(loop, 3000, (0.0, 1.3))
    ticks += [loop.tick(np.array([0.0, 1.3])) for _ in range(1500)]
    waiting = ticks[-200:]
    assert all(0.0 <= tick.law_share < 1.0 for tick in waiting)
    assert max(np.abs(tick.state.v).max() for tick in waiting) < 0.02
    assert all(tick.state.q[1] < 0.0 < tick.state.q[3] for tick in ticks)
    ticks += led(loop, 1500, tuple(start))
    ticks += [loop.tick(start) for _ in range(2000)]
    assert ticks[-1].law_share == 1.0
    assert np.abs(ticks[-1].error.e).max() < 1e-3
    torques = np.array([tick.torque for tick in ticks])
    assert np.abs(torques).max() < 60.0
    # The largest step is that of the reference, which jumps by 0.34 m when it comes back.
    assert np.abs(np.diff(torques, axis=0)).max() < 8.0


def near_singularity(law: str = "noninteracting") -> SingularityLoop:
    """A team that the human holds out of reach, in motion."""
    loop = SingularityLoop(team(), law)
    led(loop, 1200, (0.0, 1.3))
    ticks = [loop.tick(np.array([0.0, 1.3])) for _ in range(400)]
    assert 0.0 < ticks[-1].law_share < 1.0
    return loop


def test_stop_near_a_singularity_damps_to_rest_and_lets_go():
    """After a stop nothing pulls: the team comes to rest and stays there; no torque steps."""
    loop = near_singularity()
    before = loop.tick(np.array([0.0, 1.3])).torque
    loop.controller.stop()
    ticks = [loop.tick(np.array([0.0, 1.3])) for _ in range(2500)]
    torques = np.array([before, *(tick.torque for tick in ticks)])
    assert np.abs(np.diff(torques, axis=0)).max() < 1.0
    assert np.abs(ticks[-1].state.v).max() < 1e-6
    np.testing.assert_allclose(ticks[-500].state.q, ticks[-1].state.q, atol=1e-6)


def test_resume_near_a_singularity_has_no_torque_step():
    """From a stop near a singularity the recovery comes back softly, and leads out."""
    loop = near_singularity()
    loop.controller.stop()
    ticks = [loop.tick() for _ in range(1500)]
    loop.controller.resume()
    ticks += [loop.tick() for _ in range(1500)]
    torques = np.array([tick.torque for tick in ticks[1400:]])
    assert np.abs(np.diff(torques, axis=0)).max() < 0.5
    ticks = led(loop, 1500, (0.0, 0.6)) + [loop.tick(np.array([0.0, 0.6])) for _ in range(1500)]
    assert ticks[-1].law_share == 1.0
    assert np.abs(ticks[-1].error.e[:2]).max() < 1e-2


@pytest.mark.parametrize("law", ["natural", "paper"])
def test_changes_of_law_near_a_singularity_have_no_torque_step(law):
    """The fade of a change counts by the law's share, and starts over where the law is gone."""
    same, changed = near_singularity(), near_singularity()
    changed.controller.set_law(law)
    goal = np.array([0.0, 1.3])
    np.testing.assert_allclose(changed.tick(goal).torque, same.tick(goal).torque, atol=1e-9)
    ticks = [changed.tick(goal) for _ in range(1000)]
    assert np.abs(np.diff([tick.torque for tick in ticks], axis=0)).max() < 1.0
    gone = SingularityLoop(team(start=((0.4, 0.0), (0.4, 0.0))))
    gone.tick()
    gone.controller.set_law(law)
    gone.controller.stop()
    assert np.isfinite(gone.tick().torque).all()


STRETCHED = np.array([0.4, 0.0, 2.5, 0.0])


def jumped_into_a_singularity(**keys) -> SingularityLoop:
    loop = SingularityLoop(team(), **keys)
    for _ in range(50):
        loop.tick()
    loop.simulation.q = STRETCHED.copy()
    assert "jumped" in loop.tick().restarted
    return loop


def test_a_team_put_into_a_singularity_moves_out_by_itself():
    """Softly, to where the law is almost whole again; then it can be led as ever."""
    loop = jumped_into_a_singularity()
    ticks = [loop.tick() for _ in range(2500)]
    assert ticks[0].law_share == 0.0
    assert ticks[-1].law_share > 0.8
    torques = np.array([tick.torque for tick in ticks])
    speeds = np.array([tick.state.v for tick in ticks])
    assert np.abs(np.diff(torques, axis=0)).max() < 0.05 * np.abs(torques).max()
    assert np.abs(speeds).max() < 2.0
    assert np.abs(ticks[-1].state.v).max() < 0.05
    assert led(loop, 2500, (0.0, 0.2))[-1].law_share == 1.0
    rest = [loop.tick(np.array([0.0, 0.2])) for _ in range(2500)]
    np.testing.assert_allclose(rest[-1].task.x[:2], [0.0, 0.2], atol=1e-3)


def test_a_team_that_starts_in_a_singularity_can_be_led():
    """It need not have been regular before, and finds the same way in every run."""
    runs = []
    for _ in range(2):
        loop = SingularityLoop(team(start=((0.4, 0.0), (2.5, 0.0))))
        for _ in range(500):
            loop.tick()
        runs.append(led(loop, 2500, (0.0, 0.2)))
        assert runs[-1][-1].law_share == 1.0
    first, second = ([tick.torque for tick in run] for run in runs)
    np.testing.assert_array_equal(first, second)


def test_a_stop_ends_the_way_out():
    """After a stop nothing leads out: the team comes to rest."""
    loop = jumped_into_a_singularity()
    for _ in range(100):
        loop.tick()
    loop.controller.stop()
    for _ in range(1000):
        last = loop.tick()
    assert np.abs(last.state.v).max() < 1e-4


def test_the_way_out_stays_within_joint_limits():
    """A joint at its limit is not led beyond it, whatever would be more regular there."""
    given = team(start=((0.4, 0.0), (2.5, 0.0)), lower_limit=(-3.0, -0.02), upper_limit=(3.0, 0.4))
    loop = SingularityLoop(given)
    q = np.array([loop.tick().state.q for _ in range(1000)])
    assert q[:, [1, 3]].min() > -0.02
    assert q[:, [1, 3]].max() <= 0.4
    assert q[-1, [1, 3]].min() > 0.05


def test_a_team_put_into_a_singularity_is_held_where_it_may_not_move_out():
    """Without the escape the team stands where it was put."""
    loop = SingularityLoop(team(), safety=SafetySettings(singularity_escape=False))
    for _ in range(50):
        loop.tick()
    loop.simulation.q = np.array([0.4, 0.0, 2.5, 0.0])
    first = loop.tick()
    assert "jumped" in first.restarted
    ticks = [loop.tick() for _ in range(500)]
    assert all(tick.law_share == 0.0 for tick in ticks)
    np.testing.assert_allclose(ticks[-1].state.q, [0.4, 0.0, 2.5, 0.0], atol=1e-9)


def test_a_jump_out_of_a_singularity_starts_anew():
    """Put back into a regular place, the law is in force at once, and holds there."""
    loop = near_singularity()
    for _ in range(600):
        loop.tick()  # The human has gone silent.
    loop.simulation.q, loop.simulation.v = loop.controller.team.q0.copy(), np.zeros(4)
    first = loop.tick()
    assert "jumped" in first.restarted
    assert first.law_share == 1.0
    np.testing.assert_allclose(first.torque, np.zeros(4), atol=1e-9)


def test_torque_rate_holds_across_a_jump_of_the_state():
    """The torque of a team that is put elsewhere changes as slowly as ever."""
    given = team(effort_limit=(20.0, 10.0), plane="xz")
    loop = SingularityLoop(given, safety=SafetySettings(torque_rate=200.0))
    torques = [loop.tick(np.array([0.0, 0.9])).torque for _ in range(100)]
    loop.simulation.q = np.array([0.4, 1.6, 2.5, -1.6])
    torques += [loop.tick().torque for _ in range(300)]
    changes = np.abs(np.diff(torques, axis=0))
    assert changes.max() <= 0.2 * (1.0 + 1e-9)
    assert changes[98:120].max() == pytest.approx(0.2)  # Without it there would be a step.
    assert (np.abs(torques) <= [20.0, 10.0, 20.0, 10.0]).all()


def test_a_gap_between_states_counts_for_the_torque_rate():
    """After 0.3 s without states the torque may be 60 N m from its last, and is at once."""
    loop = SingularityLoop(team(plane="xz"), safety=SafetySettings(torque_rate=200.0))
    loop.tick()
    core = loop.controller
    q = core.team.q0 + 0.05
    tick = core.step(0.3, q, np.zeros(4))
    assert tick.restarted.startswith("no state")
    np.testing.assert_allclose(tick.torque, core.team.gravity(q), atol=1e-9)
    assert np.abs(tick.torque - core.team.gravity(core.team.q0)).max() > 0.2


def test_inputs_beyond_all_numbers_leave_the_torque_finite():
    """References of 1e200 and velocities of 1e160 overflow the law; brakes take over."""
    for v in (np.zeros(4), np.array([1e160, 0.0, 0.0, 0.0])):
        loop = SingularityLoop(team(effort_limit=(20.0, 10.0)))
        loop.tick()
        core = loop.controller
        huge = np.full(2, 1e200)
        core.inputs["cooperative"].sources["human"].receive(
            STEP, Reference(huge, huge, huge), STEP
        )
        with np.errstate(all="ignore"):
            tick = core.step(STEP, loop.simulation.q, v)
        assert np.isfinite(tick.torque).all()
        assert (np.abs(tick.torque) <= [20.0, 10.0, 20.0, 10.0]).all()
        assert tick.intervened
    again = core.step(2 * STEP, loop.simulation.q, np.zeros(4))
    assert np.isfinite(again.torque).all()


def test_a_law_that_fails_brakes_and_is_reported(monkeypatch):
    """Not a number from a subtask of one's own, or from a bug: gravity and brakes, and back."""
    loop = SingularityLoop(team(plane="xz"))
    for _ in range(20):
        loop.tick()
    core = loop.controller
    with monkeypatch.context() as patch:
        patch.setattr(core._law, "_wanted", lambda *_: np.full(4, np.nan))
        for _ in range(200):
            tick = loop.tick()
            assert not tick.safety.finite
            gravity = core.team.gravity(tick.state.q)
            expected = gravity - core.team.brake_damping * tick.state.v
            np.testing.assert_allclose(tick.torque, expected, atol=1e-9)
    tick = loop.tick()
    assert tick.safety.finite
    assert np.isfinite(tick.torque).all()
    assert not tick.intervened


def test_a_rate_input_out_of_reach_is_survived():
    """A joystick that is held away from the team for seconds does no harm."""
    loop = SingularityLoop(team())
    torques = []
    for _ in range(4000):
        now = loop.simulation.now
        source = loop.controller.inputs["cooperative"].sources["human"]
        source.receive(now, Rate(np.array([0.0, 0.4])), now)
        torques.append(loop.tick().torque)
    assert np.abs(torques).max() < 60.0
    assert np.abs(loop.simulation.v).max() < 0.5
