# SPDX-License-Identifier: Apache-2.0
"""The command line: `noninteract demo | report | check | describe | repair | bench`."""

import json
import os
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

# Matrices of a team are small; BLAS threads would only fight over the cores. Set before numpy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from noninteract_ros import __version__
from noninteract_ros.errors import NoninteractError, ScenarioError, one_of

if TYPE_CHECKING:
    from noninteract_ros.analysis.bench import BenchSettings, Row

app = typer.Typer(
    help="Robot teams led by a human: demos, reports, checks and measurements.",
    no_args_is_help=True,
    add_completion=False,
)
console = Console()


def main() -> int:
    """Entry point: 0 where all is well, 1 where a run or a check failed, 2 on wrong input."""
    try:
        code = app(standalone_mode=False)
    except ScenarioError as error:
        print(error, file=sys.stderr)
        return 2
    except NoninteractError as error:
        print(f"noninteract: {error}", file=sys.stderr)
        return 1
    except typer.Exit as end:
        return end.exit_code
    except (typer.Abort, KeyboardInterrupt):
        print("noninteract: interrupted", file=sys.stderr)
        return 130
    except Exception as error:
        return _usage_error(error)
    return int(code or 0)


def _usage_error(error: Exception) -> int:
    """Shows what click says about a wrong command line; anything else is a bug and passes."""
    show = getattr(error, "show", None)
    if show is None:
        raise error
    show()
    return int(getattr(error, "exit_code", 2))


@app.command()
def demo(
    scenario: Annotated[str, typer.Argument(help="Name or file of a scenario.")] = "paper",
    duration: Annotated[float | None, typer.Option(help="Simulated time [s].")] = None,
    rate_factor: Annotated[float, typer.Option(help="Multiplies the control rate.")] = 1.0,
    out: Annotated[Path | None, typer.Option(help="Output folder.")] = None,
    in_process: Annotated[bool, typer.Option(help="All nodes in this one process.")] = False,
    with_console: Annotated[
        bool, typer.Option("--console", help="Lead it yourself, in the browser, until Ctrl-C.")
    ] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the console.")] = 8090,
) -> int:
    """Run a scenario on the full stack, record it, check it and draw it."""
    from noninteract_ros.scenario_file import find_scenario

    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    source = find_scenario(scenario)
    folder = out or Path("runs") / f"{source.stem}_{time.strftime('%Y-%m-%d_%H-%M-%S')}"
    if with_console:
        if in_process:
            raise ScenarioError("--in-process", "given", "nothing, with --console")
        return _lead(source, folder, duration, rate_factor, port)
    file = _prepare(source, folder.resolve(), duration, rate_factor)
    interrupted = _run(file, folder.resolve(), in_process)
    if interrupted:
        console.print(f"Interrupted; what was recorded lies in {folder}")
        return 130
    return _report(folder, None)


def _lead(
    source: Path, folder: Path, duration: float | None, rate_factor: float, port: int
) -> int:
    """Runs a scenario in real time with the console, which speaks for the human."""
    from noninteract_ros.nodes.demo import run_with_console
    from noninteract_ros.scenario_file import for_console, read_parameters

    values = for_console(read_parameters(source), port)
    file = _prepare(source, folder.resolve(), duration, rate_factor, values)
    with suppress(KeyboardInterrupt):
        run_with_console(file, folder.resolve(), partial(console.print, soft_wrap=True))
    console.print(f"Recorded in {folder}; draw it with: noninteract report {folder}")
    return 0


def _prepare(
    source: Path, folder: Path, duration: float | None, rate_factor: float, values: Any = None
) -> Path:
    """Writes the scenario as it is run: paused at the start, with an end, at its own rate.

    Values of its own, as with a console, have no end but the one that is asked for.
    """
    from noninteract_ros.nodes.parameter_files import dump
    from noninteract_ros.scenario_file import load_scenario, read_parameters

    scenario = load_scenario(source)
    if duration is not None and not duration > 0.0:
        raise ScenarioError("--duration", duration, "> 0")
    if not rate_factor > 0.0:
        raise ScenarioError("--rate-factor", rate_factor, "> 0")
    general = scenario.general
    changes: dict[str, Any] = {
        "rate": general.rate * rate_factor,
        "duration": duration or general.duration,
        "end_time": duration or (0.0 if values else general.duration),
        "start_paused": True,
    }
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "scenario.yaml"
    values = values or read_parameters(source)
    file.write_text(dump({"/**": {"ros__parameters": values | changes}}))
    load_scenario(file)
    return file


def _run(file: Path, folder: Path, in_process: bool) -> bool:
    """Runs the stack under a progress bar; returns whether the user ended it."""
    from noninteract_ros.nodes.demo import run_demo
    from noninteract_ros.scenario_file import load_scenario

    end = load_scenario(file).general.end_time
    columns = (
        TextColumn("{task.description:10}"),
        BarColumn(),
        TextColumn("{task.completed:6.2f} of {task.total:.2f} s simulated"),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console) as bar:
        task = bar.add_task("starting", total=end)

        def progress(now: float, state: str) -> None:
            bar.update(task, completed=min(now, end), description=state)

        try:
            run_demo(file, folder, in_process, progress)
        except KeyboardInterrupt:
            return True
    return False


@app.command()
def report(
    run: Annotated[Path, typer.Argument(help="A run: its folder or its run.mcap.")],
    out: Annotated[Path | None, typer.Option(help="Output folder; by default the run's.")] = None,
    compare_laws: Annotated[
        bool, typer.Option(help="Also the same motion under each law and at other rates.")
    ] = False,
) -> int:
    """Make metrics and figures again from a recording alone."""
    return _report(run, out, compare_laws)


def _report(run: Path, out: Path | None, compare_laws: bool = False) -> int:
    from noninteract_ros.analysis.report import tables, write_report

    with console.status("computing metrics, drawing figures"):
        made = write_report(run, out, compare=compare_laws)
    for table in tables(made):
        console.print(table)
    console.print("Files:", *(f"\n  {file}" for file in made.files))
    failed = [check.name for check in made.checks if check.passed is False]
    if failed:
        console.print(f"[bold red]Failed:[/] {', '.join(failed)}")
    return 0 if made.passed else 1


@app.command()
def repair(
    file: Annotated[Path, typer.Argument(help="A recording that was cut off.")],
    out: Annotated[Path | None, typer.Option(help="Where to write; by default in place.")] = None,
) -> int:
    """Make a recording readable again after its recorder was killed."""
    from noninteract_ros.analysis.repair import repair as repair_file

    console.print(str(repair_file(file, out)))
    return 0


@app.command()
def check(
    target: Annotated[
        str, typer.Argument(help="Name or file of a scenario, or: identities, gauntlet.")
    ],
    others: Annotated[
        list[str] | None,
        typer.Argument(help="Scenarios of identities; or all. With --json, gauntlet: a file."),
    ] = None,
    samples: Annotated[
        int | None, typer.Option("--states", "--samples", min=1, help="Number of random states.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random states.")] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="JSON instead of tables.")] = False,
    cases: Annotated[int, typer.Option(min=1, help="Gauntlet: number of cases.")] = 1000,
    case: Annotated[int | None, typer.Option(min=0, help="Gauntlet: one case in full.")] = None,
    law: Annotated[list[str] | None, typer.Option(help="Gauntlet: this law only.")] = None,
    delay: Annotated[int, typer.Option(min=0, help="Gauntlet: age of commands [ticks].")] = 0,
    drop: Annotated[float, typer.Option(min=0.0, help="Gauntlet: share of states lost.")] = 0.0,
    rate: Annotated[float, typer.Option(help="Gauntlet: ticks per second.")] = 1000.0,
    horizon: Annotated[float, typer.Option(help="Gauntlet: time to come to rest [s].")] = 4000.0,
) -> int:
    """Check a scenario, and the law on its team, without running it."""
    from noninteract_ros.analysis.check import run_check
    from noninteract_ros.analysis.check_report import CheckSettings
    from noninteract_ros.analysis.gauntlet.settings import LAWS, GauntletSettings

    chosen = GauntletSettings(
        cases, seed, tuple(law or LAWS), delay, drop, rate, horizon, only=case
    )
    others = others or []
    file = Path(others.pop()) if target == "gauntlet" and as_json and others else None
    found = run_check(target, CheckSettings(samples, seed, gauntlet=chosen), others)
    if file:
        file.write_text(json.dumps(found.as_dict(), indent=2) + "\n")
    elif as_json:
        print(json.dumps(found.as_dict(), indent=2))
        return 0 if found.passed else 1
    console.print(f"[bold]{found.target}[/]")
    for table in found.tables():
        console.print(table)
    for warning in found.warnings:
        console.print(f"[yellow]warning:[/] {warning}")
    failed = [item.name for item in found.checks if item.passed is False]
    if failed:
        console.print(f"[bold red]Failed:[/] {'; '.join(failed)}")
    return 0 if found.passed else 1


@app.command()
def bench(
    part: Annotated[list[str] | None, typer.Option(help="law, node, lockstep or wall.")] = None,
    ticks: Annotated[int, typer.Option(min=1, help="Cycles timed of each kind.")] = 2000,
    rounds: Annotated[int, typer.Option(min=1, help="Turns of programs and floor.")] = 2,
    seconds: Annotated[float, typer.Option(min=0.1, help="Length of each turn [s].")] = 4.0,
    json_file: Annotated[Path | None, typer.Option("--json", help="Also write JSON.")] = None,
) -> int:
    """Measure the law, the controller and the lockstep, each beside its floor."""
    from noninteract_ros.analysis import bench as measures

    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    for name in part or ():
        if name not in measures.PARTS:
            raise ScenarioError("--part", name, one_of(measures.PARTS, name))
    settings = measures.BenchSettings(ticks, rounds, seconds)
    machine = measures.machine()
    rows = _measure(part or measures.PARTS, settings)
    machine["load average after"] = measures.load_average()
    figures = measures.as_dict(rows, machine)
    console.print(measures.table(figures))
    if json_file is not None:
        json_file.write_text(json.dumps(figures, indent=2) + "\n")
    return 0


@app.command()
def describe(
    scenario: Annotated[str, typer.Argument(help="Name or file of a scenario.")],
    out: Annotated[Path, typer.Option(help="File to write.")],
    timeout: Annotated[float, typer.Option(help="Time to wait for descriptions [s].")] = 10.0,
) -> int:
    """Write a scenario with the robots' descriptions in place of the topics they come on."""
    from noninteract_ros.nodes.describe import described
    from noninteract_ros.nodes.parameter_files import dump
    from noninteract_ros.scenario_file import find_scenario, load_scenario, read_parameters

    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    values = described(read_parameters(find_scenario(scenario)), timeout)
    out.write_text(dump({"/**": {"ros__parameters": values}}))
    load_scenario(out)
    console.print(f"{out}: {', '.join(load_scenario(out).robots)}")
    return 0


def _measure(parts: Sequence[str], settings: "BenchSettings") -> list["Row"]:
    from noninteract_ros.analysis import bench as measures
    from noninteract_ros.analysis.bench_law import law_rows
    from noninteract_ros.analysis.bench_teams import bench_teams
    from noninteract_ros.nodes import bench as nodes

    scenarios = measures.bench_scenarios()
    paper, teams = scenarios["paper"], bench_teams() if "law" in parts else {}
    rows = []
    with console.status("starting") as status:
        chosen = scenarios if {"law", "node"} & set(parts) else {}
        for name, values in (chosen | teams).items():
            status.update(f"law and controller node, {name}")
            try:
                material = measures.Material.of(values, settings.ticks + measures.WARM_UP)
            except ScenarioError as error:  # Models of robots are an extra.
                console.print(f"{name} is left out: {error}")
                continue
            if "law" in parts:
                rows += law_rows(name, material, settings.ticks)
            # Robots with topics of their own have no single state to be answered.
            own = "node" in parts and material.scenario.own_states
            if "node" in parts and name not in teams and not own:
                rows += nodes.node_rows(name, values, material, settings.ticks)
        if "lockstep" in parts:
            status.update("lockstep of the real programs")
            rows += nodes.lockstep_rows("paper", paper, settings)
        if "wall" in parts:
            status.update("wall time")
            rows += nodes.wall_rows("paper", paper, settings)
    return sorted(rows, key=lambda row: measures.PARTS.index(row.part))


@app.command()
def version() -> int:
    """Print the version."""
    print(__version__)
    return 0


if __name__ == "__main__":
    sys.exit(main())
