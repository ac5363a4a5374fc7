# SPDX-License-Identifier: Apache-2.0
"""Who has spoken for which tick, and in which order."""

import time
from collections.abc import Mapping, Sequence

from noninteract_ros.clock import seconds
from noninteract_ros.control.references.inputs import HORIZON
from noninteract_ros.control.references.subtask_input import SubtaskInput
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
        self._passed_over: set[str] = set()
        self.absent: set[str] = set()

    def begins_ahead(self, name: str, when: float, now: float) -> bool:
        """Whether the first word of a source, for `when` [s], is for a later tick than `now` [s].

        What it said for this tick was lost then, as messages are before both ends know of each
        other. It says everything again when the team sends its state again; then it is believed.
        """
        subtask, source = name.split("/")
        heard = self._inputs[subtask].sources[source].complete_until > -float("inf")
        if heard or when <= now + 1e-9 or name not in self._names or name in self._passed_over:
            self._passed_over.discard(name)
            return False
        self._passed_over.add(name)
        return True

    def missing(self, now: float, waiting_since: float) -> list[str]:
        """Sources that have not spoken for the tick at `now` [s] and are still waited for.

        Args:
            now: The team's time [s].
            waiting_since: When the tick's state came, by the monotonic clock [s].
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


class StampOrder:
    """Refuses stamps that go back or run ahead, topic by topic; after a silence all may be new."""

    def __init__(self) -> None:
        self._last: dict[str, tuple[int, float]] = {}

    def last(self, topic: str) -> int:
        """Newest stamp that was taken on a topic [ns]; -1, if none was."""
        return self._last.get(topic, (-1, 0.0))[0]

    def check(self, topic: str, stamp: int, lead: float = float("inf")) -> bool:
        """Compares a stamp [ns] with the one before it.

        Args:
            topic: Where it came.
            stamp: The stamp [ns].
            lead: By how much more than wall time it may have grown [s].

        Returns:
            Whether the topic starts anew with an earlier stamp.

        Raises:
            InputError: The stamp goes back or runs ahead, without a silence before it.
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

    def note(self, topic: str, stamp: int) -> None:
        """Keeps the stamp [ns] of a message that was taken."""
        self._last[topic] = (stamp, time.monotonic())

    def take(self, topic: str, stamp: int, lead: float = float("inf")) -> bool:
        """Checks and keeps a stamp; see `check`."""
        anew = self.check(topic, stamp, lead)
        self.note(topic, stamp)
        return anew

    def forget(self) -> None:
        """Starts anew on every topic."""
        self._last.clear()


def state_lead(rate: float) -> float:
    """By how much the stamps of a team with this rate [Hz] may run ahead of wall time [s]."""
    return max(HORIZON, 2.0 / rate)
