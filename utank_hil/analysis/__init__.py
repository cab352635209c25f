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
    name: module
    for module, names in {
        "capsize.maps": ("CapsizeMap", "capsize_map", "phase_grid"),
        "capsize.sea_stack": ("stacked_seas",),
        "capsize.survival": ("Survival", "controlled_run", "largest_survivable_wave"),
        "capsize.threshold": (
            *("Equilibrium", "Probability", "Threshold", "capsize_probability", "equilibria"),
            *("capsize_threshold", "erosion", "safe_basin", "without_tank"),
        ),
        "loop.comparison": ("Loop", "compare", "comparison_table"),
        "motion.decay": ("RollDecay", "roll_decay"),
        "motion.response": ("ResponseAmplitude", "simulated_response"),
        "motion.stimulation": ("StimulatedRoll", "stimulate_on_still_water", "tuned_tank"),
    }.items()
    for name in names
}


def __getattr__(name: str) -> object:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)
