"""The panel's page in a browser: touch, keys, palettes, a lost connection, two pages."""

import time
from collections.abc import Iterator
from contextlib import suppress

import pytest
from browsing import Opened, opened, pixels
from playwright.sync_api import Browser, TimeoutError
from ship_of_a_page import Bench, bench

from utank_hil.canbus import AlarmState, Fault, Mode

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]

TABLET = (1024, 768)
CLOCK = """
word => new Promise(done => {
    const mode = document.getElementById("mode"), began = performance.now();
    const look = () => mode.textContent === word && done(performance.now() - began);
    setTimeout(() => done(5000), 5000);
    new MutationObserver(look).observe(mode, {childList: true, characterData: true, subtree: true});
})
"""
"""Time in ms until the large word is this one, 5000 at most."""


@pytest.fixture(scope="module")
def running() -> Iterator[tuple[Bench, str]]:
    with bench() as made:
        yield made


@pytest.fixture
def at(browser: Browser, running: tuple[Bench, str]) -> Iterator[tuple[Bench, Opened]]:
    """A bench in STANDBY, and its page on a tablet."""
    made, url = running
    made.ship.mode, made.ship.alarms = Mode.STANDBY, {}
    with opened(browser, url, *TABLET) as seen:
        shows(seen, "STANDBY")
        yield made, seen
        made.held.clear()
    assert seen.outside == []


def shows(seen: Opened, word: str) -> None:
    seen.page.locator(f"#mode:text-is('{word}')").wait_for()


def arms(seen: Opened) -> None:
    """Hold A until the ship is armed, as a person does: a page that hears nothing for a moment, or
    loses the focus, lets go of it."""
    word = seen.page.locator("#mode:text-is('ACTIVE')")
    for _ in range(20):
        seen.page.bring_to_front()
        seen.page.keyboard.down("a")
        with suppress(TimeoutError):
            word.wait_for(timeout=2000)
        seen.page.keyboard.up("a")
        if word.count():
            return
    shows(seen, "ACTIVE")


def test_arm_by_touch_is_held_and_stop_is_not(at: tuple[Bench, Opened]) -> None:
    made, seen = at
    seen.page.locator("#arm").hover()
    seen.page.mouse.down()
    time.sleep(0.3)
    seen.page.mouse.up()
    time.sleep(1.2)
    assert made.ship.mode is Mode.STANDBY  # a touch in passing
    seen.page.mouse.down()
    shows(seen, "ACTIVE")
    seen.page.mouse.up()
    seen.page.locator("#stop").click()
    shows(seen, "STANDBY")


def test_stop_acts_once_and_before_the_finger_is_lifted(at: tuple[Bench, Opened]) -> None:
    made, seen = at
    arms(seen)
    told, mouse = len(made.said), seen.page.mouse
    seen.page.locator("#stop").hover()
    mouse.down()
    shows(seen, "STANDBY")
    mouse.move(5, 5)  # it slides off
    mouse.up()
    assert made.said[told:].count("page: stop") == 1
    seen.page.locator("#stop").click()
    made.wait(f"said[{told}:].count('page: stop') == 2")
    seen.page.locator("#stop").focus()
    seen.page.keyboard.press("Enter")
    made.wait(f"said[{told}:].count('page: stop') == 3")


def test_a_finger_arms_and_a_tap_stops(browser: Browser, running: tuple[Bench, str]) -> None:
    made, url = running
    made.ship.mode, made.ship.alarms = Mode.STANDBY, {}
    context = browser.new_context(viewport={"width": 1024, "height": 768}, has_touch=True)
    page = context.new_page()
    page.goto(url, wait_until="commit")
    seen = Opened(page)
    shows(seen, "STANDBY")
    middle = {
        name: (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        for name in ("arm", "stop")
        if (box := page.locator(f"#{name}").bounding_box()) is not None
    }
    page.touchscreen.tap(*middle["arm"])
    time.sleep(1.2)
    assert made.ship.mode is Mode.STANDBY  # a tap in passing
    finger, (x, y) = context.new_cdp_session(page), middle["arm"]
    touch = {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]}
    finger.send("Input.dispatchTouchEvent", touch)
    shows(seen, "ACTIVE")
    finger.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    page.touchscreen.tap(*middle["stop"])
    shows(seen, "STANDBY")
    context.close()


def test_keys_alone_do_for_everything(at: tuple[Bench, Opened]) -> None:
    made, seen = at
    keyboard = seen.page.keyboard
    arms(seen)
    keyboard.press("Escape")
    shows(seen, "STANDBY")
    made.ship.alarms = {Fault.DRIFT: AlarmState.ACTIVE_UNACKNOWLEDGED}
    keyboard.press("3")
    seen.page.locator("#alarm-line:has-text('DRIFT: accept?')").wait_for()
    seen.page.locator("#alarms li:has-text('Roll and integrated roll rate')").wait_for()
    keyboard.press("c")
    seen.page.locator("#alarms li:has-text('accepted,')[data-tone=caution]").wait_for()
    seen.page.locator("#palette").focus()
    reached = []
    while len(reached) < 12 and "stop" not in reached:  # by Tab, in the order of the page
        keyboard.press("Tab")
        reached.append(
            seen.page.evaluate("(e => e.id || e.textContent.slice(0, 4))(document.activeElement)")
        )
    assert reached[:4] == ["Home", "Heel", "Alar", "Engi"]
    assert reached[-4:] == ["arm", "DISA", "ACCE", "stop"]


def test_a_lost_connection_is_shown_within_a_second(at: tuple[Bench, Opened]) -> None:
    made, seen = at
    made.held.set()
    taken_ms = seen.page.evaluate(CLOCK, "NO CONNECTION")
    assert taken_ms < 1000
    assert seen.page.locator("#lost-word").inner_text() == "NO CONNECTION"
    assert float(seen.page.locator("#home").evaluate("e => getComputedStyle(e).opacity")) < 0.3
    assert seen.page.locator("#arm").get_attribute("aria-disabled") == "true"
    made.held.clear()
    shows(seen, "STANDBY")


def test_two_pages_see_each_others_orders(
    browser: Browser, running: tuple[Bench, str], at: tuple[Bench, Opened]
) -> None:
    _, first = at
    with opened(browser, running[1], *TABLET) as second:
        shows(second, "STANDBY")
        arms(first)
        second.page.bring_to_front()
        shows(second, "ACTIVE")
        second.page.keyboard.press("s")
        shows(first, "STANDBY")


@pytest.mark.evidence("day", "dusk")
@pytest.mark.parametrize("palette", ["day", "dusk", "night"])
def test_nothing_is_cut_and_night_is_red(at: tuple[Bench, Opened], palette: str) -> None:
    made, seen = at
    made.ship.alarms = {Fault.DRIVE_WARNING: AlarmState.ACTIVE_UNACKNOWLEDGED}
    arms(seen)
    while seen.page.locator("#palette span").inner_text() != palette:
        seen.page.keyboard.press("p")
    for key in "1234":
        seen.page.keyboard.press(key)
        seen.page.locator(f"nav [data-key='{key}'][aria-current]").wait_for()
        assert seen.cut() == []
        assert seen.too_wide == 0
        image = pixels(seen.page)
        if palette == "night":
            assert image[..., 1:].max() < 0.4 * 255
            assert image.mean() < 30  # dark: a third of a dim screen's light would blind
    assert seen.complaints == []
