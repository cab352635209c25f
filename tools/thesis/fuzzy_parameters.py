"""Figures 4.12, 4.13 and 4.16: what the direct fuzzy laws learn, over time."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from tools.thesis.capsize import PATTI_B, WAVE_RAD_S, law_factory
from tools.thesis.figure import Check, Curve, Figure, Panel, Verdict
from tools.thesis.patti_b import METHOD, MIDDLE_NM, ROBUST, SMALL_GAIN, Run, run_controller, told
from tools.thesis.simulate import WaveMoment
from utank_hil.base.arrays import FloatArray
from utank_hil.control.fuzzy.adaptive import DirectFuzzyController, DirectFuzzyLaw, RobustFuzzy
from utank_hil.control.fuzzy.indirect import SmallGainFuzzy

DURATION_S: Final = 120.0
_OPEN: Final = (
    "Gains of adaptation, leakage and starting values are not given. Varied: as in "
    "`tools.thesis.capsize`, from zero, twice as fast."
)


def _law(name: str) -> DirectFuzzyLaw:
    controller = law_factory(name, unlimited=True)()
    assert isinstance(controller, DirectFuzzyController)
    return controller.law


def _robust() -> dict[str, RobustFuzzy]:
    law = _law(ROBUST)
    assert isinstance(law, RobustFuzzy)
    fast = replace(law, adaptation=(2 * law.adaptation[0], 2 * law.adaptation[1]))
    return {"as contest": law, "from zero": replace(law, initial=(0.0, 0.0)), "twice as fast": fast}


def _small_gain() -> dict[str, SmallGainFuzzy]:
    law = _law(SMALL_GAIN)
    assert isinstance(law, SmallGainFuzzy)
    fast = replace(law, adaptation=2 * law.adaptation)
    return {"as contest": law, "from zero": replace(law, initial=0.0), "twice as fast": fast}


def _run(build: Callable[[], DirectFuzzyController]) -> Run:
    wave = WaveMoment([MIDDLE_NM], [WAVE_RAD_S], [0.0])
    return run_controller(PATTI_B, build(), wave, DURATION_S)


def figure_4_12() -> Figure:
    """Parameter lambda of (4.23)."""
    runs = {name: _run(law.controller) for name, law in _robust().items()}
    return _figure(runs, 0, "λ")


def figure_4_13() -> Figure:
    """Parameter theta of (4.23)."""
    runs = {name: _run(law.controller) for name, law in _robust().items()}
    return _figure(runs, 1, "θ")


def figure_4_16() -> Figure:
    """Parameter lambda of (4.20)."""
    runs = {name: _run(law.controller) for name, law in _small_gain().items()}
    return _figure(runs, 0, "λ")


def _figure(runs: dict[str, Run], column: int, symbol: str) -> Figure:
    records = {name: each.parameters[:, column] for name, each in runs.items()}
    bounded = all(bool((y >= 0).all() and np.isfinite(y).all()) for y in records.values())
    first = {name: _settled_s(runs[name].time_s, y) for name, y in records.items()}
    return Figure(
        METHOD,
        _OPEN,
        (
            Panel(
                "",
                "Time (s)",
                symbol,
                tuple(Curve(name, runs[name].time_s, y) for name, y in records.items()),
            ),
        ),
        checks=(
            Check(
                "the parameter stays bounded (theorems 1 and 2)",
                Verdict.of(bounded),
                "; ".join(
                    f"{name}: {y.min():.3g} to {y.max():.3g} ({told(runs[name].result)})"
                    for name, y in records.items()
                ),
            ),
            Check(
                "the law must have some time to adjust its parameters",
                Verdict.of(max(first.values()) > 10.5),
                "time until the mean over a wave stays within a tenth of its last value: "
                + ", ".join(f"{name} {value:.0f} s" for name, value in first.items()),
            ),
        ),
        columns=1,
    )


def _settled_s(time_s: FloatArray, record: FloatArray) -> float:
    """When the mean over a wave period comes to stay within a tenth of its last value."""
    period = round(2 * np.pi / WAVE_RAD_S / (time_s[1] - time_s[0]))
    mean = np.convolve(record, np.ones(period) / period, mode="valid")
    off = np.flatnonzero(np.abs(mean - mean[-1]) > 0.1 * abs(mean[-1]))
    return float(time_s[off[-1] + period]) if off.size else 0.0
