# SPDX-License-Identifier: Apache-2.0
"""A person at the console, in a real browser: everything that can be held, pressed and cut."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from harness import Ros
from pages import RawPage
from programs import Programs
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from show import (
    TOKEN,
    Relay,
    Show,
    drag,
    frozen,
    launch,
    missing,
    press_pad,
    shoot,
    wait,
)
from std_msgs.msg import String
from waiting import until
from websockets.exceptions import ConnectionClosed

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.skipif(bool(missing()), reason=missing())
REST = 0.5  # [s] given to the team to come to rest
PUSH = {
    "subtask": "cooperative",
    "element": 0,
    "grab": 1,
    "linear": [1, 0, 0],
    "angular": [0, 0, 0],
}


@pytest.fixture(scope="module")
def show(module_domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Show]:
    """One team, one console and one browser for all tests; each opens pages of its own."""
    from playwright.sync_api import sync_playwright

    with ExitStack() as left:
        browser = launch(left.enter_context(sync_playwright()))
        left.callback(browser.close)
        ros = Ros(module_domain)
        left.callback(ros.close)
        programs = Programs(tmp_path_factory.mktemp("show"), module_domain)
        left.callback(programs.close)
        yield Show.open(ros, programs, browser)


@pytest.fixture(scope="module")
def one_page(show: Show) -> Iterator[Page]:
    """A page that stays open."""
    with show.page(drives=False) as page:
        yield page


@pytest.fixture
def page(show: Show, one_page: Page) -> Iterator[Page]:
    """The page that stays open, driving a team at rest, whatever the last test has left."""
    one_page.bring_to_front()
    if not one_page.evaluate("operatorConsole.drives()"):
        one_page.click("#take")
        wait(one_page, "operatorConsole.drives()")
    if one_page.evaluate("operatorConsole.status().stopped"):
        one_page.click("#resume")
        wait(one_page, "!operatorConsole.status().stopped")
    one_page.select_option("#what", "cooperative/0")
    one_page.evaluate("document.activeElement.blur()")  # In a field, keys write.
    show.rests()
    yield one_page
    one_page.mouse.up()
    one_page.evaluate("window.pad = null")


def test_the_page_asks_nobody_else(show: Show) -> None:
    """Every request goes to the console, and nothing is refused by the page's own policy."""
    asked: list[str] = []
    complaints: list[str] = []
    with show.page(drives=False) as page:
        page.on("request", lambda request: asked.append(request.url))
        page.on("console", lambda said: complaints.append(said.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.reload()
        wait(page, "operatorConsole.status()?.there")
        shoot(page, "watching")
    own = (f"http://127.0.0.1:{show.port}/", "data:,")
    assert asked
    assert all(url.startswith(own) for url in asked), asked
    assert [text for text in complaints if "GL Driver" not in text] == []


def test_a_drag_of_the_handle_moves_the_team_by_that_much(show: Show, page: Page) -> None:
    """The team's middle is where the mouse has pulled it to, on the screen and in the world."""
    start = show.centre()
    before = page.evaluate(f"operatorConsole.pixel({[*start.tolist(), 0.0]})")
    drag(page, "x", (60.0, 0.0))
    pulled = page.evaluate("operatorConsole.handle()")
    until(lambda: np.abs(show.centre() - pulled[:2]).max() < 1e-3, "the team follows the handle")
    shoot(page, "drag")
    page.mouse.up()
    show.rests()
    moved = show.centre() - start
    assert moved[0] > 0.1
    assert abs(moved[1]) < 1e-3
    after = page.evaluate(f"operatorConsole.pixel({[*show.centre().tolist(), 0.0]})")
    np.testing.assert_allclose(np.subtract(after, before), [60.0, 0.0], atol=2.0)


def by_pad(page: Page) -> Callable[[], None]:
    press_pad(page, 0.0, -0.4)
    return page.mouse.up


def by_keys(page: Page) -> Callable[[], None]:
    page.keyboard.down("ArrowDown")
    return lambda: page.keyboard.up("ArrowDown")


def tilt_stick(page: Page, button: bool) -> None:
    pressed = f"(_, i) => ({{ pressed: i === 5 && {str(button).lower()} }})"
    buttons = f"Array.from({{ length: 17 }}, {pressed})"
    page.evaluate(f"window.pad = {{ connected: true, axes: [0, 1, 0, 0], buttons: {buttons} }}")


def by_gamepad(page: Page) -> Callable[[], None]:
    tilt_stick(page, True)
    return lambda: tilt_stick(page, False)


@pytest.mark.parametrize("hold", [by_pad, by_keys, by_gamepad])
def test_what_is_held_leads_until_it_is_let_go(
    show: Show, page: Page, hold: Callable[[Page], Callable[[], None]]
) -> None:
    """Towards -y at the console's speed, and at rest soon after the release."""
    start = show.centre()
    release = hold(page)
    show.moves(0.19)
    shoot(page, hold.__name__)
    assert show.rest_after(release) < REST
    moved = show.centre() - start
    assert moved[1] < -0.02  # What it takes to come to that speed and to rest.
    assert abs(moved[0]) < 1e-3
    assert show.stays()


def test_a_stick_without_its_button_does_nothing(show: Show, page: Page) -> None:
    """A gamepad's button is the dead-man's switch."""
    tilt_stick(page, False)
    assert show.stays()


def freeze(show: Show, left: ExitStack) -> tuple[Page, Callable[[], None]]:
    page = left.enter_context(show.page())
    return page, lambda: left.enter_context(frozen(show.browser))


def close(show: Show, left: ExitStack) -> tuple[Page, Callable[[], None]]:
    page = left.enter_context(show.page())
    return page, page.close


def cut(show: Show, left: ExitStack) -> tuple[Page, Callable[[], None]]:
    relay = Relay(show.port)
    left.callback(relay.close)
    return left.enter_context(show.page(port=relay.port)), relay.cut


@pytest.mark.parametrize("lose", [freeze, close, cut])
def test_a_page_that_is_lost_lets_go(
    show: Show, lose: Callable[[Show, ExitStack], tuple[Page, Callable[[], None]]]
) -> None:
    """Frozen, closed or cut off while it drives: the team is at rest within half a second."""
    with ExitStack() as left:
        page, end = lose(show, left)
        press_pad(page, 0.0, 0.4)
        show.moves(0.19, page)
        assert show.rest_after(end) < REST
        assert show.stays()


def test_the_space_key_stops_and_the_stop_is_latched(show: Show, page: Page) -> None:
    """While a pad is held, and with the cursor in a field; only a resume lets anything move."""
    press_pad(page, 0.0, 0.4)
    show.moves()
    page.locator("input[data-gain]").first.focus()
    assert show.rest_after(lambda: page.keyboard.press("Space")) < REST
    wait(page, "operatorConsole.status().stopped")
    page.mouse.move(400, 300)
    shoot(page, "stopped")
    page.mouse.up()
    press_pad(page, 0.0, 0.4)
    assert show.stays()
    page.mouse.up()
    page.click("#resume")
    wait(page, "!operatorConsole.status().stopped")
    release = by_keys(page)
    show.moves()
    release()


def test_anybody_stops_by_the_button(show: Show, page: Page) -> None:
    """A page that only watches stops the team, and cannot resume it."""
    with show.page(drives=False, size=(390, 844)) as watcher:
        page.bring_to_front()
        page.keyboard.down("KeyW")
        show.moves()
        watcher.click("#stop")
        show.rests()
        wait(watcher, "operatorConsole.status().stopped")
        assert watcher.is_disabled("#resume")
        page.keyboard.up("KeyW")
        page.click("#resume")
        wait(page, "!operatorConsole.status().stopped")


def hand_over(page: Page, subtask: str, source: str) -> None:
    page.click(f"button[data-subtask={subtask}][data-source={source}]")
    wait(page, f"operatorConsole.status().subtasks.{subtask}.authority === '{source}'")


def test_a_subtask_is_handed_over_in_mid_motion(show: Show, page: Page) -> None:
    """What the human leads no more comes to rest, though the key is held; and back again."""
    page.keyboard.down("ArrowDown")
    show.moves()
    hand_over(page, "cooperative", "hold")
    show.rests()
    assert page.inner_text("#hint") == ("cooperative is led by hold: hand it over to human first")
    assert show.stays()
    shoot(page, "handed_over")
    hand_over(page, "cooperative", "human")
    show.moves()
    page.keyboard.up("ArrowDown")
    show.rests()


def test_errors_energies_and_the_tank_are_plotted(show: Show, page: Page) -> None:
    """A plot each, with numbers of this team, and the tank where the law has one."""
    law = page.input_value("#law")
    page.select_option("#law", "energy_gated")
    titles = ["Tracking error [m]", "Storage [J]", "Power supplied [W]", "Tank [J] and σ"]
    drawn = "[...document.querySelectorAll('#plots h3')].map((title) => title.textContent)"
    wait(page, f"{titles}.every((title) => {drawn}.includes(title))")
    page.locator("#plots").scroll_into_view_if_needed()
    shoot(page, "plots")
    page.select_option("#law", law)
    wait(page, f"operatorConsole.status().law === '{law}'")


def leads(page: Page, source: str) -> None:
    """Waits until the page's buttons show that a source leads the relative subtask."""
    button = f"button[data-subtask=relative][data-source={source}]"
    pressed = f"document.querySelector('{button}').getAttribute('aria-pressed') === 'true'"
    wait(page, pressed)


def test_every_page_shows_who_leads_however_it_came_about(show: Show, page: Page) -> None:
    """By topic and by parameter, from outside; the page's own buttons are pressed by it."""
    leads(page, "autonomy")
    talker = show.ros.probe.create_publisher(String, "relative/authority", 10)
    show.ros.matched(talker)
    talker.publish(String(data="human"))
    leads(page, "human")
    wanted = Parameter("relative.authority", value="autonomy").to_parameter_msg()
    request = SetParametersAtomically.Request(parameters=[wanted])
    service = "controller/set_parameters_atomically"
    assert show.ros.call(SetParametersAtomically, service, request).result.successful
    leads(page, "autonomy")
    show.ros.probe.destroy_publisher(talker)


def test_the_human_takes_the_relative_subtask(show: Show, page: Page) -> None:
    """Handed over by the page, its handle squeezes the team, whose middle stays."""
    hand_over(page, "relative", "human")
    page.select_option("#what", "relative/0")
    start, before = show.centre(), show.ear.newest().position.copy()
    page.keyboard.down("ArrowLeft")
    show.moves(0.1)
    page.keyboard.up("ArrowLeft")
    show.rests()
    now = show.ear.newest().position
    assert (before - now)[0] - (before - now)[2] > 0.02
    assert np.abs(show.centre() - start).max() < 1e-3
    hand_over(page, "relative", "autonomy")
    show.rests()


def test_law_and_gains_are_changed(show: Show, page: Page) -> None:
    """The controller says that it has them; what does not fit is refused in words."""
    page.select_option("#law", "natural")
    wait(page, "operatorConsole.status().law === 'natural'")
    gain = page.locator("input[data-gain='relative.stiffness']")
    gain.fill("60, 70")
    gain.press("Enter")
    wait(page, "String(operatorConsole.status().subtasks.relative.stiffness) === '60,70'")
    gain.fill("1, 2, 3")
    gain.press("Enter")
    wait(page, "document.querySelector('#answers .bad')?.textContent.includes('stiffness')")
    shoot(page, "refused_gains")
    page.select_option("#law", "noninteracting")
    wait(page, "operatorConsole.status().law === 'noninteracting'")
    assert show.stays()


def test_the_simulation_is_paused_stepped_and_reset(show: Show, page: Page) -> None:
    """Paused, its time stands; a step is one tick; a reset puts the team where it began."""
    release = by_keys(page)
    show.moves()
    release()
    page.click("#pause")
    wait(page, "operatorConsole.status().paused")
    words = "document.querySelector('#programs').textContent"
    wait(page, f"{words}.includes('waiting: the team is paused')")
    standing = show.ear.now
    page.click("#step")
    until(lambda: show.ear.now > standing, "a step")
    assert show.ear.now == pytest.approx(standing + 1.0 / 200.0, abs=1e-6)
    page.click("#pause")
    wait(page, "!operatorConsole.status().paused")
    page.click("#reset")
    until(lambda: np.abs(show.centre()).max() < 1e-4, "the team is where it began")
    show.rests()
    assert np.abs(show.centre()).max() < 1e-3


def test_one_drives_and_the_other_watches(show: Show, page: Page) -> None:
    """The second page's pad does nothing until it takes over; then the first one's does."""
    with show.page(drives=False) as second:
        assert second.inner_text("#hint") == "somebody else drives"
        press_pad(second, 0.0, 0.4)
        assert show.stays()
        second.mouse.up()
        assert second.inner_text("#take") == "Take over"
        second.click("#take")
        wait(second, "operatorConsole.drives()")
        wait(page, "!operatorConsole.drives()")
        shoot(page, "taken_over")
        press_pad(page, 0.0, 0.4)
        assert show.stays()
        page.mouse.up()
        press_pad(second, 0.0, 0.4)
        show.moves(pressed=second)
        second.mouse.up()
        show.rests()


def refused(show: Show) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Everything that must be refused, each by a name."""

    def driving(send: Callable[[RawPage], None], code: int) -> Callable[[], None]:
        def attack() -> None:
            page = RawPage(show.port, TOKEN)
            page.welcomed()
            page.say("take")
            send(page)
            assert page.closed()[0] == code

        return attack

    def foreign() -> None:
        with pytest.raises(Exception, match="403"):
            RawPage(show.port, TOKEN, origin="http://evil.example")

    def without_token() -> None:
        page = RawPage(show.port, "")
        assert page.closed() == (1008, "wrong token")

    def flood(page: RawPage) -> None:
        with suppress(ConnectionClosed):
            for _ in range(400):
                page.say("release")

    yield "foreign origin", foreign
    yield "missing token", without_token
    yield "oversized", driving(lambda page: page.say("push", **PUSH, more="x" * 5000), 1009)
    yield "malformed", driving(lambda page: page.say("push", **PUSH, more=1), 1008)
    yield "no numbers", driving(lambda page: page.say("push", **PUSH | {"linear": "x"}), 1008)
    yield "too frequent", driving(flood, 1008)


def test_nothing_moves_by_what_is_refused(show: Show) -> None:
    """Foreign origins, missing tokens, messages too large, malformed or too many: no effect."""
    show.rests()
    began = show.ear.now
    for name, attack in refused(show):
        attack()
        assert show.stays(0.05), name
    assert show.ear.now > began


def test_it_works_on_a_phone(show: Show) -> None:
    """390 x 844: no scrolling sideways, the stop and the pad at hand, and the pad leads."""
    with show.page(size=(390, 844)) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        shoot(page, "phone")
        page.mouse.wheel(0, 3000)
        wait(page, "scrollY > 100")
        for name in ("#stop", "#pad-plane"):
            box = page.locator(name).bounding_box()
            assert box is not None
            assert box["x"] >= 0.0
            assert box["x"] + box["width"] <= 390.0
            assert box["y"] >= 0.0
            assert box["y"] + box["height"] <= 844.0
        shoot(page, "phone_scrolled")
        press_pad(page, 0.4, 0.0)
        show.moves(pressed=page)
        page.mouse.up()
        show.rests()
