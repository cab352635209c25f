"""What of the source's statements holds: a change of the physics that turns one shows here."""

import pytest

from tools.thesis.figure import Verdict, as_json
from tools.thesis.registry import ENTRIES, UnknownFigureError, chosen

SIGNS = {Verdict.HOLDS: "+", Verdict.PARTLY: "~", Verdict.FAILS: "-", Verdict.OPEN: "?"}
# of each figure its statements, in their order
FAST = {
    "magnification": "+",
    "2.3": "+~~~",
    "2.4": "+~",
    "2.5": "++",
    "2.6": "~~",
    "2.7": "~++",
    "2.8": "++-+++?",
    "3.1": "+++",
    "tank-height": "~++",
    "3.2": "++-",
    "3.3": "+",
    "3.4": "+",
    "first-ship": "-",
    "gains": "+-",
    "3.6": "++-",
    "3.7": "+",
    "3.8": "+",
    "3.9": "+",
    "3.10": "++~",
    "3.12": "+",
    "3.14": "+",
    "3.15": "~~~",
    "4.1": "++",
    "table-4.1": "-",
    "4.5": "--+",
    "4.6": "++",
    "4.12": "++",
    "4.13": "++",
    "4.16": "++",
}
LONG = {
    "3.11": "~+",
    "3.13": "~~",
    "4.7": "+",
    "4.8": "+",
    "4.9": "+",
    "4.10": "-~++",
    "4.11": "~",
    "capsize": "+~+",
    "contest": "+-",
    "4.14": "-+",
    "4.15": "+",
    "damping": "~~-~",
}


def made(key):
    (entry,) = chosen([key])
    assert entry.make is not None
    return entry.make()


def signs(figure):
    return "".join(SIGNS[check.verdict] for check in figure.checks)


def judge(key, expected):
    figure = made(key)
    assert signs(figure) == expected
    assert all(check.statement and check.measured for check in figure.checks)
    deviating = [row for row in figure.rows if row.deviation is None or abs(row.deviation) > 0.005]
    assert [row.quantity for row in deviating if not row.reason] == []
    return figure


@pytest.mark.evidence
@pytest.mark.parametrize("key", FAST)
def test_a_figure_has_its_verdicts_and_a_reason_for_each_deviation(key):
    judge(key, FAST[key])


@pytest.mark.evidence
@pytest.mark.parametrize("key", LONG)
def test_so_have_the_figures_that_take_long(key):
    judge(key, LONG[key])


@pytest.mark.evidence
@pytest.mark.parametrize("key", [*FAST, *LONG])
def test_a_figure_is_the_same_each_time(key):
    assert as_json(made(key)) == as_json(made(key))


def test_every_figure_has_its_verdicts():
    assert {*FAST, *LONG} == {entry.key for entry in ENTRIES if entry.make}


def test_keys_are_unique_and_what_has_nothing_to_compute_is_named():
    assert len({entry.key for entry in ENTRIES}) == len(ENTRIES)
    assert all((entry.make is None) == bool(entry.word) for entry in ENTRIES)
    assert all(entry.title for entry in ENTRIES)


def test_no_figure_of_chapters_2_to_4_is_missing():
    last = {2: 8, 3: 15, 4: 16}
    numbered = [f"{chapter}.{n}" for chapter in last for n in range(1, last[chapter] + 1)]
    keys = [entry.key for entry in ENTRIES]
    assert [key for key in keys if key in numbered] == numbered
    named = {
        "tank-height",
        "first-ship",
        "gains",
        "table-4.1",
        "capsize",
        "damping",
        "magnification",
        "contest",
    }
    assert set(keys) - set(numbered) == named


def test_chosen_figures_come_in_the_source_s_order():
    assert [entry.key for entry in chosen(["2.7", "2.3"])] == ["2.3", "2.7"]
    assert chosen([]) == ENTRIES
    with pytest.raises(UnknownFigureError, match=r"'9\.9'.*--list.*2\.1"):
        chosen(["9.9"])
