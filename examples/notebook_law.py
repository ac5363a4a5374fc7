# SPDX-License-Identifier: Apache-2.0
"""The law without ROS: a human input moves two robots of different mass in formation."""

import numpy as np

from noninteract_ros.control.references.inputs import Target
from noninteract_ros.scenario import Scenario

gains = {"stiffness": [50.0], "damping": [30.0]}
robots = {"light": {"mass": 1.0}, "heavy": {"mass": 4.0, "initial_position": [-1.0, 0.0]}}
led = {"kind": "cooperative_position", "authority": "human", **gains}
subtasks = {"cooperative": led, "relative": {"kind": "relative_position", **gains}}
scenario = Scenario.from_dict({"robots": [*robots], "subtasks": [*subtasks], **robots, **subtasks})
team = scenario.build_team()
controller = scenario.build_controller(team, scenario.build_stack(team))
simulation = scenario.build_simulation(team, controller.stack)
goal = Target(np.array([1.0, 0.5]), np.zeros(2))
while (now := simulation.now) < 3.0:
    controller.inputs["cooperative"].sources["human"].receive(now, goal, now)
    tick = controller.step(now, simulation.q, simulation.v)
    simulation.step(tick.torque)
print(tick.task.x.round(3), tick.error.e, controller.energy(tick, np.zeros(4)).storage)
