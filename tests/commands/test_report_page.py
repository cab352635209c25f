"""Reports as a browser shows them: on a desk, on a phone, in print."""

import re
from pathlib import Path

import numpy as np
import pytest
from browsing import A4_PX, DESK, PHONE, WIDE, of_color, opened, pixels
from one_process import in_one_process
from playwright.sync_api import Browser

from firmware_sim.bench import BenchOptions, run_bench
from firmware_sim.figures import figures
from firmware_sim.report_page import write_files
from firmware_sim.scenario import Scenario
from utank_hil.base.provenance import describe
from utank_hil.configuration import load_config
from utank_hil.pictures.report_page import LEAST_TEXT_PX, TEXT_PX
from utank_hil.pictures.style import COLORS, NO_TANK

pytestmark = pytest.mark.slow

SCENARIO = Path("configs/scenarios/storm.yaml")
LEAST_PRINTED_PT = 6.0
SHOWN = """() => [...document.images].map(image =>
    [image.naturalWidth, image.clientWidth, image.parentElement.clientWidth])"""


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Address of the report of a short bench of the storm."""
    folder = tmp_path_factory.mktemp("bench")
    scenario = load_config(SCENARIO, Scenario)
    gpc = scenario.controllers["gpc"]  # a fourth curve that costs no design
    controllers = {"dpc": scenario.controllers["dpc"], "gpc": gpc, "gpc again": gpc}
    scenario = scenario.model_copy(update={"settle_s": 10.0, "controllers": controllers})
    with in_one_process():
        result = run_bench(scenario, BenchOptions(duration_s=30.0), lambda *_: None)
    about = describe("bench", result.scenario, folder, options={}, seed=result.seed)
    files, failures = write_files(result, figures(result), folder, about)
    assert failures == []
    return files["report"].as_uri()


@pytest.mark.parametrize("width", [PHONE, DESK, WIDE])
def test_nothing_of_a_report_is_cut_and_it_asks_for_nothing(
    browser: Browser, page: str, width: int
) -> None:
    with opened(browser, page, width) as seen:
        seen.page.wait_for_load_state("load")
        assert seen.too_wide <= 0
        assert seen.cut(scrolls=width == PHONE) == []
        for natural, shown, _ in seen.page.evaluate(SHOWN):
            assert natural > 0
            assert shown * TEXT_PX / natural >= LEAST_TEXT_PX - 0.1
        assert seen.outside == []
        assert seen.complaints == []


def test_captions_and_names_of_rows_stay_in_sight_on_a_phone(browser: Browser, page: str) -> None:
    with opened(browser, page, PHONE) as seen:
        captions = seen.page.locator("figcaption")
        assert captions.count() >= 2
        for caption in captions.all():
            box = caption.bounding_box()
            assert box["x"] + box["width"] <= PHONE
        first = seen.page.locator("td:first-child").first
        seen.page.evaluate("document.querySelector('table').parentElement.scrollLeft = 200")
        box = first.bounding_box()
        assert box["x"] >= 0


def test_each_run_is_seen_in_its_colour_from_the_beginning_to_the_end(
    browser: Browser, page: str
) -> None:
    with opened(browser, page, DESK) as seen:
        image = pixels(seen.page.locator("img").first)
    curves = image[image.shape[0] // 2 :, int(0.15 * image.shape[1]) :]
    for color in COLORS[:4]:
        columns = np.flatnonzero(of_color(curves, color, 40).any(axis=0))
        tenths = np.unique(10 * columns // curves.shape[1])
        assert len(tenths) >= 9, color
    bars = image[: image.shape[0] // 3]
    for color in (NO_TANK, *COLORS[:4]):
        assert of_color(bars, color, 8).sum() > 300


def test_a_report_prints_on_a4_with_every_column(browser: Browser, page: str) -> None:
    with opened(browser, page, A4_PX) as seen:
        seen.page.emulate_media(media="print")
        seen.page.wait_for_load_state("load")
        assert seen.too_wide <= 0
        assert seen.cut(scrolls=False) == []
        tables = seen.page.evaluate(
            "[...document.querySelectorAll('table')].map(t => t.getBoundingClientRect().right)"
        )
        assert max(tables) <= A4_PX + 1
        for natural, shown, room in seen.page.evaluate(SHOWN):
            assert shown <= room
            assert shown * TEXT_PX / natural * 72 / 96 >= LEAST_PRINTED_PT
        assert not seen.page.locator("pre").is_visible()
        printed = seen.page.pdf(format="A4", prefer_css_page_size=True)
        assert 2 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 6
