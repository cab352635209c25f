"""The documentation site as a browser shows it: on a desk, on a phone, in print."""

import subprocess
import sys

import pytest
from browsing import A4_PX, DESK, PHONE, WIDE, of_color, opened, pixels
from pages import ROOT

from utank_hil.pictures.style import COLORS

pytestmark = pytest.mark.slow

PAGES = ("index", "tutorial", "can-catalogue", "thesis", "README")
LOADED = "() => [...document.images].map(image => [image.src, image.naturalWidth, image.width])"
LEAST_SHARE = 0.5
"""Of its size that a picture keeps on a narrow screen, and scrolls: words of 18 pixels become 9."""


@pytest.fixture(scope="module")
def site():
    """The folder of pages that `make site` writes; written anew if a page or the style is newer."""
    folder, made = ROOT / "out" / "site", ROOT / ".cache" / "site" / "environment.pickle"
    sources = [*ROOT.glob("*.md"), *(file for file in (ROOT / "docs").rglob("*") if file.is_file())]
    newest = max(file.stat().st_mtime for file in sources)
    if not made.exists() or not folder.exists() or made.stat().st_mtime < newest:
        command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going"]
        command += ["-d", ".cache/site", "-c", "docs", ".", "out/site"]
        subprocess.run(command, cwd=ROOT, check=True)
    return folder / "docs"


@pytest.mark.evidence
@pytest.mark.parametrize("name", PAGES)
def test_nothing_of_a_page_is_cut_and_it_asks_for_nothing(browser, site, name):
    with opened(browser, (site / f"{name}.html").as_uri(), DESK) as seen:
        seen.page.wait_for_load_state("load")
        for width in (DESK, WIDE, PHONE):
            seen.page.set_viewport_size({"width": width, "height": 900})
            assert seen.too_wide <= 0, width
            assert seen.cut(scrolls=width == PHONE) == [], width
            for address, natural, shown in seen.page.evaluate(LOADED):
                assert natural > 0, address
                assert shown >= LEAST_SHARE * natural, (address, width)
        seen.page.set_viewport_size({"width": A4_PX, "height": 900})
        seen.page.emulate_media(media="print")
        assert seen.too_wide <= 0
        assert seen.cut(scrolls=False) == []
        assert seen.outside == []
        assert seen.complaints == []


@pytest.mark.evidence
def test_a_phone_breaks_names_in_tables_at_blanks_alone(browser, site):
    with opened(browser, (site / "README.html").as_uri(), PHONE) as seen:
        seen.page.wait_for_load_state("load")
        names = seen.page.locator("td code")
        assert names.count() > 50
        for name in names.all():
            words = name.inner_text().split()
            lines = name.evaluate("each => each.getClientRects().length")
            assert lines <= len(words), words
        assert seen.too_wide <= 0


@pytest.mark.evidence
def test_the_gallery_shows_its_curves(browser, site):
    with opened(browser, (site / "thesis.html").as_uri(), DESK) as seen:
        seen.page.wait_for_load_state("load")
        pictures = seen.page.locator("article img").all()
        assert len(pictures) >= 8
        for picture in pictures:
            assert of_color(pixels(picture), COLORS[1], 60).sum() > 100, picture
