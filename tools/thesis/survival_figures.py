"""Figures 4.6 to 4.11, 4.14 and 4.15: histories and phase trajectories of Patti-B in a wave."""

import math
from dataclasses import replace
from typing import Final

import numpy as np

from tools.thesis.batch import simulate_batch
from tools.thesis.capsize import PATTI_B, WAVE_RAD_S, contest
from tools.thesis.figure import Check, Curve, Figure, Panel, Verdict
from tools.thesis.patti_b import (
    LINEARIZED,
    METHOD,
    MIDDLE_NM,
    NO_TANK,
    OPEN,
    PASSIVE,
    PASSIVE_NM,
    ROBUST,
    SMALL_GAIN,
    STRONG_NM,
    WEAK_NM,
    Run,
    run,
    told,
)
from tools.thesis.simulate import WaveMoment
from utank_hil.dynamics import RollModel

SHOWN_S: Final = 120.0
SHOWN_DEG: Final = 40.0
PUMP_PA: Final = 20e3
LAWS: Final = {
    "no tank": NO_TANK,
    "passive": PASSIVE,
    "feedback linearization": LINEARIZED,
    "fuzzy (4.23)": ROBUST,
}
CONTROLLED: Final = ("feedback linearization", "fuzzy (4.23)")
_CAPTION: Final = (
    " The text gives 1.7292e5 N m for this figure, its caption 8.6461e4: both are shown."
)


def _runs(amplitude_nm: float, laws: dict[str, str] = LAWS) -> dict[str, Run]:
    return {name: run(law, amplitude_nm) for name, law in laws.items()}


def _history(title: str, runs: dict[str, Run]) -> Panel:
    return Panel(
        title,
        "Time (s)",
        "Roll (°)",
        tuple(
            Curve(name, each.time_s[each.time_s <= SHOWN_S], each.roll_deg[each.time_s <= SHOWN_S])
            for name, each in runs.items()
        ),
        y_limits=(-SHOWN_DEG, SHOWN_DEG) if not all(map(_survives, runs.values())) else None,
    )


def _plane(title: str, runs: dict[str, Run]) -> Panel:
    return Panel(
        title,
        "Roll (°)",
        "Roll rate (°/s)",
        tuple(
            Curve(name, each.roll_deg[shown], each.rate_deg_s[shown])
            for name, each in runs.items()
            for shown in [(each.time_s <= SHOWN_S) & (np.abs(each.roll_deg) < SHOWN_DEG)]
        ),
    )


def _told(runs: dict[str, Run]) -> str:
    return ", ".join(f"{name}: {told(each.result)}" for name, each in runs.items())


def _survives(each: Run) -> bool:
    return math.isinf(each.result.capsized_s)


def _figure(panel: Panel, *checks: Check) -> Figure:
    return Figure(METHOD, OPEN, (panel,), checks=checks, columns=1)


def _kn(amplitude_nm: float) -> str:
    return f"{amplitude_nm / 1e3:.1f} kN m"


def figure_4_6() -> Figure:
    """Histories in the wave that capsizes the ship without tank."""
    runs = _runs(WEAK_NM)
    return _figure(
        _history("", runs),
        Check(
            "the ship without tank capsizes at 5.0860e4 N m",
            Verdict.of(not _survives(runs["no tank"])),
            _told(runs),
        ),
        Check(
            "the tank improves the ship's ability to survive",
            Verdict.of(_survives(runs["passive"]) and not _survives(runs["no tank"])),
            f"with the tank {told(runs['passive'].result)}",
        ),
    )


def figure_4_7() -> Figure:
    """The same in the phase plane."""
    runs = _runs(WEAK_NM)
    return _figure(_plane("", runs), _nested(runs))


def _nested(runs: dict[str, Run]) -> Check:
    """Whether the trajectories lie within one another in the order of the source."""
    rolls = {name: each.result.max_roll_rad for name, each in runs.items()}
    order = sorted(rolls, key=rolls.__getitem__)
    expected = ["feedback linearization", "fuzzy (4.23)", "passive", "no tank"]
    return Check(
        "feedback linearization is most effective, adaptive fuzzy control more effective than the "
        "passive tank (abstract, 4.5)",
        Verdict.HOLDS
        if order == expected
        else Verdict.PARTLY
        if order[2:] == expected[2:]
        else Verdict.FAILS,
        "from the least roll: " + ", ".join(order),
    )


def figure_4_8() -> Figure:
    """Histories in the middle wave."""
    runs = _runs(MIDDLE_NM)
    return _figure(
        _history("", runs),
        Check(
            "the ship with the passive tank survives 7.8601e4 N m (implied)",
            Verdict.of(_survives(runs["passive"])),
            _told(runs),
        ),
    )


def figure_4_9() -> Figure:
    """The same in the phase plane."""
    runs = _runs(MIDDLE_NM)
    return _figure(_plane("", runs), _nested(runs))


def figure_4_10() -> Figure:
    """Histories in the two waves that the figure may be of."""
    passive, strong = _runs(PASSIVE_NM), _runs(STRONG_NM)
    first_minute = _early_share()
    heel, where = _heel()
    return Figure(
        METHOD,
        OPEN + _CAPTION,
        (_history(_kn(PASSIVE_NM), passive), _history(_kn(STRONG_NM), strong)),
        checks=(
            Check(
                "the ship with the passive tank capsizes at 8.6461e4 N m",
                Verdict.of(not _survives(passive["passive"])),
                _told(passive) + "; at which Lz, friction and phase it does: group `capsize`",
            ),
            Check(
                "the controlled ships survive 1.7292e5 N m (implied)",
                Verdict.of_all([_survives(strong[name]) for name in CONTROLLED]),
                _told(strong)
                + "; greatest pressure of those that survive "
                + ", ".join(
                    f"{strong[name].result.max_command / 1e3:.0f} kPa with {name}"
                    for name in CONTROLLED
                    if _survives(strong[name])
                ),
            ),
            Check(
                "in a large external moment the roll oscillates about some heel, which depends on "
                "friction and the water's frequency (4.6)",
                Verdict.of(heel > 0.1),
                f"passive tank, survived runs from 20 to 180 kN m: mean roll of the last 100 s up "
                f"to {heel:.0%} of the greatest, {where}",
            ),
            Check(
                "in the transient it can capsize at once (4.6)",
                Verdict.of(first_minute > 0.5),
                f"of the amplitudes up to 200 kN m that capsize it with the passive tank within "
                f"300 s, {first_minute:.0%} do within the first 60 s",
            ),
        ),
        columns=1,
    )


def _early_share() -> float:
    """Share of the capsizing amplitudes that capsize it within a minute."""
    amplitude = np.linspace(1e3, 200e3, 400)
    wave = WaveMoment(amplitude[:, None], [[WAVE_RAD_S]], [[0.0]])
    at = simulate_batch(PATTI_B, 300.0, wave=wave).capsized_s
    return float(np.mean(at[np.isfinite(at)] < 60.0))


def _heel() -> tuple[float, str]:
    """Greatest mean roll per greatest roll of survived passive runs; for which tank."""
    best, where = 0.0, ""
    amplitude = np.linspace(20e3, 180e3, 161)
    wave = WaveMoment(amplitude[:, None], [[WAVE_RAD_S]], [[0.0]])
    found = []
    for friction in (0.02, 0.1, 0.3):
        for duct_m2 in (0.12, 0.19, 0.3):
            tank = replace(PATTI_B.tank, damping_ratio=friction, duct_area_m2=duct_m2)
            result = simulate_batch(
                RollModel(PATTI_B.ship, tank), 300.0, wave=wave, record_every=10
            )
            late = result.history[:, result.time_s > 300.0 - 10 * math.tau / WAVE_RAD_S, 0]
            share = np.abs(late.mean(axis=1)) / np.maximum(np.abs(late).max(axis=1), 1e-9)
            share[np.isfinite(result.capsized_s)] = 0.0
            at = int(share.argmax())
            found.append(f"{share[at]:.0%} at {friction:g} and {duct_m2:g} m²")
            if share[at] > best:
                best = float(share[at])
                where = (
                    f"at {amplitude[at] / 1e3:.0f} kN m, friction {friction:g}, duct {duct_m2:g} m²"
                )
    return best, where + " (" + ", ".join(found) + ")"


def figure_4_11() -> Figure:
    """The same in the phase plane."""
    passive, strong = _runs(PASSIVE_NM), _runs(STRONG_NM)
    fuzzy = strong.pop("fuzzy (4.23)")
    return Figure(
        METHOD,
        OPEN
        + _CAPTION
        + " In the greater one (4.23) chatters, with roll rates up to "
        + f"{np.abs(fuzzy.rate_deg_s).max():.0f} °/s, and is not drawn.",
        (_plane(_kn(PASSIVE_NM), passive), _plane(_kn(STRONG_NM), strong)),
        checks=(_nested(passive),),
    )


def _small_gain_runs() -> dict[str, Run]:
    return _runs(
        MIDDLE_NM, {"passive": PASSIVE, "fuzzy (4.20)": SMALL_GAIN, "fuzzy (4.23)": ROBUST}
    )


def figure_4_14() -> Figure:
    """Histories of the other direct fuzzy law."""
    runs = _small_gain_runs()
    rolls = [math.degrees(runs[name].result.max_roll_rad) for name in runs if "fuzzy" in name]
    ratio = max(rolls) / min(rolls)
    passive_nm, *fuzzy_nm = (
        contest(law, PUMP_PA).survivable_nm for law in (PASSIVE, SMALL_GAIN, ROBUST)
    )
    gains = {
        law: survived / passive_nm - 1
        for law, survived in zip((SMALL_GAIN, ROBUST), fuzzy_nm, strict=True)
    }
    return _figure(
        _history("", runs),
        Check(
            "the two direct fuzzy laws give close results (4.6)",
            Verdict.of(ratio < 1.2),
            _told(runs) + ": it is their gains, which the source does not give, that decide",
        ),
        Check(
            "adaptive fuzzy control does not significantly help it to survive, compared with "
            "the passive tank",
            Verdict.of(all(gain < 0.1 for gain in gains.values())),
            f"with a pump of {PUMP_PA / 1e3:g} kPa the greatest wave survived is, per that of "
            "the passive tank: "
            + ", ".join(f"{law} {1 + gain:.2f}" for law, gain in gains.items()),
        ),
    )


def figure_4_15() -> Figure:
    """The same in the phase plane."""
    runs = _small_gain_runs()
    return _figure(
        _plane("", runs),
        Check(
            "the law keeps it within the passive tank's trajectory (implied)",
            Verdict.of(
                runs["fuzzy (4.20)"].result.max_roll_rad < runs["passive"].result.max_roll_rad
            ),
            _told(runs),
        ),
    )
