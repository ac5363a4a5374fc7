# SPDX-License-Identifier: Apache-2.0
"""WebSocket clients that act as pages without a browser."""

import json
import socket
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from noninteract_ros.console.protocol import VERSION

DEADLINE = 20.0  # [s]


class RawPage:
    """Connection to a console that sends arbitrary messages.

    Args:
        port: Port of the console.
        token: Token in the hello; None sends no hello.
        origin: Origin header; by default the console's own, empty for none.
        host: Host header; by default the address of the connection.

    Attributes:
        socket: The connection.
        received: Received JSON messages.
    """

    def __init__(
        self, port: int, token: str | None = "", origin: str | None = None, host: str = ""
    ) -> None:
        own = f"http://127.0.0.1:{port}"
        uri = f"ws://{host or f'127.0.0.1:{port}'}/socket"
        self._cleanup = ExitStack()
        opening = connect(
            uri,
            sock=socket.create_connection(("127.0.0.1", port), DEADLINE),
            origin=own if origin is None else origin or None,
            compression=None,
            max_size=2**24,
        )
        self.socket: ClientConnection = self._cleanup.enter_context(opening)
        self.received: list[dict[str, Any]] = []
        if token is not None:
            with suppress(ConnectionClosed):  # The console may be full.
                self.send("hello", version=VERSION, token=token)

    def send(self, kind: str, **values: Any) -> None:
        """Send a message."""
        self.socket.send(json.dumps({"kind": kind, **values}))

    def until(self, done: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Receive until a JSON message meets a condition, and return it."""
        end = time.monotonic() + DEADLINE
        while time.monotonic() < end:
            data = self.socket.recv(timeout=DEADLINE)
            if isinstance(data, str):
                self.received.append(json.loads(data))
                if done(self.received[-1]):
                    return self.received[-1]
        raise AssertionError(f"no such message within {DEADLINE} s; last: {self.received[-3:]}")

    def wait_for_welcome(self) -> int:
        """Wait until the console accepts the page; return its number."""
        return int(self.until(lambda message: message["kind"] == "welcome")["page"])

    def response(self) -> tuple[bool, str]:
        """Return success and text of the next response."""
        message = self.until(lambda message: message["kind"] == "response")
        return message["ok"], message["text"]

    def closed(self) -> tuple[int, str]:
        """Receive until the console closes the connection; return code and reason."""
        end = time.monotonic() + DEADLINE
        while time.monotonic() < end:
            try:
                self.socket.recv(timeout=DEADLINE)
            except ConnectionClosed as error:
                return (
                    (error.rcvd.code, error.rcvd.reason) if error.rcvd else (0, "no close frame")
                )
        raise AssertionError(f"not closed within {DEADLINE} s")

    def close(self) -> None:
        """Close the connection."""
        self._cleanup.close()
