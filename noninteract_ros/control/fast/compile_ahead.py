# SPDX-License-Identifier: Apache-2.0
"""Compile the law in advance: `python -m noninteract_ros.control.fast.compile_ahead`.

Otherwise a controller compiles at its first start, and later ones load the cached code.
"""

from noninteract_ros.control.fast.compiled_layout import CompiledLayout
from noninteract_ros.control.fast.robotwise_evaluation import RobotwiseEvaluator
from noninteract_ros.subtasks.kinds.cooperative_position import CooperativePosition
from noninteract_ros.subtasks.kinds.relative_position import RelativePosition
from noninteract_ros.subtasks.stack import SubtaskStack
from noninteract_ros.team.models.point_mass import PointMass
from noninteract_ros.team.team import Team


def compile_ahead() -> None:
    """Compile all functions, or load them from the cache; the code is the same for all teams."""
    team = Team([PointMass(mass=1.0).build(name) for name in ("first", "second")])
    lead = CooperativePosition("cooperative_position").build("lead", team)
    gap = RelativePosition("relative_position").build("gap", team)
    stack = SubtaskStack(team, [lead, gap])
    RobotwiseEvaluator.of(team, stack)
    CompiledLayout(stack.layout).prepare()


if __name__ == "__main__":
    compile_ahead()
