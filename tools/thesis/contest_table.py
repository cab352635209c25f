"""Section 4.5: who capsizes in which wave, with every nonlinear law and several pumps."""

import math
from typing import Final

from tools.thesis.capsize.contest import LAWS, PRINTED_NM, Contest, contest
from tools.thesis.capsize.survival import Survival
from tools.thesis.figure import Check, Figure, Table, Verdict
from tools.thesis.patti_b import LINEARIZED, NO_TANK, PASSIVE, ROBUST, SMALL_GAIN, told

CONTROLLED: Final = (LINEARIZED, SMALL_GAIN, ROBUST)
PUMPS_PA: Final = (math.inf, 100e3, 20e3)


def figure_contest() -> Figure:
    """Every law in the printed waves, and the greatest that it survives."""
    found = {
        (law, pump): contest(law, pump)
        for pump in PUMPS_PA
        for law in LAWS
        if law != NO_TANK or math.isinf(pump)  # the same with any pump
    }
    largest = {entry: each.survivable_nm for entry, each in found.items()}
    bare, passive = (largest[law, math.inf] for law in (NO_TANK, PASSIVE))
    controlled = [largest[law, math.inf] for law in CONTROLLED]
    small = {law: largest[law, PUMPS_PA[-1]] for law in LAWS if law != NO_TANK}
    return Figure(
        "nonlinear model, M cos(0.6 t) from rest for 300 s, laws sampled at 20 ms without delay; "
        "the greatest wave survived by bisection",
        "Lz, friction, pump and the laws' parameters are not given: Lz = 0, damping ratio 0.10, "
        "reservoirs of ±2 m. A limited pump has ten times its pressure a second and the level "
        "barrier at 1.9 m, with the passive law too; the fuzzy laws have lower gains then.",
        table=Table(
            (
                "pump",
                "law",
                *(f"{amplitude / 1e3:.1f} kN m" for amplitude in PRINTED_NM),
                "greatest survived, kN m",
                "greatest pressure, kPa",
                "strikes",
            ),
            tuple(_cells(law, pump, each) for (law, pump), each in found.items()),
        ),
        checks=(
            Check(
                "in rising order of the wave survived: no tank, passive tank, controlled tank",
                Verdict.of(bare < passive < min(controlled)),
                f"unlimited pump: {bare / 1e3:.0f}, {passive / 1e3:.0f}, "
                + " and ".join(f"{value / 1e3:.0f}" for value in controlled)
                + " kN m ((4.11), (4.20), (4.23))",
            ),
            Check(
                "so it is with a pump that the boat can carry",
                Verdict.of(small[PASSIVE] < min(small[law] for law in CONTROLLED)),
                f"{PUMPS_PA[-1] / 1e3:.0f} kPa: "
                + ", ".join(f"{law} {value / 1e3:.0f} kN m" for law, value in small.items()),
            ),
        ),
    )


def _cells(law: str, pump_pa: float, found: Contest) -> tuple[str, ...]:
    """One law with one pump; pressure and strikes of the runs survived."""
    alive: list[Survival] = [run for run in found.runs if math.isinf(run.capsized_s)]
    pressure_pa = max((run.max_command for run in alive), default=0.0)
    return (
        "unlimited" if math.isinf(pump_pa) else f"{pump_pa / 1e3:g} kPa",
        law,
        *(told(run) for run in found.runs),
        f"{found.survivable_nm / 1e3:.1f}",
        f"{pressure_pa / 1e3:.0f}" if pressure_pa else "",
        "yes" if any(run.strikes for run in alive) else "",
    )
