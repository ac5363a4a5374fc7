# SPDX-License-Identifier: Apache-2.0
"""Conditions of limits in diagnostics: in words, once, and long enough to be read."""

from types import SimpleNamespace

import pytest

from noninteract_ros.control.safety.torque_limits import SafetyReport
from noninteract_ros.control.telemetry.limit_activity import LINGER, LimitActivity

JOINTS = ("left/joint_1", "left/joint_2")


def tick(
    law_share: float = 1.0,
    regularity: float = 0.8,
    sigma: float = 1.0,
    nu: float = 1.0,
    damping: float = 1.0,
    **report,
) -> SimpleNamespace:
    """A tick, as far as its conditions go."""
    safety = SafetyReport(**report)
    tank = SimpleNamespace(sigma=sigma, nu=nu, damping=damping)
    return SimpleNamespace(
        law_share=law_share,
        regularity=regularity,
        safety=safety,
        in_transition=False,
        intervened=law_share < 1.0 or safety.acted or sigma < 1.0 or nu * damping < 1.0,
        account=SimpleNamespace(gated=True, tank=tank, sigma=sigma),
        walls=None,
    )


@pytest.mark.parametrize(
    ("what", "texts"),
    [
        ({}, []),
        ({"law_share": 0.4}, ["near a singularity: recovering"]),
        ({"effort_share": 0.9}, ["at effort limits"]),
        (
            {"sigma": 0.99},
            ["decoupling reduced since the energy tank was low: damping or ~/refill restores it"],
        ),
        ({"nu": 0.99}, ["energy reserve low: springs yield"]),
        (
            {"nu": 0.0},
            ["energy reserve spent: springs released, damping and gravity compensation hold"],
        ),
        ({"damping": 0.5}, ["dampers feed motions since torques come late: damping reduced"]),
        ({"rate_fit": 0.5}, ["at the torque-rate limit"]),
        ({"clipped": True}, ["at effort limits"]),
        ({"repelled": (0,)}, ["left/joint_1 at its position limit"]),
        ({"rate_share": 0.0}, ["at the torque-rate limit"]),
        ({"too_fast": (0, 1)}, ["left/joint_1 too fast", "left/joint_2 too fast"]),
        ({"finite": False}, ["the law gives no finite torque: braking"]),
    ],
)
def test_each_condition_has_words(what, texts):
    """Joints are called by name, and a team inside its limits is no news."""
    watch = LimitActivity(JOINTS)
    watch.record(1.0, tick(**what))
    assert watch.conditions(1.0) == texts
    assert watch.interventions == bool(texts)


def test_a_condition_that_comes_and_goes_is_told_without_flicker():
    """Every third tick at the effort limit is one condition, until it has been over for 1 s."""
    watch = LimitActivity(JOINTS)
    for k in range(3000):
        now = k / 1000.0
        watch.record(now, tick(effort_share=0.5 if k % 3 == 0 and k < 1500 else 1.0))
        told = watch.conditions(now) == ["at effort limits"]
        assert told == (now <= 1.497 + LINGER)
    assert watch.interventions == 500


def test_values_are_the_lowest_since_they_were_asked_for():
    """A single tick between two reports is seen; then it starts anew."""
    watch = LimitActivity(JOINTS)
    for share in (1.0, 0.3, 1.0):
        watch.record(0.0, tick(law_share=share, regularity=0.2 + share, effort_share=0.1 + share))
    values = watch.values()
    assert values["law share, lowest"] == 0.3
    assert values["regularity, lowest"] == 0.5
    assert values["effort share, lowest"] == 0.4
    assert values["torque rate share, lowest"] == 1.0
    watch.record(0.1, tick())
    values = watch.values()
    assert values["law share, lowest"] == values["effort share, lowest"] == 1.0
    assert values["interventions"] == 1


def test_a_reset_forgets_conditions_of_another_time():
    """When the team's clock starts anew, nothing is told of what its former time had."""
    watch = LimitActivity(JOINTS)
    watch.record(50.0, tick(law_share=0.0))
    watch.reset()
    assert watch.conditions(0.0) == []
    assert watch.interventions == 1
