# SPDX-License-Identifier: Apache-2.0
"""Scenarios: settings, files and the parts built from them."""

from noninteract_ros.scenario.scenario import Scenario as Scenario
