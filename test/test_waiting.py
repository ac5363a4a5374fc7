# SPDX-License-Identifier: Apache-2.0
"""What a wait in vain tells."""

import pytest
import waiting


def test_a_wait_in_vain_tells_how_things_are_at_its_end(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not how they were before; and whoever has seen something is asked."""
    seen: list[int] = []

    def done() -> bool:
        seen.append(len(seen))
        return False

    monkeypatch.setattr(waiting, "DEADLINE", 0.05)
    monkeypatch.setattr(waiting, "WITNESSES", [lambda: [f"seen up to {seen[-1]}"]])
    with pytest.raises(AssertionError) as caught:
        waiting.until(done, lambda: f"more than {len(seen)}")
    said = str(caught.value)
    assert len(seen) > 1
    assert f"more than {len(seen)}" in said
    assert f"seen up to {seen[-1]}" in said
