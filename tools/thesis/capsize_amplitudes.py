"""Section 4.5: the wave moments that capsize Patti-B, over what the source leaves open."""

from dataclasses import replace
from typing import Final

import numpy as np

from tools.thesis.capsize import PATTI_B, WAVE_RAD_S, capsize_threshold, without_tank
from tools.thesis.figure import Check, Curve, Figure, Panel, Row, Verdict
from tools.thesis.patti_b import MIDDLE_NM, PASSIVE_NM, STRONG_NM, WEAK_NM
from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics import RollModel

DURATION_S: Final = 300.0
PHASES_DEG: Final = np.arange(0.0, 180.0, 7.5)
COARSE_DEG: Final = np.arange(0.0, 180.0, 15.0)
PLACES_M: Final = (-1.0, -0.5, 0.0, 0.5)
FRICTIONS: Final = (0.05, 0.1, 0.2, 0.5)
HIGHEST_NM: Final = 200e3
FINE_NM, COARSE_NM = 100.0, 500.0


def _thresholds(model: RollModel, phases_deg: FloatArray, step_nm: float) -> FloatArray:
    """Least amplitude of M cos(0.6 t + phase) that capsizes it from rest, N m, at each phase."""
    return np.array(
        [
            capsize_threshold(
                model,
                WAVE_RAD_S,
                HIGHEST_NM,
                duration_s=DURATION_S,
                phase_rad=float(phase),
                cells=round(HIGHEST_NM / step_nm),
                tolerance=0.01,  # a step is less
            ).capsizing_nm
            for phase in np.radians(phases_deg)
        ]
    )


def _with(lz_m: float, friction: float) -> RollModel:
    return RollModel(PATTI_B.ship, replace(PATTI_B.tank, lz_m=lz_m, damping_ratio=friction))


def figure_capsize() -> Figure:
    """Thresholds over phase, Lz and friction."""
    bare = _thresholds(without_tank(PATTI_B), PHASES_DEG, FINE_NM)
    by_place = {z: _thresholds(_with(z, 0.1), COARSE_DEG, COARSE_NM) for z in PLACES_M}
    by_friction = {
        friction: by_place[0.0]
        if friction == 0.1
        else _thresholds(_with(0.0, friction), COARSE_DEG, COARSE_NM)
        for friction in FRICTIONS
    }
    cases = {f"Lz {z:g} m": y for z, y in by_place.items()}
    cases |= {f"friction {f:g}": y for f, y in by_friction.items() if f != 0.1}
    fits = [name for name, y in cases.items() if np.min(y) <= PASSIVE_NM <= np.max(y)]
    survives = [name for name, y in cases.items() if np.max(y) > MIDDLE_NM]
    between = [
        name for name, y in cases.items() if bool(((y > MIDDLE_NM) & (y <= PASSIVE_NM)).any())
    ]
    least_deg = float(PHASES_DEG[int(np.argmin(np.abs(bare - WEAK_NM)))])
    closest = float(bare[int(np.argmin(np.abs(bare - WEAK_NM)))])
    nearest = by_place[0.0][int(np.argmin(np.abs(by_place[0.0] - PASSIVE_NM)))]
    return Figure(
        "nonlinear model; the least capsizing amplitude, searched upwards in steps of "
        f"{FINE_NM:g} N m without a tank and {COARSE_NM:g} with it, {DURATION_S:.0f} s each",
        "The phase at which the wave starts, Lz, the friction and how long it must survive are "
        "not given: phases over half a turn (the other half is to the other side), Lz from -1 to "
        "0.5 m, damping ratio of the water from 0.05 to 0.5.",
        (
            Panel(
                "Without a tank",
                "Phase of the wave (°)",
                "Least capsizing moment (kN m)",
                (
                    Curve("no tank", PHASES_DEG, bare / 1e3),
                    Curve("printed", [0.0, 180.0], [WEAK_NM / 1e3] * 2),
                ),
                y_limits=(0.0, 60.0),
            ),
            Panel(
                "With the tank, friction 0.1",
                "Phase of the wave (°)",
                "Least capsizing moment (kN m)",
                (
                    *(
                        Curve(f"Lz {z:g} m", COARSE_DEG, by_place[z] / 1e3)
                        for z in (-1.0, 0.0, 0.5)
                    ),
                    Curve("printed", [0.0, 180.0], [PASSIVE_NM / 1e3] * 2),
                ),
                y_limits=(0.0, 160.0),
            ),
        ),
        rows=(
            Row(
                "least moment that capsizes it without a tank, cosine",
                "N m",
                WEAK_NM,
                float(bare[0]),
                "the phase of the wave is not given",
            ),
            Row("the same over all phases, least", "N m", WEAK_NM, float(np.min(bare)), "as above"),
            Row(
                f"the same at the phase that fits best, {least_deg:g}°",
                "N m",
                WEAK_NM,
                closest,
                "as above",
            ),
            Row(
                "least moment with the tank, Lz = 0, cosine",
                "N m",
                PASSIVE_NM,
                float(by_place[0.0][0]),
                "Lz, friction and phase are not given",
            ),
            Row(
                "the same at the phase that fits best",
                "N m",
                PASSIVE_NM,
                float(nearest),
                "as above",
            ),
            *(
                Row(
                    f"the same over all phases, {name}, least",
                    "N m",
                    PASSIVE_NM,
                    float(np.min(y)),
                    "varied",
                )
                for name, y in cases.items()
            ),
            Row(
                "survived with the passive tank",
                "N m",
                MIDDLE_NM,
                None,
                "a survival, no border: it holds for " + ", ".join(survives),
            ),
            Row(
                "greatest wave of the controlled cases",
                "N m",
                STRONG_NM,
                None,
                "no border is said of it; see 4.10",
            ),
        ),
        checks=(
            Check(
                "the ship without tank capsizes at 5.0860e4 N m",
                Verdict.of(bool((bare <= WEAK_NM).mean() > 0.5)),
                f"the least capsizing moment is {np.min(bare) / 1e3:.1f} to "
                f"{np.max(bare) / 1e3:.1f} kN m over the phase; it is the printed one at about "
                f"{least_deg:g}° only, elsewhere it capsizes before",
            ),
            Check(
                "the ship with the passive tank survives 7.8601e4 and capsizes at 8.6461e4 N m",
                Verdict.PARTLY if between else Verdict.FAILS,
                "the least capsizing moment lies between them at some phase with "
                + (", ".join(between) or "none of the tanks tried")
                + "; the greater lies within the range over the phase with "
                + (", ".join(fits) or "none"),
            ),
            Check(
                "the tank reduces capsizing in rough seas",
                Verdict.of(float(np.min(by_place[0.0])) > float(np.max(bare))),
                f"Lz = 0, friction 0.1: {np.min(by_place[0.0]) / 1e3:.0f} to "
                f"{np.max(by_place[0.0]) / 1e3:.0f} kN m",
            ),
        ),
    )
