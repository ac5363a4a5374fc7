# SPDX-License-Identifier: Apache-2.0
"""`noninteract demo SCENARIO --console` with a real browser."""

from __future__ import annotations

import signal
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from browser_session import (
    TOKEN,
    BrowserSession,
    console_port,
    drag,
    launch,
    missing_browser,
    take_screenshot,
)
from harness import Ros
from programs import Programs
from repository import ROOT
from waiting import DEADLINE, until

from noninteract_ros.arrays import Array
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters
from noninteract_ros.subtasks import so3

if TYPE_CHECKING:
    from pathlib import Path

pytestmark = pytest.mark.skipif(bool(missing_browser()), reason=missing_browser())


def scenario() -> dict[str, Any]:
    """Return a scenario of two Pandas without object and pushes."""
    values = read_parameters(ROOT / "config" / "dual_panda.yaml")
    for name in ("pushes", "elbow", "hand", "surroundings", "box"):
        del values[name]
    return values | {"console": {"frame_rate": 5.0}}


class CooperativePose:
    """Measured pose of the cooperative subtask.

    Args:
        values: The scenario.
        session: Team whose states are received.
    """

    def __init__(self, values: dict[str, Any], session: BrowserSession) -> None:
        built = Scenario.from_dict(values)
        self._team, self._session = built.build_team(), session
        self._stack = built.build_stack(self._team)

    def read(self) -> Array:
        """Return the newest pose, shape (7,)."""
        q = self._team.configuration_from_joints(self._session.monitor.newest().position)
        x = self._stack.evaluate(self._team.state(q, np.zeros(self._team.n))).x
        return x[self._stack.value_slices[0]]


def test_the_ring_of_the_handle_rotates_the_team(
    programs: Programs, domain: int, tmp_path: Path
) -> None:
    """The team follows a rotation of the handle about z; Ctrl-C ends the demo."""
    from playwright.sync_api import sync_playwright

    values = scenario()
    programs.environment |= {"NONINTERACT_CONSOLE_TOKEN": TOKEN}
    command = ["demo", str(programs.write(values)), "--console", "--port", "0"]
    demo = programs.python("demo", "-m", "noninteract_ros.cli", *command, "--out", str(tmp_path))
    with ExitStack() as cleanup:
        browser = launch(cleanup.enter_context(sync_playwright()))
        cleanup.callback(browser.close)
        port, ros = (
            console_port(programs, "demo"),
            Ros(domain),
        )  # A demo starts only in an empty namespace.
        cleanup.callback(ros.close)
        session = BrowserSession(browser, ros.monitor(values), port, ros)
        page, pose = cleanup.enter_context(session.page()), CooperativePose(values, session)
        page.select_option("#driven", "cooperative/0")
        page.click("#rotate")
        start = pose.read()
        drag(page, "z", (40.0, 0.0), part="ring")

        def reached() -> bool:
            goal = np.array(page.evaluate("operatorConsole.rotation()"))
            error = so3.log(so3.product(goal, so3.inverse(pose.read()[3:])))
            return bool(np.abs(error).max() < 5e-3)

        until(reached, "the team follows the ring")
        take_screenshot(page, "rotated")
        page.mouse.up()
        rotation = so3.log(so3.product(pose.read()[3:], so3.inverse(start[3:])))
        assert abs(rotation[2]) > 0.1
        np.testing.assert_allclose(rotation[:2], 0.0, atol=5e-3)
        np.testing.assert_allclose(pose.read()[:3], start[:3], atol=2e-3)
    demo.send_signal(signal.SIGINT)
    assert demo.wait(DEADLINE) == 0, programs.log("demo")
    assert "Recorded in" in programs.log("demo")
    assert (tmp_path / "run.mcap").stat().st_size > 0
