"""Pages in headless Chromium: what is cut of them, what they ask for, what the browser says."""

import io
import os
import shutil
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page, sync_playwright

OPTIONS = (
    "--no-sandbox",  # which needs a kernel that lets a user do so, or another user than root
    "--disable-background-networking",
    "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1",
    *(
        "--use-gl=angle",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
    ),  # no graphics card
)
DESK, WIDE, PHONE = 1280, 1920, 390
PATIENCE_MS = 120_000
"""A page that is drawn without a graphics card, beside other tests, is slow."""
A4_PX = 680
"""Width between margins of 15 mm, at 96 pixels an inch."""

CUT = """
scrolls => {
    const found = new Set();
    const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    for (let text; (text = walker.nextNode());) {
        const parent = text.parentElement;
        if (!text.data.trim() || !parent.checkVisibility({visibilityProperty: true})) continue;
        const range = document.createRange();
        range.selectNodeContents(text);
        for (const box of range.getClientRects()) {
            if (box.width < 2 || box.height < 2) continue;
            const [left, right] = [box.left + scrollX, box.right + scrollX];
            let reached = false, hidden = right < 0;
            for (let e = parent; e && e !== document.body; e = e.parentElement) {
                const style = getComputedStyle(e), edge = e.getBoundingClientRect();
                if (style.position === "fixed" || style.clipPath !== "none") hidden = true;
                const beside = box.right > edge.right + 1 || box.left < edge.left - 1;
                const above = box.bottom > edge.bottom + 4 || box.top < edge.top - 4;
                const clips = beside && style.overflowX !== "visible"
                    || above && /hidden|clip/.test(style.overflowY);
                if (!clips) continue;
                reached = scrolls && beside && /auto|scroll/.test(style.overflowX);
                if (!reached) found.add(`${e.tagName}.${e.className}: ${text.data.trim()}`);
                break;
            }
            const beyond = left < -1 || right > document.documentElement.clientWidth + 1;
            if (beyond && !reached && !hidden) found.add(`page: ${text.data.trim()}`);
        }
    }
    return [...found];
}
"""
"""Texts beyond the page or what clips them; where `scrolls`, without those one can scroll to."""


@dataclass
class Opened:
    """A page, the addresses it asked for, and the errors and warnings in the browser's console."""

    page: Page
    asked: list[str] = field(default_factory=list)
    complaints: list[str] = field(default_factory=list)

    def cut(self, *, scrolls=True):
        """Words that are cut; where `scrolls`, what is in a part that scrolls is not."""
        found: list[str] = self.page.evaluate(CUT, scrolls)
        return found

    @property
    def too_wide(self):
        """Pixels by which the page scrolls sideways."""
        return int(self.page.evaluate("document.documentElement.scrollWidth - innerWidth"))

    @property
    def outside(self):
        """Addresses beyond this machine."""
        return [
            address for address in self.asked
            if not address.startswith(("file://", "data:", "blob:", "http://127.0.0.1:"))
        ]  # fmt: skip


@contextmanager
def launched():
    """Chromium; without it the test is skipped, in continuous integration it fails."""
    program = shutil.which("chromium") or shutil.which("chromium-browser")
    if program is None:
        assert "UTANK_HIL_CI" not in os.environ, "chromium is missing: apt-get install chromium"
        pytest.skip("no chromium: apt-get install chromium")
    with (
        sync_playwright() as driver,
        driver.chromium.launch(executable_path=program, args=list(OPTIONS)) as browser,
    ):
        yield browser


@contextmanager
def opened(browser, url, width, height=900):
    """A page in a window of its own."""
    page = browser.new_page(viewport={"width": width, "height": height})
    page.set_default_timeout(PATIENCE_MS)
    seen = Opened(page)
    page.on("request", lambda request: seen.asked.append(request.url))
    page.on("pageerror", lambda error: seen.complaints.append(str(error)))
    page.on(
        "console",
        lambda said: said.type in ("error", "warning") and seen.complaints.append(said.text),
    )
    page.goto(url, wait_until="commit")
    try:
        yield seen
    finally:
        page.close()


def pixels(shown):
    """What is seen of a page or a part, shape (rows, columns, 3), 0 to 255."""
    with Image.open(io.BytesIO(shown.screenshot())) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def of_color(image, color, slack=24):
    """Which pixels have a colour."""
    if isinstance(color, str):
        color = [int(color[place : place + 2], 16) for place in (1, 3, 5)]
    found: np.ndarray = np.abs(image - np.asarray(color)).max(axis=-1) <= slack
    return found
