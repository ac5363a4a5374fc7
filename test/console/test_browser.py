# SPDX-License-Identifier: Apache-2.0
"""The console in a real browser: driving, stopping, authority, settings and failures."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from browser_session import (
    TOKEN,
    BrowserSession,
    CutRelay,
    drag,
    launch,
    missing_browser,
    press_pad,
    suspended_pages,
    take_screenshot,
    wait,
)
from harness import Ros
from pages import RawPage
from programs import Programs
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from std_msgs.msg import String
from waiting import until
from websockets.exceptions import ConnectionClosed

if TYPE_CHECKING:
    from playwright.sync_api import Page

pytestmark = pytest.mark.skipif(bool(missing_browser()), reason=missing_browser())
MAX_STOPPING_TIME = 0.5  # [s]
TWIST = {
    "subtask": "cooperative",
    "element": 0,
    "grab": 1,
    "linear": [1, 0, 0],
    "angular": [0, 0, 0],
}


@pytest.fixture(scope="module")
def session(
    module_domain: int, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[BrowserSession]:
    """Run one team, one console and one browser for all tests."""
    from playwright.sync_api import sync_playwright

    with ExitStack() as cleanup:
        browser = launch(cleanup.enter_context(sync_playwright()))
        cleanup.callback(browser.close)
        ros = Ros(module_domain)
        cleanup.callback(ros.close)
        programs = Programs(tmp_path_factory.mktemp("session"), module_domain)
        cleanup.callback(programs.close)
        yield BrowserSession.open(ros, programs, browser)


@pytest.fixture(scope="module")
def shared_page(session: BrowserSession) -> Iterator[Page]:
    """Open a page for all tests."""
    with session.page(drives=False) as page:
        yield page


@pytest.fixture
def page(session: BrowserSession, shared_page: Page) -> Iterator[Page]:
    """Return the shared page, driving a team at rest, whatever the last test has left."""
    shared_page.bring_to_front()
    if not shared_page.evaluate("operatorConsole.drives()"):
        shared_page.click("#control")
        wait(shared_page, "operatorConsole.drives()")
    if shared_page.evaluate("operatorConsole.status().stopped"):
        shared_page.click("#resume")
        wait(shared_page, "!operatorConsole.status().stopped")
    shared_page.select_option("#driven", "cooperative/0")
    shared_page.evaluate("document.activeElement.blur()")  # In a text field, keys do not drive.
    session.wait_until_rest()
    yield shared_page
    shared_page.mouse.up()
    shared_page.evaluate("window.pad = null")


def test_the_page_requests_only_the_console(session: BrowserSession) -> None:
    """Every request goes to the console, and nothing violates the page's content policy."""
    urls: list[str] = []
    errors: list[str] = []
    with session.page(drives=False) as page:
        page.on("request", lambda request: urls.append(request.url))
        page.on("console", lambda message: errors.append(message.text))
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.reload()
        wait(page, "operatorConsole.status()?.live")
        take_screenshot(page, "watching")
    own = (f"http://127.0.0.1:{session.port}/", "data:,")
    assert urls
    assert all(url.startswith(own) for url in urls), urls
    assert [text for text in errors if "GL Driver" not in text] == []


def test_the_team_follows_a_drag_of_the_handle(session: BrowserSession, page: Page) -> None:
    """The centre of the team moves by the drag of the mouse, in the window and in the world."""
    start = session.centre()
    before = page.evaluate(f"operatorConsole.pixel({[*start.tolist(), 0.0]})")
    drag(page, "x", (60.0, 0.0))
    dragged = page.evaluate("operatorConsole.handle()")
    until(
        lambda: np.abs(session.centre() - dragged[:2]).max() < 1e-3, "the team follows the handle"
    )
    take_screenshot(page, "drag")
    page.mouse.up()
    session.wait_until_rest()
    moved = session.centre() - start
    assert moved[0] > 0.1
    assert abs(moved[1]) < 1e-3
    after = page.evaluate(f"operatorConsole.pixel({[*session.centre().tolist(), 0.0]})")
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
def test_a_held_input_drives_until_it_is_released(
    session: BrowserSession, page: Page, hold: Callable[[Page], Callable[[], None]]
) -> None:
    """The team moves along -y at the console's speed and is at rest soon after the release."""
    start = session.centre()
    release = hold(page)
    session.wait_until_moving(0.19)
    take_screenshot(page, hold.__name__)
    assert session.stopping_time(release) < MAX_STOPPING_TIME
    moved = session.centre() - start
    assert moved[1] < -0.02  # The least distance to reach that speed and stop.
    assert abs(moved[0]) < 1e-3
    assert session.stays_at_rest()


def test_a_gamepad_drives_only_with_its_enable_button(session: BrowserSession, page: Page) -> None:
    """The shoulder button is the dead-man's switch."""
    tilt_stick(page, False)
    assert session.stays_at_rest()


def suspend_page(session: BrowserSession, cleanup: ExitStack) -> tuple[Page, Callable[[], None]]:
    page = cleanup.enter_context(session.page())
    return page, lambda: cleanup.enter_context(suspended_pages(session.browser))


def close_page(session: BrowserSession, cleanup: ExitStack) -> tuple[Page, Callable[[], None]]:
    page = cleanup.enter_context(session.page())
    return page, page.close


def cut_connection(session: BrowserSession, cleanup: ExitStack) -> tuple[Page, Callable[[], None]]:
    relay = CutRelay(session.port)
    cleanup.callback(relay.close)
    return cleanup.enter_context(session.page(port=relay.port)), relay.cut


@pytest.mark.parametrize("lose", [suspend_page, close_page, cut_connection])
def test_a_lost_page_releases_its_input(
    session: BrowserSession,
    lose: Callable[[BrowserSession, ExitStack], tuple[Page, Callable[[], None]]],
) -> None:
    """The team is at rest within half a second after its page is suspended, closed or cut off."""
    with ExitStack() as cleanup:
        page, trigger = lose(session, cleanup)
        press_pad(page, 0.0, 0.4)
        session.wait_until_moving(0.19, page)
        assert session.stopping_time(trigger) < MAX_STOPPING_TIME
        assert session.stays_at_rest()


def test_the_space_key_latches_a_stop(session: BrowserSession, page: Page) -> None:
    """It stops while a pad is held and a text field has the focus; only a resume ends it."""
    press_pad(page, 0.0, 0.4)
    session.wait_until_moving()
    page.locator("input[data-gain]").first.focus()
    assert session.stopping_time(lambda: page.keyboard.press("Space")) < MAX_STOPPING_TIME
    wait(page, "operatorConsole.status().stopped")
    page.mouse.move(400, 300)
    take_screenshot(page, "stopped")
    page.mouse.up()
    press_pad(page, 0.0, 0.4)
    assert session.stays_at_rest()
    page.mouse.up()
    page.click("#resume")
    wait(page, "!operatorConsole.status().stopped")
    release = by_keys(page)
    session.wait_until_moving()
    release()


def test_every_page_can_stop(session: BrowserSession, page: Page) -> None:
    """A page that does not drive stops the team, but cannot resume it."""
    with session.page(drives=False, size=(390, 844)) as observer:
        page.bring_to_front()
        page.keyboard.down("KeyW")
        session.wait_until_moving()
        observer.click("#stop")
        session.wait_until_rest()
        wait(observer, "operatorConsole.status().stopped")
        assert observer.is_disabled("#resume")
        page.keyboard.up("KeyW")
        page.click("#resume")
        wait(page, "!operatorConsole.status().stopped")


def hand_over(page: Page, subtask: str, source: str) -> None:
    page.click(f"button[data-subtask={subtask}][data-source={source}]")
    wait(page, f"operatorConsole.status().subtasks.{subtask}.authority === '{source}'")


def test_a_hand_over_in_motion_stops_the_subtask(session: BrowserSession, page: Page) -> None:
    """Without human authority a held key has no effect; with it the subtask moves again."""
    page.keyboard.down("ArrowDown")
    session.wait_until_moving()
    hand_over(page, "cooperative", "hold")
    session.wait_until_rest()
    assert page.inner_text("#hint") == "cooperative: authority is hold; set it to human first"
    assert session.stays_at_rest()
    take_screenshot(page, "handed_over")
    hand_over(page, "cooperative", "human")
    session.wait_until_moving()
    page.keyboard.up("ArrowDown")
    session.wait_until_rest()


def test_errors_energies_and_tank_are_plotted(session: BrowserSession, page: Page) -> None:
    """Each has a plot; the tank has one under a law with a tank."""
    law = page.input_value("#law")
    page.select_option("#law", "energy_gated")
    titles = ["Tracking error [m]", "Storage [J]", "Power supplied [W]", "Tank [J] and σ"]
    drawn = "[...document.querySelectorAll('#plots h3')].map((title) => title.textContent)"
    wait(page, f"{titles}.every((title) => {drawn}.includes(title))")
    page.locator("#plots").scroll_into_view_if_needed()
    take_screenshot(page, "plots")
    page.select_option("#law", law)
    wait(page, f"operatorConsole.status().law === '{law}'")


def wait_for_authority(page: Page, source: str) -> None:
    """Wait until the page shows the authority of the relative subtask."""
    button = f"button[data-subtask=relative][data-source={source}]"
    pressed = f"document.querySelector('{button}').getAttribute('aria-pressed') === 'true'"
    wait(page, pressed)


def test_the_page_shows_an_authority_set_elsewhere(session: BrowserSession, page: Page) -> None:
    """The buttons follow hand-overs by topic and by parameter."""
    wait_for_authority(page, "autonomy")
    publisher = session.ros.probe.create_publisher(String, "relative/authority", 10)
    session.ros.wait_for_subscribers(publisher)
    publisher.publish(String(data="human"))
    wait_for_authority(page, "human")
    parameter = Parameter("relative.authority", value="autonomy").to_parameter_msg()
    request = SetParametersAtomically.Request(parameters=[parameter])
    service = "controller/set_parameters_atomically"
    assert session.ros.call(SetParametersAtomically, service, request).result.successful
    wait_for_authority(page, "autonomy")
    session.ros.probe.destroy_publisher(publisher)


def test_the_relative_subtask_is_driven_after_a_hand_over(
    session: BrowserSession, page: Page
) -> None:
    """Driving it changes the distance of the robots and not the centre of the team."""
    hand_over(page, "relative", "human")
    page.select_option("#driven", "relative/0")
    start, before = session.centre(), session.monitor.newest().position.copy()
    page.keyboard.down("ArrowLeft")
    session.wait_until_moving(0.1)
    page.keyboard.up("ArrowLeft")
    session.wait_until_rest()
    now = session.monitor.newest().position
    assert (before - now)[0] - (before - now)[2] > 0.02
    assert np.abs(session.centre() - start).max() < 1e-3
    hand_over(page, "relative", "autonomy")
    session.wait_until_rest()


def test_law_and_gains_are_changed(session: BrowserSession, page: Page) -> None:
    """The page shows the controller's values; an invalid value shows the reason."""
    page.select_option("#law", "natural")
    wait(page, "operatorConsole.status().law === 'natural'")
    gain = page.locator("input[data-gain='relative.stiffness']")
    gain.fill("60, 70")
    gain.press("Enter")
    wait(page, "String(operatorConsole.status().subtasks.relative.stiffness) === '60,70'")
    gain.fill("1, 2, 3")
    gain.press("Enter")
    wait(page, "document.querySelector('#responses .bad')?.textContent.includes('stiffness')")
    take_screenshot(page, "rejected_gains")
    page.select_option("#law", "noninteracting")
    wait(page, "operatorConsole.status().law === 'noninteracting'")
    assert session.stays_at_rest()


def test_the_simulation_is_paused_stepped_and_reset(session: BrowserSession, page: Page) -> None:
    """A pause holds the time, a step is one tick, and a reset restores the initial state."""
    release = by_keys(page)
    session.wait_until_moving()
    release()
    page.click("#pause")
    wait(page, "operatorConsole.status().paused")
    programs = "document.querySelector('#programs').textContent"
    wait(page, f"{programs}.includes('waiting: the team is paused')")
    paused_at = session.monitor.now
    page.click("#step")
    until(lambda: session.monitor.now > paused_at, "a step of the team")
    assert session.monitor.now == pytest.approx(paused_at + 1.0 / 200.0, abs=1e-6)
    page.click("#pause")
    wait(page, "!operatorConsole.status().paused")
    page.click("#reset")
    until(lambda: np.abs(session.centre()).max() < 1e-4, "the initial state")
    session.wait_until_rest()
    assert np.abs(session.centre()).max() < 1e-3


def test_only_one_page_drives(session: BrowserSession, page: Page) -> None:
    """The second page's pad has no effect until it takes over; then the first one's has none."""
    with session.page(drives=False) as second:
        assert second.inner_text("#hint") == "another page drives"
        press_pad(second, 0.0, 0.4)
        assert session.stays_at_rest()
        second.mouse.up()
        assert second.inner_text("#control") == "Take over"
        second.click("#control")
        wait(second, "operatorConsole.drives()")
        wait(page, "!operatorConsole.drives()")
        take_screenshot(page, "taken_over")
        press_pad(page, 0.0, 0.4)
        assert session.stays_at_rest()
        page.mouse.up()
        press_pad(second, 0.0, 0.4)
        session.wait_until_moving(pressed=second)
        second.mouse.up()
        session.wait_until_rest()


def attacks(session: BrowserSession) -> Iterator[tuple[str, Callable[[], Any]]]:
    """Yield name and function of everything that must be rejected."""

    def driving(send: Callable[[RawPage], None], code: int) -> Callable[[], None]:
        def attack() -> None:
            page = RawPage(session.port, TOKEN)
            page.wait_for_welcome()
            page.send("take_control")
            send(page)
            assert page.closed()[0] == code

        return attack

    def foreign() -> None:
        with pytest.raises(Exception, match="403"):
            RawPage(session.port, TOKEN, origin="http://evil.example")

    def without_token() -> None:
        page = RawPage(session.port, "")
        assert page.closed() == (1008, "wrong token")

    def flood(page: RawPage) -> None:
        with suppress(ConnectionClosed):
            for _ in range(400):
                page.send("release")

    yield "foreign origin", foreign
    yield "missing token", without_token
    yield "oversized", driving(lambda page: page.send("twist", **TWIST, more="x" * 5000), 1009)
    yield "malformed", driving(lambda page: page.send("twist", **TWIST, more=1), 1008)
    yield "wrong type", driving(lambda page: page.send("twist", **TWIST | {"linear": "x"}), 1008)
    yield "too frequent", driving(flood, 1008)


def test_rejected_messages_move_nothing(session: BrowserSession) -> None:
    """Foreign origins, wrong tokens and invalid or too many messages have no effect."""
    session.wait_until_rest()
    start = session.monitor.now
    for name, attack in attacks(session):
        attack()
        assert session.stays_at_rest(0.05), name
    assert session.monitor.now > start


def test_the_page_fits_a_phone(session: BrowserSession) -> None:
    """At 390 x 844 nothing scrolls sideways, stop and pad stay visible, and the pad drives."""
    with session.page(size=(390, 844)) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        take_screenshot(page, "phone")
        page.mouse.wheel(0, 3000)
        wait(page, "scrollY > 100")
        for name in ("#stop", "#pad-plane"):
            box = page.locator(name).bounding_box()
            assert box is not None
            assert box["x"] >= 0.0
            assert box["x"] + box["width"] <= 390.0
            assert box["y"] >= 0.0
            assert box["y"] + box["height"] <= 844.0
        take_screenshot(page, "phone_scrolled")
        press_pad(page, 0.4, 0.0)
        session.wait_until_moving(pressed=page)
        page.mouse.up()
        session.wait_until_rest()
