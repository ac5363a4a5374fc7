# SPDX-License-Identifier: Apache-2.0
"""Command line `noninteract`: demo, report, check, describe, repair and bench."""

import json
import os
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Annotated, Any

# Small matrices gain nothing from BLAS threads. Set before numpy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from noninteract_ros import __version__
from noninteract_ros.errors import NoninteractError, RecordingError, ScenarioError, one_of

app = typer.Typer(
    help="Shared control of robot teams: demos, reports, checks and benchmarks.",
    no_args_is_help=True,
    add_completion=False,
)
console = Console()


def main() -> int:
    """Run a command; return 0 on success, 1 on a failed run or check, 2 on invalid input."""
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
    """Print the usage error of a command line; raise any other exception again."""
    if not hasattr(error, "show"):
        raise error
    error.show()
    return int(getattr(error, "exit_code", 2))


@app.command()
def demo(
    scenario: Annotated[str, typer.Argument(help="Name or file of a scenario.")] = "paper",
    duration: Annotated[float | None, typer.Option(help="Simulated time [s].")] = None,
    rate_factor: Annotated[float, typer.Option(help="Multiplies the control rate.")] = 1.0,
    out: Annotated[Path | None, typer.Option(help="Output folder.")] = None,
    in_process: Annotated[bool, typer.Option(help="Run all nodes in one process.")] = False,
    with_console: Annotated[
        bool, typer.Option("--console", help="Drive in the browser until Ctrl-C.")
    ] = False,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port of the console.")] = 8090,
) -> int:
    """Run a scenario on the full stack, record it and write its report."""
    from noninteract_ros.nodes.stack.demo import write_run_file
    from noninteract_ros.scenario.files import find_scenario

    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    source = find_scenario(scenario)
    folder = out or Path("runs") / f"{source.stem}_{time.strftime('%Y-%m-%d_%H-%M-%S')}"
    if with_console:
        if in_process:
            raise ScenarioError("--in-process", "given", "not together with --console")
        return _run_with_console(source, folder, duration, rate_factor, port)
    file = write_run_file(source, folder.resolve(), duration, rate_factor)
    with _report_recording(folder):
        interrupted = _run(file, folder.resolve(), in_process)
    if interrupted:
        console.print(f"Interrupted; recorded in {folder}")
        return 130
    return _report(folder, None)


def _run_with_console(
    source: Path, folder: Path, duration: float | None, rate_factor: float, port: int
) -> int:
    """Run a scenario in real time with the console as the human's input."""
    from noninteract_ros.nodes.stack.demo import run_with_console, write_run_file
    from noninteract_ros.scenario.files import for_console, read_parameters

    values = for_console(read_parameters(source), port)
    file = write_run_file(source, folder.resolve(), duration, rate_factor, values)
    with suppress(KeyboardInterrupt), _report_recording(folder):
        run_with_console(file, folder.resolve(), partial(console.print, soft_wrap=True))
    console.print(f"Recorded in {folder}; report: noninteract report {folder}")
    return 0


@contextmanager
def _report_recording(folder: Path) -> Iterator[None]:
    """Print the path of the recording if the run fails."""
    try:
        yield
    except NoninteractError:
        recording = folder / "run.mcap"
        if recording.exists():
            console.print(f"Recorded until the failure in {recording}", soft_wrap=True)
        raise


def _run(file: Path, folder: Path, in_process: bool) -> bool:
    """Run the stack with a progress bar; return True if the user interrupted it."""
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
        bool, typer.Option(help="Compare the motion under all laws and at other rates.")
    ] = False,
) -> int:
    """Compute metrics and figures from a recording."""
    return _report(run, out, compare_laws)


def _report(run: Path, out: Path | None, compare_laws: bool = False) -> int:
    from noninteract_ros.reporting.report.report import write_report
    from noninteract_ros.reporting.report.tables import summary, tables

    with console.status("computing metrics, drawing figures"):
        result = write_report(run, out, compare=compare_laws)
    for table in tables(result):
        console.print(table)
    console.print("Files:", *(f"\n  {file}" for file in result.files))
    for reason in result.missing:
        console.print(f"Not drawn: {reason}", markup=False)
    console.print(summary(result))
    return 0 if result.passed else 1


@app.command()
def repair(
    file: Annotated[Path, typer.Argument(help="A truncated recording.")],
    out: Annotated[Path | None, typer.Option(help="Output file; by default in place.")] = None,
) -> int:
    """Repair a recording whose recorder was killed."""
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
        typer.Argument(help="Scenarios of identities, or: all. With gauntlet and --json: a file."),
    ] = None,
    samples: Annotated[
        int | None,
        typer.Option(
            "--states", "--samples", min=1, help="Number of random states; of seeds for delay."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random states.")] = 0,
    as_json: Annotated[bool, typer.Option("--json", help="JSON instead of tables.")] = False,
    cases: Annotated[int | None, typer.Option(min=1, help="Gauntlet: number of cases.")] = None,
    case: Annotated[int | None, typer.Option(min=0, help="Gauntlet: one case in detail.")] = None,
    law: Annotated[list[str] | None, typer.Option(help="Gauntlet: this law only.")] = None,
    delay: Annotated[
        int | None, typer.Option(min=0, help="Gauntlet: age of commands [ticks].")
    ] = None,
    drop: Annotated[
        float | None, typer.Option(min=0.0, help="Gauntlet: fraction of lost states.")
    ] = None,
    rate: Annotated[float | None, typer.Option(help="Gauntlet: control rate [Hz].")] = None,
    horizon: Annotated[
        float | None, typer.Option(help="Gauntlet: time to come to rest [s].")
    ] = None,
) -> int:
    """Check a scenario and the law on its team without running it."""
    from noninteract_ros.validation.check import CheckSettings, run_check
    from noninteract_ros.validation.gauntlet.settings import GauntletSettings

    options = {"cases": cases, "delay": delay, "drop": drop, "rate": rate, "horizon": horizon}
    given: dict[str, Any] = {name: item for name, item in options.items() if item is not None}
    if law:
        given["laws"] = tuple(law)
    settings = GauntletSettings(seed=seed, only=case, **given)
    others = others or []
    file = Path(others.pop()) if target == "gauntlet" and as_json and others else None
    result = run_check(target, CheckSettings(samples, seed, gauntlet=settings), others)
    if file:
        file.write_text(json.dumps(result.as_dict(), indent=2) + "\n")
    elif as_json:
        print(json.dumps(result.as_dict(), indent=2))
        return 0 if result.passed else 1
    console.print(f"[bold]{result.target}[/]")
    for table in result.tables():
        console.print(table)
    for warning in result.warnings:
        console.print(f"[yellow]warning:[/] {warning}")
    failed = [item.name for item in result.checks if item.passed is False]
    if failed:
        console.print(f"[bold red]Failed:[/] {'; '.join(failed)}")
    return 0 if result.passed else 1


@app.command()
def bench(
    part: Annotated[list[str] | None, typer.Option(help="law, node, lockstep or wall.")] = None,
    ticks: Annotated[int, typer.Option(min=1, help="Timed cycles of each kind.")] = 2000,
    rounds: Annotated[int, typer.Option(min=1, help="Alternations of programs and baseline.")] = 2,
    seconds: Annotated[
        float, typer.Option(min=0.1, help="Duration of each alternation [s].")
    ] = 4.0,
    json_file: Annotated[Path | None, typer.Option("--json", help="Also write JSON.")] = None,
) -> int:
    """Measure law, controller node and lockstep, each beside its baseline."""
    from noninteract_ros.validation.benchmarks import bench as benchmark

    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    for name in part or ():
        if name not in benchmark.PARTS:
            raise ScenarioError("--part", name, one_of(benchmark.PARTS, name))
    from noninteract_ros.nodes.bench.bench import measure

    settings = benchmark.BenchSettings(ticks=ticks, rounds=rounds, seconds=seconds)
    machine = benchmark.machine()
    with console.status("starting") as status:
        rows = measure(part or benchmark.PARTS, settings, status.update, console.print)
    machine["load average after"] = benchmark.load_average()
    figures = benchmark.as_dict(rows, machine)
    console.print(benchmark.table(figures))
    if json_file is not None:
        json_file.write_text(json.dumps(figures, indent=2) + "\n")
    return 0


@app.command()
def describe(
    scenario: Annotated[str, typer.Argument(help="Name or file of a scenario.")],
    out: Annotated[Path, typer.Option(help="File to write.")],
    timeout: Annotated[float, typer.Option(help="Time to wait for descriptions [s].")] = 10.0,
) -> int:
    """Write a scenario with robot descriptions received from topics."""
    from noninteract_ros.nodes.common.parameter_files import write
    from noninteract_ros.nodes.stack.describe import with_descriptions
    from noninteract_ros.scenario.files import find_scenario, load_scenario, read_parameters

    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    values = with_descriptions(read_parameters(find_scenario(scenario)), timeout)
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
