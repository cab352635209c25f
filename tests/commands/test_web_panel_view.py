"""What the page shows of a state, by its own script, and its colours, by its own style sheet.

The script runs in the JavaScript engine that Playwright brings along: no browser is needed.
"""

import json
import re
import subprocess
from itertools import product
from pathlib import Path
from typing import Any

import playwright
import pytest

from utank_hil.commands import web_panel

PAGE = Path(web_panel.__file__).parent
ENGINE = Path(playwright.__file__).parent / "driver" / "node"
STATE = {
    "heard": True, "mode": "STANDBY", "stopping": False, "in_command": True, "degraded": False,
    "retuning": None, "fault": None, "alarms": [],
}  # fmt: skip
TIRED = {"code": "DRIFT", "lasts": True, "accepted": False}


def script(*calls: tuple[Any, ...]) -> list[Any]:
    """Answers of functions of the page's script, called by name."""
    source = f"""
        import * as view from {json.dumps((PAGE / "view.js").as_uri())};
        const calls = {json.dumps(calls)};
        console.log(JSON.stringify(calls.map(([name, ...given]) => view[name](...given))));
    """
    done = subprocess.run(
        [ENGINE, "--input-type=module", "-"],
        input=source, capture_output=True, text=True, check=True, timeout=60,
    )  # fmt: skip
    answers: list[Any] = json.loads(done.stdout)
    return answers


def test_words_of_figures() -> None:
    shown = script(
        ("figure", None, 1, " m"), ("figure", -0.126, 2, " m"), ("angle", 3.24), ("angle", -3.24),
        ("angle", 0.04), ("angle", None), ("share", -2, 1), ("share", None, 1), ("share", 1, 0),
        ("passiveText", {"roll_rms_deg": 1.5, "passive_rms_deg": 2.44}),
        ("passiveText", {"roll_rms_deg": 1.5, "passive_rms_deg": None}),
    )  # fmt: skip
    assert shown == [
        "—", "−0.13 m", {"size": "3.2°", "side": "STBD"}, {"size": "3.2°", "side": "PORT"},
        {"size": "0.0°", "side": ""}, {"size": "—", "side": ""}, -1, None, None,
        "of 2.4° with the pump off", "",
    ]  # fmt: skip


def test_the_dial_shows_beyond_its_limit_and_starboard_to_the_right() -> None:
    roll, heel, middle, starboard, beyond = script(
        ("dial", 20.05), ("dial", 8.0), ("onDial", 0, 25, 160), ("onDial", 25, 25, 160),
        ("onDial", 50, 25, 160),
    )  # fmt: skip
    assert (roll, heel) == ({"most": 25, "step": 5}, {"most": 10, "step": 2})
    assert middle == [200, 45]
    assert starboard[0] > 300
    assert starboard == beyond


@pytest.mark.parametrize(
    ("change", "word", "tone", "arms"),
    [
        ({}, "STANDBY", "plain", True),
        ({"mode": "PASSIVE"}, "PASSIVE", "plain", True),
        ({"mode": "ACTIVE"}, "ACTIVE", "good", False),
        ({"mode": "FAULT"}, "FAULT", "alarm", False),
        ({"mode": "INIT"}, "INIT", "plain", False),
        ({"heard": False}, "NO CONTROLLER", "alarm", False),
        ({"stopping": True}, "STANDBY", "plain", False),
        ({"in_command": False}, "STANDBY", "plain", False),
    ],
)
def test_the_large_word_and_whether_arm_is_offered(
    change: dict[str, Any], word: str, tone: str, arms: bool
) -> None:
    state = STATE | change
    shown, refusal = script(("headline", state, ""), ("whyNotArm", state, ""))
    assert (shown["word"], shown["tone"], refusal == "") == (word, tone, arms)


def test_a_lost_connection_hides_every_state() -> None:
    active = STATE | {"mode": "ACTIVE"}
    for state in (active, None):
        shown, refusal = script(("headline", state, "old"), ("whyNotArm", state, "old"))
        assert (shown["word"], shown["dead"], refusal) == ("NO CONNECTION", True, "no connection")


def test_alarms_are_red_and_sound_until_accepted_or_gone() -> None:
    accepted, gone = TIRED | {"accepted": True}, TIRED | {"lasts": False}
    states = [STATE | {"alarms": alarms} for alarms in ([TIRED, gone], [accepted], [gone], [])]
    tones = [[each["tone"] for each in script(("alarms", state))[0]] for state in states]
    assert tones == [["alarm", "plain"], ["caution"], ["plain"], []]
    assert script(*(("sounds", state) for state in states)) == [True, False, False, False]
    lines = script(*(("alarmLine", state) for state in states))
    assert lines == ["DRIFT and 1 more: accept?", "", "DRIFT: accept?", ""]


def test_shortcuts_are_single_keys_and_each_is_a_button_once() -> None:
    keys = script(
        *(("shortcut", {"key": key}) for key in ("S", "Escape", "Tab")),
        ("shortcut", {"key": "s", "ctrlKey": True}),
    )
    assert keys == ["s", "s", "", ""]
    page = (PAGE / "page.html").read_text()
    shortcuts = re.findall(r'data-key="(.)"', page)
    assert len(shortcuts) == len(set(shortcuts))
    for key in shortcuts:
        assert f"<kbd>{key.upper()}</kbd>" in page  # each is shown


def test_the_page_holds_no_script_and_no_style_of_its_own() -> None:
    page = (PAGE / "page.html").read_text()
    assert not re.search(r"<style|\sstyle=|\son\w+=|<script(?![^>]*src=)", page)
    assert not re.search(r"https?://(?!www\.w3\.org)", page + (PAGE / "page.js").read_text())


# contrast by WCAG 2.2, 1.4.3 and 1.4.11
WORDS = [
    *product(("ink", "faded", "alarm-ink", "caution"), ("panel", "ground")),
    ("on-good", "good"), ("on-alarm", "alarm"), ("panel", "ink"),
]  # fmt: skip
GRAPHICS = [
    ("line", "panel"), ("given", "panel"), ("asked", "panel"), ("alarm", "panel"),
    ("focus", "panel"), ("focus", "ground"),
]  # fmt: skip


def luminance(color: str) -> float:
    """Relative luminance of sRGB, WCAG 2.2."""
    channels = [int(color[place : place + 2], 16) / 255 for place in (1, 3, 5)]
    linear = [each / 12.92 if each <= 0.04045 else ((each + 0.055) / 1.055) ** 2.4
              for each in channels]  # fmt: skip
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(one: str, other: str) -> float:
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


@pytest.mark.parametrize("palette", ["day", "dusk", "night"])
def test_contrast_is_that_of_wcag_aa(palette: str) -> None:
    assert contrast("#000000", "#ffffff") == pytest.approx(21)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)
    style = (PAGE / "page.css").read_text()
    block = re.search(rf'data-palette="{palette}"\] {{(.*?)}}', style, re.DOTALL)
    assert block is not None
    colors = dict(re.findall(r"--([\w-]+): (#\w{6})", block[1]))
    low = {
        pair: round(found, 2)
        for pairs, least in ((WORDS, 4.5), (GRAPHICS, 3.0))
        for pair in pairs
        if (found := contrast(colors[pair[0]], colors[pair[1]])) < least
    }
    assert low == {}
    if palette == "night":  # a night-adapted eye keeps its sight under red alone
        for color in colors.values():
            red, green, blue = (int(color[place : place + 2], 16) for place in (1, 3, 5))
            assert red == green == blue == 0 or red >= 3 * max(green, blue)


def test_no_colour_stands_outside_the_palettes() -> None:
    style = re.sub(r":root\[.*?}", "", (PAGE / "page.css").read_text(), flags=re.DOTALL)
    assert re.findall(r": [^;{]*(?:#[0-9a-f]{3}|rgb|hsl)[^;{]*;", style) == []
