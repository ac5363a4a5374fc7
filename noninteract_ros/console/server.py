# SPDX-License-Identifier: Apache-2.0
"""HTTP and WebSocket server of the console, with its own thread and event loop."""

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
from noninteract_ros.console.held_input import HeldInput
from noninteract_ros.console.protocol import VERSION, PageCommand, held_input, parse
from noninteract_ros.console.site import HEADERS, AccessPolicy, RateLimit, load_static_files
from noninteract_ros.errors import InputError, ScenarioError
from noninteract_ros.scenario.console_settings import ConsoleSettings

SOCKET = "/socket"
HELLO_TIMEOUT = 2.0  # [s] for the handshake, and for the first message of a page
MAX_STRANGERS = 64  # Connections before their hello; beyond it, the oldest one is closed.
MAX_BACKLOG = 2**18  # [bytes] waiting for a page, above which frames are dropped for it
DRIVER_TIMEOUT = 5.0  # [s] without a message, after which the driver loses the lock
POLICY, BUSY = 1008, 1013  # WebSocket close codes
START_TIMEOUT = 10.0  # [s]
DRIVER_COMMANDS = {
    "resume",
    "authority",
    "law",
    "gains",
    "pause",
    "step",
    "reset",
    "refill",
}


class ConsoleBackend(Protocol):
    """Interface between the server and the console; called in the server's thread."""

    def greeting(self) -> list[str | bytes]:
        """Return the messages that open a connection."""

    def accepts(self, held: HeldInput) -> bool:
        """Return True if the subtask and element of an input can be driven."""

    def enqueue(self, page: int, command: PageCommand) -> None:
        """Queue a command of a page; the response is sent later."""


@dataclass(eq=False)
class Page:
    """One open page.

    Attributes:
        number: Number of the page.
        socket: Its connection.
        rate_limit: Limit of its messages.
    """

    number: int
    socket: ServerConnection
    rate_limit: RateLimit = field(repr=False)


class ConsoleServer:
    """HTTP and WebSocket server of the page.

    Args:
        settings: Address and limits.
        token: Token that pages must send; empty where none is required.
        lock: Driver lock.
        backend: Console behind the server.

    Attributes:
        port: Port that the server listens on.
        rejected: Number of rejected requests and connections.
    """

    def __init__(
        self, settings: ConsoleSettings, token: str, lock: DriverLock, backend: ConsoleBackend
    ) -> None:
        self._settings, self._token, self._lock, self._backend = settings, token, lock, backend
        self._files = load_static_files()
        self._access = AccessPolicy(settings)
        self._pages: dict[int, Page] = {}
        self._strangers: list[ServerConnection] = []
        self._places = self._last_number = 0
        self._loop = asyncio.new_event_loop()
        self._stopped = asyncio.Event()
        self._started = threading.Event()
        self._failure: OSError | None = None
        self._thread = threading.Thread(target=self._run, daemon=True, name="console server")
        self.port = settings.port
        self.rejected = 0

    @property
    def pages(self) -> int:
        """Number of open pages."""
        return len(self._pages)

    def start(self) -> None:
        """Start listening.

        Raises:
            ScenarioError: The address cannot be used.
        """
        self._thread.start()
        self._started.wait(START_TIMEOUT)
        if self._failure is not None:
            found = f"{self._settings.host}:{self._settings.port}: {self._failure.strerror}"
            raise ScenarioError("console.port", found, "a free port; 0: any") from self._failure

    def stop(self) -> None:
        """Close all pages and end the thread."""
        if self._loop.is_running():
            self._loop.call_soon_threadsafe(self._stopped.set)
        self._thread.join(START_TIMEOUT)

    def broadcast(self, data: str | bytes) -> None:
        """Send to all pages that keep up; callable from any thread."""
        if self._pages and self._loop.is_running():
            self._loop.call_soon_threadsafe(self._broadcast, data)

    def send(self, page: int, content: Mapping[str, Any]) -> None:
        """Send a JSON message to one page; callable from any thread."""
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
        logger = logging.getLogger("noninteract_ros.console")
        logger.addHandler(logging.NullHandler())
        logger.propagate = False  # Unauthenticated clients must not fill logs.
        async with serve(
            self._handle_connection,
            self._settings.host,
            self._settings.port,
            process_request=self._handle_request,
            max_size=self._settings.max_message,
            max_queue=16,
            compression=None,
            ping_interval=5.0,
            ping_timeout=10.0,
            close_timeout=1.0,
            open_timeout=HELLO_TIMEOUT,
            server_header=None,
            logger=logger,
        ) as server:
            self.port = next(iter(server.sockets)).getsockname()[1]
            self._started.set()
            await self._stopped.wait()

    def _handle_request(self, connection: ServerConnection, request: Request) -> Response | None:
        """Respond to an HTTP request; None lets a WebSocket handshake continue."""
        try:
            return self._respond(request)
        except (LookupError, ValueError):  # Several hosts, or no host or path.
            return self._reject(HTTPStatus.BAD_REQUEST, "malformed request\n")

    def _respond(self, request: Request) -> Response | None:
        host = request.headers.get("Host")
        if not self._access.allows_host(host):
            return self._reject(HTTPStatus.MISDIRECTED_REQUEST, "unknown host\n")
        path = urlsplit(request.path).path
        if path == SOCKET:
            if not self._access.allows_origin(request.headers.get("Origin"), host):
                return self._reject(HTTPStatus.FORBIDDEN, "foreign origin\n")
            return None
        if path not in self._files:
            return _response(HTTPStatus.NOT_FOUND, "text/plain", b"not found\n")
        return _response(HTTPStatus.OK, *self._files[path])

    def _reject(self, status: HTTPStatus, text: str) -> Response:
        self.rejected += 1
        return _response(status, "text/plain", text.encode())

    async def _handle_connection(self, socket: ServerConnection) -> None:
        """Handle a connection; only one with a valid hello takes the place of a page."""
        self._strangers.append(socket)
        try:
            if len(self._strangers) > MAX_STRANGERS:
                await self._close(self._strangers.pop(0), "no hello", BUSY)
            known = await self._authenticate(socket)
            self._leave(socket)
            if known and self._places >= self._settings.max_pages:
                await self._close(socket, "too many pages", BUSY)
            elif known:
                self._places += 1
                try:
                    await self._handle_page(socket)
                finally:
                    self._places -= 1
        except ConnectionClosed as end:
            self.rejected += end.sent is not None and end.sent.code != 1000
        finally:
            self._leave(socket)

    def _leave(self, socket: ServerConnection) -> None:
        """Remove a connection from those before their hello."""
        if socket in self._strangers:
            self._strangers.remove(socket)

    async def _authenticate(self, socket: ServerConnection) -> bool:
        """Return True if the first message is a hello of this version with the token."""
        try:
            async with asyncio.timeout(HELLO_TIMEOUT):
                hello = parse(await socket.recv())
        except (TimeoutError, InputError) as error:
            await self._close(socket, str(error) or "no hello")
            return False
        token = hello.values.get("token", "")
        if hello.kind != "hello" or hello.values["version"] != VERSION:
            await self._close(socket, "no hello of this version: reload the page")
        elif self._token and not hmac.compare_digest(token.encode(), self._token.encode()):
            await self._close(socket, "wrong token")
        else:
            return True
        return False

    async def _close(self, socket: ServerConnection, reason: str, code: int = POLICY) -> None:
        self.rejected += 1
        await socket.close(code, reason[:120])

    async def _handle_page(self, socket: ServerConnection) -> None:
        self._last_number += 1
        rate_limit = RateLimit(self._settings.max_message_rate)
        page = Page(number=self._last_number, socket=socket, rate_limit=rate_limit)
        for item in self._backend.greeting():
            await socket.send(item)
        await socket.send(json.dumps({"kind": "welcome", "page": page.number}))
        self._pages[page.number] = page
        try:
            async for data in socket:
                reason = self._handle_message(page, data)
                if reason:
                    await self._close(socket, reason)
                    return
        finally:
            del self._pages[page.number]
            self._lock.release(page.number)

    def _handle_message(self, page: Page, data: str | bytes) -> str:
        """Process a message; return the reason to close the connection, or an empty text."""
        now = time.monotonic()
        if not page.rate_limit.accept(now):
            return "too many messages"
        try:
            command = parse(data)
            held = held_input(command)
        except InputError as error:
            return str(error)
        if held is not None and not self._backend.accepts(held):
            return f"{command.kind}: not a drivable subtask"
        self._lock.refresh(page.number, now)
        if held is not None:
            self._lock.hold_input(page.number, held, now)
        elif command.kind != "heartbeat":
            self._handle_command(page, command, now)
        return ""

    def _handle_command(self, page: Page, command: PageCommand, now: float) -> None:
        number = page.number
        if command.kind == "release":
            self._lock.release_input(number)
        elif command.kind == "take_control":
            before = self._lock.acquire(number, now)
            if before is not None:
                text = "another page has taken control"
                self.send(before, {"kind": "response", "ok": False, "text": text})
        elif command.kind == "release_control":
            self._lock.release(number)
        elif command.kind in DRIVER_COMMANDS and number != self._lock.driver:
            text = f"{command.kind}: take control first"
            self.send(number, {"kind": "response", "ok": False, "text": text})
        elif command.kind in DRIVER_COMMANDS or command.kind == "stop":
            self._backend.enqueue(number, command)

    def _broadcast(self, data: str | bytes) -> None:
        driver = self._lock.driver
        if driver is not None and self._lock.idle_time(time.monotonic()) > DRIVER_TIMEOUT:
            self._lock.release(driver)
        keeping_up = [
            page.socket
            for page in self._pages.values()
            if page.socket.transport.get_write_buffer_size() < MAX_BACKLOG
        ]
        broadcast(keeping_up, data)

    def _send(self, number: int, data: str) -> None:
        if number in self._pages:
            broadcast([self._pages[number].socket], data)


def _response(status: HTTPStatus, content_type: str, content: bytes) -> Response:
    headers = Headers(
        {**HEADERS, "Content-Type": content_type, "Content-Length": str(len(content))}
    )
    headers["Connection"] = "close"
    return Response(status.value, status.phrase, headers, content)
