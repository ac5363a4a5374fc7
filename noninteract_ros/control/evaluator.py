# SPDX-License-Identifier: Apache-2.0
"""Choice of the evaluator of a team's states: robot by robot, or dense."""

from noninteract_ros.control.law.team_dynamics import DenseEvaluator, TeamEvaluator
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.team import Team


def make_evaluator(team: Team, stack: SubtaskStack) -> TeamEvaluator:
    """Return a robot-by-robot evaluator where the subtasks allow it; this imports numba."""
    from noninteract_ros.control.fast.robotwise_evaluation import RobotwiseEvaluator

    return RobotwiseEvaluator.of(team, stack) or DenseEvaluator(team, stack)
