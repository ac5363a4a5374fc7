# SPDX-License-Identifier: Apache-2.0
"""The console's HTTP and WebSocket server, with a thread and an event loop of its own."""

import asyncio
import hmac
import json
import logging
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any, Protocol
from urllib.parse import urlsplit

from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from noninteract_ros.console.driver_lock import DriverLock
from noninteract_ros.console.limits import RateLimit
from noninteract_ros.console.page_input import Held
from noninteract_ros.console.protocol import VERSION, PageCommand, held, parse
from noninteract_ros.console.site import HEADERS, AccessPolicy, load_site
from noninteract_ros.errors import InputError, ScenarioError
from noninteract_ros.scenario.console_settings import ConsoleSettings

SOCKET = "/socket"
HELLO_TIMEOUT = 3.0  # [s] given to a page to say who it is
SLOW = 2**18  # [bytes] that wait for a page before pictures are left out for it
SEAT_TIMEOUT = 5.0  # [s] of silence after which the driver's seat is free
POLICY, BUSY = 1008, 1013  # codes that a WebSocket is closed with
START_TIMEOUT = 10.0  # [s]
FOR_DRIVERS = {
    "resume",
    "authority",
    "law",
    "gains",
    "pause",
    "step",
    "reset",
    "refill",
}


class Host(Protocol):
    """What the server serves; called in the server's thread."""

    def greeting(self) -> list[str | bytes]:
        """What a page is told first."""

    def knows(self, item: Held) -> bool:
        """Whether there is such a thing to hold."""

    def command(self, page: int, said: PageCommand) -> None:
        """A page asks for something; what comes of it is told later."""


@dataclass(eq=False)
class Page:
    """One open page.

    Attributes:
        number: Its number.
        socket: Its connection.
        allowance: How much more it may send.
    """

    number: int
    socket: ServerConnection
    allowance: RateLimit = field(repr=False)


class ConsoleServer:
    """Serves the page, lets pages in, hears them, tells them.

    Args:
        settings: Where to listen, and the limits.
        token: What pages must know; an empty text, where none is demanded.
        seat: Who drives.
        host: What is served.
    """

    def __init__(
        self, settings: ConsoleSettings, token: str, seat: DriverLock, host: Host
    ) -> None:
        self._settings, self._token, self._seat, self._host = settings, token, seat, host
        self._site = load_site()
        self._door = AccessPolicy(settings)
        self._pages: dict[int, Page] = {}
        self._sockets = self._next = 0
        self._loop = asyncio.new_event_loop()
        self._ended = asyncio.Event()
        self._started = threading.Event()
        self._failure: OSError | None = None
        self._thread = threading.Thread(target=self._run, daemon=True, name="console server")
        self.port = settings.port
        self.refused = 0

    @property
    def pages(self) -> int:
        """How many pages are open."""
        return len(self._pages)

    def start(self) -> None:
        """Listens.

        Raises:
            ScenarioError: The address cannot be used.
        """
        self._thread.start()
        self._started.wait(START_TIMEOUT)
        if self._failure is not None:
            found = f"{self._settings.host}:{self._settings.port}: {self._failure.strerror}"
            raise ScenarioError("console.port", found, "a free port; 0: any") from self._failure

    def stop(self) -> None:
        """Closes all pages and ends the thread."""
        if self._loop.is_running():
            self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join(START_TIMEOUT)

    def tell_all(self, data: str | bytes) -> None:
        """Tells all pages; those that do not keep up miss it. From any thread."""
        if self._pages and self._loop.is_running():
            self._loop.call_soon_threadsafe(self._broadcast, data)

    def tell(self, page: int, content: Mapping[str, Any]) -> None:
        """Tells one page. From any thread."""
        if self._loop.is_running():
            self._loop.call_soon_threadsafe(self._send, page, json.dumps(content))

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve())
        except OSError as error:
            self._failure = error
        finally:
            self._started.set()
            self._loop.close()

    async def _serve(self) -> None:
        quiet = logging.getLogger("noninteract_ros.console")
        quiet.addHandler(logging.NullHandler())
        quiet.propagate = False  # What strangers send must not fill logs.
        async with serve(
            self._talk,
            self._settings.host,
            self._settings.port,
            process_request=self._answer,
            max_size=self._settings.max_message,
            max_queue=16,
            compression=None,
            ping_interval=5.0,
            ping_timeout=10.0,
            close_timeout=1.0,
            server_header=None,
            logger=quiet,
        ) as server:
            self.port = next(iter(server.sockets)).getsockname()[1]
            self._started.set()
            await self._ended.wait()

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Plain requests; None lets a WebSocket through."""
        host = request.headers.get("Host")
        if not self._door.knows_host(host):
            return self._refused(HTTPStatus.MISDIRECTED_REQUEST, "unknown host\n")
        path = urlsplit(request.path).path
        if path == SOCKET:
            if not self._door.knows_origin(request.headers.get("Origin"), host):
                return self._refused(HTTPStatus.FORBIDDEN, "foreign origin\n")
            return None
        if path not in self._site:
            return _response(HTTPStatus.NOT_FOUND, "text/plain", b"not found\n")
        return _response(HTTPStatus.OK, *self._site[path])

    def _refused(self, status: HTTPStatus, text: str) -> Response:
        self.refused += 1
        return _response(status, "text/plain", text.encode())

    async def _talk(self, socket: ServerConnection) -> None:
        self._sockets += 1
        try:
            if self._sockets > self._settings.max_pages:
                await self._dismiss(socket, "too many pages", BUSY)
            elif await self._is_known(socket):
                await self._attend(socket)
        except ConnectionClosed as end:
            self.refused += end.sent is not None and end.sent.code != 1000
        finally:
            self._sockets -= 1

    async def _is_known(self, socket: ServerConnection) -> bool:
        """Whether a page introduces itself as it has to."""
        try:
            async with asyncio.timeout(HELLO_TIMEOUT):
                said = parse(await socket.recv())
        except (TimeoutError, InputError) as error:
            await self._dismiss(socket, str(error) or "no hello")
            return False
        given = said.values.get("token", "")
        if said.kind != "hello" or said.values["version"] != VERSION:
            await self._dismiss(socket, "no hello of this version: load the page again")
        elif self._token and not hmac.compare_digest(given.encode(), self._token.encode()):
            await self._dismiss(socket, "wrong token")
        else:
            return True
        return False

    async def _dismiss(self, socket: ServerConnection, reason: str, code: int = POLICY) -> None:
        self.refused += 1
        await socket.close(code, reason[:120])

    async def _attend(self, socket: ServerConnection) -> None:
        self._next += 1
        page = Page(self._next, socket, RateLimit(self._settings.max_message_rate))
        for item in self._host.greeting():
            await socket.send(item)
        await socket.send(json.dumps({"kind": "you", "page": page.number}))
        self._pages[page.number] = page
        try:
            async for data in socket:
                reason = self._hear(page, data)
                if reason:
                    await self._dismiss(socket, reason)
                    return
        finally:
            del self._pages[page.number]
            self._seat.leave(page.number)

    def _hear(self, page: Page, data: str | bytes) -> str:
        """Takes a message; the reason to end the talk, or an empty text."""
        now = time.monotonic()
        if not page.allowance.take(now):
            return "too many messages"
        try:
            said = parse(data)
            holding = held(said)
        except InputError as error:
            return str(error)
        if holding is not None and not self._host.knows(holding):
            return f"{said.kind} of nothing that can be driven"
        self._seat.heard(page.number, now)
        if holding is not None:
            self._seat.hold(page.number, holding, now)
        elif said.kind != "beat":
            self._obey(page, said, now)
        return ""

    def _obey(self, page: Page, said: PageCommand, now: float) -> None:
        number = page.number
        if said.kind == "release":
            self._seat.release(number)
        elif said.kind == "take":
            before = self._seat.take(number, now)
            if before is not None:
                text = "another page has taken over"
                self.tell(before, {"kind": "answer", "ok": False, "text": text})
        elif said.kind == "leave":
            self._seat.leave(number)
        elif said.kind in FOR_DRIVERS and number != self._seat.driver:
            text = f"{said.kind}: take control first"
            self.tell(number, {"kind": "answer", "ok": False, "text": text})
        elif said.kind in FOR_DRIVERS or said.kind == "stop":
            self._host.command(number, said)

    def _broadcast(self, data: str | bytes) -> None:
        if self._seat.driver is not None and self._seat.silence(time.monotonic()) > SEAT_TIMEOUT:
            self._seat.leave(self._seat.driver)
        keeping_up = [
            page.socket
            for page in self._pages.values()
            if page.socket.transport.get_write_buffer_size() < SLOW
        ]
        broadcast(keeping_up, data)

    def _send(self, number: int, data: str) -> None:
        if number in self._pages:
            broadcast([self._pages[number].socket], data)


def _response(status: HTTPStatus, kind: str, content: bytes) -> Response:
    headers = Headers({**HEADERS, "Content-Type": kind, "Content-Length": str(len(content))})
    headers["Connection"] = "close"
    return Response(status.value, status.phrase, headers, content)
