# SPDX-License-Identifier: Apache-2.0
"""Both ways to install the package, each into a place of its own: pip and colcon."""

import os
import shutil
import site
import subprocess
import sys
import venv
from pathlib import Path

import pytest
from repository import PACKAGE, ROOT, programs

DEADLINE = 240.0  # s, for a command that installs
START_DEADLINE = 60.0  # s, for a program that is to refuse its parameter file

PRINT_WHERE_IMPORTED = f"import {PACKAGE}; print({PACKAGE}.__file__)"
FIND_AS_ROS2_RUN = f"""
from ament_index_python.packages import get_package_prefix, get_package_share_directory
print(get_package_prefix("{PACKAGE}"))
print(get_package_share_directory("{PACKAGE}"))
"""


def environment(**changes: str) -> dict[str, str]:
    """This process's environment without another Python path or ROS prefix in it."""
    kept = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "AMENT_PREFIX_PATH")}
    return kept | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"} | changes


def run(*command: str | Path, **options: object) -> str:
    """Runs a command that must succeed and returns what it printed."""
    options = {"env": environment(), "timeout": DEADLINE} | options
    done = subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, check=False, **options
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of what git knows of the repository, so that builds leave nothing behind in it."""
    copy = tmp_path_factory.mktemp("workspace") / "src" / PACKAGE
    listing = run(
        *("git", "-C", ROOT, "ls-files", "-z", "--cached", "--others", "--exclude-standard")
    )
    for name in filter(os.path.lexists, map(ROOT.joinpath, listing.rstrip("\0").split("\0"))):
        target = copy / name.relative_to(ROOT)
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(name, target, follow_symlinks=False)
    return copy


@pytest.fixture(scope="module")
def pip_prefix(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A virtual environment with the package; its dependencies are those of this Python."""
    prefix = tmp_path_factory.mktemp("pip") / "venv"
    venv.create(prefix, symlinks=True)
    python = prefix / "bin" / "python3"
    purelib = run(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip()
    lines = (f"import site; site.addsitedir({path!r})\n" for path in site.getsitepackages())
    (Path(purelib) / "dependencies.pth").write_text("".join(lines))
    pip = (sys.executable, "-m", "pip", "--python", python, "--disable-pip-version-check")
    options = ("--no-deps", "--no-index", "--no-build-isolation", "--ignore-installed")
    run(*pip, "install", *options, source)
    return prefix


@pytest.fixture(scope="module")
def colcon_prefix(source: Path) -> Path:
    """The prefix of the package in a workspace that colcon has built."""
    workspace = source.parent.parent
    colcon = Path(sys.executable).with_name("colcon")
    quiet = {"env": environment(COLCON_HOME=str(workspace / "home")), "cwd": workspace}
    assert "(ros.ament_python)" in run(colcon, "--log-base", "log", "list", **quiet)
    run(colcon, "--log-base", "log", "build", **quiet)
    return workspace / "install" / PACKAGE


def check_prefix(prefix: Path, env: dict[str, str]) -> None:
    """Everything that `ros2 run` and `ros2 launch` look for lies under `prefix`."""
    share = prefix / "share" / PACKAGE
    assert run(sys.executable, "-c", FIND_AS_ROS2_RUN, env=env).split() == [
        str(prefix),
        str(share),
    ]
    for folder, pattern in (("config", "*.yaml"), ("launch", "*.py")):
        installed = {file.name for file in (share / folder).glob(pattern)}
        assert installed == {file.name for file in (ROOT / folder).glob(pattern)}
        assert installed
    assert (share / "package.xml").read_text() == (ROOT / "package.xml").read_text()
    executables = list((prefix / "lib" / PACKAGE).iterdir())
    assert {file.name for file in executables} == set(programs())
    for file in executables:
        assert file.is_file()
        assert file.stat().st_mode & 0o555 == 0o555


def check_refusal(executable: Path, env: dict[str, str]) -> None:
    """The program starts, and ends with status 2 and one line for a missing parameter file."""
    missing = "/nonexistent.yaml"
    done = subprocess.run(
        [executable, "--ros-args", "--params-file", missing],
        env=env,
        capture_output=True,
        text=True,
        check=False,
        timeout=START_DEADLINE,
    )
    assert done.returncode == 2, done.stderr
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert missing in done.stderr


def node_programs() -> list[str]:
    """The programs that are nodes, and so read a parameter file."""
    return sorted(set(programs()) - {"noninteract"})


def test_pip_installs_what_ros2_needs(pip_prefix: Path) -> None:
    """`pip install .` leaves programs on the PATH, the ament index entry, share and lib."""
    check_prefix(pip_prefix, environment(AMENT_PREFIX_PATH=str(pip_prefix)))
    for name in programs():
        assert os.access(pip_prefix / "bin" / name, os.X_OK)
    imported = run(pip_prefix / "bin" / "python3", "-P", "-c", PRINT_WHERE_IMPORTED)
    assert Path(imported.strip()).is_relative_to(pip_prefix)
    static = {file.name for file in (ROOT / PACKAGE / "console" / "static").iterdir()}
    page = Path(imported.strip()).parent / "console" / "static"
    assert {file.name for file in page.iterdir()} == static
    assert (Path(imported.strip()).parent / "nodes" / "udp.xml").is_file()


@pytest.mark.parametrize("name", node_programs())
def test_programs_start_after_pip_install(pip_prefix: Path, name: str) -> None:
    """What `ros2 run` would start is the installed program."""
    check_refusal(pip_prefix / "lib" / PACKAGE / name, environment())


def test_command_line_starts_after_pip_install(pip_prefix: Path) -> None:
    """`ros2 run noninteract_ros noninteract` is the command line."""
    assert "demo" in run(pip_prefix / "lib" / PACKAGE / "noninteract", "--help")


def sourced(prefix: Path) -> dict[str, str]:
    """The environment after `source install/local_setup.sh`."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    setup = prefix.parent / "local_setup.sh"
    printed = run("sh", "-c", f". {setup} && env -0", env=environment(PATH=path))
    return dict(entry.split("=", 1) for entry in printed.rstrip("\0").split("\0"))


def test_colcon_installs_what_ros2_needs(colcon_prefix: Path) -> None:
    """`colcon build` takes the package for ament_python and lays out the same prefix."""
    env = sourced(colcon_prefix)
    check_prefix(colcon_prefix, env)
    imported = run(sys.executable, "-P", "-c", PRINT_WHERE_IMPORTED, env=env)
    assert Path(imported.strip()).is_relative_to(colcon_prefix)


@pytest.mark.parametrize("name", node_programs())
def test_programs_start_after_colcon_build(colcon_prefix: Path, name: str) -> None:
    """What `ros2 run` would start is the program in the workspace."""
    check_refusal(colcon_prefix / "lib" / PACKAGE / name, sourced(colcon_prefix))
