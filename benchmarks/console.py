# SPDX-License-Identifier: Apache-2.0
"""Benchmark of the console: latency from mouse to reference, frame rates, CPU share.

`python benchmarks/console.py [SCENARIO] [--shot FILE]`, by default with two Pandas. It needs
Chromium (Debian: `apt-get install chromium`), playwright and, for the Pandas, `[robots]`.
The browser renders in software; with a graphics card it draws faster.
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

from noninteract_ros.nodes.recording.raw_subscription import RawSubscription

DRAGS = 20
DURATION = 10.0  # [s] over which frames and CPU time are measured
DEADLINE = 90.0  # [s]
PORT = 8093
FLAGS = (
    "--no-sandbox --disable-gpu --no-first-run --disable-background-networking --disable-sync"
    " --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader"
)


def until(done: Callable[[], Any], condition: str) -> Any:
    """Poll until a condition is true, and return its value."""
    end = time.monotonic() + DEADLINE
    while not (value := done()):
        if time.monotonic() > end:
            raise SystemExit(f"not within {DEADLINE:.0f} s: {condition}")
        time.sleep(0.001)
    return value


@contextmanager
def demo(scenario: str) -> Iterator[None]:
    """Run a demo with a console."""
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
                raise SystemExit("the demo did not start")
            yield
        finally:
            process.send_signal(signal.SIGINT)
            process.wait()


def console_process() -> int:
    """Return the process id of the console."""
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                arguments = (entry / "cmdline").read_bytes().split(b"\0")
            except OSError:
                continue
            if b"operator_console" in arguments:
                return int(entry.name)
    raise SystemExit("operator_console is not running")


def cpu_time(pid: int) -> float:
    """Return the CPU time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def latency(page: Page, subscription: RawSubscription) -> float:
    """Return the time from a motion of the mouse to the first reference that follows it [ms]."""
    messages: list[tuple[int, bytes]] = []

    def store(topic: str, kind: str, received: int, sent: int, data: bytes, number: int) -> None:
        messages.append((received, data))

    x, y = page.evaluate("operatorConsole.arrow('x')")
    page.mouse.move(x, y)
    page.mouse.down()
    time.sleep(0.4)  # Until the references rest.
    subscription.drain(store)
    moved = time.time_ns()
    page.mouse.move(x + 10.0, y)
    rest = messages[-1][1][12:] if messages else b""
    messages.clear()

    def changed() -> int:
        subscription.drain(store)
        return next((at for at, data in messages if data[12:] != rest), 0)

    at = until(changed, "a reference")
    page.mouse.up()
    time.sleep(0.6)
    return 1e-6 * (at - moved)


def measure(page: Page, subscription: RawSubscription, pid: int) -> None:
    """Measure and print all results."""
    cpu_before, start = cpu_time(pid), time.monotonic()
    drawn, sent = [], []
    while time.monotonic() < start + DURATION:
        time.sleep(1.0)
        rates = re.findall(r"\d+", page.inner_text("#rate"))
        drawn.append(int(rates[0]))
        sent.append(int(rates[1]))
    share = (cpu_time(pid) - cpu_before) / (time.monotonic() - start)
    times = [latency(page, subscription) for _ in range(DRAGS)]
    load = ", ".join(f"{item:.1f}" for item in os.getloadavg())
    print(f"{os.cpu_count()} cores, load average {load}")
    print(f"frames sent        {np.median(sent):6.0f} 1/s")
    print(f"frames drawn       {np.median(drawn):6.0f} 1/s (software rendering)")
    print(f"console process    {100.0 * share:6.1f} % of a core, one page open")
    print(
        f"mouse to reference {np.median(times):6.1f} ms median,"
        f" {np.percentile(times, 90):.1f} ms 90th percentile of {len(times)}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenario", nargs="?", default="dual_panda")
    parser.add_argument("--shot", type=Path, help="file for a screenshot of the page")
    options = parser.parse_args()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # End the demo with this program.
    with demo(options.scenario), sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=FLAGS.split()
        )
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(f"http://127.0.0.1:{PORT}/")
        until(lambda: page.evaluate("operatorConsole.status()?.live"), "the page")
        page.click("#control")
        until(lambda: page.evaluate("operatorConsole.drives()"), "the driver lock")
        if options.shot:
            page.keyboard.down("w")
            time.sleep(4.0)
            page.screenshot(path=options.shot)
            page.keyboard.up("w")
        rclpy.init()
        node = Node("console_bench", namespace="team")
        message_type = "trajectory_msgs/msg/MultiDOFJointTrajectory"
        driven = page.input_value("#driven").split("/")[0]
        topic = f"/team/{driven}/human/reference"
        subscription = RawSubscription(node, topic, message_type)
        measure(page, subscription, console_process())
        browser.close()
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
