# SPDX-License-Identifier: Apache-2.0
"""Elbow angles: value, differentials, singular states, and two Pandas led by them."""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from harness import merged
from repository import ROOT

from noninteract_ros.control.references.inputs import Target
from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters
from noninteract_ros.scenario.rehearsal import Rehearsal, rehearse
from noninteract_ros.subtasks.kinds.elbow_angle import ElbowAngle
from noninteract_ros.team.team import Team
from noninteract_ros.validation.identities.identities import identities
from noninteract_ros.validation.identities.law_probe import LawProbe

STEP = 1e-6
FRAMES = {"shoulder": ["panda_link2"], "elbow": ["panda_link4"], "wrist": ["panda_link6"]}
OTHER_ELBOW = {  # held as the scenario does it, where only the first robot's angle counts
    "kind": "posture",
    "joints": ["panda_2/panda_joint1"],
    "stiffness": [200.0],
    "damping": [12.0],
}


def pandas(**changes: Any) -> dict[str, Any]:
    """Two Pandas whose elbows are held by their angles instead of by a joint."""
    values = read_parameters(ROOT / "config" / "dual_panda_free.yaml")
    values["posture"] = {
        "kind": "elbow_angle",
        "stiffness": [200.0],
        "damping": [20.0],
        **FRAMES,
    }
    return merged(values, changes)


def team() -> Team:
    return Scenario.from_dict(pandas()).build_team()


def block(**keys: Any) -> ElbowAngle:
    frames = {name: tuple(value) for name, value in FRAMES.items()}
    return ElbowAngle("elbow_angle", **(frames | keys))


def angles(robots: Team, q: np.ndarray, **keys: Any) -> np.ndarray:
    return block(**keys).build("elbows", robots).evaluate(robots.state(q, np.zeros(14))).x


def points(robots: Team, q: np.ndarray, robot: str) -> list[np.ndarray]:
    """Shoulder, elbow and wrist in the world, by the team's own model."""
    data = robots.model.createData()
    pin.framesForwardKinematics(robots.model, data, q)
    names = (frame for (frame,) in FRAMES.values())
    return [data.oMf[robots.model.getFrameId(f"{robot}/{name}")].translation for name in names]


def random_q(robots: Team, rng: np.random.Generator) -> np.ndarray:
    return robots.q0 + rng.uniform(-0.8, 0.8, robots.n)


def test_it_is_the_angle_between_two_half_planes() -> None:
    """Turning the reference's normal by the angle about the line gives the arm's normal."""
    robots, rng = team(), np.random.default_rng(0)
    reference = np.array([0.3, -0.2, 0.9])
    for _ in range(20):
        q = random_q(robots, rng)
        for angle, robot in zip(
            angles(robots, q, reference=(0.3, -0.2, 0.9)), robots.names, strict=True
        ):
            shoulder, elbow, wrist = points(robots, q, robot)
            u = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
            zero, arm = np.cross(u, reference), np.cross(u, elbow - shoulder)
            turned = pin.exp3(angle * u) @ zero / np.linalg.norm(zero)
            np.testing.assert_allclose(turned, arm / np.linalg.norm(arm), atol=1e-12)


@pytest.mark.parametrize("robots_named", [(), ("panda_2",)])
def test_jacobian_and_rate_are_derivatives(robots_named: tuple[str, ...]) -> None:
    """J v is the rate of the angles along the motion, and J_rate that of J (6)."""
    robots, rng = team(), np.random.default_rng(1)
    task = block(robots=robots_named, reference=(0.2, 0.5, 0.8)).build("elbows", robots)
    assert task.elements == (robots_named or robots.names)
    for _ in range(10):
        q, v = random_q(robots, rng), rng.normal(size=robots.n)
        here = task.evaluate(robots.state(q, v))
        after, before = (task.evaluate(robots.state(q + h * v, v)) for h in (STEP, -STEP))
        rate = task.difference(after.x, before.x) / (2 * STEP)
        np.testing.assert_allclose(here.J @ v, rate, atol=1e-7)
        np.testing.assert_allclose(here.J_rate, (after.J - before.J) / (2 * STEP), atol=1e-7)


def test_only_turning_about_the_line_counts() -> None:
    """As the whole arm turns about the reference, its angle stays; about the line it follows."""
    robots = team()
    q, step = robots.q0, np.zeros(14)
    step[0] = 0.5  # The first joint's axis is the vertical.
    before, after = angles(robots, q), angles(robots, q + step)
    np.testing.assert_allclose(after, before, atol=1e-14)
    shoulder, _, wrist = points(robots, q, "panda_1")
    along = tuple(wrist - shoulder)
    moved = angles(robots, q + step, reference=(1.0, 0.0, 0.0)) - angles(
        robots, q, reference=(1.0, 0.0, 0.0)
    )
    assert abs(moved[0]) > 0.1
    assert moved[1] == 0.0
    assert np.linalg.norm(along) > 0.3


def test_differences_are_the_shortest_ones() -> None:
    """Angles on both sides of half a turn are close, and a full turn is none."""
    task = block().build("elbows", team())
    e = task.difference(np.array([3.1, 0.5]), np.array([-3.1, 0.5 - 4.0 * np.pi]))
    np.testing.assert_allclose(e, [6.2 - 2.0 * np.pi, 0.0], atol=1e-14)
    stack = Scenario.from_dict(pandas()).build_stack(team())
    x, x_d = np.zeros((2, stack.layout.size))
    x[-2:], x_d[-2:], x[0] = [3.1, -0.2], [-3.1, 0.3], 7.0
    x[[6, 13]] = x_d[[6, 13]] = 1.0  # The quaternions of the poses.
    e = stack.difference(x, x_d)
    np.testing.assert_allclose(e[[0, -2, -1]], [7.0, 6.2 - 2.0 * np.pi, -0.5], atol=1e-14)


def singularity_distance(robots: Team, q: np.ndarray, **keys: Any) -> float:
    return (
        block(**keys).build("elbows", robots).singularity_distance(robots.state(q, np.zeros(14)))
    )


def test_singularity_distance_is_zero_without_an_angle_and_all_terms_stay_finite() -> None:
    """A line along the reference, and points in one line, are detected."""
    robots = team()
    shoulder, _, wrist = points(robots, robots.q0, "panda_1")
    along = tuple(wrist - shoulder)
    assert singularity_distance(robots, robots.q0) > 0.5
    assert singularity_distance(robots, robots.q0, reference=along) < 1e-8
    straight = {"elbow": ("panda_link3",), "wrist": ("panda_link3",)}
    for keys in ({"reference": along}, straight, {"wrist": ("panda_link2",)}):
        task = block(**keys).build("elbows", robots)
        assert singularity_distance(robots, robots.q0, **keys) < 1e-8
        found = task.evaluate(robots.state(robots.q0, np.ones(14)))
        for term in (found.x, found.J, found.J_rate):
            assert np.isfinite(term).all()


def test_the_law_fades_out_where_the_angle_ends() -> None:
    """Between a sine of 0.3 and 0.1 the law fades, below the team only recovers; all bounded."""
    robots = team()
    shoulder, _, wrist = points(robots, robots.q0, "panda_1")
    u = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
    across = np.cross(u, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    torques = []
    for sine, share in ((0.31, 1.0), (0.2, 0.5), (0.1, 0.0), (1e-4, 0.0), (0.0, 0.0)):
        reference = tuple(np.sqrt(1.0 - sine**2) * u + sine * across)
        values = pandas(posture={"reference": list(map(float, reference)), "robots": ["panda_1"]})
        values["subtasks"].append("other")
        values["other"] = OTHER_ELBOW
        scenario = Scenario.from_dict(values)
        stack = scenario.build_stack(robots)
        controller = scenario.build_controller(robots, stack)
        tick = controller.step(0.0, robots.q0, np.full(14, 0.1))
        assert tick.law_share == pytest.approx(share, abs=1e-6)
        torques.append(np.abs(tick.torque).max())
    assert max(torques) < 2.0 * torques[0]


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"robots": ("panda_3",)}, ["elbows.robots", "panda_3", "panda_1"]),
        ({"robots": ("panda_1", "panda_1")}, ["elbows.robots", "once"]),
        ({"elbow": ("panda_lnk4",)}, ["elbows.elbow", "panda_lnk4", "panda_link4"]),
        ({"wrist": ("a", "b", "c")}, ["elbows.wrist", "1 name, or 2"]),
        ({"reference": (0.0, 0.0, 0.0)}, ["elbows.reference", "not all zero"]),
        ({"reference": (1.0,)}, ["elbows.reference", "x y z"]),
    ],
)
def test_what_does_not_fit_is_refused(keys: dict[str, Any], words: list[str]) -> None:
    """The error has the full key, what was found and what is allowed."""
    with pytest.raises(ScenarioError) as caught:
        block(**keys).build("elbows", team())
    assert all(word in str(caught.value) for word in words)


def test_two_pandas_meet_assumption_2_and_stay_apart() -> None:
    """Pose, pose and elbows: the law's identities hold, and the human moves no elbow."""
    scenario = Scenario.from_dict(pandas())
    robots = scenario.build_team()
    stack = scenario.build_stack(robots)
    gains = scenario.build_controller(robots, stack).mode.impedance
    found = identities(LawProbe(robots, stack, gains), samples=10, seed=3)
    assert [item.name for item in found if not item.passed] == []
    led = rehearse(scenario, 1.5)
    assert np.abs(led.x[:, 0:3] - led.x[0, 0:3]).max() > 0.1
    assert np.abs(led.q - led.q[0]).max() > 0.3
    assert np.abs(led.x[:, 7:] - led.x[0, 7:]).max() < 5e-5


def test_an_elbow_is_led_through_half_a_turn_of_the_number() -> None:
    """Led past pi, the elbow goes on and comes to where it was sent, the tools standing still."""
    start = angles(team(), team().q0)[0]
    back = start - np.pi + 0.15  # The reference that makes the start 0.15 rad short of pi.
    shoulder, _, wrist = points(team(), team().q0, "panda_1")
    u = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
    reference = (pin.exp3(back * u) @ np.array([0.0, 0.0, 1.0])).tolist()
    values = pandas(
        haptic=None,
        lockstep_sources=["relative/autonomy"],
        posture={"reference": reference, "authority": "human", "robots": ["panda_1"]},
    )
    values["subtasks"].append("other")
    values["other"] = OTHER_ELBOW
    run = Rehearsal(Scenario.from_dict(values))
    heard = run.controller.inputs["posture"].sources["human"]
    goal, seen = np.pi + 0.15, []
    while (now := run.simulation.now) < 2.0:
        heard.receive(now, Target(np.array([goal]), np.zeros(1)), now)
        tick = run.step()
        seen.append(tick.task.x[-2])
        assert tick.law_share == 1.0
    assert seen[0] == pytest.approx(np.pi - 0.15, abs=1e-6)
    assert np.abs(np.diff(seen)).max() > 6.0  # The number jumps by a turn,
    assert np.abs(np.diff(np.unwrap(seen))).max() < 2e-3  # the elbow does not.
    assert seen[-1] == pytest.approx(goal - 2.0 * np.pi, abs=1e-3)
