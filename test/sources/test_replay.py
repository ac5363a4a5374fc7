# SPDX-License-Identifier: Apache-2.0
"""Replay of recorded motions and rejection of broken recordings."""

import numpy as np
import pytest

from noninteract_ros.errors import InputError
from noninteract_ros.sources.human.replay import read_recording, replay


def test_a_cubic_motion_is_replayed_exactly():
    """Resampling recovers a cubic motion and its derivatives from a few uneven samples."""
    times = np.array([10.0, 10.4, 11.0, 11.3, 12.0])
    s = times - 10.0
    motion = replay(times, np.stack([s**3 - s, 2.0 * s**2], axis=1))
    for t in np.linspace(0.0, 2.0, 23):
        now = motion(t)
        np.testing.assert_allclose(now.position, [t**3 - t, 2 * t**2], atol=1e-13)
        np.testing.assert_allclose(now.velocity, [3 * t**2 - 1, 4 * t], atol=1e-12)
        np.testing.assert_allclose(now.acceleration, [6 * t, 4.0], atol=1e-11)


def test_samples_are_met_and_the_ends_held(tmp_path):
    """The positions of a file are replayed at its times; the motion is at rest outside."""
    file = tmp_path / "hand.csv"
    file.write_text(
        "\ufefft, x, y\n2.0, 1.0, -1\n\n2.5, 1.5, -2\n3.5, 0, 3e-1\n", encoding="utf-8"
    )
    times, positions = read_recording(file, 2)
    motion = replay(times, positions)
    np.testing.assert_array_equal(times, [2.0, 2.5, 3.5])
    for t, expected in ((0.0, [1, -1]), (0.5, [1.5, -2]), (1.5, [0, 0.3]), (-3, [1, -1])):
        np.testing.assert_allclose(motion(t).position, expected, atol=1e-14)
    np.testing.assert_array_equal(motion(99.0).position, [0, 0.3])
    np.testing.assert_array_equal(motion(99.0).velocity, [0, 0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "header is nothing, should be t and 2 coordinates"),
        ("t,x\n0,1\n1,2\n", "header is t, x, should be t and 2 coordinates"),
        ("t,x,y,z\n0,1,2,3\n", "header is t, x, y, z, should be t and 2 coordinates"),
        ("time,x,y\n0,1,2\n", "header is time, x, y"),
        ("0,1,2\n1,2,3\n", "header is 0, 1, 2"),
        ("t,1,2\n1,2,3\n", "the first line must name the columns"),
        ("t,x,y\n0,1,2\n", "1 rows of numbers, at least 2"),
        ("t,x,y\n0,1,2\n1,2\n", "line 3: 2 columns, the header has 3"),
        ("t,x,y\n0,1,2\n1,oops,3\n", "line 3: 'oops' is not a finite number"),
        ("t,x,y\n0,1,nan\n1,2,3\n", "line 2: 'nan' is not a finite number"),
        ("t,x,y\ninf,1,2\n1,2,3\n", "line 2: 'inf' is not a finite number"),
        ("t,x,y\n0,1,2\n\n1,2,3\n1,2,3\n", "line 5: t = 1 is not later than the line before"),
        ("t,x,y\n0,1,2\n-1,2,3\n", "line 3: t = -1 is not later than the line before"),
        ('t,x,y\n0,"1,2\n', "unexpected end of data"),
    ],
)
def test_a_broken_recording_is_rejected_by_line(tmp_path, text, message):
    """The message names the file, the line and the error."""
    file = tmp_path / "hand.csv"
    file.write_text(text)
    with pytest.raises(InputError) as caught:
        read_recording(file, 2)
    assert str(file) in str(caught.value)
    assert message in str(caught.value)


def test_an_unreadable_file_is_rejected(tmp_path):
    """A missing file, a folder and a binary file are rejected by name."""
    binary = tmp_path / "hand.bin"
    binary.write_bytes(b"t,x\n\xff\xfe\x00\n")
    for path in (tmp_path / "none.csv", tmp_path, binary):
        with pytest.raises(InputError, match=path.name):
            read_recording(path, 1)
