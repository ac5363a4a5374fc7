# SPDX-License-Identifier: Apache-2.0
"""Command `python -m noninteract_ros.nodes NAME --ros-args ...`."""

import sys
from importlib import import_module

from noninteract_ros.errors import one_of
from noninteract_ros.nodes import PROGRAMS


def main() -> int:
    """Run the program named by the first argument.

    Returns:
        Exit status of the program; 2 if there is no program of that name.
    """
    name = sys.argv[1] if len(sys.argv) > 1 else ""
    if name not in PROGRAMS:
        print(f"program: found {name!r}; allowed: {one_of(PROGRAMS, name)}", file=sys.stderr)
        return 2
    program = import_module(f"{__package__}.{PROGRAMS[name]}")
    return int(program.main(sys.argv[1:]))


if __name__ == "__main__":
    sys.exit(main())
