# SPDX-License-Identifier: Apache-2.0
"""Startup and shutdown of a program: argument errors in one line, no traceback on signals."""

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

STARTER = "NONINTERACT_ROS_STARTER"  # Environment variable with the process id of the parent.
PR_SET_PDEATHSIG = 1  # <linux/prctl.h>


class Runnable(Protocol):
    """Node of a program.

    Attributes:
        shutdown_requested: Return True after SIGINT or SIGTERM.
    """

    shutdown_requested: Callable[[], bool]

    @property
    def handles_shutdown(self) -> bool:
        """True where `run` still publishes after SIGINT or SIGTERM and then returns."""

    def run(self) -> None:
        """Run until the context is shut down, or until shutdown is handled."""

    def destroy_node(self) -> None:
        """Destroy the node."""


class StopSignal:
    """Handler of SIGINT and SIGTERM that sets a flag instead of raising an exception.

    Attributes:
        received: True once one of the signals was received.
    """

    def __init__(self) -> None:
        self.received = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._on_signal)

    def _on_signal(self, number: int, frame: FrameType | None) -> None:
        self.received = True


@contextmanager
def until_shutdown(context: rclpy.Context) -> Iterator[None]:
    """Leave the block without an error if it fails because the context was shut down."""
    try:
        yield
    except ExternalShutdownException:
        pass
    except RuntimeError:  # Raised by publishers, among others, without a context.
        if context.ok():
            raise


def follow_starter() -> None:
    """Request SIGINT for this process when the parent given by `STARTER` ends.

    No program outlives a parent that is killed.
    """
    starter = os.environ.get(STARTER)
    if starter is None:
        return
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGINT)
    if os.getppid() != int(starter):  # The parent has ended already.
        signal.raise_signal(signal.SIGINT)


def init(arguments: Sequence[str], signals: SignalHandlerOptions) -> None:
    """Initialize rclpy with parameter files rewritten for the parser of ROS.

    Raises:
        ScenarioError: An argument or a parameter file is wrong.
    """
    follow_starter()
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
    """Run the node of a program.

    An error in an argument or a parameter is printed in one line.

    Args:
        make: Factory of the node.
        arguments: Command line; by default that of this process.

    Returns:
        Exit status: 0 after SIGINT or SIGTERM, 2 after an error in an argument or a parameter.
    """
    argv = list(sys.argv if arguments is None else arguments)
    # On a signal ROS shuts the context down, then calls the handler installed before.
    stop = StopSignal()
    node = None
    try:
        init(argv, SignalHandlerOptions.ALL)
        with until_shutdown(rclpy.get_default_context()):
            node = make()
            # The loop must not wait long for the executor thread.
            sys.setswitchinterval(0.0005)
            if node.handles_shutdown:  # ROS would shut the context down at once.
                uninstall_signal_handlers()
                node.shutdown_requested = lambda: stop.received
            if not stop.received:
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
