"""The tables of docs/control.md that take no simulation: margins, passive optimum, printed laws.

    python -m tools.studies.linear_law_tables                       # all of them
    python -m tools.studies.linear_law_tables margins --json        # or passive, printed, index

* margins: what the printed and the shipped laws stand. The printed roll laws are judged on the
  model that they were made from, which has no delay besides the sample. S is the sensitivity; the
  worst pole is the loop's greatest eigenvalue over 0.7 to 1.3 of the roll period and 0.8 to 1.2 of
  the pump's gain, and "list, no washout" is what the law would make of a steady list without one.
* passive: the best passive tank for the first ship's geometry, and the tank that PD makes of hers.
* printed: how far laws designed here are from the printed coefficients, by the ship assumed.
* index: the performance index of Fig. 3.10 relative to that of DPC (roll).
"""

import math
from collections.abc import Callable

import numpy as np

from tools.printing import print_tables
from tools.studies.trial_setup import entrant, shipped
from tools.thesis.performance_index import performance_index
from tools.thesis.printed_laws import (
    DPC_ROLL,
    PRINTED,
    PRINTED_ARX,
    SAMPLE_TIME_S,
    designed_laws,
    deviations,
    held_model,
    printed_plant,
    source_index,
)
from tools.thesis.ships import AS_PRINTED, FITTED, GREATER
from utank_hil.analysis.loop.closed_loop import closed_loop_response
from utank_hil.analysis.loop.margins import Margins, margins
from utank_hil.analysis.loop.robustness import robustness
from utank_hil.control import (
    DesignPlant,
    WashoutLaw,
    design_dpc,
    design_gpc,
    design_lqr,
    design_pd,
)
from utank_hil.control.interface import LinearLaw
from utank_hil.control.optimal_tank import (
    ShipTankRatios,
    passive_optimum,
    roll_magnification,
    ship_ratios,
)
from utank_hil.dynamics import RollShip, Tank
from utank_hil.dynamics.linear import STATES, coupled_model

Rows = dict[str, dict[str, float]]
SHIPPED = {
    "GPC_ROLL": "gpc",
    "DPC_ROLL_LEVEL": "dpc",
    "LQG": "lqg",
    "constrained": "constrained_gpc",
}
MASS_RATIOS = (0.02, 0.05, 0.10)  # beside the first ship's own
WAVE_RATIOS = np.geomspace(0.05, 5.0, 8000)


def margin_rows() -> Rows:
    """What each law stands."""
    plant = printed_plant()
    found: Rows = {}
    for name, law in (
        ("printed DPC", design_dpc(PRINTED_ARX)),
        ("printed GPC", design_gpc(PRINTED_ARX)),
    ):
        found[name] = _margin_row(law, margins(law, plant, SAMPLE_TIME_S))
    for name, file in SHIPPED.items():
        own, one = shipped(file).plant, entrant(name, shipped(file))
        report = robustness(one.law, own, one.measured)
        found[name] = {
            **_margin_row(one.law, report.nominal),
            "S 20 ms late": report.late_peak_sensitivity,
            "worst pole": report.worst_radius,
        }
        if isinstance(one.law, WashoutLaw):
            found[name]["list, no washout"] = steady_list(one.law.law, own, one.measured)
    return found


def steady_list(law: LinearLaw, plant: DesignPlant, measured: tuple[str, ...]) -> float:
    """List under a steady moment with a law, per list with the tank passive."""
    system, slow = coupled_model(plant.ship, plant.tank), np.array([1e-6])
    row = system.output_labels.index("roll_rad")
    passive, active = (
        closed_loop_response(one, system, measured, slow, plant.delay_s, plant.lag_s)[0][0, row]
        for one in (None, law)
    )
    return float(abs(active) / abs(passive))


def _margin_row(law: LinearLaw, found: Margins) -> dict[str, float]:
    return {
        "peak of S": found.peak_sensitivity,
        "gain from": found.gain_low,
        "gain to": found.gain_high,
        "phase margin °": math.degrees(found.phase_margin_rad),
        "delay margin s": found.delay_margin_s,
        "law's pole": float(np.abs(np.linalg.eigvals(law.matrices().A)).max()),
    }


def passive_rows() -> Rows:
    """Best passive tanks by mass ratio; the first ship's as built and as PD makes it."""
    vessel = shipped("gpc").vessel
    own, frequency_rad_s = ship_ratios(vessel.ship, vessel.tank)
    found: Rows = {}
    for mass_ratio in sorted((*MASS_RATIOS, own.mass_ratio)):
        ratios = ShipTankRatios(mass_ratio, own.coupling_ratio, own.roll_damping_ratio)
        best = passive_optimum(ratios)
        found[f"mass ratio {mass_ratio:.4f}"] = {
            "frequency ratio": best.frequency_ratio,
            "damping ratio": best.damping_ratio,
            "greatest roll per static": best.peak,
        }
    built = vessel.tank.natural_frequency_rad_s / frequency_rad_s
    by_pd = passive_optimum(own)
    as_built = np.abs(roll_magnification(WAVE_RATIOS, built, vessel.tank.damping_ratio, own)).max()
    found["first ship as built"] = {
        "frequency ratio": built,
        "damping ratio": vessel.tank.damping_ratio,
        "greatest roll per static": float(as_built),
    }
    spring, loss = design_pd(vessel.ship, vessel.tank).gain[0]
    found[f"by PD, {spring:.0f} Pa/m, {loss:.0f} Pa s/m"] = {
        "frequency ratio": by_pd.frequency_ratio,
        "damping ratio": by_pd.damping_ratio,
        "greatest roll per static": by_pd.peak,
    }
    return found


def printed_rows() -> Rows:
    """Largest deviations from the printed coefficients."""
    found: Rows = {}
    for name, ship, unit in (
        ("as printed", AS_PRINTED, 1.0),
        ("the same, tank angle x 1.486", AS_PRINTED, 1.486),
        ("reservoirs of 25.2 m²", GREATER, 1.0),
        ("reservoirs of 24.4 m²", FITTED, 1.0),
    ):
        deviation = deviations(*ship, unit)
        found[name] = {
            "roll damping N m s": ship[0].damping_nms_rad,
            "tank damping": ship[1].damping_ratio,
            "16 roll-only": deviation.roll_only,
            "8 on u and roll": deviation.both,
            "4 on tank angle": deviation.angle,
        }
    worst = 0.0
    for name, law in (("DPC", design_dpc(PRINTED_ARX)), ("GPC", design_gpc(PRINTED_ARX))):
        printed = PRINTED[f"{name} (roll)"]
        for mine, theirs in (
            (law.input_gains, printed.input_gains),
            (law.output_gains, printed.roll_gains),
        ):
            worst = max(worst, float(np.abs(mine[:, 0, 0] / np.array(theirs) - 1).max()))
    found["ARX(4) recovered from the laws"] = {"16 roll-only": worst}
    return found


def index_rows() -> Rows:
    """Performance indices relative to DPC (roll)."""
    measured = {name: printed.measured for name, printed in PRINTED.items()}

    def of_printed(vessel: tuple[RollShip, Tank]) -> dict[str, float]:
        return {
            name: source_index(printed.law(vessel[1]), *vessel, measured[name])
            for name, printed in PRINTED.items()
        }

    own = {
        name: source_index(law, *AS_PRINTED, measured[name])
        for name, law in designed_laws(*AS_PRINTED).items()
    }
    lqr = design_lqr(held_model(*AS_PRINTED, STATES), 1e14)
    own["LQR"] = performance_index(lqr, DesignPlant(*AS_PRINTED, SAMPLE_TIME_S, 0.0), STATES)
    found: Rows = {}
    for name, indices in (
        ("printed", {**{key: law.index for key, law in PRINTED.items()}, "LQR": 504.0}),
        ("printed laws, 25.2 m²", of_printed(GREATER)),
        ("printed laws, printed ship", of_printed(AS_PRINTED)),
        ("laws designed here, printed ship", own),
    ):
        found[name] = {key: value / indices[DPC_ROLL] for key, value in indices.items()}
        found[name]["DPC (roll) itself"] = indices[DPC_ROLL]
    return found


TABLES: dict[str, Callable[[], Rows]] = {
    "margins": margin_rows,
    "passive": passive_rows,
    "printed": printed_rows,
    "index": index_rows,
}


def main() -> None:
    """Print the tables that were asked for."""
    print_tables(__doc__, TABLES)


if __name__ == "__main__":
    main()
