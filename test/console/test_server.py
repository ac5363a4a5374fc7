# SPDX-License-Identifier: Apache-2.0
"""Who is let in, who is refused, who drives: the console's server with pages that are none."""

import http.client
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from pages import RawPage
from websockets.exceptions import InvalidStatus

from noninteract_ros.console.driver_lock import DriverLock
from noninteract_ros.console.page_input import Held, PageDeadMan
from noninteract_ros.console.protocol import PageCommand
from noninteract_ros.console.server import ConsoleServer
from noninteract_ros.errors import ScenarioError
from noninteract_ros.scenario.console_settings import ConsoleSettings

PUSH = {"subtask": "a", "element": 0, "grab": 1, "linear": [1, 0, 0], "angular": [0, 0, 0]}
TOKEN = "a token that is known"
DEADLINE = 10.0  # [s]


class Host:
    """Something to be served: one subtask `a`, which keeps what it is asked for."""

    def __init__(self) -> None:
        self.asked: list[tuple[int, str]] = []

    def greeting(self) -> list[str | bytes]:
        return ['{"kind": "hello"}', b"\x01\x00\x00\x00"]

    def knows(self, item: Held) -> bool:
        return item.subtask == "a" and item.element == 0

    def command(self, page: int, said: PageCommand) -> None:
        self.asked.append((page, said.kind))


class Console:
    """A server with what it serves."""

    def __init__(self, token: str = "", **settings: Any) -> None:
        self.host, self.switch = Host(), PageDeadMan(0.2)
        self.seat = DriverLock(self.switch)
        chosen = ConsoleSettings(port=0, **settings)
        self.server = ConsoleServer(chosen, token, self.seat, self.host)
        self.server.start()

    def page(self, **options: Any) -> RawPage:
        return RawPage(self.server.port, **options)

    def get(self, path: str, **headers: str) -> http.client.HTTPResponse:
        connection = http.client.HTTPConnection("127.0.0.1", self.server.port, timeout=DEADLINE)
        connection.request("GET", path, headers=headers)
        return connection.getresponse()

    def untouched(self) -> bool:
        """Whether nothing was held and nothing was asked for."""
        return self.switch.held(time.monotonic()) is None and not self.host.asked


def until(done: Callable[[], Any]) -> None:
    end = time.monotonic() + DEADLINE
    while not done():
        assert time.monotonic() < end
        time.sleep(0.002)


@pytest.fixture
def make() -> Iterator[Callable[..., Console]]:
    """Makes consoles that end with the test."""
    made: list[Console] = []

    def build(**options: Any) -> Console:
        made.append(Console(**options))
        return made[-1]

    yield build
    for console in made:
        console.server.stop()


@pytest.fixture
def console(make: Callable[..., Console]) -> Console:
    """A console on this machine, with its defaults."""
    return make()


def test_the_page_brings_all_it_needs(console: Console) -> None:
    """Every file comes with a policy that allows no other source and no inline script."""
    for path in ("/", "/main.js", "/style.css", "/LICENSES.txt", "/?x=1"):
        response = console.get(path)
        assert response.status == 200
        policy = response.headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "script-src 'self';" in policy
        assert "unsafe" not in policy
        assert len(response.read()) == int(response.headers["Content-Length"])


@pytest.mark.parametrize("path", ["/x", "/../server.py", "/%2e%2e/server.py", "//etc/passwd"])
def test_nothing_else_is_served(console: Console, path: str) -> None:
    """Only the page's own files can be asked for."""
    assert console.get(path).status == 404


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "", "http://127.0.0.1:1"])
def test_a_foreign_origin_is_refused(console: Console, origin: str) -> None:
    """A page of another origin, or one that names none, gets no WebSocket."""
    with pytest.raises(InvalidStatus) as refused:
        console.page(origin=origin)
    assert refused.value.response.status_code == 403
    assert console.untouched()


def test_a_foreign_name_is_refused(console: Console) -> None:
    """A name that somebody has made to point to this machine is no way in."""
    host = f"evil.example:{console.server.port}"
    assert console.get("/", Host=host).status == 421
    with pytest.raises(InvalidStatus) as refused:
        console.page(host=host, origin=f"http://{host}")
    assert refused.value.response.status_code == 421


def test_another_origin_can_be_allowed(make: Callable[..., Console]) -> None:
    """Behind a proxy the page has the proxy's origin, which the settings name."""
    console = make(origins=("https://robots.example",))
    assert console.page(origin="https://robots.example").welcomed()


@pytest.mark.parametrize("token", ["", "another token, of some length", TOKEN + "x", "ü"])
def test_a_wrong_token_is_refused(make: Callable[..., Console], token: str) -> None:
    """Without the token there is no word, not even a greeting; with it there is."""
    console = make(token=TOKEN)
    page = console.page(token=token)
    assert page.closed() == (1008, "wrong token")
    assert page.told == []
    assert console.page(token=TOKEN).welcomed()


def test_only_this_machine_is_listened_to_by_default() -> None:
    """Any other address is known for one, so that a token is demanded there."""
    assert ConsoleSettings().is_local
    assert ConsoleSettings(host="::1").is_local
    assert not ConsoleSettings(host="0.0.0.0").is_local
    assert not ConsoleSettings(host="192.168.0.7").is_local
    with pytest.raises(ScenarioError, match=r"console\.host"):
        ConsoleSettings(host="robots.example").check()


def test_an_address_in_use_is_said(console: Console) -> None:
    """A port that is taken is named, with its key."""
    seat = DriverLock(PageDeadMan(0.2))
    second = ConsoleServer(ConsoleSettings(port=console.server.port), "", seat, Host())
    with pytest.raises(ScenarioError, match=r"console\.port"):
        second.start()


@pytest.mark.parametrize(
    ("said", "code"),
    [
        ("no JSON", 1008),
        ('{"kind": "drive"}', 1008),
        (b"\x00\x01", 1008),
        ('{"kind": "push"}', 1008),
        ('{"kind": "beat", "more": "' + "x" * 5000 + '"}', 1009),
    ],
    ids=["no JSON", "unknown", "binary", "no values", "too large"],
)
def test_what_is_malformed_or_too_large_ends_the_talk(
    console: Console, said: str | bytes, code: int
) -> None:
    """The driver who sends it is closed, loses the seat and holds nothing any more."""
    page = console.page()
    page.welcomed()
    page.say("take")
    page.say("push", **PUSH)
    until(lambda: console.switch.held(time.monotonic()) is not None)
    page.socket.send(said)
    assert page.closed()[0] == code
    until(lambda: console.seat.driver is None)
    assert console.untouched()


def test_a_first_word_that_is_no_hello_ends_the_talk(console: Console) -> None:
    """Whoever does not introduce itself is not heard; another version is told so."""
    page = console.page(token=None)
    page.say("stop")
    assert page.closed()[0] == 1008
    other = console.page(token=None)
    other.say("hello", version=2, token="")
    assert other.closed() == (1008, "no hello of this version: load the page again")
    assert console.untouched()


def test_what_comes_too_often_ends_the_talk(make: Callable[..., Console]) -> None:
    """A flood is cut off, whatever it consists of."""
    console = make(max_message_rate=50.0)
    page = console.page()
    page.welcomed()
    for _ in range(120):
        page.say("beat")
    assert page.closed() == (1008, "too many messages")


def test_what_does_not_exist_cannot_be_held(console: Console) -> None:
    """A subtask or an element that is not there ends the talk."""
    for wrong in ({"subtask": "b"}, {"element": 1}):
        page = console.page()
        page.welcomed()
        page.say("take")
        page.say("push", **PUSH | wrong)
        assert page.closed()[0] == 1008
    assert console.untouched()


def test_one_drives_and_the_others_watch(console: Console) -> None:
    """Watchers hold nothing and command nothing, but anybody stops; taking over is told."""
    first, second = console.page(), console.page()
    numbers = first.welcomed(), second.welcomed()
    first.say("take")
    second.say("push", **PUSH)
    second.say("reset")
    assert second.answer() == (False, "reset: take control first")
    assert console.untouched()
    second.say("stop")
    until(lambda: console.host.asked == [(numbers[1], "stop")])
    first.say("push", **PUSH)
    until(lambda: console.switch.held(time.monotonic()) is not None)
    second.say("take")
    assert first.answer() == (False, "another page has taken over")
    assert console.seat.driver == numbers[1]
    assert console.switch.held(time.monotonic()) is None


def test_a_closed_page_leaves_the_seat(console: Console) -> None:
    """Closing lets go at once, without waiting for silence."""
    page = console.page()
    page.welcomed()
    page.say("take")
    page.say("push", **PUSH)
    until(lambda: console.switch.held(time.monotonic()) is not None)
    page.close()
    until(lambda: console.seat.driver is None)
    assert console.switch.held(time.monotonic()) is None


def test_there_is_an_end_to_pages(make: Callable[..., Console]) -> None:
    """One page too many is told to come again; one that leaves makes room."""
    console = make(max_pages=2)
    pages = [console.page(), console.page()]
    for page in pages:
        page.welcomed()
    assert console.page().closed() == (1013, "too many pages")
    pages[0].close()
    until(lambda: console.server.pages == 1)
    until(lambda: console.server._sockets == 1)
    console.page().welcomed()
