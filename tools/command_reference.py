# SPDX-License-Identifier: Apache-2.0
"""Reference of the command line `noninteract`, made from its definition."""

from typing import Any

import typer

from noninteract_ros import cli


def command_group() -> Any:
    """Return the commands as click has them."""
    return typer.main.get_command(cli.app)


def commands() -> str:
    """Return a section for each command: its purpose, its arguments and its options."""
    parts = []
    for name, command in command_group().commands.items():
        rows = [_row(item) for item in command.params if item.name != "help"]
        usage = " ".join(
            [f"noninteract {name}", *(_place(item) for item in command.params if _placed(item))]
        )
        parts += [f"## {name}", command.help, f"```text\n{usage} [OPTIONS]\n```"]
        if rows:
            head = ["| argument or option | default | meaning |", "|---|---|---|"]
            parts.append("\n".join(head + rows))
    return "\n\n".join(parts)


def _placed(item: Any) -> bool:
    return bool(item.param_type_name == "argument")


def _place(item: Any) -> str:
    return str(item.name.upper() if item.required else f"[{item.name.upper()}]")


def _row(item: Any) -> str:
    name = item.name.upper() if _placed(item) else ", ".join(item.opts)
    default = "required" if item.required else _shown(item.default)
    return f"| `{name}` | {default} | {item.help} |"


def _shown(value: Any) -> str:
    return "" if value is None or value is False or callable(value) else f"`{value}`"
