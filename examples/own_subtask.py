# SPDX-License-Identifier: Apache-2.0
"""Custom kind of subtask: distance and bearing of two robots, with independent references."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from noninteract_ros.control.references.inputs import Target
from noninteract_ros.scenario import Scenario
from noninteract_ros.schema import key
from noninteract_ros.subtasks.kinds.registry import register_kind
from noninteract_ros.subtasks.subtask import Subtask, SubtaskState
from noninteract_ros.team.team import Team, TeamState


class PolarFormation(Subtask):
    """Distance [m] and bearing [rad] of the first robot from the second, in the x-y plane."""

    elements = ("distance", "bearing")
    axes = ("x",)  # One number per element, sent as the x of a message.

    def __init__(self, name: str) -> None:
        self.name = name

    def evaluate(self, state: TeamState) -> SubtaskState:
        """Return value, Jacobian and its exact rate; undefined at zero distance."""
        d = (state.tool_positions[0] - state.tool_positions[1])[:2]
        D = (state.tool_jacobians[0] - state.tool_jacobians[1])[:2]
        D_rate = (state.tool_jacobian_rates[0] - state.tool_jacobian_rates[1])[:2]
        r = np.hypot(*d)
        along = d / r
        across = np.array([-along[1], along[0]])
        r_rate, bearing_rate = along @ D @ state.v, across @ D @ state.v / r
        J = np.array([along @ D, across @ D / r])
        across_rate = -(bearing_rate * along + r_rate / r * across) / r  # of across / r
        J_rate = [
            bearing_rate * across @ D + along @ D_rate,
            across_rate @ D + across @ D_rate / r,
        ]
        return SubtaskState(np.array([r, np.arctan2(d[1], d[0])]), J, np.array(J_rate))


@dataclass(frozen=True)
class PolarFormationBlock:
    """Configuration block of the kind."""

    kind: str = key("Kind of subtask", choices=("polar_formation",))

    def build(self, name: str, team: Team, others: Mapping[str, Subtask]) -> Subtask:
        """Build the subtask for a team; the stack validates it."""
        return PolarFormation(name)


def main() -> None:
    register_kind("polar_formation", PolarFormationBlock)
    gains = {"stiffness": [50.0], "damping": [30.0]}
    blocks = {
        "robots": ["left", "right"],
        "left": {"mass": 1.0},
        "right": {"mass": 4.0, "initial_position": [1.0, 0.0]},
        "subtasks": ["cooperative", "formation"],
        "cooperative": {"kind": "cooperative_position", "authority": "human", **gains},
        "formation": {"kind": "polar_formation", "authority": "autonomy", **gains},
    }
    scenario = Scenario.from_dict(blocks)
    team = scenario.build_team()
    controller = scenario.build_controller(team, scenario.build_stack(team))
    simulation = scenario.build_simulation(team, controller.stack)
    human = controller.inputs["cooperative"].sources["human"]
    autonomy = controller.inputs["formation"].sources["autonomy"]
    rows = []
    while (now := simulation.now) < 4.0:
        human.receive(now, Target(np.array([2.0, 1.0]), np.zeros(2)), now)
        autonomy.receive(now, Target(np.array([1.0, np.pi / 2]), np.zeros(2)), now)
        tick = controller.step(now, simulation.q, simulation.v)
        simulation.step(tick.torque)
        rows.append(tick.task.x)
    x = np.array(rows)
    print(f"Centre moved from {x[0, :2].round(3)} to {x[-1, :2].round(3)} m,")
    print(f"bearing from {np.rad2deg(x[0, 3]):.1f} to {np.rad2deg(x[-1, 3]):.1f} degrees;")
    print(f"the distance deviated from 1 m by at most {np.abs(x[:, 2] - 1.0).max():.1e} m.")


if __name__ == "__main__":
    main()
