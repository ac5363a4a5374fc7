# SPDX-License-Identifier: Apache-2.0
"""Facts about the repository, for the tests of the package as a whole."""

import os
from distutils.core import run_setup
from pathlib import Path

from setuptools import Distribution

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = "noninteract_ros"


def distribution() -> Distribution:
    """Return the metadata of setup.py, without building anything."""
    before = Path.cwd()
    os.chdir(ROOT)  # setup.py finds its data files relative to itself.
    try:
        return run_setup("setup.py", stop_after="init")
    finally:
        os.chdir(before)


def programs() -> dict[str, str]:
    """Return the function of each program, by name, from setup.py's entry points."""
    scripts = distribution().entry_points["console_scripts"]
    return dict(script.split(" = ") for script in scripts)
