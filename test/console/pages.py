# SPDX-License-Identifier: Apache-2.0
"""Pages that are no browsers: they say what they are told to."""

import json
import socket
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Any

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

DEADLINE = 20.0  # [s]


class RawPage:
    """A connection to a console.

    Args:
        port: Where the console listens.
        token: What it says in its hello; None for no hello.
        origin: Origin that it claims; by default the console's own, an empty text for none.
        host: Host that it asks for; by default where it connects to.
    """

    def __init__(
        self, port: int, token: str | None = "", origin: str | None = None, host: str = ""
    ) -> None:
        own = f"http://127.0.0.1:{port}"
        uri = f"ws://{host or f'127.0.0.1:{port}'}/socket"
        self._left = ExitStack()
        opening = connect(
            uri,
            sock=socket.create_connection(("127.0.0.1", port), DEADLINE),
            origin=own if origin is None else origin or None,
            compression=None,
            max_size=2**24,
        )
        self.socket: ClientConnection = self._left.enter_context(opening)
        self.told: list[dict[str, Any]] = []
        if token is not None:
            with suppress(ConnectionClosed):  # It may be one page too many.
                self.say("hello", version=1, token=token)

    def say(self, kind: str, **values: Any) -> None:
        """Sends a message."""
        self.socket.send(json.dumps({"kind": kind, **values}))

    def until(self, done: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """Reads until a message is the one."""
        end = time.monotonic() + DEADLINE
        while time.monotonic() < end:
            data = self.socket.recv(timeout=DEADLINE)
            if isinstance(data, str):
                self.told.append(json.loads(data))
                if done(self.told[-1]):
                    return self.told[-1]
        raise AssertionError(f"not told within {DEADLINE} s; last: {self.told[-3:]}")

    def welcomed(self) -> int:
        """Waits to be let in; the page's number."""
        return int(self.until(lambda told: told["kind"] == "you")["page"])

    def answer(self) -> tuple[bool, str]:
        """The next answer."""
        told = self.until(lambda told: told["kind"] == "answer")
        return told["ok"], told["text"]

    def closed(self) -> tuple[int, str]:
        """Reads until the console closes; code and reason."""
        end = time.monotonic() + DEADLINE
        while time.monotonic() < end:
            try:
                self.socket.recv(timeout=DEADLINE)
            except ConnectionClosed as error:
                return (error.rcvd.code, error.rcvd.reason) if error.rcvd else (0, "no word")
        raise AssertionError(f"not closed within {DEADLINE} s")

    def close(self) -> None:
        """Leaves."""
        self._left.close()
