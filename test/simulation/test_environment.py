# SPDX-License-Identifier: Apache-2.0
"""Keys of surroundings and pushes in a scenario: valid and rejected values."""

import pytest

from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario import Scenario

AROUND = {
    "box": {"kind": "rigid_object", "mass": 1.0},
    "gate": {"kind": "door", "hinge": [0.5, 1.0, 0.0], "inertia": 1.0},
    "side": {"kind": "wall", "point": [0.0, -1.0, 0.0], "normal": [0.0, 2.0, 0.0]},
    "shove": {"robot": "left", "start": 1.0, "duration": 0.5, "force": [1.0, 0.0, 0.0]},
}


def values(**changes: dict) -> dict:
    """Return two point masses with an environment, with keys of blocks changed or added."""
    given = {
        "robots": ["left", "right"],
        "left": {"mass": 1.0},
        "right": {"mass": 2.0, "initial_position": [1.0, 0.0]},
        "subtasks": ["cooperative", "relative"],
        "cooperative": {"kind": "cooperative_position", "stiffness": [25.0], "damping": [53.0]},
        "relative": {"kind": "relative_position", "stiffness": [50.0], "damping": [25.0]},
        "surroundings": ["box", "gate", "side"],
        "pushes": ["shove"],
    }
    blocks = {name: block | changes.get(name, {}) for name, block in AROUND.items()}
    return given | blocks | {k: v for k, v in changes.items() if k not in AROUND}


def test_every_element_of_the_environment_is_built():
    """Bodies, grips and contacts of each kind, in the order of their names."""
    scenario = Scenario.from_dict(values())
    team = scenario.build_team()
    plant = scenario.build_simulation(team, scenario.build_stack(team)).plant
    assert [name for name in plant.model.names if "/" in name][4:] == ["box/pose", "gate/hinge"]
    assert [item.frames for item in plant.couplings] == [
        ("left/tool", "box/grip_left"),
        ("right/tool", "box/grip_right"),
        ("left/tool", "gate/handle_left"),
        ("right/tool", "gate/handle_right"),
        ("left/tool",),
        ("right/tool",),
    ]


def test_robots_in_contact_can_be_selected():
    """`held_by` and `touched_by` exclude the other robots."""
    chosen = {"held_by": ["right"]}
    scenario = Scenario.from_dict(
        values(box=chosen, gate=chosen, side={"touched_by": ["left"]})
    )  # fmt: skip
    team = scenario.build_team()
    plant = scenario.build_simulation(team, scenario.build_stack(team)).plant
    frames = [item.frames[0] for item in plant.couplings]
    assert frames == ["right/tool", "right/tool", "left/tool"]


def test_every_key_is_a_parameter():
    """Surroundings, pushes and safety are listed with their values, as ROS parameters."""
    listed = {key: value for key, _, _, value in Scenario.from_dict(values()).parameters()}
    assert listed["box.mass"] == 1.0
    assert listed["box.held_by"] == ()
    assert listed["gate.axis"] == (0.0, 0.0, 1.0)
    assert listed["side.normal"] == (0.0, 2.0, 0.0)
    assert listed["shove.frame"] == ""
    assert listed["safety.singularity_begin"] == 0.3
    assert listed["surroundings"] == ("box", "gate", "side")


@pytest.mark.parametrize(
    ("block", "change", "key", "words"),
    [
        ("box", {"kind": "rigid_obj"}, "box.kind", ["'rigid_obj'", "rigid_object | door | wall"]),
        ("box", {"kind": None}, "box.kind", ["nothing", "rigid_object"]),
        ("box", {"kind": ["door"]}, "box.kind", ["['door']"]),
        ("box", {"mass": 0.0}, "box.mass", ["0.0", "> 0"]),
        ("box", {"masss": 1.0}, "box.masss", ["unknown key", "mass"]),
        ("box", {"size": [1.0, 1.0]}, "box.size", ["[1.0, 1.0]", "3 numbers > 0"]),
        ("box", {"size": [1.0, 1.0, 0.0]}, "box.size", ["3 numbers > 0"]),
        ("box", {"held_by": ["lift"]}, "box.held_by", ["'lift'", "left | right"]),
        ("box", {"stiffness": -1.0}, "box.stiffness", ["-1.0", ">= 0"]),
        ("gate", {"hinge": [0.0]}, "gate.hinge", ["[0.0]", "3 numbers"]),
        ("gate", {"axis": [0.0, 0.0, 0.0]}, "gate.axis", ["not all zero"]),
        ("gate", {"axis": [0.0, 1.0]}, "gate.axis", ["3 numbers"]),
        ("gate", {"inertia": 0.0}, "gate.inertia", ["> 0"]),
        ("gate", {"held_by": ["nobody"]}, "gate.held_by", ["'nobody'", "left"]),
        ("side", {"point": [0.0, 0.0]}, "side.point", ["3 numbers"]),
        ("side", {"normal": [0.0, 0.0, 0.0]}, "side.normal", ["not all zero"]),
        ("side", {"stiffness": 0.0}, "side.stiffness", ["> 0"]),
        ("side", {"touched_by": ["both"]}, "side.touched_by", ["'both'"]),
        ("shove", {"frame": "elbow"}, "shove.frame", ["'elbow'", "tool"]),
        ("shove", {"robot": "box"}, "shove.robot", ["'box'", "left | right"]),
        ("shove", {"torque": [1.0]}, "shove.torque", ["[1.0]", "3 numbers"]),
        ("shove", {"force": [1.0]}, "shove.force", ["[1.0]", "3 numbers"]),
    ],
)
def test_invalid_values_are_rejected_by_key(block, change, key, words):
    """Each error has the full key, the value found and the allowed values."""
    given = values(**{block: change})
    given[block] = {name: value for name, value in given[block].items() if value is not None}
    with pytest.raises(ScenarioError) as caught:
        Scenario.from_dict(given)
    assert caught.value.key == key
    assert all(word in str(caught.value) for word in words), str(caught.value)


def test_an_object_at_subtask_level_excludes_bodies():
    """Its equations are those of the team alone; walls have no body and may stay."""
    with pytest.raises(ScenarioError, match=r"^object: .*surroundings have bodies"):
        Scenario.from_dict(values(object={"mass": 1.0}))
    given = values(object={"mass": 1.0}, surroundings=["side"])
    del given["box"], given["gate"]
    Scenario.from_dict(given)


def test_thresholds_of_singularities_must_be_in_order():
    """`singularity_end` must be below `singularity_begin`."""
    with pytest.raises(
        ScenarioError, match=r"^safety.singularity_end: found 0.4, allowed: < sing"
    ):
        Scenario.from_dict(values(safety={"singularity_end": 0.4}))


def test_names_of_surroundings_are_unique():
    """A name is used once and is not another key."""
    with pytest.raises(ScenarioError, match=r"^surroundings: .*unique"):
        Scenario.from_dict(values(surroundings=["box", "left"]))
    with pytest.raises(ScenarioError, match=r"^missing: .*nothing"):
        Scenario.from_dict(values(surroundings=["box", "gate", "side", "missing"]))
