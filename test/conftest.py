# SPDX-License-Identifier: Apache-2.0
"""Fixtures of all tests that need ROS."""

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

DOMAINS = range(10, 60)  # Up to 101, ports stay below the ephemeral ones; other tests have theirs.


def pytest_sessionstart(session: pytest.Session) -> None:
    """Compiles the law before any worker or program of a test would, each with its deadline.

    Also removes what programs that earlier tests have killed left in shared memory.
    """
    if not hasattr(session.config, "workerinput"):
        from noninteract_ros.control.fast.compile_ahead import compile_ahead
        from noninteract_ros.nodes.stack.shared_memory import remove_abandoned

        compile_ahead()
        remove_abandoned()


@contextmanager
def free_domain() -> Iterator[int]:
    """A ROS domain that no other test on this machine uses at the same time."""
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
    """A ROS domain of its own for a test."""
    with free_domain() as number:
        yield number


@pytest.fixture(scope="module")
def module_domain() -> Iterator[int]:
    """A ROS domain of its own for all tests of a module."""
    with free_domain() as number:
        yield number


@pytest.fixture
def ros(domain: int) -> Iterator["Ros"]:
    """A private context with an executor."""
    from harness import Ros

    harness = Ros(domain)
    yield harness
    harness.close()


@pytest.fixture
def programs(tmp_path: Path, domain: int) -> Iterator["Programs"]:
    """A starter of programs in processes of their own."""
    from programs import Programs

    starter = Programs(tmp_path, domain)
    yield starter
    starter.close()
