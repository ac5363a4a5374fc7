# SPDX-License-Identifier: Apache-2.0
"""Obstacles of a scenario and the bodies that its robots are made of."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from repository import ROOT

from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario import Scenario
from noninteract_ros.scenario.files import read_parameters
from noninteract_ros.scenario.shapes import shapes_of

TETRAHEDRON = """solid t
{facets}endsolid t
"""
FACET = "facet normal 0 0 0\nouter loop\n{}endloop\nendfacet\n"


def scenario(name: str, **obstacles: dict[str, Any]) -> Scenario:
    """A shipped scenario with obstacles in it."""
    values = read_parameters(ROOT / "config" / f"{name}.yaml")
    listed = [*values.get("surroundings", ()), *obstacles]
    return Scenario.from_dict({**values, "surroundings": listed, **obstacles})


def least(found: Scenario) -> dict[str, float]:
    """Smallest distance of each obstacle from any robot at the start [m]."""
    team = found.build_team()
    scene = found.build_scene(team)
    clearances = scene.evaluate(team.q0, np.zeros(team.n))
    result: dict[str, float] = {}
    for distance, pair in zip(clearances.distances, clearances.pairs, strict=True):
        for body in scene.pairs.watched[pair]:
            owner = scene.bodies[body].owner
            result[owner] = min(result.get(owner, np.inf), float(distance))
    return result


def test_obstacles_are_as_far_from_a_point_mass_as_geometry_says() -> None:
    """A point mass at (-0.5, 0) sees every kind of obstacle at its distance."""
    obstacles: dict[str, dict[str, Any]] = {
        "ball": {"kind": "sphere", "position": [-0.5, 1.0, 0.0], "radius": 0.3},
        "post": {"kind": "capsule", "start": [-2.0, 0, -1], "end": [-2.0, 0, 1], "radius": 0.1},
        "table": {"kind": "box", "size": [1.0, 0.4, 2.0], "pose": [-0.5, -2.0, 0, 0, 0, 0, 1]},
        "floor": {"kind": "plane", "point": [0.0, 0.0, -0.7], "normal": [0.0, 0.0, 2.0]},
    }
    found = scenario("paper", **obstacles)
    start = found.build_team().q0[:2]
    distances = least(found)
    assert distances["floor"] == pytest.approx(0.7)
    for name, centre, size in (("ball", (-0.5, 1.0), 0.3), ("post", (-2.0, 0.0), 0.1)):
        others = [found.build_team().q0[2:], start]
        nearest = min(float(np.linalg.norm(q - centre)) for q in others)
        assert distances[name] == pytest.approx(nearest - size, abs=1e-6)
    assert distances["table"] > 0.0


def test_a_mesh_is_its_convex_hull(tmp_path: Path) -> None:
    """A tetrahedron from a file is an obstacle; its scale counts."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    facets = "".join(
        FACET.format("".join("vertex {} {} {}\n".format(*corners[i]) for i in face))
        for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
    )
    file = tmp_path / "mesh.stl"
    file.write_text(TETRAHEDRON.format(facets=facets))
    block = {"kind": "mesh", "mesh": str(file), "scale": 0.5, "pose": [5.0, 0, 0, 0, 0, 0, 1.0]}
    found = scenario("paper", rock=block)
    team = found.build_team()
    right = max(float(team.q0[0]), float(team.q0[2]))
    assert least(found)["rock"] <= 5.0 - right + 1e-6
    plant = found.build_simulation(team, found.build_stack(team)).plant
    hull = [shape.hull for shape in shapes_of(found, plant, 1.0)][-1]
    assert hull.points.max(axis=0) == pytest.approx([5.5, 0.5, 0.5])


@pytest.mark.parametrize(
    ("block", "key"),
    [
        ({"kind": "sphere", "position": [0.0], "radius": 1.0}, "it.position"),
        ({"kind": "plane", "point": [0.0] * 3, "normal": [0.0] * 3}, "it.normal"),
        ({"kind": "mesh", "mesh": "nowhere.stl"}, "it.mesh"),
        ({"kind": "box", "size": [1.0, 1.0, 1.0], "pose": [0.0] * 7}, "it.pose"),
    ],
)
def test_an_obstacle_that_is_none_is_refused(block: dict[str, Any], key: str) -> None:
    """The error names the key."""
    with pytest.raises(ScenarioError, match=key):
        scenario("paper", it=block)


def test_two_pandas_are_bodies_with_the_box_they_hold() -> None:
    """Links are capsules; the held box touches the hands by design and is no pair with them."""
    found = scenario("dual_panda")
    team = found.build_team()
    scene = found.build_scene(team)
    names = [body.name for body in scene.bodies]
    assert len(names) == 23
    assert "box" in names
    partners = {
        names[other]
        for pair in scene.pairs.watched
        for body, other in (pair, pair[::-1])
        if names[body] == "box"
    }
    assert "panda_1/panda_link4" in partners
    assert "panda_1/panda_hand" not in partners
    clearances = scene.evaluate(team.q0, np.zeros(team.n))
    assert clearances.least > 0.0
