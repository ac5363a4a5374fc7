# SPDX-License-Identifier: Apache-2.0
"""Teams among obstacles: they keep their distance, the grasp stays, and nobody pays."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from repository import ROOT

from noninteract_ros.arrays import Array
from noninteract_ros.control.telemetry.limit_activity import LimitActivity
from noninteract_ros.control.tick import Tick
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters
from noninteract_ros.scenario.rehearsal import Rehearsal

MARGIN = 0.02
BLOCK = {"kind": "box", "size": [2.0, 0.2, 1.0], "pose": [-1.0, 0.2, 0, 0, 0, 0, 1]}


def masses(**changes: Any) -> dict[str, Any]:
    """Two unlike masses that keep their distance while the human leads them past a post."""
    return {
        "rate": 500.0,
        "robots": ["light", "heavy"],
        "light": {"mass": 1.0, "initial_position": [-0.3, 0.0]},
        "heavy": {"mass": 4.0, "initial_position": [0.3, 0.0]},
        "subtasks": ["lead", "gap"],
        "lead": {
            "kind": "cooperative_position",
            "stiffness": [50.0],
            "damping": [35.0],
            "authority": "human",
        },
        "gap": {"kind": "relative_position", "stiffness": [400.0], "damping": [45.0]},
        "surroundings": ["post"],
        "post": {"kind": "sphere", "position": [-0.36, 0.5, 0.0], "radius": 0.15},
        "walls": {"margin": MARGIN},
        "haptic": {
            "subtask": "lead",
            "motion": "waypoints",
            "times": [0.0, 1.2],
            "points": [0.0, 0.0, 0.0, 0.9],
        },
        **changes,
    }


class Run:
    """A rehearsal, and what was found at each tick.

    Args:
        values: The scenario.
        duration: How long [s].
        every: Ticks between distances that are measured.
    """

    def __init__(self, values: dict[str, Any], duration: float, every: int = 1) -> None:
        self.scenario = Scenario.from_dict(values)
        self.rehearsal = Rehearsal(self.scenario)
        scene = self.scenario.build_scene(self.rehearsal.team)
        self.ticks: list[Tick] = []
        self.least: list[float] = []
        for number in range(round(duration * self.scenario.general.rate)):
            if number % every == 0:
                q, v = self.rehearsal.simulation.q, self.rehearsal.simulation.v
                self.least.append(scene.evaluate(q, v, 1.0).least)
            self.ticks.append(self.rehearsal.step())

    def error(self, subtask: str, coordinates: Sequence[int] = (0, 1)) -> float:
        """Largest error of a subtask's first coordinates at any tick."""
        stack = self.rehearsal.stack
        start = stack.slices[stack.names.index(subtask)].start
        rows = [start + k for k in coordinates]
        return max(float(np.linalg.norm(tick.error.e[rows])) for tick in self.ticks)

    @property
    def torques(self) -> Array:
        """Shape (ticks, n)."""
        return np.array([tick.torque for tick in self.ticks])


@pytest.fixture(scope="module")
def led() -> Run:
    """Masses that are led into the post."""
    return Run(masses(), 2.6)


def test_the_margin_holds(led: Run) -> None:
    """No body comes nearer than the margin, less what a held torque moves in a tick."""
    assert min(led.least) >= MARGIN - 1e-4
    assert min(led.least) <= MARGIN + 1e-3  # It was needed.


def test_a_tick_reports_the_wall_that_pushes(led: Run) -> None:
    """Distance and names of the nearest pair are those at that tick, and diagnostics name it."""
    pushed = [k for k, tick in enumerate(led.ticks) if tick.walls and tick.walls.active]
    assert pushed
    walls, activity = led.ticks[pushed[0]].walls, LimitActivity(led.rehearsal.team.joint_names)
    assert walls is not None
    assert walls.least == pytest.approx(led.least[pushed[0]])
    assert "post" in walls.nearest
    assert walls.held
    activity.record(1.0, led.ticks[pushed[0]])
    assert activity.conditions(1.0) == [f"walls push: {walls.nearest}"]
    assert activity.values()["clearance, lowest [m]"] == walls.least


def test_without_walls_the_post_is_hit() -> None:
    """The same motion without the block goes through the post."""
    values = masses()
    del values["walls"]
    assert min(Run(values, 1.0, every=5).least) < 0.0


def test_the_formation_stays_and_nobody_pays(led: Run) -> None:
    """Masses stay in formation within a micrometre, sigma is 1 and the tank keeps its energy."""
    assert led.error("gap") <= 1e-6
    tanks = [tick.account.tank for tick in led.ticks]
    assert min(tank.sigma for tank in tanks) == 1.0
    assert min(tank.level for tank in tanks) >= tanks[0].level - 1e-6
    assert all(tick.account.sound for tick in led.ticks)
    assert max(tick.account.residual for tick in led.ticks) <= 1e-6


def test_it_slides_past_and_comes_to_rest(led: Run) -> None:
    """A second after the reference has stopped the team stands there, without chatter."""
    assert np.abs(led.ticks[-1].state.v).max() < 0.1
    steps = np.abs(np.diff(led.torques, axis=0)).max(axis=1)
    assert steps.max() < 10.0
    assert steps[-100:].max() < 0.1


def test_far_from_the_post_walls_change_no_bit() -> None:
    """With a post that is far away all torques are those of a scenario without walls."""
    far = {"kind": "sphere", "position": [-0.36, 5.0, 0.0], "radius": 0.15}
    with_walls = masses(post=far)
    without = {key: value for key, value in with_walls.items() if key != "walls"}
    assert (Run(with_walls, 0.2).torques == Run(without, 0.2).torques).all()


@pytest.mark.parametrize("law", ["natural", "noninteracting"])
def test_every_law_keeps_the_margin_and_the_formation(law: str) -> None:
    """Walls hold references back before any law has to."""
    run = Run(masses(law=law), 1.0, every=5)
    assert min(run.least) >= MARGIN - 1e-4
    assert run.error("gap") <= 1e-4


def test_a_push_towards_a_block_ends_at_the_margin() -> None:
    """With 40 N for 0.4 s a mass comes to the margin of a block and no nearer."""
    push = {"robot": "light", "start": 0.4, "duration": 0.4, "force": [0.0, 40.0, 0.0]}
    still = {"subtask": "lead", "motion": "waypoints", "times": [0.0, 1.0], "points": [0.0] * 4}
    run = Run(masses(post=BLOCK, haptic=still, pushes=["shove"], shove=push), 1.6)
    assert min(run.least) == pytest.approx(MARGIN, abs=1e-3)
    assert run.least[-1] >= MARGIN - 1e-3
    assert max(tick.account.residual for tick in run.ticks) <= 1e-6


def test_a_team_that_starts_inside_a_margin_is_not_thrown_out() -> None:
    """A post at 5 mm leaves a team at rest where it is."""
    near = {"kind": "sphere", "position": [-0.3, 0.155, 0.0], "radius": 0.15}
    still = {"subtask": "lead", "motion": "waypoints", "times": [0.0, 1.0], "points": [0.0] * 4}
    run = Run(masses(post=near, haptic=still), 0.2)
    assert np.abs([tick.state.v for tick in run.ticks]).max() < 1e-6


def test_the_order_of_giving_way_can_be_turned_round() -> None:
    """With the formation last in order it gives way, and the lead is held back less."""
    firm, soft = Run(masses(post=BLOCK), 1.4, every=10), masses(post=BLOCK)
    soft["gap"] = {**soft["gap"], "priority": 2}
    soft["lead"] = {**soft["lead"], "priority": 0}
    yielding = Run(soft, 1.4, every=10)
    assert min(yielding.least) >= MARGIN - 1e-4
    stack = firm.rehearsal.stack
    lead = stack.value_slices[stack.names.index("lead")]
    reached = [run.ticks[-1].task.x[lead][1] for run in (firm, yielding)]
    assert reached[1] > reached[0] + 0.05


def test_two_pandas_are_led_against_a_post_with_the_grasp_kept() -> None:
    """The grasp stays within 30 micrometres, sigma 1 and the tank full; the hand keeps 20 mm."""
    values = read_parameters(ROOT / "config" / "obstacles.yaml")
    values["pushes"] = []
    del values["hand"]
    values["haptic"] = {**values["haptic"], "times": [0.0, 0.6], "start_time": 0.0}
    values["haptic"]["points"] = [0.0, 0.0, 0.5, 0.0, 0.16, 0.5]
    values["haptic"]["orientations"] = [0.0, 0.0, 0.0, 1.0] * 2
    run = Run(values, 0.7, every=10)
    assert MARGIN - 1e-3 <= min(run.least) <= MARGIN + 1e-3
    assert run.error("relative", (0, 1, 2)) <= 3e-5
    assert min(tick.account.tank.sigma for tick in run.ticks) == 1.0
    assert max(tick.account.residual for tick in run.ticks) <= 1e-6
