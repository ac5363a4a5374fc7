# SPDX-License-Identifier: Apache-2.0
"""Commands that documents print, checked against the code without being run."""

import re
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import typer
import yaml
from documents import codes, tables
from repository import ROOT, distribution, programs

from noninteract_ros import cli
from noninteract_ros.nodes.recording.recorder import PARAMETERS as RECORDER_PARAMETERS
from noninteract_ros.scenario.files import known_scenarios, load_scenario
from noninteract_ros.scenario.scenario import Scenario
from noninteract_ros.schema import Key

NAMESPACE = "/team/"
INTERFACES = ROOT / "docs/reference/interfaces.md"
# Files that a reader is told to write, or that a command before makes.
READERS_FILES = ("my.yaml", "mine.yaml", "my_team.yaml", "my_arms.yaml")
PLACEHOLDERS = ("RUN", "SCENARIO", "FILE", "NAME")
OTHER_PACKAGES = {
    ("joy", "game_controller_node"),
    ("joy", "joy_node"),
    ("spacenav", "spacenav_node"),
}
OTHER_COMMANDS = ("cat", "cd", "colcon", "export", "sed", "source")
SEPARATORS = {"&&", "||", ";", "|", "&"}


def commands(text: str) -> Iterator[list[str]]:
    """Yield the simple commands of a shell block as words, with loops over names unrolled."""
    text = text.replace("\\\n", " ")
    loop = re.compile(r"for (\w+) in ([^;\n]+); do\n(.*?)\ndone", re.DOTALL)
    text = loop.sub(
        lambda found: "\n".join(
            found[3].replace(f"${found[1]}", value) for value in found[2].split()
        ),
        text,
    )
    for line in text.splitlines():
        lexer = shlex.shlex(line, posix=True, punctuation_chars="&|;")
        lexer.whitespace_split = True
        lexer.commenters = "#"
        command: list[str] = []
        for word in [*lexer, ";"]:
            if word not in SEPARATORS:
                command.append(word)
            elif command:
                yield command
                command = []


def check(command: Sequence[str]) -> None:
    """Raise AssertionError where a command names something that the code does not have."""
    head, arguments = Path(command[0]).name, list(command[1:])
    if head in OTHER_COMMANDS:
        return
    if head in programs() and head != "noninteract":
        _check_ros_arguments(arguments, head)
    elif head.startswith("python"):
        _check_python(arguments)
    else:
        assert head in CHECKS, f"unknown command {head!r}"
        CHECKS[head](arguments)


def _check_make(arguments: list[str]) -> None:
    makefile = (ROOT / "Makefile").read_text()
    targets = re.findall(r"^([a-z-]+):", makefile, re.MULTILINE)
    given = dict(word.split("=", 1) for word in arguments if "=" in word)
    called = [word for word in arguments if "=" not in word]
    assert called, "no target"
    for target in called:
        assert target in targets, f"no target {target!r}: {targets}"
    for name in given:
        assert re.search(rf"^{name} \?=", makefile, re.MULTILINE), f"no variable {name!r}"
    words = shlex.split(given.get("ARGS", ""))
    if called[0] == "demo":
        _check_noninteract(["demo", given.get("SCENARIO", "paper"), *words])
    elif called[0] == "bench":
        _check_noninteract(["bench", *words])


def _check_noninteract(arguments: list[str]) -> None:
    group: Any = typer.main.get_command(cli.app)
    assert arguments, "no command"
    name, *rest = arguments
    assert name in group.commands, f"no command {name!r}: {list(group.commands)}"
    # A placeholder stands for a number or a name.
    context = group.commands[name].make_context(name, rest)
    for item in ("scenario", "target"):
        value = context.params.get(item)
        if value and value not in ("identities", "delay", "gauntlet"):
            _check_scenario(value)
    if context.params.get("target") == "identities":
        for value in context.params["others"] or ():
            assert value == "all" or value in known_scenarios(), f"no scenario {value!r}"


def _check_scenario(name: str) -> None:
    known = name in known_scenarios() or name in (*READERS_FILES, *PLACEHOLDERS)
    assert known or (ROOT / name).is_file(), f"no scenario {name!r}"


def _check_python(arguments: list[str]) -> None:
    if arguments[0] != "-m":
        assert (ROOT / arguments[0]).is_file(), f"no file {arguments[0]!r}"
        return
    module, rest = arguments[1], arguments[2:]
    if module == "noninteract_ros.nodes":
        assert rest[0] in programs(), f"no program {rest[0]!r}"
        _check_ros_arguments(rest[1:], rest[0])
    elif module == "pytest":
        for word in rest:
            file, _, test = word.partition("::")
            assert not file.startswith("test/") or (ROOT / file).exists(), f"no {file}"
            assert not test or f"def {test}" in (ROOT / file).read_text(), f"no test {test}"
    else:
        assert module in ("venv", "http.server", "mkdocs"), f"unknown module {module!r}"


def _check_pip(arguments: list[str]) -> None:
    extras = distribution().extras_require
    for word in arguments:
        for extra in re.findall(r"^(?:\.|noninteract_ros)\[(\w+)\]$", word):
            assert extra in extras, f"no extra {extra!r}"


def _check_ros2(arguments: list[str]) -> None:
    verb, *rest = arguments
    ROS2[verb](rest)


def _check_run(arguments: list[str]) -> None:
    package, program, *rest = arguments
    if package == "noninteract_ros":
        assert program in programs(), f"no program {program!r}"
        _check_ros_arguments(rest, program)
    else:
        assert (package, program) in OTHER_PACKAGES, f"unknown program {package} {program}"


def _check_ros_arguments(arguments: list[str], program: str) -> None:
    if arguments in ([], ["…"]):
        return
    assert arguments[0] == "--ros-args", f"--ros-args is missing before {arguments[0]!r}"
    for option, value in zip(arguments[1::2], arguments[2::2], strict=True):
        if option == "--params-file":
            assert value in READERS_FILES or (ROOT / value).is_file(), f"no file {value!r}"
        elif option == "-p":
            name, _, content = value.partition(":=")
            assert content, f"{value!r} is no assignment"
            known = RECORDER_PARAMETERS if program == "recorder" else parameters()
            assert name in known, f"{program} has no parameter {name!r}"
        else:
            assert option == "-r", f"unknown option {option!r}"
            assert re.fullmatch(r"__(ns|node):=\S+", value), f"unknown remapping {value!r}"


def _check_launch(arguments: list[str]) -> None:
    package, file, *rest = arguments
    assert package == "noninteract_ros"
    text = (ROOT / "launch" / file).read_text()
    declared = re.findall(r'DeclareLaunchArgument\(\s*"(\w+)"', text)
    for word in rest:
        name, _, value = word.partition(":=")
        assert name in declared, f"no launch argument {name!r}: {declared}"
        if name == "scenario":
            _check_scenario(value)


def _check_param(arguments: list[str]) -> None:
    verb, node, *rest = arguments
    assert verb in ("list", "get", "set", "describe"), f"unknown verb {verb!r}"
    assert node.removeprefix(NAMESPACE) in programs(), f"no node {node!r}"
    if rest:
        assert rest[0] in parameters(), f"no parameter {rest[0]!r}"
        assert verb != "set" or parameters()[rest[0]].live, f"{rest[0]!r} is read-only"


def _check_service(arguments: list[str]) -> None:
    verb, name, kind, *_ = arguments
    assert verb == "call"
    assert services().get(name.removeprefix(NAMESPACE)) == kind, f"no service {name!r} of {kind}"


def _check_topic(arguments: list[str]) -> None:
    verb, *words = arguments
    words = [word for word in words if not re.fullmatch(r"-r|--once|[\d.]+", word)]
    assert verb in ("pub", "echo", "hz"), f"unknown verb {verb!r}"
    kind = topic_type(words[0])
    if verb == "pub":
        assert words[1] == kind, f"{words[0]} has the type {kind}"
        check_fields(message_type(kind), yaml.safe_load(words[2]))


def topic_type(name: str) -> str:
    """Return the documented type of a topic, given by its full name."""
    relative = name.removeprefix(NAMESPACE)
    for pattern, kind in topics().items():
        if re.fullmatch(re.sub(r"<[^>]+>", "[a-z0-9_]+", pattern), relative):
            return kind
    raise AssertionError(f"no topic {name!r}")


def message_type(kind: str) -> type:
    """Return the class of a message, as of std_msgs/msg/String."""
    package, _, name = kind.split("/")
    found: type = getattr(import_module(f"{package}.msg"), name)
    return found


def check_fields(message: Any, values: Mapping[str, Any]) -> None:
    """Raise AssertionError where values name fields that a message does not have."""
    fields = message.get_fields_and_field_types()
    for name, value in values.items():
        assert name in fields, f"{message.__name__} has no field {name!r}"
        if isinstance(value, Mapping):
            package, kind = fields[name].split("/")
            check_fields(message_type(f"{package}/msg/{kind}"), value)


@cache
def topics() -> dict[str, str]:
    """Return the documented topics with their types."""
    return {
        topic: codes(row[1])[0]
        for heading, rows in tables(INTERFACES)
        if heading in ("States and commands", "Inputs of a subtask", "State of the subtasks")
        for row in rows
        if len(row) == 6
        for topic in codes(row[0])
    }


@cache
def services() -> dict[str, str]:
    """Return the documented services with their types."""
    rows = next(rows for heading, rows in tables(INTERFACES) if heading == "Services")
    return {codes(row[0])[0]: codes(row[1])[0] for row in rows}


@cache
def parameters() -> dict[str, Key]:
    """Return the parameters of all scenarios of the package, with their rules."""
    found: dict[str, Key] = {}
    for file in known_scenarios().values():
        scenario: Scenario = load_scenario(file)
        found |= {name: rule for name, _, rule, _ in scenario.parameters()}
    return found


CHECKS: dict[str, Callable[[list[str]], None]] = {
    "make": _check_make,
    "noninteract": _check_noninteract,
    "pip": _check_pip,
    "ros2": _check_ros2,
    "run": lambda _: None,  # .ci/run
}
ROS2: dict[str, Callable[[list[str]], None]] = {
    "run": _check_run,
    "launch": _check_launch,
    "param": _check_param,
    "service": _check_service,
    "topic": _check_topic,
}
