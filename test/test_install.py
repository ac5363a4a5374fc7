# SPDX-License-Identifier: Apache-2.0
"""Installation of the package with pip and with colcon, into separate prefixes."""

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
START_DEADLINE = 60.0  # s, for a program that rejects its parameter file

PRINT_PACKAGE_PATH = f"import {PACKAGE}; print({PACKAGE}.__file__)"
PRINT_AMENT_PREFIX = f"""
from ament_index_python.packages import get_package_prefix, get_package_share_directory
print(get_package_prefix("{PACKAGE}"))
print(get_package_share_directory("{PACKAGE}"))
"""


def environment(**changes: str) -> dict[str, str]:
    """Return the environment without a Python path and ROS prefix."""
    inherited = {
        k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "AMENT_PREFIX_PATH")
    }
    return inherited | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"} | changes


def run(*command: str | Path, **options: object) -> str:
    """Run a command that must succeed; return its output."""
    options = {"env": environment(), "timeout": DEADLINE} | options
    done = subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, check=False, **options
    )
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a copy of the tracked and untracked files, so that builds do not change them."""
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
    """Return a virtual environment with the package and the dependencies of this Python."""
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
    """Build a workspace with colcon; return the prefix of the package."""
    workspace = source.parent.parent
    colcon = Path(sys.executable).with_name("colcon")
    options = {"env": environment(COLCON_HOME=str(workspace / "home")), "cwd": workspace}
    assert "(ros.ament_python)" in run(colcon, "--log-base", "log", "list", **options)
    run(colcon, "--log-base", "log", "build", **options)
    return workspace / "install" / PACKAGE


def check_prefix(prefix: Path, env: dict[str, str]) -> None:
    """Check that `prefix` contains all that `ros2 run` and `ros2 launch` need."""
    share = prefix / "share" / PACKAGE
    assert run(sys.executable, "-c", PRINT_AMENT_PREFIX, env=env).split() == [
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


def check_rejection(executable: Path, env: dict[str, str]) -> None:
    """Check that the program ends with status 2 and one line for a missing parameter file."""
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
    """Return the programs that are nodes and read a parameter file."""
    return sorted(set(programs()) - {"noninteract"})


def test_pip_installs_the_ros_prefix(pip_prefix: Path) -> None:
    """`pip install .` installs programs on the PATH, ament index entry, share and lib."""
    check_prefix(pip_prefix, environment(AMENT_PREFIX_PATH=str(pip_prefix)))
    for name in programs():
        assert os.access(pip_prefix / "bin" / name, os.X_OK)
    imported = run(pip_prefix / "bin" / "python3", "-P", "-c", PRINT_PACKAGE_PATH)
    assert Path(imported.strip()).is_relative_to(pip_prefix)
    static = {file.name for file in (ROOT / PACKAGE / "console" / "static").iterdir()}
    page = Path(imported.strip()).parent / "console" / "static"
    assert {file.name for file in page.iterdir()} == static
    assert (Path(imported.strip()).parent / "nodes" / "udp.xml").is_file()


@pytest.mark.parametrize("name", node_programs())
def test_programs_start_after_pip_install(pip_prefix: Path, name: str) -> None:
    """`ros2 run` starts the installed program."""
    check_rejection(pip_prefix / "lib" / PACKAGE / name, environment())


def test_command_line_starts_after_pip_install(pip_prefix: Path) -> None:
    """`ros2 run noninteract_ros noninteract` starts the command line."""
    assert "demo" in run(pip_prefix / "lib" / PACKAGE / "noninteract", "--help")


def sourced(prefix: Path) -> dict[str, str]:
    """Return the environment after `source install/local_setup.sh`."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    setup = prefix.parent / "local_setup.sh"
    printed = run("sh", "-c", f". {setup} && env -0", env=environment(PATH=path))
    return dict(entry.split("=", 1) for entry in printed.rstrip("\0").split("\0"))


def test_colcon_installs_the_ros_prefix(colcon_prefix: Path) -> None:
    """`colcon build` recognizes ament_python and installs the same prefix."""
    env = sourced(colcon_prefix)
    check_prefix(colcon_prefix, env)
    imported = run(sys.executable, "-P", "-c", PRINT_PACKAGE_PATH, env=env)
    assert Path(imported.strip()).is_relative_to(colcon_prefix)


@pytest.mark.parametrize("name", node_programs())
def test_programs_start_after_colcon_build(colcon_prefix: Path, name: str) -> None:
    """`ros2 run` starts the program of the workspace."""
    check_rejection(colcon_prefix / "lib" / PACKAGE / name, sourced(colcon_prefix))
