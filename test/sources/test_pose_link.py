# SPDX-License-Identifier: Apache-2.0
"""Six degrees of freedom over the link: arms that carry a box, and work that turns."""

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


def test_two_arms_follow_a_hand_that_moves_and_turns_and_the_account_is_kept() -> None:
    """At 100 ms one way with jitter and losses: bound, poses and the felt wrench."""
    rehearsal = Rehearsal(Scenario.from_dict(pose_link()))
    link = rehearsal.link
    assert link is not None
    subtask = rehearsal.stack.subtasks[0]
    values, part = rehearsal.stack.value_slices[0], rehearsal.stack.slices[0]
    assert subtask.dim == 6
    start, felt = None, []
    for _ in range(2200):
        tick = rehearsal.step()
        if (account := link.account) is None:
            continue
        here, device = tick.task.x[values], link.device_motion.position
        start = here if start is None else start
        assert account.operator_net >= -(0.1 + account.surprise) - 1e-9
        assert account.device_budget >= -account.surprise - 1e-9
        assert account.team_in <= account.operator_in + 0.1 + 1e-9
        felt.append(tick.feedback[part])
    wanted, moved, left = (
        subtask.layout.difference(*pair)
        for pair in ((device, start), (here, start), (device, here))
    )
    assert np.linalg.norm(wanted[:3]) > 0.1
    assert np.linalg.norm(wanted[3:]) > 0.2
    assert np.linalg.norm(left[:3]) < 0.2 * np.linalg.norm(moved[:3])
    assert np.linalg.norm(left[3:]) < 0.2 * np.linalg.norm(moved[3:])
    late = np.array(felt[-400:])
    assert np.abs(late).min(axis=0).max() > 0.0
    assert np.linalg.norm(late, axis=1).max() < 100.0
    assert (np.abs(np.array(felt)).max(axis=0) > 0.5).all()  # Forces and torques, all six.
    assert link.account is not None
    assert link.account.operator_out > 0.0


def test_without_passivity_the_arms_shake_and_energy_is_drawn() -> None:
    """The same hand and arms."""
    rehearsal = Rehearsal(Scenario.from_dict(pose_link(passivity="none")))
    for _ in range(900):
        rehearsal.step()
    assert rehearsal.link is not None
    assert rehearsal.link.account is not None
    assert rehearsal.link.account.operator_net < -1.0


def unlike_work(period: float) -> tuple[float, float]:
    """Work of a torque by the account and on the hand's own motion; their greatest difference."""
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
    counted = apart = 0.0
    for n in range(1, round(0.4 / period) + 1):
        now = n * period
        torque = 0.1 * np.array([np.cos(20.0 * now), np.sin(20.0 * now), 0.3])
        after = device.sample(now, torque)
        assert after is not None
        counted += float(torque @ TURN.difference(after.position, before.position))
        phi = so3.log(after.position)
        rate = so3.inverse_jacobian(phi) @ after.velocity
        apart = max(apart, abs(counted - 0.005 * float(rate @ rate)))
        before = after
    return counted, apart


def test_torque_and_rotation_are_power_conjugate() -> None:
    """What the account counts is the energy of a hand that turns freely, but for the sampling.

    The axes of torque and turn change; what is left falls with the tick.
    """
    energy, coarse = unlike_work(2e-3)
    _, fine = unlike_work(1e-3)
    assert energy > 0.005
    assert coarse < 1e-4 * energy
    assert fine < 0.55 * coarse


@pytest.mark.parametrize("scale", [0.5, 2.0])
def test_the_scale_of_the_force_scales_what_is_felt_and_counted(scale: float) -> None:
    """Half of the force over the same way is half of the energy, exactly."""

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
