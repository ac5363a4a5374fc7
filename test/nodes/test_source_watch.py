# SPDX-License-Identifier: Apache-2.0
"""Who a tick waits for, and whose first word is believed."""

from harness import paper

from noninteract_ros.control.references.inputs import Source
from noninteract_ros.nodes.common.lockstep import LockstepSources
from noninteract_ros.scenario import Scenario

NAME = "cooperative/human"


def watch() -> tuple[LockstepSources, Source]:
    scenario = Scenario.from_dict(paper())
    team = scenario.build_team()
    core = scenario.build_controller(team, scenario.build_stack(team))
    return LockstepSources([NAME], core.inputs, 5.0), core.inputs["cooperative"].sources["human"]


def test_a_first_word_for_a_later_tick_is_believed_when_it_is_said_again() -> None:
    """The word for this tick may have been lost before both ends knew of each other."""
    found, _ = watch()
    assert found.starts_late(NAME, 0.001, 0.0)
    assert not found.starts_late(NAME, 0.001, 0.0)


def test_a_first_word_for_this_tick_and_all_that_follow_are_believed() -> None:
    """Also where a later word came first and was passed over."""
    found, source = watch()
    assert found.starts_late(NAME, 0.001, 0.0)
    assert not found.starts_late(NAME, 0.0, 0.0)
    source.mark_complete_until(0.0)
    assert not found.starts_late(NAME, 0.001, 0.0)
    assert not found.starts_late(NAME, 0.002, 0.0)


def test_nobody_else_is_passed_over() -> None:
    """Only sources that ticks wait for say everything again."""
    found, _ = watch()
    assert not found.starts_late("relative/autonomy", 0.001, 0.0)
