# SPDX-License-Identifier: Apache-2.0
"""The console measured: from the mouse to the reference, pictures per second, processor share.

`python benchmarks/console.py [SCENARIO] [--shot FILE]`, by default with two Pandas. It needs
Chromium (Debian: `apt-get install chromium`), playwright and, for the Pandas, `[robots]`.
The browser renders in software, as without a graphics card: with one it draws faster.
"""

import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
from playwright.sync_api import Page, sync_playwright
from rclpy.node import Node

from noninteract_ros.nodes.recording.feed import RawSubscription

DRAGS = 20
WATCHED = 10.0  # [s] over which processor time is counted
DEADLINE = 90.0  # [s]
PORT = 8093
FLAGS = (
    "--no-sandbox --disable-gpu --no-first-run --disable-background-networking --disable-sync"
    " --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader"
)


def until(done: Callable[[], Any], what: str) -> Any:
    end = time.monotonic() + DEADLINE
    while not (value := done()):
        if time.monotonic() > end:
            raise SystemExit(f"not within {DEADLINE:.0f} s: {what}")
        time.sleep(0.001)
    return value


@contextmanager
def demo(scenario: str) -> Iterator[None]:
    """A demo with a console, until it is over."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "noninteract_ros.cli", "demo", scenario, "--console"]
        command += ["--port", str(PORT), "--out", folder]
        process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            assert process.stdout is not None
            for line in process.stdout:
                if "open http" in line:
                    break
            else:
                raise SystemExit("the demo did not begin")
            yield
        finally:
            process.send_signal(signal.SIGINT)
            process.wait()


def console_process() -> int:
    """Number of the console's process."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                words = (entry / "cmdline").read_bytes().split(b"\0")
            except OSError:
                continue
            if b"operator_console" in words:
                return int(entry.name)
    raise SystemExit("there is no console")


def processor_time(pid: int) -> float:
    """Of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def latency(page: Page, feed: RawSubscription) -> float:
    """Time from a motion of the mouse to the first reference that follows it [ms]."""
    heard: list[tuple[int, bytes]] = []

    def note(topic: str, kind: str, received: int, sent: int, data: bytes, number: int) -> None:
        heard.append((received, data))

    x, y = page.evaluate("operatorConsole.arrow('x')")
    page.mouse.move(x, y)
    page.mouse.down()
    time.sleep(0.4)  # Until what is held says nothing new.
    feed.drain(note)
    moved = time.time_ns()
    page.mouse.move(x + 10.0, y)
    still = heard[-1][1][12:] if heard else b""
    heard.clear()

    def answered() -> int:
        feed.drain(note)
        return next((at for at, data in heard if data[12:] != still), 0)

    at = until(answered, "a reference")
    page.mouse.up()
    time.sleep(0.6)
    return 1e-6 * (at - moved)


def measure(page: Page, feed: RawSubscription, pid: int) -> None:
    """Prints all figures."""
    before, began = processor_time(pid), time.monotonic()
    frames, rates = [], []
    while time.monotonic() < began + WATCHED:
        time.sleep(1.0)
        words = re.findall(r"\d+", page.inner_text("#rate"))
        frames.append(int(words[0]))
        rates.append(int(words[1]))
    share = (processor_time(pid) - before) / (time.monotonic() - began)
    times = [latency(page, feed) for _ in range(DRAGS)]
    load = ", ".join(f"{item:.1f}" for item in os.getloadavg())
    print(f"{os.cpu_count()} cores, load average {load}")
    print(f"pictures sent      {np.median(rates):6.0f} 1/s")
    print(f"frames drawn       {np.median(frames):6.0f} 1/s (software rendering)")
    print(f"console's process  {100.0 * share:6.1f} % of a core, one page watching")
    print(
        f"mouse to reference {np.median(times):6.1f} ms median,"
        f" {np.percentile(times, 90):.1f} ms 90th percentile of {len(times)}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", nargs="?", default="dual_panda")
    parser.add_argument("--shot", type=Path, help="also keep a picture of the page here")
    options = parser.parse_args()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # Whatever ends it ends the demo.
    with demo(options.scenario), sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=FLAGS.split()
        )
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(f"http://127.0.0.1:{PORT}/")
        until(lambda: page.evaluate("operatorConsole.status()?.there"), "the page")
        page.click("#take")
        until(lambda: page.evaluate("operatorConsole.drives()"), "the driver's seat")
        if options.shot:
            page.keyboard.down("w")
            time.sleep(4.0)
            page.screenshot(path=options.shot)
            page.keyboard.up("w")
        rclpy.init()
        node = Node("console_bench", namespace="team")
        kind = "trajectory_msgs/msg/MultiDOFJointTrajectory"
        driven = page.input_value("#what").split("/")[0]
        topic = f"/team/{driven}/human/reference"
        feed = RawSubscription(node, topic, kind)
        measure(page, feed, console_process())
        browser.close()
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
