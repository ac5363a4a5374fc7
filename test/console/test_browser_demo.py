# SPDX-License-Identifier: Apache-2.0
"""`noninteract demo SCENARIO --console` as a person has it: a page, and a hand that turns."""

from __future__ import annotations

import signal
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from harness import Ros
from programs import Programs
from repository import ROOT
from show import TOKEN, Show, address, drag, launch, missing, shoot
from waiting import DEADLINE, until

from noninteract_ros.arrays import Array
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters
from noninteract_ros.subtasks import so3

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())


def scenario() -> dict[str, Any]:
    """Two Pandas that hold nothing and are pushed by nobody."""
    values = read_parameters(ROOT / "config" / "dual_panda.yaml")
    for name in ("pushes", "elbow", "hand", "surroundings", "box"):
        del values[name]
    return values | {"console": {"frame_rate": 5.0}}


class Team:
    """Where the subtasks of the team are that is heard of."""

    def __init__(self, values: dict[str, Any], show: Show) -> None:
        built = Scenario.from_dict(values)
        self._team, self._show = built.build_team(), show
        self._stack = built.build_stack(self._team)

    def pose(self) -> Array:
        """Of the cooperative subtask, shape (7,)."""
        q = self._team.configuration_from_joints(self._show.ear.newest().position)
        x = self._stack.evaluate(self._team.state(q, np.zeros(self._team.n))).x
        return x[self._stack.value_slices[0]]


def test_a_demo_with_a_console_is_turned_by_its_ring(
    programs: Programs, domain: int, tmp_path: Path
) -> None:
    """The ring about z turns the team by as much as the page shows; Ctrl-C ends it all."""
    from playwright.sync_api import sync_playwright

    values = scenario()
    programs.environment |= {"NONINTERACT_CONSOLE_TOKEN": TOKEN}
    command = ["demo", str(programs.write(values)), "--console", "--port", "0"]
    demo = programs.python("demo", "-m", "noninteract_ros.cli", *command, "--out", str(tmp_path))
    with ExitStack() as left:
        browser = launch(left.enter_context(sync_playwright()))
        left.callback(browser.close)
        port, ros = address(programs, "demo"), Ros(domain)  # A demo wants to be alone at first.
        left.callback(ros.close)
        show = Show(browser, ros.ear(values), port, ros)
        page, team = left.enter_context(show.page()), Team(values, show)
        page.select_option("#what", "cooperative/0")
        page.click("#turn")
        start = team.pose()
        drag(page, "z", (40.0, 0.0), part="ring")

        def turned() -> bool:
            wanted = np.array(page.evaluate("operatorConsole.turn()"))
            gap = so3.log(so3.product(wanted, so3.inverse(team.pose()[3:])))
            return bool(np.abs(gap).max() < 5e-3)

        until(turned, "the team follows the ring")
        shoot(page, "turned")
        page.mouse.up()
        turn = so3.log(so3.product(team.pose()[3:], so3.inverse(start[3:])))
        assert abs(turn[2]) > 0.1
        np.testing.assert_allclose(turn[:2], 0.0, atol=5e-3)
        np.testing.assert_allclose(team.pose()[:3], start[:3], atol=2e-3)
    demo.send_signal(signal.SIGINT)
    assert demo.wait(DEADLINE) == 0, programs.log("demo")
    assert "Recorded in" in programs.log("demo")
    assert (tmp_path / "run.mcap").stat().st_size > 0
