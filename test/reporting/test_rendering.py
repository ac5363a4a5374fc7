# SPDX-License-Identifier: Apache-2.0
"""Rendering of robots, held bodies and reference ghosts."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from matplotlib.figure import Figure
from PIL import Image
from rehearsed import record, scenario_values

from noninteract_ros.reporting.recording.recorded import Recorded
from noninteract_ros.reporting.rendering.animation import (
    PUSH_COLOUR,
    Animation,
    motion_figure,
    save_animation,
)
from noninteract_ros.reporting.rendering.painter import Camera, paint
from noninteract_ros.reporting.rendering.scene import Scene
from noninteract_ros.scenario.files import find_scenario, nest, read_parameters
from noninteract_ros.scenario.rehearsal import Rehearsal
from noninteract_ros.scenario.shapes import NO_ROBOT
from noninteract_ros.team.geometry import hulls

URDF = """<robot name="two">
<link name="root"><collision><geometry><box size="0.2 0.4 0.6"/></geometry></collision></link>
<link name="turning"><inertial><mass value="1"/><origin xyz="0.1 0 0"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><origin xyz="0 0 0.5"/><geometry><sphere radius="0.1"/></geometry></collision></link>
<link name="sliding"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><cylinder radius="0.05" length="0.3"/></geometry></collision></link>
<link name="tool"/>
<joint name="j1" type="revolute"><parent link="root"/><child link="turning"/><axis xyz="1 0 0"/>
<limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
<joint name="j2" type="prismatic"><parent link="turning"/><child link="sliding"/>
<origin xyz="0 0 1"/><axis xyz="1 0 0"/>
<limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
<joint name="fix" type="fixed"><parent link="sliding"/><child link="tool"/></joint></robot>"""


def values_of(name: str) -> dict:
    return nest(dict(read_parameters(find_scenario(name))))


@pytest.fixture(scope="module")
def carried(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    """Two planar arms and a cart with a plate, pushed at an elbow early on."""
    values = values_of("carry") | {"rate": 500.0}
    values["nudge"] |= {"start": 0.2}
    values["haptic"] |= {"start_time": 0.1, "update_rate": 500.0}
    return Recorded(record(tmp_path_factory.mktemp("carry"), values, 1.0))


def centre(hull: hulls.Hull) -> np.ndarray:
    return 0.5 * (hull.points.min(axis=0) + hull.points.max(axis=0))


def test_collision_geometry_moves_with_the_joints(tmp_path: Path) -> None:
    """Box, sphere and cylinder of a URDF are where its joints put them, on a turned base."""
    arm = {
        "model": "urdf",
        "urdf_text": URDF,
        "tool_frame": "tool",
        "base_pose": [2.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0],  # Half a turn about z.
        "initial_position": [0.5, 0.4],
    }
    joints = ["arm/j1", "arm/j2", "mass/x", "mass/y"]
    values = {
        "robots": ["arm", "mass"],
        "arm": arm,
        "mass": {"mass": 1.0},
        "subtasks": ["all"],
        "all": {"kind": "posture", "joints": joints, "stiffness": [1.0], "damping": [1.0]},
    }
    recorded = Recorded(record(tmp_path, values, 0.01))
    scene = Scene(recorded)
    parts = [hull for owner, hull in scene.hulls(scene.snapshot(0).q) if owner == 0]
    # x -> -x and y -> -y by the base; the first joint leans what stands on it along z.
    across, up = -np.sin(0.5), np.cos(0.5)
    expected = ([2.0, 0.0, 0.0], [2.0, -0.5 * across, 0.5 * up], [1.6, -across, up])
    assert len(parts) == 3
    for part, place in zip(parts, expected, strict=True):
        np.testing.assert_allclose(centre(part), place, atol=2e-3)
    np.testing.assert_allclose(np.ptp(parts[0].points, axis=0), [0.2, 0.4, 0.6], atol=1e-12)


def test_held_bodies_are_drawn_near_their_simulated_pose(carried: Recorded) -> None:
    """The static equilibrium in the grasps is close to the simulated pose."""
    rehearsal = Rehearsal(carried.scenario)
    scene = Scene(carried)
    for row in range(400):
        if row % 100 == 0:
            drawn, true = scene.snapshot(row).q, rehearsal.simulation.plant_q
            np.testing.assert_allclose(drawn[: carried.team.n], true[: carried.team.n], atol=1e-12)
            plates = [
                next(h for owner, h in scene.hulls(q) if owner == NO_ROBOT) for q in (drawn, true)
            ]
            # It starts without strain, m g / 3 k = 2.18 mm above its rest.
            assert np.abs(plates[0].points - plates[1].points).max() < 2.2e-3
            np.testing.assert_allclose(
                np.linalg.norm(np.ptp(plates[0].points, axis=0)[:2]), np.hypot(0.6, 0.4), rtol=0.05
            )
        rehearsal.step()


def test_the_ghost_is_on_the_references(carried: Recorded) -> None:
    """All subtasks of the ghost have their desired values; those of the pushed team do not."""
    scene = Scene(carried)
    row = 200
    ghost = scene.snapshot(row).ghost
    assert ghost is not None
    still = np.zeros((1, carried.team.n))
    wanted = np.hstack(
        [
            carried.motion(f"{name}/desired", name).position[row // 2]
            for name in carried.stack.names
        ]
    )
    values = carried.task_values(ghost[None, : len(carried.team.q0)], still)[0][0]
    assert np.abs(carried.stack.difference(values, wanted)).max() < 2e-4
    assert np.abs(carried.stack.difference(carried.values[0][row], wanted)).max() > 2e-3


def test_a_push_is_an_arrow_while_it_lasts(carried: Recorded) -> None:
    """It ends at the pushed elbow, from 0.2 s to 0.5 s only."""
    animation = Animation(carried)
    counts = []
    for row in (50, 150, 350):
        figure = Figure()
        axes = figure.add_subplot()
        animation.draw(axes, animation.scene.snapshot(row))
        arrows = [text for text in axes.texts if getattr(text, "arrow_patch", None)]
        counts.append(len(arrows))
        assert all(a.arrow_patch.get_edgecolor()[0] == pytest.approx(0xD0 / 255) for a in arrows)
    assert PUSH_COLOUR == "#D00000"
    assert counts == [0, 1, 0]
    point, force = animation.scene.pushes(animation.scene.snapshot(150))[0]
    data = carried.team.model.createData()
    pin.forwardKinematics(carried.team.model, data, carried.q[150])
    elbow = data.oMi[carried.team.model.getJointId("left/joint_2")].translation
    np.testing.assert_allclose(point, elbow, atol=1e-12)
    np.testing.assert_array_equal(force, [15.0, 0.0, 0.0])


def test_the_image_sequence_shows_six_states(carried: Recorded) -> None:
    """They range from the first to the last, with the whole team inside each image."""
    animation = Animation(carried)
    figure = motion_figure(animation)
    assert len(figure.axes) == 6
    texts = [text.get_text() for axes in figure.axes for text in axes.texts if text.get_text()]
    times = [float(text.removesuffix(" s")) for text in texts]
    np.testing.assert_allclose(times, np.linspace(0.0, 0.998, 6), atol=0.06)
    for axes in figure.axes:
        drawn = next(item for item in axes.collections if type(item).__name__ == "TriMesh")
        triangulation = drawn._triangulation
        (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
        assert left < triangulation.x.min() < triangulation.x.max() < right
        assert low < triangulation.y.min() < triangulation.y.max() < high


def test_the_animation_is_short_and_small(tmp_path: Path, carried: Recorded) -> None:
    """It is a GIF in real time with differing images."""
    path = save_animation(Animation(carried), tmp_path / "motion.gif")
    assert path.stat().st_size < 2_000_000
    with Image.open(path) as animation:
        assert animation.n_frames == 10
        shown = []
        for number in (0, 9):
            animation.seek(number)
            shown.append(np.asarray(animation.convert("RGB"), dtype=int))
            assert animation.info["duration"] == 100
    assert np.abs(shown[0] - shown[1]).max() > 50


def test_point_masses_are_spheres_joined_by_edges(tmp_path: Path) -> None:
    """Heavier spheres are larger; a planar team is viewed from above."""
    animation = Animation(Recorded(record(tmp_path, scenario_values(), 0.3)))
    light, heavy = (hull for _, hull in animation.scene.hulls(animation.scene.snapshot(0).q))
    sizes = [np.ptp(hull.points, axis=0).max() for hull in (light, heavy)]
    assert sizes[1] / sizes[0] == pytest.approx(2.0 ** (1 / 3), rel=1e-6)
    np.testing.assert_allclose(centre(light), [0.3, 0.4, 0.0], atol=2e-3)
    assert animation.scene.flat
    assert animation.scene.edges == [(0, 1)]


def test_non_finite_states_are_skipped(tmp_path: Path) -> None:
    """All other states are drawn."""

    def spoil(topic: str, time: float, arrays: list[np.ndarray]) -> list[np.ndarray]:
        broken = topic == "joint_states" and time < 0.1
        return [array * np.nan for array in arrays] if broken else arrays

    animation = Animation(Recorded(record(tmp_path, scenario_values(), 0.2, spoil)))
    assert animation.rows(5).min() == 50
    assert len(motion_figure(animation).axes) == 6


def test_hulls_are_closed_with_outward_normals() -> None:
    """The divergence theorem gives the volume of every shape, refined or not."""
    turned = pin.SE3(pin.utils.rotate("x", 0.7), np.array([0.3, -0.2, 1.0]))
    for hull, volume in (
        (hulls.box(np.array([0.2, 0.4, 0.6])), 0.048),
        (hulls.sphere(0.5, 4000), 4 / 3 * np.pi * 0.125),
        (hulls.cylinder(0.1, 0.5), 0.005 * np.pi),
        (hulls.capsule(np.zeros(3), np.array([0.0, 0.4, 0.0]), 0.1), 0.004 * np.pi * (1 + 1 / 3)),
    ):
        for body in (hull, hull.transformed(turned), hull.refined(0.05)):
            a, b, c = body.corners.transpose(1, 0, 2)
            found = (np.cross(a, b) * c).sum() / 6.0
            assert found == pytest.approx(volume, rel=0.12)
            outward = np.cross(b - a, c - a)
            assert ((outward[:, None] * body.normals).sum(axis=2) > 0.0).all()
        edges = np.linalg.norm(np.diff(hull.refined(0.05).corners, axis=1), axis=2)
        assert edges.max() <= 0.05


def test_edges_of_a_box_stay_sharp() -> None:
    """Normals at its corners are those of its sides."""
    normals = hulls.box(np.ones(3)).normals.reshape(-1, 3)
    np.testing.assert_allclose(np.sort(np.abs(normals), axis=1), [[0, 0, 1]] * 36, atol=1e-12)


def test_near_bodies_hide_far_ones() -> None:
    """The result does not depend on the order of the bodies."""
    camera = Camera.towards(np.zeros(3), 1.0, -90.0, 0.0)
    near = "#FF0000", hulls.sphere(0.2).transformed(pin.SE3(np.eye(3), np.array([0.0, -1.0, 0.0])))
    far = "#0000FF", hulls.sphere(0.6)
    for bodies in ([near, far], [far, near]):
        axes = Figure().add_subplot()
        paint(axes, camera, bodies)
        colours = axes.collections[0].get_facecolor()
        assert colours[-1][0] > 0.0  # Drawn last: red, the near one.
        assert colours[0][2] > 0.0
