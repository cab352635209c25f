import argparse
import json
import math

from tools.printing import show

FIGURES = {
    "seconds": 60.0,
    "laws": {"gpc": {"roll": 0.5, "share": {"mean": 0.25}}, "dpc": {"roll": math.inf}},
    "runs": [{"seed": 1, "why [sic]": "a, b"}, {"seed": 2, "rolls": [0.1, 0.2]}],
    "none": {},
}


def test_json_is_one_object_of_finite_numbers(capsys):
    show(FIGURES, argparse.Namespace(json=True))
    found = json.loads(capsys.readouterr().out)
    assert found["laws"]["dpc"]["roll"] is None
    assert found["laws"]["gpc"] == FIGURES["laws"]["gpc"]
    assert found["runs"] == FIGURES["runs"]


def test_tables_hold_every_figure_of_the_json(capsys):
    show(FIGURES, argparse.Namespace(json=False))
    printed = capsys.readouterr().out
    for part in (
        "seconds: 60",
        "laws, gpc",
        "mean",
        "0.25",
        "inf",
        "why [sic]",
        "a, b",
        "0.1, 0.2",
    ):
        assert part in printed, part
