# SPDX-License-Identifier: Apache-2.0
"""Fixtures of the tests that need ROS."""

import fcntl
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from harness import Ros
    from programs import Programs

DOMAINS = range(
    10, 60
)  # Up to 101 the ports stay below the ephemeral ones; other tests use 60 to 69.


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compile the control law before tests with deadlines need it.

    Also remove shared memory of programs that earlier tests have killed.
    """
    if not hasattr(session.config, "workerinput"):
        from noninteract_ros.control.fast.compile_ahead import compile_ahead
        from noninteract_ros.nodes.stack.shared_memory import remove_abandoned

        compile_ahead()
        remove_abandoned()


@contextmanager
def free_domain() -> Iterator[int]:
    """Lock a ROS domain that no other test on this machine uses."""
    for number in DOMAINS:
        with Path(tempfile.gettempdir(), f"noninteract_ros_domain_{number}").open("w") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            yield number
            return
    raise RuntimeError("all ROS domains for tests are in use")


@pytest.fixture
def domain() -> Iterator[int]:
    """ROS domain of one test."""
    with free_domain() as number:
        yield number


@pytest.fixture(scope="module")
def module_domain() -> Iterator[int]:
    """ROS domain of the tests of a module."""
    with free_domain() as number:
        yield number


@pytest.fixture
def ros(domain: int) -> Iterator["Ros"]:
    """Context and executor of one test."""
    from harness import Ros

    harness = Ros(domain)
    yield harness
    harness.close()


@pytest.fixture
def programs(tmp_path: Path, domain: int) -> Iterator["Programs"]:
    """Launcher of programs in separate processes."""
    from programs import Programs

    launcher = Programs(tmp_path, domain)
    yield launcher
    launcher.close()
