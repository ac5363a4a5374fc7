# SPDX-License-Identifier: Apache-2.0
"""The command line: `noninteract demo | report | check | describe | repair | bench`."""

import json
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Annotated, Any

# Matrices of a team are small; BLAS threads would only fight over the cores. Set before numpy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from noninteract_ros import __version__
from noninteract_ros.errors import NoninteractError, RecordingError, ScenarioError, one_of

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
        return 2 if isinstance(error, RecordingError) else 1
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
    from noninteract_ros.nodes.stack.run_file import prepare
    from noninteract_ros.scenario.files import find_scenario

    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    source = find_scenario(scenario)
    folder = out or Path("runs") / f"{source.stem}_{time.strftime('%Y-%m-%d_%H-%M-%S')}"
    if with_console:
        if in_process:
            raise ScenarioError("--in-process", "given", "nothing, with --console")
        return _lead(source, folder, duration, rate_factor, port)
    file = prepare(source, folder.resolve(), duration, rate_factor)
    with _keeping(folder):
        interrupted = _run(file, folder.resolve(), in_process)
    if interrupted:
        console.print(f"Interrupted; what was recorded lies in {folder}")
        return 130
    return _report(folder, None)


def _lead(
    source: Path, folder: Path, duration: float | None, rate_factor: float, port: int
) -> int:
    """Runs a scenario in real time with the console, which speaks for the human."""
    from noninteract_ros.nodes.stack.demo import run_with_console
    from noninteract_ros.nodes.stack.run_file import prepare
    from noninteract_ros.scenario.files import for_console, read_parameters

    values = for_console(read_parameters(source), port)
    file = prepare(source, folder.resolve(), duration, rate_factor, values)
    with suppress(KeyboardInterrupt), _keeping(folder):
        run_with_console(file, folder.resolve(), partial(console.print, soft_wrap=True))
    console.print(f"Recorded in {folder}; draw it with: noninteract report {folder}")
    return 0


@contextmanager
def _keeping(folder: Path) -> Iterator[None]:
    """Says where the recording of a run that fails lies."""
    try:
        yield
    except NoninteractError:
        recording = folder / "run.mcap"
        if recording.exists():
            console.print(f"What was recorded until then lies in {recording}", soft_wrap=True)
        raise


def _run(file: Path, folder: Path, in_process: bool) -> bool:
    """Runs the stack under a progress bar; returns whether the user ended it."""
    from noninteract_ros.nodes.stack.demo import run_demo
    from noninteract_ros.scenario.files import load_scenario

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
    from noninteract_ros.reporting.report.report import write_report
    from noninteract_ros.reporting.report.tables import summary, tables

    with console.status("computing metrics, drawing figures"):
        made = write_report(run, out, compare=compare_laws)
    for table in tables(made):
        console.print(table)
    console.print("Files:", *(f"\n  {file}" for file in made.files))
    for reason in made.missing:
        console.print(f"Not drawn: {reason}", markup=False)
    console.print(summary(made))
    return 0 if made.passed else 1


@app.command()
def repair(
    file: Annotated[Path, typer.Argument(help="A recording that was cut off.")],
    out: Annotated[Path | None, typer.Option(help="Where to write; by default in place.")] = None,
) -> int:
    """Make a recording readable again after its recorder was killed."""
    from noninteract_ros.reporting.recording.repair import repair as repair_file

    console.print(str(repair_file(file, out)))
    return 0


@app.command()
def check(
    target: Annotated[
        str, typer.Argument(help="Name or file of a scenario, or: identities, delay, gauntlet.")
    ],
    others: Annotated[
        list[str] | None,
        typer.Argument(help="Scenarios of identities; or all. With --json, gauntlet: a file."),
    ] = None,
    samples: Annotated[
        int | None,
        typer.Option(
            "--states", "--samples", min=1, help="Number of random states, or of seeds (delay)."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random states.")] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="JSON instead of tables.")] = False,
    cases: Annotated[int | None, typer.Option(min=1, help="Gauntlet: number of cases.")] = None,
    case: Annotated[int | None, typer.Option(min=0, help="Gauntlet: one case in full.")] = None,
    law: Annotated[list[str] | None, typer.Option(help="Gauntlet: this law only.")] = None,
    delay: Annotated[
        int | None, typer.Option(min=0, help="Gauntlet: age of commands [ticks].")
    ] = None,
    drop: Annotated[
        float | None, typer.Option(min=0.0, help="Gauntlet: share of states lost.")
    ] = None,
    rate: Annotated[float | None, typer.Option(help="Gauntlet: ticks per second.")] = None,
    horizon: Annotated[
        float | None, typer.Option(help="Gauntlet: time to come to rest [s].")
    ] = None,
) -> int:
    """Check a scenario, and the law on its team, without running it."""
    from noninteract_ros.validation.check import CheckSettings, run_check
    from noninteract_ros.validation.gauntlet.settings import GauntletSettings

    options = {"cases": cases, "delay": delay, "drop": drop, "rate": rate, "horizon": horizon}
    given: dict[str, Any] = {name: item for name, item in options.items() if item is not None}
    if law:
        given["laws"] = tuple(law)
    chosen = GauntletSettings(seed=seed, only=case, **given)
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
    from noninteract_ros.validation.benchmarks import bench as measures

    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    for name in part or ():
        if name not in measures.PARTS:
            raise ScenarioError("--part", name, one_of(measures.PARTS, name))
    from noninteract_ros.nodes.bench.bench import measure

    settings = measures.BenchSettings(ticks, rounds, seconds)
    machine = measures.machine()
    with console.status("starting") as status:
        rows = measure(part or measures.PARTS, settings, status.update, console.print)
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
    from noninteract_ros.nodes.common.parameter_files import write
    from noninteract_ros.nodes.stack.describe import described
    from noninteract_ros.scenario.files import find_scenario, load_scenario, read_parameters

    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    values = described(read_parameters(find_scenario(scenario)), timeout)
    write(out, values)
    console.print(f"{out}: {', '.join(load_scenario(out).robots)}")
    return 0


@app.command()
def version() -> int:
    """Print the version."""
    print(__version__)
    return 0


if __name__ == "__main__":
    sys.exit(main())
