# SPDX-License-Identifier: Apache-2.0
"""Start and end of a program: wrong arguments in one line, signals without a trace."""

import ctypes
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from types import FrameType
from typing import Protocol

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.signals import SignalHandlerOptions, uninstall_signal_handlers
from rclpy.utilities import remove_ros_args

from noninteract_ros.errors import ScenarioError
from noninteract_ros.nodes.common.parameter_files import origin_of_key, rewrite

STARTER = "NONINTERACT_ROS_STARTER"  # Process id of whoever ends the programs that it starts.
PR_SET_PDEATHSIG = 1  # <linux/prctl.h>


class Runnable(Protocol):
    """A node that a program consists of.

    Attributes:
        told_to_stop: Whether it was, asked by a node with last words.
    """

    told_to_stop: Callable[[], bool]

    @property
    def has_last_words(self) -> bool:
        """Whether it has something to say before the context may be shut down."""

    def run(self) -> None:
        """Runs until the context is shut down; with last words, until it is told to stop."""

    def destroy_node(self) -> None:
        """Ends the node."""


class StopSignal:
    """Turns SIGINT and SIGTERM into a flag: no exception breaks off what is being done.

    Attributes:
        came: Whether one of the signals has come.
    """

    def __init__(self) -> None:
        self.came = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.came = True


@contextmanager
def until_shutdown(context: rclpy.Context) -> Iterator[None]:
    """Ends the block quietly where it fails because the context was shut down."""
    try:
        yield
    except ExternalShutdownException:
        pass
    except RuntimeError:  # What publishing, and most else, raises without a context.
        if context.ok():
            raise


def end_with_starter() -> None:
    """Asks for SIGINT when the process named by `STARTER` ends: none that it started is left.

    However that one ends, it may have been killed.
    """
    starter = os.environ.get(STARTER)
    if starter is None:
        return
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGINT)
    if os.getppid() != int(starter):  # It has ended already.
        signal.raise_signal(signal.SIGINT)


def init(arguments: Sequence[str], signals: SignalHandlerOptions) -> None:
    """Starts ROS with a command line whose parameter files are made readable for it.

    Raises:
        ScenarioError: An argument or a parameter file is wrong.
    """
    end_with_starter()
    with TemporaryDirectory() as folder:
        ros_arguments = rewrite(arguments, Path(folder))
        try:
            plain = remove_ros_args(ros_arguments)[1:]
            if plain:
                raise ScenarioError("(arguments)", " ".join(plain), "--ros-args ...")
            rclpy.init(args=ros_arguments, signal_handler_options=signals)
        except RuntimeError as error:
            found = " ".join(str(error).split())
            raise ScenarioError("(arguments)", found, "--ros-args ...") from error


def run_program(make: Callable[[], Runnable], arguments: Sequence[str] | None) -> int:
    """Main function of a program.

    Args:
        make: Makes its node.
        arguments: Command line, by default the one of this process.

    Returns:
        Exit status: 0 after SIGINT or SIGTERM, 2 where an argument or a parameter is wrong; that
        is said in one line.
    """
    argv = list(sys.argv if arguments is None else arguments)
    # ROS shuts the context down at a signal, then calls the handler that it found.
    stop = StopSignal()
    node = None
    try:
        init(argv, SignalHandlerOptions.ALL)
        with until_shutdown(rclpy.get_default_context()):
            node = make()
            # The loop must not wait for the executor's thread for long.
            sys.setswitchinterval(0.0005)
            if node.has_last_words:  # ROS would shut the context down before they are said.
                uninstall_signal_handlers()
                node.told_to_stop = lambda: stop.came
            if not stop.came:
                node.run()
    except ScenarioError as error:
        named = error.file or origin_of_key(argv, error.key)
        print(ScenarioError(error.key, error.found, error.allowed, named), file=sys.stderr)
        return 2
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
