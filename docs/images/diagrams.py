# SPDX-License-Identifier: Apache-2.0
"""Draw the diagrams of the documentation: `python docs/images/diagrams.py`."""

from collections.abc import Iterable
from pathlib import Path
from xml.sax.saxutils import escape

FOLDER = Path(__file__).parent
INK, LINE, PALE, WARM, GREEN = "#263238", "#546e7a", "#eceff1", "#ffe0b2", "#dcedc8"
STYLE = "font-family='sans-serif' font-size='13'"
HEAD = (
    "<defs><marker id='tip' viewBox='0 0 10 10' refX='9' refY='5' markerWidth='7'"
    " markerHeight='7' orient='auto-start-reverse'>"
    f"<path d='M0 0 L10 5 L0 10 z' fill='{LINE}'/></marker></defs>"
)

Point = tuple[float, float]


def text(x: float, y: float, lines: Iterable[str], anchor: str = "middle", more: str = "") -> str:
    """Return lines of text, the first with its baseline at y."""
    return "".join(
        f"<text x='{x:g}' y='{y + 17 * i:g}' text-anchor='{anchor}' fill='{INK}' {more}>"
        f"{escape(line)}</text>"
        for i, line in enumerate(lines)
    )


def box(place: Point, size: Point, title: str, lines: Iterable[str] = (), fill: str = PALE) -> str:
    """Return a box with a title and lines of text below it."""
    (x, y), (width, height), lines = place, size, list(lines)
    top = y + 0.5 * height - 8.5 * len(lines) + 5
    return (
        f"<rect x='{x:g}' y='{y:g}' width='{width:g}' height='{height:g}' rx='6' fill='{fill}'"
        f" stroke='{LINE}'/>"
        + text(x + 0.5 * width, top, [title], more="font-weight='bold'")
        + text(x + 0.5 * width, top + 17, lines, more="font-size='12'")
    )


def arrow(points: Iterable[Point], dashed: bool = False) -> str:
    """Return a line through points with a tip at its end."""
    path = " ".join(f"{x:g},{y:g}" for x, y in points)
    dash = " stroke-dasharray='5 4'" if dashed else ""
    return (
        f"<polyline points='{path}' fill='none' stroke='{LINE}' stroke-width='1.5'{dash}"
        " marker-end='url(#tip)'/>"
    )


def drawing(size: Point, title: str, parts: Iterable[str]) -> str:
    """Return an SVG file."""
    width, height = size
    return (
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width:g} {height:g}'"
        f" width='{width:g}' height='{height:g}' {STYLE} role='img'>\n"
        f"<title>{escape(title)}</title>\n{HEAD}\n" + "\n".join(parts) + "\n</svg>\n"
    )


def topics(x: float, y: float, lines: Iterable[str], anchor: str = "middle") -> str:
    """Return names of topics beside an arrow."""
    return text(x, y, lines, anchor, "font-family='monospace' font-size='11.5'")


def node_graph() -> str:
    """Return the graph of the programs and their topics."""
    operators = ("haptic_emulator", "joy_operator, pose_operator", "keyboard_operator")
    return drawing(
        (940, 430),
        "Programs and topics: human and autonomy send references to the controller, which"
        " exchanges states and commands with the team; the recorder receives everything",
        [
            box((10, 40), (210, 110), "Human", (*operators, "operator_console"), WARM),
            box((10, 230), (210, 70), "Autonomy", ("relative_planner",), GREEN),
            box((430, 110), (150, 130), "controller", ("law, references,", "energy account")),
            box(
                (760, 110),
                (170, 130),
                "robot_team",
                ("simulated robots,", "or drivers of", "robots"),
            ),
            box((430, 350), (150, 60), "recorder", ("run.mcap",)),
            box((700, 350), (230, 60), "noninteract report", ("metrics, checks, figures",)),
            arrow([(220, 80), (430, 150)]),
            topics(
                228,
                52,
                ("<subtask>/human/reference,", "target_pose, target_twist, wrench"),
                "start",
            ),
            arrow([(430, 185), (220, 130)], dashed=True),
            topics(318, 196, ("<subtask>/feedback,", "<subtask>/desired")),
            arrow([(220, 265), (430, 215)]),
            topics(330, 282, ("<subtask>/autonomy/reference",)),
            arrow([(580, 150), (760, 150)]),
            topics(670, 141, ("joint_commands",)),
            arrow([(760, 205), (580, 205)]),
            topics(670, 223, ("joint_states,", "<robot>/external_wrench")),
            arrow([(845, 50), (845, 110)]),
            topics(845, 42, ("<robot>/push",)),
            arrow([(505, 240), (505, 350)], dashed=True),
            topics(515, 300, ("all topics", "of the namespace"), "start"),
            arrow([(580, 380), (700, 380)]),
        ],
    )


STEPS = (
    ("Message", "JointState of the team"),
    ("Arrays", "q, v in the model's order"),
    ("Terms", "M, C, g of the team; x, J, S, M_i of the subtasks"),
    ("References", "desired motion and error of each subtask"),
    ("Account", "energy, tank and gates after the last tick"),
    ("Law", "impedance, decoupling: task acceleration"),
    ("Torque", "inverse dynamics, limits of joints"),
    ("Message", "JointState with efforts"),
)


def one_tick() -> str:
    """Return the path of one tick through the controller."""
    width, height, gap = 200, 84, 36
    parts = []
    for number, (title, what) in enumerate(STEPS):
        row, column = divmod(number, 4)
        x = 10 + column * (width + gap)
        y = 46 + row * (height + 66)
        fill = WARM if title == "Message" else GREEN if title in ("Law", "Torque") else PALE
        parts.append(box((x, y), (width, height), f"{number + 1}  {title}", wrapped(what), fill))
        if column < 3:
            parts.append(arrow([(x + width, y + height / 2), (x + width + gap, y + height / 2)]))
    right, middle = 10 + 3 * (width + gap) + width / 2, 46 + height + 33
    parts.append(
        arrow([(right, 46 + height), (right, middle), (110, middle), (110, 46 + height + 66)])
    )
    node = "font-style='italic' font-size='12'"
    parts.append(text(10, 26, ["nodes/: messages and arrays, at both ends"], "start", node))
    parts.append(
        text(width + gap + 246, 26, ["control/: without ROS, from step 3 to 7"], "start", node)
    )
    return drawing((930, 290), "One tick of the controller in eight steps", parts)


def wrapped(line: str, width: int = 28) -> list[str]:
    """Return words in lines of at most so many letters."""
    lines = [""]
    for word in line.split():
        if len(lines[-1]) + len(word) >= width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines


DRAWINGS = {"node_graph.svg": node_graph, "one_tick.svg": one_tick}


def main() -> None:
    """Write all diagrams beside this file."""
    for name, draw in DRAWINGS.items():
        (FOLDER / name).write_text(draw())


if __name__ == "__main__":
    main()
