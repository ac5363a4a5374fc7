# SPDX-License-Identifier: Apache-2.0
"""First inputs of lockstep sources."""

from harness import paper

from noninteract_ros.control.references.inputs import Source
from noninteract_ros.nodes.common.lockstep import LockstepSources
from noninteract_ros.scenario import Scenario

NAME = "cooperative/human"


def lockstep_sources() -> tuple[LockstepSources, Source]:
    scenario = Scenario.from_dict(paper())
    core = scenario.build_controller(scenario.team, scenario.stack)
    return LockstepSources([NAME], core.inputs, 5.0), core.inputs["cooperative"].sources["human"]


def test_a_late_first_input_is_accepted_when_it_is_resent() -> None:
    """The input of the current tick may have been lost before the topics were matched."""
    sources, _ = lockstep_sources()
    assert sources.starts_late(NAME, 0.001, 0.0)
    assert not sources.starts_late(NAME, 0.001, 0.0)


def test_a_first_input_for_the_current_tick_is_accepted() -> None:
    """It is accepted, like all that follow, after a late input was skipped."""
    sources, source = lockstep_sources()
    assert sources.starts_late(NAME, 0.001, 0.0)
    assert not sources.starts_late(NAME, 0.0, 0.0)
    source.mark_complete_until(0.0)
    assert not sources.starts_late(NAME, 0.001, 0.0)
    assert not sources.starts_late(NAME, 0.002, 0.0)


def test_inputs_of_other_sources_are_not_skipped() -> None:
    """Only lockstep sources resend their inputs."""
    sources, _ = lockstep_sources()
    assert not sources.starts_late("relative/autonomy", 0.001, 0.0)
