# SPDX-License-Identifier: Apache-2.0
"""Lockstep sources and the order of stamps."""

import time
from collections.abc import Mapping, Sequence

from noninteract_ros.clock import seconds
from noninteract_ros.control.references.inputs import HORIZON
from noninteract_ros.control.references.subtask_input import SubtaskInput
from noninteract_ros.errors import InputError

START_TIMEOUT = 30.0  # [s] wall time to wait for the first input of a source
RESTART_SILENCE = 1.0  # [s] wall time without messages after which an earlier stamp is a restart


class LockstepSources:
    """Sources whose input each lockstep tick waits for.

    Args:
        names: Sources as `<subtask>/<source>`.
        inputs: Inputs by subtask.
        timeout: Wall time after which a tick no longer waits for a source [s].

    Attributes:
        absent: Sources that have timed out. A source returns with its next input.
    """

    def __init__(
        self, names: Sequence[str], inputs: Mapping[str, SubtaskInput], timeout: float
    ) -> None:
        self._names, self._inputs, self._timeout = tuple(names), inputs, timeout
        self._skipped: set[str] = set()
        self.absent: set[str] = set()

    def starts_late(self, name: str, stamp: float, now: float) -> bool:
        """Return True if the first input of a source is for a later tick than the current one.

        The input for the current tick was then lost, as messages are until publisher and
        subscription are matched. The source publishes all of it again when the team sends its
        state again, so only the first such input is skipped.

        Args:
            name: Source as `<subtask>/<source>`.
            stamp: Stamp of the input [s].
            now: Time of the team [s].
        """
        subtask, source = name.split("/")
        received = self._inputs[subtask].sources[source].complete_until > -float("inf")
        if received or stamp <= now + 1e-9 or name not in self._names or name in self._skipped:
            self._skipped.discard(name)
            return False
        self._skipped.add(name)
        return True

    def missing(self, now: float, waiting_since: float) -> list[str]:
        """Return the sources whose input for the tick at `now` is still awaited.

        Args:
            now: Time of the team [s].
            waiting_since: Monotonic time at which the state of the tick was received [s].
        """
        missing = []
        for name in self._names:
            subtask, source = name.split("/")
            complete_until = self._inputs[subtask].sources[source].complete_until
            if complete_until >= now - 1e-9:
                self.absent.discard(name)
            elif name not in self.absent:
                limit = self._timeout if complete_until > -float("inf") else START_TIMEOUT
                if time.monotonic() - waiting_since > limit:
                    self.absent.add(name)
                else:
                    missing.append(name)
        return missing


class StampChecker:
    """Order of stamps per topic.

    Rejects stamps that go back or run ahead. After `RESTART_SILENCE` without messages on a topic,
    any stamp is accepted.
    """

    def __init__(self) -> None:
        self._last: dict[str, tuple[int, float]] = {}

    def last(self, topic: str) -> int:
        """Return the newest accepted stamp of a topic [ns], or -1 if there is none."""
        return self._last.get(topic, (-1, 0.0))[0]

    def check(self, topic: str, stamp: int, lead: float = float("inf")) -> bool:
        """Check a stamp against the last accepted one.

        Args:
            topic: Topic of the message.
            stamp: Stamp [ns].
            lead: Maximum growth of the stamp beyond the elapsed wall time [s].

        Returns:
            True if the topic has restarted with an earlier stamp.

        Raises:
            InputError: The stamp goes back or runs ahead without a silence before it.
        """
        if topic not in self._last:
            return False
        last, at = self._last[topic]
        silence = time.monotonic() - at
        if silence >= RESTART_SILENCE:
            return stamp < last
        if stamp < last:
            text = f"stamp goes back: {seconds(stamp):.6f} s after {seconds(last):.6f} s"
            raise InputError(text)
        if seconds(stamp - last) > silence + lead:
            text = f"stamp runs ahead: {seconds(stamp):.6f} s after {seconds(last):.6f} s"
            raise InputError(text)
        return False

    def record(self, topic: str, stamp: int) -> None:
        """Record the stamp [ns] of an accepted message."""
        self._last[topic] = (stamp, time.monotonic())

    def accept(self, topic: str, stamp: int, lead: float = float("inf")) -> bool:
        """Check a stamp and record it; see `check`."""
        restarted = self.check(topic, stamp, lead)
        self.record(topic, stamp)
        return restarted

    def reset(self) -> None:
        """Discard the stamps of all topics."""
        self._last.clear()


def max_stamp_lead(rate: float) -> float:
    """Return how far stamps of a team with this rate [Hz] may run ahead of wall time [s]."""
    return max(HORIZON, 2.0 / rate)
