# SPDX-License-Identifier: Apache-2.0
"""A team, its console and a real browser, for tests that look and touch as a person does."""

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
from harness import Ear, Ros, paper
from programs import Programs
from repository import ROOT
from waiting import DEADLINE, until

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, Playwright

TOKEN = "known to those who may"
OUTPUT = ROOT / "build" / "console"  # Screenshots, to be looked at.
NAMES = ["robot_team", "controller", "relative_planner", "operator_console"]
RATE = 200.0
FLAGS = (
    "--no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking"
    " --disable-component-update --disable-sync --use-gl=angle --use-angle=swiftshader"
    " --enable-unsafe-swiftshader"
)
SLOW = 1e-3  # [m/s] below which the team is at rest
# A gamepad that tests can press; nothing is held while it is null.
GAMEPAD = "window.pad = null; navigator.getGamepads = () => [window.pad];"


def chromium() -> str | None:
    """Debian's Chromium, if it is installed."""
    return shutil.which("chromium")


def missing() -> str:
    """What a real browser needs and is not here; an empty text, where all is."""
    if chromium() is None:
        return "no chromium here: apt-get install chromium"
    return "" if find_spec("playwright") else "no playwright here: pip install playwright"


def launch(playwright: Playwright) -> Browser:
    """A browser with an empty profile."""
    return playwright.chromium.launch(executable_path=chromium(), args=FLAGS.split())


def scenario() -> dict[str, Any]:
    """Two point masses at rest, led by a human, in lockstep that keeps to wall time.

    The object of the paper is left out: its mass is not in the model, so that the team would
    creep after its reference for seconds.
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


class Show:
    """What a team with a console does.

    Attributes:
        browser: Opens pages.
        ear: Every state of the team.
        port: Where the console listens.
        ros: For what tests ask of the team besides.
    """

    def __init__(self, browser: Browser, ear: Ear, port: int, ros: Ros) -> None:
        self.browser, self.ear, self.port, self.ros = browser, ear, port, ros
        until(lambda: len(ear.states) > 10, "the team moves")

    @classmethod
    def open(cls, ros: Ros, programs: Programs, browser: Browser) -> Show:
        """The programs of a scenario, one by one."""
        values = scenario()
        ear = ros.ear(values)
        programs.environment |= {"NONINTERACT_CONSOLE_TOKEN": TOKEN}
        for name in NAMES:
            programs.start(name, values)
        for name in NAMES:  # Each has a deadline of its own: together they start slowly.
            until(partial(ear.status.__contains__, name), f"{name} speaks")
        return cls(browser, ear, address(programs, NAMES[3]), ros)

    @contextmanager
    def page(
        self, drives: bool = True, port: int = 0, size: tuple[int, int] = (1024, 700)
    ) -> Iterator[Page]:
        """A page that is open and knows the team; it drives, where asked for."""
        context = self.browser.new_context(viewport={"width": size[0], "height": size[1]})
        context.add_init_script(GAMEPAD)
        page = context.new_page()
        page.set_default_timeout(1e3 * DEADLINE)
        page.goto(f"http://127.0.0.1:{port or self.port}/#token={TOKEN}")
        wait(page, "operatorConsole.status()?.there")
        if drives:
            page.click("#take")
            wait(page, "operatorConsole.drives()")
            page.bring_to_front()
        try:
            yield page
        finally:
            context.close()

    def centre(self) -> np.ndarray:
        """Where the team's middle is now, shape (2,) [m]."""
        positions = self.ear.newest().position
        return positions.reshape(2, 2).mean(axis=0)

    def speed(self) -> float:
        """Of the fastest joint now [m/s]."""
        return float(np.abs(self.ear.newest().velocity).max())

    def moves(self, faster: float = 0.1, pressed: Page | None = None) -> None:
        """Waits until the team moves at a good speed.

        A page that has stuttered for long on a busy machine has let go; then the pad that is
        pressed there is pressed anew.
        """

        def moving() -> bool:
            if pressed is not None and pressed.inner_text("#hint").startswith("not held"):
                pressed.mouse.up()
                pressed.mouse.down()
            return self.speed() > faster

        until(moving, lambda: f"the team moves, not {self.speed()} m/s")

    def rests(self) -> None:
        """Waits until the team is at rest."""
        until(lambda: self.stays(0.1), lambda: f"the team is at rest, not at {self.speed()} m/s")

    def rest_after(self, release: Callable[[], None]) -> float:
        """Time of the team from a release at a good speed to rest [s], by the states' stamps.

        It counts from when the release is done. The team's time is never faster than the wall's,
        so that a slow machine makes it shorter.
        """
        self.moves()
        release()
        began = self.ear.now
        self.rests()
        times, _, v, _ = self.ear.history(self.ear.states)
        moving = (np.abs(v).max(axis=1) >= SLOW) & (times >= began)
        return float(times[moving][-1] - began) if moving.any() else 0.0

    def stays(self, seconds: float = 0.3) -> bool:
        """Whether the team rests for so long of its own time [s]."""
        began = self.ear.now
        until(lambda: self.ear.now > began + seconds, "some more states")
        times, _, v, _ = self.ear.history(self.ear.states)
        return bool((np.abs(v[times >= began]) < SLOW).all())


def wait(page: Page, condition: str) -> None:
    """Waits until something is true in a page."""
    # Not by `wait_for_function`, whose way to ask again the page's policy forbids.
    until(lambda: page.evaluate(condition), condition)


def shoot(page: Page, name: str) -> None:
    """Keeps a picture of a page."""
    OUTPUT.mkdir(parents=True, exist_ok=True)
    page.screenshot(path=OUTPUT / f"{name}.png")


def drag(page: Page, axis: str, by: tuple[float, float], part: str = "arrow") -> None:
    """Takes the handle's arrow or ring of an axis, pulls it by so many pixels, and holds it."""
    x, y = page.evaluate(f"operatorConsole.{part}('{axis}')")
    page.mouse.move(x, y)
    page.mouse.down()
    for step in range(1, 11):
        page.mouse.move(x + by[0] * step / 10, y + by[1] * step / 10)


def press_pad(page: Page, right: float, up: float) -> None:
    """Pushes the pad of the plane; it stays held."""
    box = page.locator("#pad-plane").bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + right * box["width"], y - up * box["height"], steps=4)


@contextmanager
def frozen(browser: Browser) -> Iterator[None]:
    """Stops all processes that run pages, as `kill -STOP` does."""
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


def address(programs: Programs, name: str) -> int:
    """Port of the console that a program has printed."""
    found = until(
        lambda: re.search(r"http://127\.0\.0\.1:(\d+)/", programs.log(name)), "the address"
    )
    return int(found[1])


class Relay:
    """A link between page and console that can be cut: then nobody is told, and nothing comes.

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
        """Passes on nothing from now on; both ends stay open."""
        self._cut.set()

    def close(self) -> None:
        """Ends everything."""
        self._listener.close()
        for item in self._sockets:
            item.close()
