# SPDX-License-Identifier: Apache-2.0
"""Scenarios: valid combinations, and errors for all others."""

import copy
from pathlib import Path

import numpy as np
import pytest

from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import load_scenario

CONFIG = Path(__file__).resolve().parents[2] / "config"
MISSING = object()


def small() -> dict:
    """Scenario of two point masses with all optional blocks."""
    return {
        "robots": ["left", "right"],
        "left": {"model": "point_mass", "mass": 1.0},
        "right": {"mass": 2, "initial_position": [1, 0]},
        "subtasks": ["cooperative", "relative"],
        "cooperative": {
            "kind": "cooperative_position",
            "stiffness": [25.0],
            "damping": [53.0],
            "authority": "human",
        },
        "relative": {"kind": "relative_position", "stiffness": [50.0], "damping": [25.0]},
        "object": {"mass": 1.0, "stiffness": 20.0, "rest": [1.0, 1.0]},
        "pushes": ["shove"],
        "shove": {"robot": "left", "start": 1.0, "duration": 0.5, "force": [1.0, 0.0, 0.0]},
        "haptic": {"motion": "paper", "start_time": 4.0},
        "planner": {"formations": ["pair"], "pair": {"value": [1.0, 1.0]}},
        "lockstep_sources": ["cooperative/human"],
    }


def changed(path: str, value: object) -> dict:
    """The small scenario with the value of a dotted key changed, added or taken away."""
    values = copy.deepcopy(small())
    *blocks, name = path.split("/")
    inner = values
    for block in blocks:
        inner = inner[block]
    if value is MISSING:
        del inner[name]
    else:
        inner[name] = value
    return values


@pytest.mark.parametrize("file", sorted(CONFIG.glob("*.yaml")), ids=lambda file: file.stem)
def test_scenarios_of_the_package_load(file):
    """Every scenario that is shipped passes every check."""
    assert load_scenario(file).robots


def test_a_whole_scenario_builds_all_its_parts():
    """All named parts are built, with the right sizes and in order."""
    scenario = Scenario.from_dict(small())
    team = scenario.build_team()
    stack = scenario.build_stack(team)
    assert team.names == ("left", "right")
    np.testing.assert_array_equal(team.q0, [0.0, 0.0, 1.0, 0.0])
    assert stack.names == ("cooperative", "relative")
    controller = scenario.build_controller(team, stack)
    np.testing.assert_array_equal(controller.mode.impedance.stiffness, [25.0, 25.0, 50.0, 50.0])
    assert controller.mode.law == "energy_gated"
    assert controller.inputs["cooperative"].authority == "human"
    assert controller.inputs["relative"].authority == "hold"
    assert scenario.build_simulation(team, stack).rate == 1000.0


@pytest.mark.parametrize("name", ["object", "haptic", "planner", "pushes", "lockstep_sources"])
def test_optional_parts_may_be_left_out(name):
    """Object, operator, planner and pushes are optional."""
    values = changed(name, MISSING)
    if name == "pushes":
        del values["shove"]
    Scenario.from_dict(values)


def test_parameters_that_every_node_has_are_left_alone():
    """ROS's own parameters may stand in a scenario."""
    Scenario.from_dict(small() | {"use_sim_time": True, "qos_overrides": {}})


WRONG = [
    ("robots", 5, "robots", ["5", "a list of names"]),
    ("robots", None, "robots", ["None", "a list of names"]),
    ("robots", "left", "robots", ["'left'", "a list of names"]),
    ("robots", ["left"], "right", ["unknown key"]),
    ("robots", ["left", "left"], "robots", ["'left'", "unique"]),
    ("robots", ["left", "rate"], "robots", ["'rate'"]),
    ("robots", ["left", "planner"], "robots", ["'planner'"]),
    ("robots", ["left", "ri ght"], "robots", ["'ri ght'", "letters, digits and _"]),
    ("robots", ["left", "2nd"], "robots", ["'2nd'", "letters, digits and _"]),
    ("robots", ["left", "röbot"], "robots", ["'röbot'", "letters, digits and _"]),
    ("robots", ["left", True], "robots", ["True"]),
    ("robots", ["left", "relative"], "subtasks", ["'relative'", "unique"]),
    ("robots", ["left", "right", "middle"], "middle", ["nothing", "a block of keys"]),
    ("left", 3.0, "left", ["3.0", "a block of keys"]),
    ("left/mass", 0.0, "left.mass", ["0.0", "a number > 0"]),
    ("left/mass", "1 kg", "left.mass", ["'1 kg'", "a number"]),
    ("left/mass", MISSING, "left.mass", ["nothing", "required"]),
    ("left/model", "point_mas", "left.model", ["'point_mas'", "point_mass"]),
    ("left/model", ["point_mass"], "left.model", ["['point_mass']", "point_mass"]),
    ("left/axes", ["x", "w"], "left.axes", ["['x', 'w']", "x | y | z"]),
    ("left/axes", ["x", "x"], "left.axes", ["different ones of x, y, z"]),
    ("left/initial_position", [1.0], "left.initial_position", ["[1.0]", "2 numbers"]),
    ("left/weight", 1.0, "left.weight", ["unknown key", "mass"]),
    ("subtasks", 3, "subtasks", ["3", "a list of names"]),
    ("cooperative/kind", MISSING, "cooperative.kind", ["nothing", "cooperative_position"]),
    ("cooperative/kind", "mean", "cooperative.kind", ["'mean'", "relative_position"]),
    ("cooperative/kind", {}, "cooperative.kind", ["{}", "cooperative_position"]),
    ("cooperative/stifness", [1.0], "cooperative.stifness", ["unknown key", "stiffness"]),
    ("cooperative/stiffness", [-1.0], "cooperative.stiffness", ["[-1.0]", ">= 0"]),
    ("cooperative/stiffness", [1.0] * 3, "cooperative.stiffness", ["1 or 2 numbers"]),
    ("cooperative/damping", [0.0], "cooperative.damping", ["[0.0]", "> 0"]),
    ("cooperative/inertia", [1.0] * 3, "cooperative.inertia", ["1 or 2 numbers"]),
    ("cooperative/potential", "saturating", "cooperative.max_force", ["[]", "1 or 2 numbers"]),
    ("cooperative/authority", "robot", "cooperative.authority", ["'robot'", "autonomy"]),
    ("cooperative/takeover", "soft", "cooperative.takeover", ["'soft'", "shaped | direct"]),
    ("cooperative/timeout", 0, "cooperative.timeout", ["0", "> 0"]),
    ("cooperative/max_jerk", [1.0] * 3, "cooperative.max_jerk", ["1 or 2 numbers"]),
    ("cooperative/weights", [1.0], "cooperative.weights", ["[1.0]", "2 numbers"]),
    ("cooperative/axes", ["x"], "subtasks", ["1 (cooperative) + 2 (relative) = 3", "has 4"]),
    ("relative/edges", ["left", "middle"], "relative.edges", ["middle", "['left', 'right']"]),
    ("relative/frame", "tool", "relative.frame", ["'tool'", "world"]),
    ("object/masss", 1.0, "object.masss", ["unknown key", "mass"]),
    ("object/mass", -1.0, "object.mass", ["-1.0", ">= 0"]),
    ("object/rest", [1.0], "object.rest", ["[1.0]", "2 numbers"]),
    ("object/sign", "wrong", "object.sign", ["'wrong'", "physical | paper"]),
    ("object/carried_by", "relativ", "object.carried_by", ["'relativ'", "relative | cooperative"]),
    ("object", None, "object", ["nothing", "a block"]),
    ("haptic", 5, "haptic", ["5", "a block"]),
    ("haptic/subtask", "lead", "haptic.subtask", ["'lead'", "cooperative"]),
    ("haptic/motion", "dance", "haptic.motion", ["'dance'", "circle"]),
    ("planner", 5, "planner", ["5", "a block"]),
    ("planner", None, "planner", ["nothing", "a block"]),
    ("planner/formations", 5, "planner.formations", ["5", "a list of names"]),
    ("planner/formations", ["pair", "row"], "planner.row", ["nothing", "a formation"]),
    ("planner/subtask", "shape", "planner.subtask", ["'shape'", "relative"]),
    ("planner/pair/value", [1.0], "planner.pair.value", ["[1.0]", "2 numbers"]),
    ("planner/pair/size", [1.0], "planner.pair.size", ["unknown key", "value"]),
    ("shove/robot", "middle", "shove.robot", ["'middle'", "left | right"]),
    ("shove/force", [1.0], "shove.force", ["[1.0]", "3 numbers"]),
    ("shove/duration", MISSING, "shove.duration", ["nothing", "required"]),
    ("shove", MISSING, "shove", ["nothing", "a block"]),
    ("gravity", [0.0, -9.81], "gravity", ["[0.0, -9.81]", "3 numbers"]),
    ("law", "noninteractin", "law", ["'noninteractin'", "noninteracting | "]),
    ("rate", 0, "rate", ["0", "> 0"]),
    ("rate", float("nan"), "rate", ["nan"]),
    ("rate", 1e6, "rate", ["<= 10000"]),
    ("lockstep", 1, "lockstep", ["1", "true or false"]),
    ("lockstep_sources", ["cooperative/robot"], "lockstep_sources", ["cooperative/human"]),
    ("roobts", ["a"], "roobts", ["unknown key", "robots"]),
    ("middle", {"mass": 1.0}, "middle", ["unknown key"]),
    (True, 1.0, "True", ["unknown key"]),
]


@pytest.mark.parametrize(("path", "value", "key", "words"), WRONG)
def test_what_is_wrong_is_refused_by_key(path, value, key, words):
    """Every mistake is refused with the full key, what was found and what is allowed."""
    values = small() | {path: value} if path is True else changed(path, value)
    with pytest.raises(ScenarioError) as caught:
        Scenario.from_dict(values)
    assert caught.value.key == key
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_the_scenario_that_is_changed_above_is_right():
    """Nothing but the change makes the scenarios above wrong; nothing is changed in place."""
    values = small()
    Scenario.from_dict(values)
    assert values == small()


@pytest.mark.parametrize("name", ["robots", "subtasks"])
def test_robots_and_subtasks_must_be_listed(name):
    """A scenario without its lists of robots or subtasks is rejected by that key."""
    values = {key: value for key, value in small().items() if key in ("robots", "subtasks")}
    blocks = [block for key, listed in values.items() if key != name for block in listed]
    values = {key: small()[key] for key in [*values, *blocks] if key != name}
    with pytest.raises(ScenarioError, match=f"^{name}: found nothing, allowed: a list of names"):
        Scenario.from_dict(values)


@pytest.mark.parametrize(
    ("listing", "listed", "words"),
    [
        ("robots", ["left"], "at least 2 robots"),
        ("subtasks", ["relative"], "assumption 1 and 2 .*= 2 coordinates, the team has 4"),
    ],
)
def test_parts_that_do_not_make_a_team_are_refused(listing, listed, words):
    """Too few robots or subtasks are refused under the key that lists them."""
    values = small()
    for name in set(values[listing]) - set(listed):
        del values[name]
    for name in ("object", "haptic", "planner", "lockstep_sources", "pushes", "shove"):
        del values[name]
    values[listing] = listed
    with pytest.raises(ScenarioError, match=f"^{listing}: .*{words}"):
        Scenario.from_dict(values)
