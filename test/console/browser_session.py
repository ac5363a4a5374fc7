# SPDX-License-Identifier: Apache-2.0
"""Team, console and real browser for end-to-end tests of the page."""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any

import numpy as np
from harness import Ros, TeamMonitor, paper
from programs import Programs
from repository import ROOT
from waiting import DEADLINE, until

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, Playwright

TOKEN = "the configured token"
OUTPUT = ROOT / "build" / "console"  # Folder of screenshots.
PROGRAMS = ["robot_team", "controller", "relative_planner", "operator_console"]
RATE = 200.0
FLAGS = (
    "--no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking"
    " --disable-component-update --disable-sync --use-gl=angle --use-angle=swiftshader"
    " --enable-unsafe-swiftshader"
)
REST_SPEED = 1e-3  # [m/s] below which the team is at rest
# Emulated gamepad; null: not connected.
GAMEPAD = "window.pad = null; navigator.getGamepads = () => [window.pad];"


def chromium() -> str | None:
    """Return the path of Chromium, or None if it is not installed."""
    return shutil.which("chromium")


def missing_browser() -> str:
    """Return the reason why no browser can be started; empty if one can."""
    if chromium() is None:
        return "chromium is not installed: apt-get install chromium"
    return "" if find_spec("playwright") else "playwright is not installed: pip install playwright"


def launch(playwright: Playwright) -> Browser:
    """Start a browser with an empty profile."""
    return playwright.chromium.launch(executable_path=chromium(), args=FLAGS.split())


def scenario() -> dict[str, Any]:
    """Return a scenario of two point masses under human authority, in lockstep at wall time.

    It has no object: its mass is not in the model, so that the team would follow its reference
    only slowly.
    """
    return paper(
        rate=RATE,
        telemetry_rate=100.0,
        real_time=True,
        lockstep_sources=["relative/autonomy"],
        haptic=None,
        object=None,
        robot_1={"initial_position": [0.5, 0.5]},
        robot_2={"initial_position": [-0.5, -0.5]},
        cooperative={"takeover": "shaped"},
        relative={"takeover": "shaped"},
        console={"port": 0, "frame_rate": 10.0},
    )


class BrowserSession:
    """A running team with a console and a browser.

    Attributes:
        browser: The browser.
        monitor: Received states and diagnostics of the team.
        port: Port of the console.
        ros: ROS context of the test.
    """

    def __init__(self, browser: Browser, monitor: TeamMonitor, port: int, ros: Ros) -> None:
        self.browser, self.monitor, self.port, self.ros = browser, monitor, port, ros
        until(lambda: len(monitor.states) > 10, "states of the team")

    @classmethod
    def open(cls, ros: Ros, programs: Programs, browser: Browser) -> BrowserSession:
        """Start the programs of the scenario, one after the other."""
        values = scenario()
        monitor = ros.monitor(values)
        programs.environment |= {"NONINTERACT_CONSOLE_TOKEN": TOKEN}
        for name in PROGRAMS:
            programs.start(name, values)
        for name in PROGRAMS:  # Each has its own deadline, since they start slowly together.
            until(partial(monitor.status.__contains__, name), f"diagnostics of {name}")
        return cls(browser, monitor, console_port(programs, PROGRAMS[3]), ros)

    @contextmanager
    def page(
        self, drives: bool = True, port: int = 0, size: tuple[int, int] = (1024, 700)
    ) -> Iterator[Page]:
        """Open a page, wait for the state of the team, and take control if it drives."""
        context = self.browser.new_context(viewport={"width": size[0], "height": size[1]})
        context.add_init_script(GAMEPAD)
        page = context.new_page()
        page.set_default_timeout(1e3 * DEADLINE)
        page.goto(f"http://127.0.0.1:{port or self.port}/#token={TOKEN}")
        wait(page, "operatorConsole.status()?.live")
        if drives:
            page.click("#control")
            wait(page, "operatorConsole.drives()")
            page.bring_to_front()
        try:
            yield page
        finally:
            context.close()

    def centre(self) -> np.ndarray:
        """Return the centre of the team, shape (2,) [m]."""
        positions = self.monitor.newest().position
        return positions.reshape(2, 2).mean(axis=0)

    def speed(self) -> float:
        """Return the speed of the fastest joint [m/s]."""
        return float(np.abs(self.monitor.newest().velocity).max())

    def wait_until_moving(self, faster: float = 0.1, pressed: Page | None = None) -> None:
        """Wait until the team moves faster than a speed [m/s].

        On a busy machine the input of a page may time out; then its pad is pressed again.
        """

        def moving() -> bool:
            if pressed is not None and pressed.inner_text("#hint").startswith("input timed out"):
                pressed.mouse.up()
                pressed.mouse.down()
            return self.speed() > faster

        until(moving, lambda: f"the team moves, not {self.speed()} m/s")

    def wait_until_rest(self) -> None:
        """Wait until the team is at rest."""
        until(
            lambda: self.stays_at_rest(0.1),
            lambda: f"the team is at rest, not at {self.speed()} m/s",
        )

    def stopping_time(self, release: Callable[[], None]) -> float:
        """Return the team's time from a release in motion to rest [s], by the states' stamps.

        It counts from the end of the release. The team's time is never faster than wall time, so
        that a slow machine makes it shorter.
        """
        self.wait_until_moving()
        release()
        start = self.monitor.now
        self.wait_until_rest()
        times, _, v, _ = self.monitor.history(self.monitor.states)
        moving = (np.abs(v).max(axis=1) >= REST_SPEED) & (times >= start)
        return float(times[moving][-1] - start) if moving.any() else 0.0

    def stays_at_rest(self, seconds: float = 0.3) -> bool:
        """Return True if the team rests for a duration of its own time [s]."""
        start = self.monitor.now
        until(lambda: self.monitor.now > start + seconds, "further states")
        times, _, v, _ = self.monitor.history(self.monitor.states)
        return bool((np.abs(v[times >= start]) < REST_SPEED).all())


def wait(page: Page, condition: str) -> None:
    """Wait until a JavaScript expression is true in a page."""
    # `wait_for_function` polls in a way that the page's content policy forbids.
    until(lambda: page.evaluate(condition), condition)


def take_screenshot(page: Page, name: str) -> None:
    """Write a screenshot of a page."""
    OUTPUT.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=OUTPUT / f"{name}.png")


def drag(page: Page, axis: str, offset: tuple[float, float], part: str = "arrow") -> None:
    """Drag the handle's arrow or ring of an axis by some pixels, and keep holding it."""
    x, y = page.evaluate(f"operatorConsole.{part}('{axis}')")
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(1, 11):
        page.mouse.move(x + offset[0] * step / 10, y + offset[1] * step / 10)


def press_pad(page: Page, right: float, up: float) -> None:
    """Press the pad of the plane, and keep holding it."""
    box = page.locator("#pad-plane").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + right * box["width"], y - up * box["height"], steps=4)


@contextmanager
def suspended_pages(browser: Browser) -> Iterator[None]:
    """Suspend all renderer processes with SIGSTOP."""
    session = browser.new_browser_cdp_session()
    found = session.send("SystemInfo.getProcessInfo")["processInfo"]
    pids = [item["id"] for item in found if item["type"] == "renderer"]
    assert pids
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        for pid in pids:
            os.kill(pid, signal.SIGCONT)


def console_port(programs: Programs, name: str) -> int:
    """Return the port of the console from the address that a program has printed."""
    found = until(
        lambda: re.search(r"http://127\.0\.0\.1:(\d+)/", programs.log(name)), "the address"
    )
    return int(found[1])


class CutRelay:
    """TCP relay between page and console that can drop all data while both ends stay open.

    Args:
        port: Port of the console.

    Attributes:
        port: Port for the page.
    """

    def __init__(self, port: int) -> None:
        self._to = port
        self._cut = threading.Event()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._sockets: list[socket.socket] = []
        self.port = self._listener.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                near = self._listener.accept()[0]
            except OSError:
                return
            far = socket.create_connection(("127.0.0.1", self._to))
            self._sockets += [near, far]
            for pair in ((near, far), (far, near)):
                threading.Thread(target=self._pass, args=pair, daemon=True).start()

    def _pass(self, source: socket.socket, target: socket.socket) -> None:
        try:
            while data := source.recv(65536):
                if self._cut.is_set():
                    return
                target.sendall(data)
            target.shutdown(socket.SHUT_WR)
        except OSError:
            return

    def cut(self) -> None:
        """Drop all data from now on; both ends stay open."""
        self._cut.set()

    def close(self) -> None:
        """Close all sockets."""
        self._listener.close()
        for item in self._sockets:
            item.close()
