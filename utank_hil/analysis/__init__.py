"""Analysis: what a ship, a tank and a law do, without a bus.

The names below are loaded when they are first used, so that the controller process, which needs the
margins only, gets no compiler and no plotting along. What concerns one law alone stands in modules
of its own name: `margins`, `robustness`, `trade`, `comfort` and others.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from utank_hil.analysis.capsize import (
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
    from utank_hil.analysis.capsize_maps import CapsizeMap, capsize_map, phase_grid
    from utank_hil.analysis.capsize_picture import draw_capsize_maps
    from utank_hil.analysis.comparison import Loop, compare, comparison_table
    from utank_hil.analysis.decay import RollDecay, roll_decay
    from utank_hil.analysis.loop_pictures import draw_bode, draw_nyquist
    from utank_hil.analysis.record_pictures import draw_phase, draw_time
    from utank_hil.analysis.response import ResponseAmplitude, simulated_response
    from utank_hil.analysis.sea_stack import stacked_seas
    from utank_hil.analysis.stimulation import StimulatedRoll, stimulate_on_still_water, tuned_tank
    from utank_hil.analysis.survival import Survival, controlled_run, largest_survivable_wave

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
    "draw_bode",
    "draw_capsize_maps",
    "draw_nyquist",
    "draw_phase",
    "draw_time",
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
    "CapsizeMap": "capsize_maps",
    "Equilibrium": "capsize",
    "Loop": "comparison",
    "Probability": "capsize",
    "ResponseAmplitude": "response",
    "RollDecay": "decay",
    "StimulatedRoll": "stimulation",
    "Survival": "survival",
    "Threshold": "capsize",
    "capsize_map": "capsize_maps",
    "capsize_probability": "capsize",
    "capsize_threshold": "capsize",
    "compare": "comparison",
    "comparison_table": "comparison",
    "controlled_run": "survival",
    "draw_bode": "loop_pictures",
    "draw_capsize_maps": "capsize_picture",
    "draw_nyquist": "loop_pictures",
    "draw_phase": "record_pictures",
    "draw_time": "record_pictures",
    "equilibria": "capsize",
    "erosion": "capsize",
    "largest_survivable_wave": "survival",
    "phase_grid": "capsize_maps",
    "roll_decay": "decay",
    "safe_basin": "capsize",
    "simulated_response": "response",
    "stacked_seas": "sea_stack",
    "stimulate_on_still_water": "stimulation",
    "tuned_tank": "stimulation",
    "without_tank": "capsize",
}


def __getattr__(name: str) -> object:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)
