# SPDX-License-Identifier: Apache-2.0
"""Laws that follow each other on two Pandas with their box."""

from pathlib import Path

from noninteract_ros.scenario.files import find_scenario, load_scenario
from noninteract_ros.scenario.rehearsal import Rehearsal


def test_two_pandas_go_through_the_natural_law_and_back_without_a_debt() -> None:
    """No limit of a joint acts, nothing shakes, and the account stays in credit."""
    rehearsal = Rehearsal(load_scenario(Path(find_scenario("dual_panda"))))
    for number in range(900):
        if law := {300: "natural", 600: "energy_gated"}.get(number):
            rehearsal.controller.set_law(law)
        tick = rehearsal.step()
        assert not tick.safety.acted
        assert abs(tick.state.v).max() < 0.5
        assert tick.account.tank.level > 0.25
        assert tick.account.tank.nu == 1.0
