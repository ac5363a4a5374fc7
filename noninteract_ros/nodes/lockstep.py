# SPDX-License-Identifier: Apache-2.0
"""Who has spoken for which tick, and in which order."""

import time
from collections.abc import Mapping, Sequence

from noninteract_ros.clock import seconds
from noninteract_ros.control.subtask_input import SubtaskInput
from noninteract_ros.errors import InputError

START_TIMEOUT = 30.0  # [s] wall time given to a source that has never spoken
RESTART_SILENCE = 1.0  # [s] wall time after which a stamp that goes back means a restart


class SourceWatch:
    """Tells which lockstep sources a tick still waits for.

    Args:
        names: Sources as `<subtask>/<source>`.
        inputs: The subtasks' inputs.
        timeout: Wall time after which a source that does not speak is given up [s].

    Attributes:
        absent: Sources that were given up; they return by speaking.
    """

    def __init__(
        self, names: Sequence[str], inputs: Mapping[str, SubtaskInput], timeout: float
    ) -> None:
        self._names, self._inputs, self._timeout = tuple(names), inputs, timeout
        self.absent: set[str] = set()

    def missing(self, now: float, waiting_since: float) -> list[str]:
        """Sources that have not spoken for the tick at `now` [s] and are still waited for.

        Args:
            now: The team's time [s].
            waiting_since: When the tick's state came, by the monotonic clock [s].
        """
        missing = []
        for name in self._names:
            subtask, source = name.split("/")
            heard_until = self._inputs[subtask].sources[source].heard_until
            if heard_until >= now - 1e-9:
                self.absent.discard(name)
            elif name not in self.absent:
                limit = self._timeout if heard_until > -float("inf") else START_TIMEOUT
                if time.monotonic() - waiting_since > limit:
                    self.absent.add(name)
                else:
                    missing.append(name)
        return missing


class StampOrder:
    """Refuses stamps that go back, topic by topic; a topic that was silent may start anew."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[int, float]] = {}

    def check(self, topic: str, stamp: int) -> bool:
        """Notes a stamp [ns]; zero is no stamp.

        Returns:
            Whether the topic started anew with an earlier stamp.

        Raises:
            InputError: The stamp goes back without a silence before it.
        """
        if stamp == 0 and topic != "joint_states":
            return False
        now = time.monotonic()
        last, at = self._last.get(topic, (stamp, now))
        if stamp < last and now - at < RESTART_SILENCE:
            raise InputError(
                f"stamp goes back: {seconds(stamp):.6f} s after {seconds(last):.6f} s"
            )
        self._last[topic] = (stamp, now)
        return stamp < last
