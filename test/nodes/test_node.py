# SPDX-License-Identifier: Apache-2.0
"""Startup and shutdown of the programs, and the scenario as their parameters."""

import json
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
import rclpy
import yaml
from harness import Ros, flat, paper
from programs import Programs
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from repository import ROOT
from waiting import DEADLINE, until

from noninteract_ros.errors import ScenarioError
from noninteract_ros.nodes.common.parameter_files import EMPTY_LIST, dump, rewrite, write

PAPER = str(ROOT / "config" / "paper.yaml")
NAMES = ["robot_team", "controller", "haptic_emulator", "relative_planner"]

# One process runs all command lines, since the main function returns the exit status.
SCRIPT = """
import contextlib, io, json, sys
from noninteract_ros.nodes.controller.controller import main

for line in sys.stdin:
    output = io.StringIO()
    with contextlib.redirect_stderr(output):
        status = main(["controller", *json.loads(line)])
    print(json.dumps([status, output.getvalue()]))
"""

ROS_ARGS = ["--ros-args", "--params-file"]
FILES = {
    "mixed.yaml": "/**: {ros__parameters: {robots: [robot_1, 2]}}",
    "nothing.yaml": "",
    "broken.yaml": "/**: {ros__parameters: {rate: [1}}",
    "beside.yaml": "/**: {rate: 3.0}",
    "flat.yaml": "rate: 3.0",
    "value.yaml": "/**: {ros__parameters: 5}",
    "null.yaml": "/**: {ros__parameters: {rate: }}",
    "nested.yaml": "/**: {ros__parameters: {rate: [[1], [2]]}}",
    "date.yaml": "/**: {ros__parameters: {rate: 2020-01-01}}",
    "typo.yaml": "/**: {ros__parameters: {cooperative: {stifness: [1.0]}}}",
    "nan.yaml": "/**: {ros__parameters: {cooperative: {damping: [.nan]}}}",
    "size.yaml": "/**: {ros__parameters: {relative: {damping: [1.0, 2.0, 3.0]}}}",
    "text.yaml": "/**: {ros__parameters: {rate: fast}}",
    "other.yaml": "/**: {ros__parameters: {law: nointeracting}}",
}
# Arguments after `--ros-args --params-file PAPER`, and text of the error; {} is the folder.
INVALID = [
    (["--params-file", "{}/absent.yaml"], "{}/absent.yaml: (file): found No such file"),
    (["--params-file", "{}/nothing.yaml"], "{}/nothing.yaml: (file): found nothing"),
    (["--params-file", "{}/broken.yaml"], "{}/broken.yaml: (file): found line 1: expected"),
    (["--params-file", "{}/mixed.yaml"], "{}/mixed.yaml: robots: found ['robot_1', 2]"),
    (["--params-file", "{}/beside.yaml"], "{}/beside.yaml: /**.rate: found 3.0"),
    (["--params-file", "{}/flat.yaml"], "{}/flat.yaml: rate: found 3.0"),
    (["--params-file", "{}/value.yaml"], "{}/value.yaml: /**.ros__parameters: found 5"),
    (["--params-file", "{}/null.yaml"], "{}/null.yaml: rate: found nothing"),
    (["--params-file", "{}/nested.yaml"], "{}/nested.yaml: rate: found [[1], [2]]"),
    (["--params-file", "{}/date.yaml"], "{}/date.yaml: rate: found '20"),
    (["--params-file", "{}/typo.yaml"], "{}/typo.yaml: cooperative.stifness: found an unknown"),
    (["--params-file", "{}/nan.yaml"], "{}/nan.yaml: cooperative.damping: found [nan]"),
    (["--params-file", "{}/size.yaml"], "{}/size.yaml: relative.damping: found [1.0, 2.0, 3.0]"),
    (["--params-file", "{}/other.yaml"], "{}/other.yaml: law: found 'nointeracting', allowed:"),
    (["-p", "rate:=0"], "-p: rate: found 0"),
    (["-p", "rate:=abc"], "-p: rate: found 'abc'"),
    (["-p", "lockstep:=5"], "-p: lockstep: found 5"),
    (["--params-file", "{}/text.yaml"], "{}/text.yaml: rate: found 'fast'"),
    (["-p", "nonsense:=1"], "-p: nonsense: found an unknown key"),
    (["-p", "robot_1.axes:=[x, x]"], "robot_1.axes: found ['x', 'x']"),
    (["-p", "robot_1.axes:=[x, 1]"], "-p: robot_1.axes: found ['x', 1]"),
    (["-p", "a b"], "(arguments): found Failed to parse"),
    (["--params-file"], "(arguments): found Failed to parse"),
    (["--nonsense"], "(arguments): found ['--nonsense']"),
    (["--", "fast"], "(arguments): found fast"),
]


def test_invalid_arguments_are_reported_in_one_line(programs: Programs, tmp_path: Path) -> None:
    """Exit status 2 and one line with file, key, found and allowed values."""
    for name, text in FILES.items():
        (tmp_path / name).write_text(text)
    lines = [
        json.dumps([*ROS_ARGS, PAPER, *(item.format(tmp_path) for item in arguments)])
        for arguments, _ in INVALID
    ]
    completed = subprocess.run(
        [sys.executable, "-c", SCRIPT],
        input="\n".join(lines),
        capture_output=True,
        text=True,
        timeout=2 * DEADLINE,
        env=programs.environment,
        cwd=ROOT,
    )
    assert completed.returncode == 0, completed.stderr
    answers = [json.loads(line) for line in completed.stdout.splitlines()]
    for (arguments, expected), (status, output) in zip(INVALID, answers, strict=True):
        assert status == 2, arguments
        assert len(output.splitlines()) == 1, output
        assert expected.format(tmp_path) in output, output
        assert ", allowed: " in output


def test_each_program_rejects_an_invalid_scenario(programs: Programs) -> None:
    """The error is the only output of each program."""
    for name in NAMES:
        programs.start(name, paper(robot_2={"mass": -1.0}))
    for name in NAMES:
        assert programs.running[name].wait(DEADLINE) == 2
        lines = programs.log(name).splitlines()
        assert len(lines) == 1
        assert "scenario.yaml: robot_2.mass: found -1.0, allowed: a number > 0" in lines[0]


@pytest.mark.parametrize("lockstep", [True, False], ids=["lockstep", "wall"])
@pytest.mark.parametrize("first", [signal.SIGINT, signal.SIGTERM])
def test_each_program_shuts_down_on_a_signal(
    ros: Ros, programs: Programs, lockstep: bool, first: signal.Signals
) -> None:
    """Exit status 0 during a run, and no traceback."""
    values = paper(lockstep=lockstep, rate=200.0)
    monitor = ros.monitor(values)
    for name in NAMES:
        programs.start(name, values)

    def running(name: str) -> bool:
        """Return True once a node has left its startup; on a slow machine it may warn."""
        return not monitor.status.get(name, (0, "waiting"))[1].startswith("waiting")

    until(lambda: all(map(running, NAMES)), "all nodes run")
    second = signal.SIGINT if first == signal.SIGTERM else signal.SIGTERM
    for name, number in zip(NAMES, (first, second, second, first), strict=True):
        programs.running[name].send_signal(number)
    for name in NAMES:
        assert programs.running[name].wait(DEADLINE) == 0, programs.log(name)
        assert not re.search("Traceback|FATAL|Error", programs.log(name)), programs.log(name)


def test_a_program_without_its_block_does_not_start(ros: Ros) -> None:
    """The emulator needs a block `haptic`, the planner a block `planner`."""
    with pytest.raises(ScenarioError, match="haptic: found nothing"):
        ros.make("haptic_emulator", paper(haptic=None))
    with pytest.raises(ScenarioError, match="planner: found nothing"):
        ros.make("relative_planner", paper(planner=None))


def test_every_key_is_a_parameter_with_a_description(ros: Ros) -> None:
    """All keys are declared with value and description; none is live in this node."""
    values = paper(lockstep_sources=[])
    node = ros.make("robot_team", values)
    listed = ros.call(ListParameters, "robot_team/list_parameters").result.names
    expected = {name: (rule, value) for name, _, rule, value in node.scenario.parameters()}
    assert set(expected) <= set(listed)
    assert set(dict(flat(values))) <= set(expected)
    names = list(expected)
    request = DescribeParameters.Request(names=names)
    descriptors = ros.call(
        DescribeParameters, "robot_team/describe_parameters", request
    ).descriptors
    for name, descriptor in zip(names, descriptors, strict=True):
        assert descriptor.description == expected[name][0].doc
        assert descriptor.read_only
    wanted = ["rate", "robot_1.axes", "relative.edges", "cooperative.authority"]
    answer = ros.call(
        GetParameters, "robot_team/get_parameters", GetParameters.Request(names=wanted)
    )
    rate, axes, edges, authority = (parameter_value_to_python(item) for item in answer.values)
    assert (rate, axes, edges, authority) == (1000.0, ["x", "y"], ["robot_1", "robot_2"], "human")
    everything = GetParameters.Request(names=listed)  # As `ros2 param dump` requests it.
    values = ros.call(GetParameters, "robot_team/get_parameters", everything).values
    answered = dict(zip(listed, map(parameter_value_to_python, values), strict=True))
    assert (answered["lockstep_sources"], answered["surroundings"]) == ([], [])
    change = SetParameters.Request(parameters=[Parameter("rate", value=5.0).to_parameter_msg()])
    assert not ros.call(SetParameters, "robot_team/set_parameters", change).results[0].successful


def test_texts_and_empty_lists_reach_the_nodes(tmp_path: Path) -> None:
    """The parser of ROS keeps a path with ` #` and `: ` whole, and an empty list."""
    file = write(tmp_path / "a #1.yaml", {"sources": [], "rate": 1e3})
    arguments = ["", *ROS_ARGS, str(file), "-p", "output:=trial #2/a: b", "-p", "pushes:=[]"]
    context = rclpy.Context()
    rclpy.init(args=rewrite(arguments, tmp_path), context=context, domain_id=0)
    node = Node("reader", context=context, automatically_declare_parameters_from_overrides=True)
    found = {name: item.value for name, item in node.get_parameters_by_prefix("").items()}
    node.destroy_node()
    context.shutdown()
    assert found["output"] == "trial #2/a: b"
    assert (found["sources"], found["pushes"], found["rate"]) == (EMPTY_LIST, EMPTY_LIST, 1000.0)


def test_the_last_value_wins_whatever_its_type(tmp_path: Path) -> None:
    """A later number, list or string of another type replaces the first one."""
    files = [tmp_path / "first.yaml", tmp_path / "second.yaml"]
    files[0].write_text("/**: {ros__parameters: {rate: 100, haptic: {file: a, centre: [1, 2]}}}")
    files[1].write_text("/**: {ros__parameters: {haptic.centre: [0.5, 1.0]}}")
    arguments = ["--params-file", str(files[0]), "--params-file", str(files[1])]
    result = rewrite(["", *arguments, "-p", "rate:=20.5"], tmp_path)
    first, second = (yaml.safe_load(Path(result[place]).read_text()) for place in (2, 4))
    assert first == {"/**": {"ros__parameters": {"haptic.file": "a"}}}
    assert second == {"/**": {"ros__parameters": {"haptic.centre": [0.5, 1.0]}}}
    assert result[5:] == ["-p", "rate:=20.5"]
    assert rewrite(["", "-p", "axes:=[x, y]"], tmp_path)[2] == 'axes:=["x", "y"]'


def test_a_written_parameter_file_is_unambiguous() -> None:
    """`y` stays a string, mixed numbers become floats, and the order is kept."""
    content = {"/**": {"ros__parameters": {"axes": ["x", "y"], "centre": [0, 1.5]}}}
    assert dump(content) == (
        '"/**":\n  "ros__parameters":\n    "axes":\n    - "x"\n    - "y"\n'
        '    "centre":\n    - 0.0\n    - 1.5\n'
    )
