"""Search for a gentler design of a refused law that meets the margins.

If there is none, the remedy is the law kind that finds its own numbers.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from utank_hil.analysis.loop.linear_tuning import AutoDesign
from utank_hil.analysis.loop.robustness import robustness
from utank_hil.analysis.loop.self_tuning import NoLawError, SelfTunedDesign
from utank_hil.analysis.loop.trade import Design, scaled, varied
from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.lqg_design import LQGDesign
from utank_hil.dynamics.linear import state_matrices
from utank_hil.gate import MOST_STEP_S, JudgedLaw

GENTLER: Final = (0.3, 0.1, 0.03, 0.01, 1e-3, 1e-4)  #: Factors on a weight on outputs or states.
LONGER: Final = (1.3, 1.6, 2.0, 3.0)  #: Factors on the control horizon of an exact deadbeat.


def remedy(judged: JudgedLaw) -> str | None:
    """Return the first gentler design that meets all requirements, as keys of the file.

    None is returned if the law is not refused for its margins or has nothing to scale.
    """
    design, plant, report = judged.config.law, judged.config.plant, judged.robustness
    refused = report is not None and report.failures() and judged.step_s <= MOST_STEP_S
    if not refused or report is None or not isinstance(design, Design):
        return None
    stiffness = plant.ship.stiffness_nm_rad / report.worst_period_scale**2
    softer = replace(plant.ship, stiffness_nm_rad=stiffness)
    if np.linalg.eigvals(state_matrices(softer, plant.tank)[0]).real.max() > 0:
        return (
            f"at {report.worst_period_scale:g} of the roll period the ship is unstable with the "
            "tank's water alone, whatever the law asks for: make the tank's reservoirs smaller"
        )
    for factor in LONGER if varied(design) == "control horizon" else GENTLER:
        gentler = scaled(design, factor)
        try:
            found = robustness(
                gentler.law(plant), plant, judged.law.measured, with_delay_margin=False
            )
        except (ValueError, ArithmeticError):
            continue  # It can't be designed or judged either.
        if not found.failures():
            return f"{_keys(gentler)} passes; a value between may, too"
    return _automatic(design, plant) or (
        f"no gentler {varied(design)} passes: choose another law, or another tank"
    )


def _automatic(design: Design, plant: DesignPlant) -> str | None:
    """Return the law of the kind that finds its own numbers; None if there is none."""
    try:
        if isinstance(design, ConstrainedDesign):
            SelfTunedDesign("self_tuned", design.sea).tuned(plant)
            return "law.kind: self_tuned with the same sea in place of the other numbers passes"
        AutoDesign(design.kind, "auto").tuned(plant)
    except NoLawError:
        return None
    return f"law: {{kind: {design.kind}, tuning: auto}} passes"


def _keys(design: Design) -> str:
    """Return the keys of the numbers that `scaled` scales, as written in a file."""
    if isinstance(design, ConstrainedDesign):
        return f"law.pressure_weight_rad2: {design.pressure_weight_rad2:.3g}"
    if isinstance(design, LQGDesign):
        return f"law.state_weight: {_list(design.state_weight)}"
    if design.output_weight is not None:
        return f"law.output_weight: {_list(design.output_weight)}"
    return (
        f"law.control_horizon: {design.control_horizon} with law.prediction_horizon: "
        f"{design.prediction_horizon}"
    )


def _list(values: tuple[float, ...]) -> str:
    return f"[{', '.join(f'{value:.3g}' for value in values)}]"
