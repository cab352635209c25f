"""Figures of a controller's file that a slip of unit or digit drives out of range.

Weights and noise intensities of a law are left out: they are tuned, and the gate judges the loop
that they make.
"""

import math
from collections.abc import Iterator
from typing import Any, Final

from utank_hil.base.parameters import Problem
from utank_hil.control import SeaModel
from utank_hil.dynamics import GRAVITY_M_S2

_PERIODS: Final = (0.2, 5.0)
"""Range of a period of waves or of a wanted motion per the ship's roll period."""
_RATIOS: Final = (0.005, 3.0)
"""Damping ratios that a law may want of a motion, or see in a sea's peak."""


def controller_warnings(config: Any) -> Iterator[Problem]:
    """Return what is unusual in law, limits and retuning of a `ControllerConfig`, by their keys."""
    ship, tank, pump = config.vessel.ship, config.vessel.tank, config.vessel.pump
    roll_rad_s = ship.natural_frequency_rad_s
    roll_s = 2 * math.pi / roll_rad_s
    rolls = f"the ship rolls in {roll_s:.3g} s, at {roll_rad_s:.3g} rad/s"
    height_m = tank.level_limit_m
    full = f"a reservoir is full or empty at {height_m:.3g} m"
    most_pa = 0.0 if pump is None else pump.max_pressure_pa
    gives = f"the pump gives {most_pa:g} Pa"
    share = "it is a share of critical damping, 10 % is 0.10"
    rows: list[tuple[str, float, float, float, str]] = [
        ("limits.level_m", height_m, 0.05, 1, full),
        ("limits.pressure_pa", most_pa, 0.05, math.inf, gives),
        ("limits.rate_pa_s", config.limits.pressure_pa / roll_s, 1, math.inf,
         f"{rolls}, and the pressure needs longer to its limit"),
        ("law.frequency_rad_s", roll_rad_s, *_PERIODS, rolls),
        ("law.damping_ratio", 1, *_RATIOS, share),
        ("law.level_damping_ratio", 1, *_RATIOS, share),
        ("law.soft_level_m", height_m, 0.05, 1, full),
        ("law.hard_level_m", height_m, 0.05, 1, full),
        ("law.level_margin_m", height_m, 0.005, 0.5, full),
        ("law.error.frequency_rad_s", roll_rad_s, *_PERIODS, rolls),
        ("law.error.damping_ratio", 1, *_RATIOS, share),
        ("law.washout_rad_s", roll_rad_s, 0.002, 0.3, rolls),
        ("law.sample_time_s", roll_s, 0, 0.1, rolls),
        ("law.pump.washout_rad_s", roll_rad_s, 0.002, 0.3, rolls),
        ("retuning.pulse_pa", most_pa, 0.02, 1, gives),
        ("retuning.identification_s", roll_s, 5, 500, rolls),
    ]  # fmt: skip
    for at in ("law.predictor", "law.pump.predictor"):
        rows += [
            (f"{at}.wave_peak_rad_s", roll_rad_s, *_PERIODS, rolls),
            (f"{at}.wave_damping_ratio", 1, 1e-4, 1, "it is of the sea's peak"),
            (f"{at}.wave_slope_rad", 1, 1e-3, 0.4, "it is in radians"),
        ]
    values = {key: _of(config, key) for key, *_ in rows}
    if config.retuning is not None:
        low_s, high_s = config.retuning.roll_period_range_s
        values["retuning.roll_period_range_s"] = roll_s
        values["retuning.pulse_hold_s"] = config.retuning.pulse_hold_s[1]
        rows += [
            ("retuning.roll_period_range_s", low_s, 1, math.inf, rolls),
            ("retuning.roll_period_range_s", high_s, 0, 1, rolls),
            ("retuning.pulse_hold_s", roll_s, 0.05, 1, rolls),
        ]
    for key, scale, least, most, words in rows:
        value = values[key]
        if value is not None and scale and not least <= value / scale <= most:
            against = "" if scale == 1 else f" against {scale:.4g}"
            yield key, f"is {value:.4g}{against}: {words}"
    for key in ("law.sea", "law.pump.sea"):
        sea = _of(config, key)
        if isinstance(sea, SeaModel):
            yield from _of_sea(key, sea, roll_rad_s, tank.width_m)


def _of_sea(key: str, sea: SeaModel, roll_rad_s: float, width_m: float) -> Iterator[Problem]:
    spectrum = sea.spectrum
    peak_s = 1 / float(spectrum.frequency_hz[spectrum.density.argmax()])
    ratio = peak_s * roll_rad_s / (2 * math.pi)
    steep = 2 * math.pi * spectrum.hs_m / (GRAVITY_M_S2 * peak_s**2)
    if not _PERIODS[0] <= ratio <= _PERIODS[1] or steep > 0.08 or spectrum.hs_m < 0.02 * width_m:
        reason = (
            f"is of {spectrum.hs_m:.2g} m and {peak_s:.3g} s, and the ship rolls in "
            f"{2 * math.pi / roll_rad_s:.3g} s: frequency_hz is in Hz, density_m2_hz in m2/Hz, "
            "hs_m in m, tp_s in s"
        )
        yield key, reason
    if 0 < sea.effective_slope < 0.05:
        yield f"{key}.effective_slope", f"of {sea.effective_slope:g}: ships have 0.2 to 1"


def _of(part: Any, names: str) -> Any:
    """Return an attribute by its dotted name; None if there is none."""
    for name in names.split("."):
        part = getattr(part, name, None)
    return part
