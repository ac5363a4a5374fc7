# SPDX-License-Identifier: Apache-2.0
"""Access control, message validation and driver lock of the console server."""

import http.client
import socket
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from pages import RawPage
from websockets.exceptions import InvalidStatus

from noninteract_ros.console.driver_lock import DriverLock
from noninteract_ros.console.held_input import DeadMansSwitch, HeldInput
from noninteract_ros.console.protocol import VERSION, PageCommand
from noninteract_ros.console.server import ConsoleServer
from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario.console_settings import ConsoleSettings

TWIST = {"subtask": "a", "element": 0, "grab": 1, "linear": [1, 0, 0], "angular": [0, 0, 0]}
TOKEN = "the configured token"
DEADLINE = 10.0  # [s]


class Backend:
    """Backend with one subtask `a` that stores commands."""

    def __init__(self) -> None:
        self.commands: list[tuple[int, str]] = []

    def greeting(self) -> list[str | bytes]:
        return ['{"kind": "hello"}', b"\x01\x00\x00\x00"]

    def accepts(self, held: HeldInput) -> bool:
        return held.subtask == "a" and held.element == 0

    def enqueue(self, page: int, command: PageCommand) -> None:
        self.commands.append((page, command.kind))


class Console:
    """A running server with its backend."""

    def __init__(self, token: str = "", **settings: Any) -> None:
        self.backend, self.switch = Backend(), DeadMansSwitch(0.2)
        self.lock = DriverLock(self.switch)
        chosen = ConsoleSettings(port=0, **settings)
        self.server = ConsoleServer(chosen, token, self.lock, self.backend)
        self.server.start()

    def page(self, **options: Any) -> RawPage:
        return RawPage(self.server.port, **options)

    def get(self, path: str, **headers: str) -> http.client.HTTPResponse:
        connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=DEADLINE)
        connection.request("GET", path, headers=headers)
        return connection.getresponse()

    def untouched(self) -> bool:
        """Return True if no input is held and no command was received."""
        return self.switch.held(time.monotonic()) is None and not self.backend.commands


def until(done: Callable[[], Any]) -> None:
    end = time.monotonic() + DEADLINE
    while not done():
        assert time.monotonic() < end
        time.sleep(0.002)


@pytest.fixture
def make() -> Iterator[Callable[..., Console]]:
    """Return a factory of consoles that are stopped after the test."""
    created: list[Console] = []

    def build(**options: Any) -> Console:
        created.append(Console(**options))
        return created[-1]

    yield build
    for console in created:
        console.server.stop()


@pytest.fixture
def console(make: Callable[..., Console]) -> Console:
    """A console with default settings."""
    return make()


def test_static_files_have_a_strict_content_policy(console: Console) -> None:
    """The policy allows neither other sources nor inline scripts."""
    for path in ("/", "/main.js", "/style.css", "/LICENSES.txt", "/?x=1"):
        response = console.get(path)
        assert response.status == 200
        policy = response.headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "script-src 'self';" in policy
        assert "unsafe" not in policy
        assert len(response.read()) == int(response.headers["Content-Length"])


@pytest.mark.parametrize("path", ["/x", "/../server.py", "/%2e%2e/server.py", "//etc/passwd"])
def test_other_paths_are_not_found(console: Console, path: str) -> None:
    """Only the page's own files are served."""
    assert console.get(path).status == 404


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "", "http://127.0.0.1:1"])
def test_a_foreign_origin_is_rejected(console: Console, origin: str) -> None:
    """A page of another origin, or without one, gets no WebSocket."""
    with pytest.raises(InvalidStatus) as rejected:
        console.page(origin=origin)
    assert rejected.value.response.status_code == 403
    assert console.untouched()


def test_a_foreign_host_is_rejected(console: Console) -> None:
    """A foreign name that resolves to this machine is rejected (DNS rebinding)."""
    host = f"evil.example:{console.server.port}"
    assert console.get("/", Host=host).status == 421
    with pytest.raises(InvalidStatus) as rejected:
        console.page(host=host, origin=f"http://{host}")
    assert rejected.value.response.status_code == 421


def test_a_configured_origin_is_accepted(make: Callable[..., Console]) -> None:
    """Behind a proxy the page has the proxy's origin."""
    console = make(origins=("https://robots.example",))
    assert console.page(origin="https://robots.example").wait_for_welcome()


@pytest.mark.parametrize("token", ["", "another token, of some length", TOKEN + "x", "ü"])
def test_a_wrong_token_is_rejected(make: Callable[..., Console], token: str) -> None:
    """Without the token no message is sent, not even the greeting."""
    console = make(token=TOKEN)
    page = console.page(token=token)
    assert page.closed() == (1008, "wrong token")
    assert page.received == []
    assert console.page(token=TOKEN).wait_for_welcome()


def test_the_default_address_is_local() -> None:
    """Other addresses are recognized as such, so that they require a token."""
    assert ConsoleSettings().is_local
    assert ConsoleSettings(host="::1").is_local
    assert not ConsoleSettings(host="0.0.0.0").is_local
    assert not ConsoleSettings(host="192.168.0.7").is_local
    with pytest.raises(ScenarioError, match=r"console\.host"):
        ConsoleSettings(host="robots.example")


def test_an_address_in_use_is_reported(console: Console) -> None:
    """The error names the key of the port."""
    lock = DriverLock(DeadMansSwitch(0.2))
    second = ConsoleServer(ConsoleSettings(port=console.server.port), "", lock, Backend())
    with pytest.raises(ScenarioError, match=r"console\.port"):
        second.start()


@pytest.mark.parametrize(
    ("data", "code"),
    [
        ("not JSON", 1008),
        ('{"kind": "drive"}', 1008),
        (b"\x00\x01", 1008),
        ('{"kind": "twist"}', 1008),
        ('{"kind": "heartbeat", "more": "' + "x" * 5000 + '"}', 1009),
    ],
    ids=["not JSON", "unknown", "binary", "no values", "too large"],
)
def test_an_invalid_message_closes_the_connection(
    console: Console, data: str | bytes, code: int
) -> None:
    """A driver that sends it loses the lock, and its input is released."""
    page = console.page()
    page.wait_for_welcome()
    page.send("take_control")
    page.send("twist", **TWIST)
    until(lambda: console.switch.held(time.monotonic()) is not None)
    page.socket.send(data)
    assert page.closed()[0] == code
    until(lambda: console.lock.driver is None)
    assert console.untouched()


def test_the_first_message_must_be_a_hello(console: Console) -> None:
    """Other messages are ignored, and another version is named as the reason."""
    page = console.page(token=None)
    page.send("stop")
    assert page.closed()[0] == 1008
    other = console.page(token=None)
    other.send("hello", version=VERSION + 1, token="")
    assert other.closed() == (1008, "no hello of this version: reload the page")
    assert console.untouched()


def test_too_many_messages_close_the_connection(make: Callable[..., Console]) -> None:
    """The rate limit applies to messages of any kind."""
    console = make(max_message_rate=50.0)
    page = console.page()
    page.wait_for_welcome()
    for _ in range(120):
        page.send("heartbeat")
    assert page.closed() == (1008, "too many messages")


def test_an_unknown_subtask_closes_the_connection(console: Console) -> None:
    """So does an unknown element."""
    for wrong in ({"subtask": "b"}, {"element": 1}):
        page = console.page()
        page.wait_for_welcome()
        page.send("take_control")
        page.send("twist", **TWIST | wrong)
        assert page.closed()[0] == 1008
    assert console.untouched()


def test_only_the_driver_commands_but_every_page_stops(console: Console) -> None:
    """Inputs and commands of other pages are ignored; losing the lock is reported."""
    first, second = console.page(), console.page()
    numbers = first.wait_for_welcome(), second.wait_for_welcome()
    first.send("take_control")
    second.send("twist", **TWIST)
    second.send("reset")
    assert second.response() == (False, "reset: take control first")
    assert console.untouched()
    second.send("stop")
    until(lambda: console.backend.commands == [(numbers[1], "stop")])
    first.send("twist", **TWIST)
    until(lambda: console.switch.held(time.monotonic()) is not None)
    second.send("take_control")
    assert first.response() == (False, "another page has taken control")
    assert console.lock.driver == numbers[1]
    assert console.switch.held(time.monotonic()) is None


def test_a_closed_page_releases_the_lock(console: Console) -> None:
    """The held input is released at once, without waiting for the timeout."""
    page = console.page()
    page.wait_for_welcome()
    page.send("take_control")
    page.send("twist", **TWIST)
    until(lambda: console.switch.held(time.monotonic()) is not None)
    page.close()
    until(lambda: console.lock.driver is None)
    assert console.switch.held(time.monotonic()) is None


def test_the_number_of_pages_is_limited(make: Callable[..., Console]) -> None:
    """A page too many is closed as busy; a page that closes makes room."""
    console = make(max_pages=2)
    pages = [console.page(), console.page()]
    for page in pages:
        page.wait_for_welcome()
    assert console.page().closed() == (1013, "too many pages")
    pages[0].close()
    until(lambda: console.server.pages == 1)
    until(lambda: console.server._places == 1)
    console.page().wait_for_welcome()


def test_strangers_take_no_places(make: Callable[..., Console]) -> None:
    """Sockets without the token leave room for a page with it, whose stop gets through."""
    console = make(token=TOKEN, max_pages=1)
    strangers = [console.page(token=None) for _ in range(80)]
    page = console.page(token=TOKEN)
    page.wait_for_welcome()
    page.send("stop")
    until(lambda: [kind for _, kind in console.backend.commands] == ["stop"])
    assert strangers[0].closed() == (1013, "no hello")
    assert strangers[-1].closed()[0] == 1008
    for stranger in strangers:
        stranger.close()


@pytest.mark.parametrize(
    "request_",
    ["GET / HTTP/1.1\r\nHost: [::1\r\n\r\n", "GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n",
     "GET //[ HTTP/1.1\r\nHost: localhost\r\n\r\n"],
    ids=["host", "two hosts", "path"],
)  # fmt: skip
def test_a_malformed_request_is_answered(console: Console, request_: str) -> None:
    """A request that cannot be parsed is the fault of the client."""
    with socket.create_connection(("127.0.0.1", console.server.port), DEADLINE) as connection:
        connection.sendall(request_.encode())
        assert connection.recv(100).startswith(b"HTTP/1.1 400 ")
