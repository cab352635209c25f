"""Section 4.5: the wave moments that capsize Patti-B, over what the source leaves open."""

from dataclasses import replace
from typing import Final

import numpy as np

from utank_hil.analysis.capsize.contest import PATTI_B, WAVE_RAD_S
from utank_hil.analysis.capsize.threshold import without_tank
from utank_hil.arrays import FloatArray
from utank_hil.dynamics import RollModel, WaveMoment, simulate_batch
from utank_hil.thesis.figure import Check, Curve, Figure, Panel, Row, Verdict
from utank_hil.thesis.patti_b import MIDDLE_NM, PASSIVE_NM, STRONG_NM, WEAK_NM

DURATION_S: Final = 300.0
PHASES_DEG: Final = np.arange(0.0, 180.0, 7.5)
COARSE_DEG: Final = np.arange(0.0, 180.0, 15.0)
PLACES_M: Final = (-1.0, -0.5, 0.0, 0.5)
FRICTIONS: Final = (0.05, 0.1, 0.2, 0.5)
_FINE_NM: Final = np.arange(30e3, 60e3, 50.0)
_WIDE_NM: Final = np.arange(30e3, 180e3, 500.0)


def least_capsizing(
    model: RollModel, amplitude_nm: FloatArray, phases_deg: FloatArray
) -> FloatArray:
    """Least amplitude of M cos(0.6 t + phase) on a grid that capsizes her from rest, N m.

    Every amplitude is tried: those that capsize her need not form one interval.

    Parameters
    ----------
    model : RollModel
    amplitude_nm : ndarray, shape (a,)
        Rising.
    phases_deg : ndarray, shape (p,)

    Returns
    -------
    ndarray, shape (p,)
        NaN where none of them capsizes her.
    """
    found = np.full(len(phases_deg), np.nan)
    for n, phase in enumerate(np.radians(phases_deg)):
        wave = WaveMoment(amplitude_nm[:, None], [[WAVE_RAD_S]], [[phase]])
        capsized = np.isfinite(simulate_batch(model, DURATION_S, wave=wave).capsized_s)
        if capsized.any():
            found[n] = amplitude_nm[int(capsized.argmax())]
    return found


def _with(lz_m: float, friction: float) -> RollModel:
    return RollModel(PATTI_B.ship, replace(PATTI_B.tank, lz_m=lz_m, damping_ratio=friction))


def figure_capsize() -> Figure:
    """Thresholds over phase, Lz and friction."""
    bare = least_capsizing(without_tank(PATTI_B), _FINE_NM, PHASES_DEG)
    by_place = {z: least_capsizing(_with(z, 0.1), _WIDE_NM, COARSE_DEG) for z in PLACES_M}
    by_friction = {
        friction: by_place[0.0]
        if friction == 0.1
        else least_capsizing(_with(0.0, friction), _WIDE_NM, COARSE_DEG)
        for friction in FRICTIONS
    }
    cases = {f"Lz {z:g} m": y for z, y in by_place.items()}
    cases |= {f"friction {f:g}": y for f, y in by_friction.items() if f != 0.1}
    fits = [name for name, y in cases.items() if np.nanmin(y) <= PASSIVE_NM <= np.nanmax(y)]
    survives = [name for name, y in cases.items() if np.nanmax(y) > MIDDLE_NM]
    between = [
        name for name, y in cases.items() if bool(((y > MIDDLE_NM) & (y <= PASSIVE_NM)).any())
    ]
    least_deg = float(PHASES_DEG[int(np.nanargmin(np.abs(bare - WEAK_NM)))])
    closest = float(bare[int(np.nanargmin(np.abs(bare - WEAK_NM)))])
    nearest = by_place[0.0][int(np.nanargmin(np.abs(by_place[0.0] - PASSIVE_NM)))]
    return Figure(
        "capsize",
        "Wave moments that capsize Patti-B (4.5)",
        f"nonlinear model, every amplitude on a grid (50 N m without a tank, 500 N m with it), "
        f"{DURATION_S:.0f} s each",
        "The phase at which the wave starts, Lz, the friction and how long she must survive are "
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
                "least moment that capsizes her without a tank, cosine",
                "N m",
                WEAK_NM,
                float(bare[0]),
                "the phase of the wave is not given",
            ),
            Row(
                "the same over all phases, least",
                "N m",
                WEAK_NM,
                float(np.nanmin(bare)),
                "as above",
            ),
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
                    float(np.nanmin(y)),
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
                f"the least capsizing moment is {np.nanmin(bare) / 1e3:.1f} to "
                f"{np.nanmax(bare) / 1e3:.1f} kN m over the phase; it is the printed one at about "
                f"{least_deg:g}° only, elsewhere she capsizes before",
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
                Verdict.of(float(np.nanmin(by_place[0.0])) > float(np.nanmax(bare))),
                f"Lz = 0, friction 0.1: {np.nanmin(by_place[0.0]) / 1e3:.0f} to "
                f"{np.nanmax(by_place[0.0]) / 1e3:.0f} kN m",
            ),
        ),
    )
