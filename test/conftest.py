# SPDX-License-Identifier: Apache-2.0
"""Fixtures of all tests that need ROS."""

import itertools
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from harness import Programs, Ros

WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0")[2:])
DOMAINS = itertools.cycle(range(20 + WORKER % 4 * 10, 30 + WORKER % 4 * 10))


@pytest.fixture
def domain() -> int:
    """A ROS domain that no other test uses at the same time."""
    return next(DOMAINS)


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
    from harness import Programs

    starter = Programs(tmp_path, domain)
    yield starter
    starter.close()
