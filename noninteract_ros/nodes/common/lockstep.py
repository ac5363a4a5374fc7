# SPDX-License-Identifier: Apache-2.0
"""Sources whose input lockstep waits for."""

import time
from collections.abc import Mapping, Sequence

from noninteract_ros.control.references.subtask_input import SubtaskInput

START_TIMEOUT = 30.0  # [s] wall time to wait for the first input of a source


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
