# SPDX-License-Identifier: Apache-2.0
"""Six degrees of freedom over the link: arms with a box, and work of torques."""

import numpy as np
import pytest
from pose_link import pose_link

from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.rehearsal import Rehearsal
from noninteract_ros.schema import load
from noninteract_ros.sources.human.haptic_device import HapticDevice, HapticSettings
from noninteract_ros.sources.link.bilateral import BilateralLink
from noninteract_ros.sources.link.settings import LinkSettings
from noninteract_ros.subtasks import so3
from noninteract_ros.subtasks.layout import Layout

TURN = Layout((0,), (True,))


def test_two_arms_follow_a_hand_in_six_dimensions_within_the_energy_bound() -> None:
    """The energy bound holds at 100 ms one way with jitter and losses, in all six coordinates."""
    rehearsal = Rehearsal(Scenario.from_dict(pose_link()))
    link = rehearsal.link
    assert link is not None
    subtask = rehearsal.stack.subtasks[0]
    values, part = rehearsal.stack.value_slices[0], rehearsal.stack.slices[0]
    assert subtask.dim == 6
    start, feedback = None, []
    for _ in range(2200):
        tick = rehearsal.step()
        if (account := link.account) is None:
            continue
        here, device = tick.task.x[values], link.device_motion.position
        start = here if start is None else start
        assert account.operator_net >= -(0.1 + account.surprise) - 1e-9
        assert account.device_budget >= -account.surprise - 1e-9
        assert account.team_in <= account.operator_in + 0.1 + 1e-9
        feedback.append(tick.feedback[part])
    wanted, moved, left = (
        subtask.layout.difference(*pair)
        for pair in ((device, start), (here, start), (device, here))
    )
    assert np.linalg.norm(wanted[:3]) > 0.1
    assert np.linalg.norm(wanted[3:]) > 0.2
    assert np.linalg.norm(left[:3]) < 0.2 * np.linalg.norm(moved[:3])
    assert np.linalg.norm(left[3:]) < 0.2 * np.linalg.norm(moved[3:])
    late = np.array(feedback[-400:])
    assert np.abs(late).min(axis=0).max() > 0.0
    assert np.linalg.norm(late, axis=1).max() < 100.0
    assert (np.abs(np.array(feedback)).max(axis=0) > 0.5).all()  # Forces and torques, all six.
    assert link.account is not None
    assert link.account.operator_out > 0.0


def test_without_passivity_the_arms_oscillate_and_energy_is_drawn() -> None:
    """The same hand and arms draw energy from the link."""
    rehearsal = Rehearsal(Scenario.from_dict(pose_link(passivity="none")))
    for _ in range(900):
        rehearsal.step()
    assert rehearsal.link is not None
    assert rehearsal.link.account is not None
    assert rehearsal.link.account.operator_net < -1.0


def work_difference(period: float) -> tuple[float, float]:
    """Return the work of a torque by the account, and its largest error."""
    keys = {
        "motion": "still",
        "hand_mass": 1.0,
        "hand_inertia": 0.01,
        "hand_turning_damping": 0.0,
        "hand_turning_stiffness": 0.0,
        "update_rate": 1.0 / period,
    }
    device = HapticDevice(load(HapticSettings, keys, "haptic"), TURN)
    before = device.sample(0.0)
    assert before is not None
    counted = error = 0.0
    for n in range(1, round(0.4 / period) + 1):
        now = n * period
        torque = 0.1 * np.array([np.cos(20.0 * now), np.sin(20.0 * now), 0.3])
        after = device.sample(now, torque)
        assert after is not None
        counted += float(torque @ TURN.difference(after.position, before.position))
        phi = so3.log(after.position)
        rate = so3.inverse_jacobian(phi) @ after.velocity
        error = max(error, abs(counted - 0.005 * float(rate @ rate)))
        before = after
    return counted, error


def test_torque_and_rotation_are_power_conjugate() -> None:
    """The account counts the energy of a freely rotating hand, up to the sampling error.

    The axes of torque and rotation change; the error falls with the tick.
    """
    energy, coarse = work_difference(2e-3)
    _, fine = work_difference(1e-3)
    assert energy > 0.005
    assert coarse < 1e-4 * energy
    assert fine < 0.55 * coarse


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_the_force_scale_scales_feedback_and_energy(scale: float) -> None:
    """Half of the force over the same displacement is exactly half of the energy."""

    def net(force: float, **link: float) -> float:
        keys = {"motion": "circle", "centre": [0.0, 0.0], "hand_mass": 0.5}
        settings, layout = load(HapticSettings, keys, "haptic"), Layout.scalars(2)
        found = BilateralLink(
            HapticDevice(settings, layout), settings, load(LinkSettings, link, "link"), layout
        )
        for tick in range(500):
            found.sample(tick / 1e3, np.array([force, 0.0]))
        assert found.account is not None
        return found.account.operator_net

    assert net(1.0, force_scale=scale) == net(scale)
