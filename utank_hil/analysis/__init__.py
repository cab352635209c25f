"""Analysis: what a ship, a tank and a law do, without a bus.

The names below are loaded when they are first used, so that the controller process, which needs the
margins only, imports no compiler. The rooms: `loop` (margins, robustness, bounds, trade-offs),
`motion` (statistics, decay, comfort, exceedance) and `capsize`.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from utank_hil.analysis.capsize.maps import CapsizeMap, capsize_map, phase_grid
    from utank_hil.analysis.capsize.sea_stack import stacked_seas
    from utank_hil.analysis.capsize.survival import (
        Survival,
        controlled_run,
        largest_survivable_wave,
    )
    from utank_hil.analysis.capsize.threshold import (
        Equilibrium,
        Probability,
        Threshold,
        capsize_probability,
        capsize_threshold,
        equilibria,
        erosion,
        safe_basin,
        without_tank,
    )
    from utank_hil.analysis.loop.comparison import Loop, compare, comparison_table
    from utank_hil.analysis.motion.decay import RollDecay, roll_decay
    from utank_hil.analysis.motion.response import ResponseAmplitude, simulated_response
    from utank_hil.analysis.motion.stimulation import (
        StimulatedRoll,
        stimulate_on_still_water,
        tuned_tank,
    )

__all__ = [
    "CapsizeMap",
    "Equilibrium",
    "Loop",
    "Probability",
    "ResponseAmplitude",
    "RollDecay",
    "StimulatedRoll",
    "Survival",
    "Threshold",
    "capsize_map",
    "capsize_probability",
    "capsize_threshold",
    "compare",
    "comparison_table",
    "controlled_run",
    "equilibria",
    "erosion",
    "largest_survivable_wave",
    "phase_grid",
    "roll_decay",
    "safe_basin",
    "simulated_response",
    "stacked_seas",
    "stimulate_on_still_water",
    "tuned_tank",
    "without_tank",
]

_LAZY = {
    "CapsizeMap": "capsize.maps",
    "Equilibrium": "capsize.threshold",
    "Loop": "loop.comparison",
    "Probability": "capsize.threshold",
    "ResponseAmplitude": "motion.response",
    "RollDecay": "motion.decay",
    "StimulatedRoll": "motion.stimulation",
    "Survival": "capsize.survival",
    "Threshold": "capsize.threshold",
    "capsize_map": "capsize.maps",
    "capsize_probability": "capsize.threshold",
    "capsize_threshold": "capsize.threshold",
    "compare": "loop.comparison",
    "comparison_table": "loop.comparison",
    "controlled_run": "capsize.survival",
    "equilibria": "capsize.threshold",
    "erosion": "capsize.threshold",
    "largest_survivable_wave": "capsize.survival",
    "phase_grid": "capsize.maps",
    "roll_decay": "motion.decay",
    "safe_basin": "capsize.threshold",
    "simulated_response": "motion.response",
    "stacked_seas": "capsize.sea_stack",
    "stimulate_on_still_water": "motion.stimulation",
    "tuned_tank": "motion.stimulation",
    "without_tank": "capsize.threshold",
}


def __getattr__(name: str) -> object:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)
