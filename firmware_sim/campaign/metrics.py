"""Figures of a case."""

from typing import Final

METRICS: Final = {
    "roll_rms_rad": "root mean square of the roll",
    "roll_significant_rad": "significant single amplitude of the roll",
    "roll_max_rad": "greatest roll",
    "roll_below_no_tank": "share by which the roll RMS is less than without a tank",
    "roll_below_passive": "share by which the roll RMS is less than with the passive tank",
    "level_peak_m": "greatest deviation of a reservoir's level",
    "pressure_rms_pa": "root mean square of the pump's pressure",
    "pressure_peak_pa": "greatest pressure of the pump",
    "power_mean_w": "mean power drawn; of the shaft, in the linear simulation into the water",
    "power_peak_w": "greatest power drawn",
    "strikes": "how often the water struck a limit of its level",
    "active_share": "share of the time in which the controller was in charge",
}  #: Meaning of each metric's column over the scenario's window; NaN where it does not apply.
