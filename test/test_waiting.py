# SPDX-License-Identifier: Apache-2.0
"""Error of a missed deadline."""

import pytest
import waiting


def test_the_error_of_a_missed_deadline_has_the_last_state(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The name of the condition is evaluated at the deadline, and all reports are included."""
    polls: list[int] = []

    def done() -> bool:
        polls.append(len(polls))
        return False

    monkeypatch.setattr(waiting, "DEADLINE", 0.05)
    monkeypatch.setattr(waiting, "REPORTS", [lambda: [f"polled up to {polls[-1]}"]])
    with pytest.raises(AssertionError) as caught:
        waiting.until(done, lambda: f"more than {len(polls)}")
    text = str(caught.value)
    assert len(polls) > 1
    assert f"more than {len(polls)}" in text
    assert f"polled up to {polls[-1]}" in text
