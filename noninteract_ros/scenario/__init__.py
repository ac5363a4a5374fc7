# SPDX-License-Identifier: Apache-2.0
"""What a run is: settings, files and the parts that they build."""

from noninteract_ros.scenario.scenario import Scenario as Scenario
