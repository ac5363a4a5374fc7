# SPDX-License-Identifier: Apache-2.0
"""Row of each subtask on the topic `<subtask>/energy`: energies, and what made the torque."""

import numpy as np

from noninteract_ros.arrays import Array
from noninteract_ros.control.energy.storage import Energy
from noninteract_ros.control.law.decoupling import LAWS
from noninteract_ros.control.references.subtask_input import AUTHORITIES
from noninteract_ros.control.telemetry.limit_activity import LimitActivity
from noninteract_ros.control.tick import Tick

# In this order. `interventions` and `transitions` count ticks since the program's start; `law` is
# an index in `decoupling.LAWS`, `leader` one in `subtask_input.AUTHORITIES`.
LABELS = (
    "time",
    "storage",
    "rate",
    "supplied",
    "dissipated",
    "interventions",
    "transitions",
    "law",
    "leader",
)


def rows(now: float, tick: Tick, energy: Energy, watch: LimitActivity) -> Array:
    """Return a row of numbers for each subtask, shape (number of subtasks, labels).

    Args:
        now: Time of the tick [s].
        tick: The tick.
        energy: Its storage functions.
        watch: Activity of limits up to this tick, itself included.
    """
    count = len(tick.led)
    leaders = [AUTHORITIES.index(led.leader) for led in tick.led]
    columns = (
        np.full(count, now),
        energy.storage,
        energy.rate,
        energy.supplied,
        energy.dissipated,
        np.full(count, watch.interventions),
        np.full(count, watch.transitions),
        np.full(count, LAWS.index(tick.law)),
        leaders,
    )
    return np.array(columns, dtype=float).T
