"""What a watch-keeper sees of a recording, in a browser and in Rerun's own window."""

import re
import socket
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from browsing import PATIENCE_MS, Opened, of_color, opened, pixels
from PIL import Image
from playwright.sync_api import Browser

from tools.documents import screenshot
from utank_hil.canbus.enumerations import Fault, Mode
from utank_hil.commands.monitor import LOOKS
from utank_hil.nodes.signals import SIGNALS
from utank_hil.safety.faults import fault_text
from utank_hil.telemetry.blueprint import _PALETTE, MOST_SHADES, WATCH_SHARES
from utank_hil.telemetry.recording import write_recording
from utank_hil.telemetry.scene import HULL, LIMIT, SEA, WATER
from utank_hil.telemetry.viewer import open_viewer

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]

SIZES = ((1280, 800), (1920, 1080))
VESSEL = {
    "tank": {"width_m": 17.0, "height_m": 5.0, "lz_m": 2.0, "headroom_m": 4.0},
    "pump": {"max_pressure_pa": 5e4},
}
ORANGE, BLUE = _PALETTE["orange"], _PALETTE["blue"]
BACKGROUND = (13, 13, 13)
KNOWN = re.compile(
    "[Ss]oftware rasterizer|No available adapters"  # this machine has no graphics card
    "|not implemented in web backend|deprecated parameters for the initialization"  # Rerun's own
    "|Failed to load resource: net::ERR_NAME_NOT_RESOLVED|TypeError: Failed to fetch"  # see ASKED
)
ASKED = {"fonts.googleapis.com", "tel.rerun.io", "api.github.com"}
"""Whom Rerun's page asks for a font, its statistics and a newer version; docs/telemetry.md."""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ship that rolls half as much as her twin, with her water to starboard at the beginning."""
    time_s = np.arange(0.0, 60.0, 0.05)
    rows = np.zeros((len(time_s), len(SIGNALS)))
    for name, values in (
        ("time_s", time_s),
        ("roll_rad", 0.1 * np.sin(0.5 * time_s)),
        ("twin_roll_rad", 0.2 * np.sin(0.5 * time_s)),
        ("starboard_level_m", 2.0 * np.cos(0.5 * time_s)),
        ("port_level_m", -2.0 * np.cos(0.5 * time_s)),
        ("pressure_command_pa", 4e4 * np.sin(0.5 * time_s)),
        ("pressure_actual_pa", 3.5e4 * np.sin(0.5 * time_s)),
        ("mode", Mode.ACTIVE),
    ):
        rows[:, SIGNALS.index(name)] = values
    file = tmp_path_factory.mktemp("recording") / "run.rrd"
    write_recording(file, SIGNALS, {"run": rows}, about={"configuration": {"vessel": VESSEL}})
    return file


def shows_the_watch(image: np.ndarray) -> None:
    """Assert that section, words and plots are where they belong, in the colours of the signals."""
    height, width, _ = image.shape
    section = image[int(0.12 * height) : int(0.6 * height), : width // 2 - 4]
    for color in (WATER, HULL, LIMIT, SEA):
        assert of_color(section, color).sum() > 200, color
    water = of_color(section, WATER)
    port, starboard = (
        np.flatnonzero(side.sum(axis=1) > 10).min()
        for side in np.split(water[:, : 2 * (water.shape[1] // 2)], 2, axis=1)
    )
    assert port - starboard > 0.05 * height  # the water stands to starboard
    words = image[int(0.66 * height) : int(0.85 * height), : width // 2]
    assert (words.min(axis=-1) > 200).sum() > 200
    plots = image[int(0.11 * height) : int(0.95 * height), width // 2 :]
    for panel in np.array_split(plots, 3):
        # data begin at the cursor, in the middle
        before, after = panel[:, : int(0.48 * panel.shape[1])], panel[:, panel.shape[1] // 2 :]
        for color in (ORANGE, BLUE):
            assert not of_color(before, color, 30).any()
            columns = of_color(after, color, 60).any(axis=0)
            assert columns.mean() > 0.6, color
    heights = [
        np.ptp(np.flatnonzero(of_color(plots[: plots.shape[0] // 3], color, 60).any(axis=1)))
        for color in (ORANGE, BLUE)
    ]
    assert heights[1] / heights[0] == pytest.approx(2.0, rel=0.06)
    top = image[: int(0.05 * height)]
    assert of_color(top, BACKGROUND, 12).mean() > 0.8  # the colours are for a dark ground


@pytest.fixture
def shown(browser: Browser, recording: Path) -> Iterator[Opened]:
    """The page of the recording, once Rerun has drawn it."""
    with pytest.MonkeyPatch.context() as patch:
        for name in ("DISPLAY", "WAYLAND_DISPLAY"):
            patch.delenv(name, raising=False)
        viewer = open_viewer(recording)
    with viewer:
        await_ports(viewer.ports)
        with opened(browser, f"{viewer.url}{LOOKS}", *SIZES[0]) as seen:
            seen.page.locator("canvas.visible").wait_for()
            yield seen


def await_ports(ports: Iterable[int]) -> None:
    """Wait until Rerun listens: on a busy machine that takes longer than to start a browser."""
    deadline = time.monotonic() + PATIENCE_MS * 1e-3
    for port in ports:
        while True:
            try:
                socket.create_connection(("127.0.0.1", port)).close()
                break
            except ConnectionRefusedError:
                assert time.monotonic() < deadline
                time.sleep(0.1)


def settled(seen: Opened) -> np.ndarray:
    """The picture of the page, once the section is there and nothing moves."""
    before = pixels(seen.page)
    for _ in range(120):
        seen.page.wait_for_timeout(1000)
        after = pixels(seen.page)
        if of_color(after, WATER).sum() > 1000 and np.array_equal(before, after):
            break
        before = after
    return after


@pytest.mark.evidence
def test_a_browser_shows_the_watch(shown: Opened) -> None:
    for width, height in SIZES:
        shown.page.set_viewport_size({"width": width, "height": height})
        shows_the_watch(settled(shown))
    said = [complaint for complaint in shown.complaints if not KNOWN.search(complaint)]
    assert said == []
    assert {urlsplit(address).hostname for address in shown.outside} <= ASKED


@pytest.mark.evidence("1920-1080")
@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_viewers_own_window_shows_the_watch(
    browser: Browser, recording: Path, tmp_path: Path, width: int, height: int
) -> None:
    picture = tmp_path / "watch.png"
    # the browser brings the renderer
    assert screenshot.main(str(recording), str(picture), f"{width}x{height}") == 0
    with Image.open(picture) as image:
        assert image.size == (width, height)
        shows_the_watch(np.asarray(image.convert("RGB")).astype(int))


def words_seen(file: Path, ships: int, height: int) -> int:
    """Pixels of bright text in the words of the watch, 1280 wide."""
    picture = file.with_suffix(".png")
    assert screenshot.main(str(file), str(picture), f"1280x{height}") == 0
    top, bottom = 66, height - 32  # of the tab
    above, below = np.cumsum(WATCH_SHARES[ships])[:2] / sum(WATCH_SHARES[ships])
    rows = slice(*(round(top + part * (bottom - top)) + 4 for part in (above, below)))
    with Image.open(picture) as image:
        shown = np.asarray(image.convert("RGB"))[rows, : 640 if ships == 1 else 1280]
    return int((shown.min(axis=-1) > 150).sum())


@pytest.mark.evidence
@pytest.mark.parametrize("ships", [1, pytest.param(MOST_SHADES, marks=pytest.mark.evidence)])
def test_the_longest_words_of_faults_are_not_cut(
    browser: Browser, tmp_path: Path, ships: int
) -> None:
    assert browser  # it brings the renderer
    longest = sorted(Fault, key=lambda fault: len(fault_text(fault)))[-ships:]
    runs = {}
    for number, fault in enumerate(longest):
        rows = np.zeros((40, len(SIGNALS)))
        for name, values in (
            ("time_s", np.arange(40) / 20),
            ("mode", Mode.FAULT),
            ("fault", fault),
            ("roll_rms_rad", 0.1),
            ("twin_roll_rms_rad", 0.2),
        ):
            rows[:, SIGNALS.index(name)] = values
        runs[f"run {number}"] = rows
    file = tmp_path / "faults.rrd"
    write_recording(file, SIGNALS, runs, about={"configuration": {"vessel": VESSEL}})
    assert words_seen(file, ships, 800) == pytest.approx(words_seen(file, ships, 1200), rel=0.01)
