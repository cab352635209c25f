"""Figures of a controller's file that a slip of unit or digit drives out of range.

Weights and noise intensities of a law are left out: they are tuned, and the gate judges the loop
that they make.
"""

import math
from collections.abc import Iterator
from typing import Any, Final

from utank_hil.base.parameters import Problem
from utank_hil.control import PumpLimits, SeaModel
from utank_hil.dynamics import GRAVITY_M_S2, RollShip, Tank

_PERIODS: Final = (0.2, 5.0)
"""Range of a period of waves or of a wanted motion per the ship's roll period."""
_RATIOS: Final = (0.005, 3.0)
"""Damping ratios that a law may want of a motion, or see in a sea's peak."""


def controller_warnings(
    ship: RollShip, tank: Tank, law: Any, limits: PumpLimits, most_pa: float | None, retuning: Any
) -> Iterator[Problem]:
    """Return what is unusual in a law, its limits and its retuning, by keys of the file.

    `most_pa` is the pump's greatest pressure, None without a pump; `retuning` may be None.
    """
    roll_rad_s = ship.natural_frequency_rad_s
    roll_s = 2 * math.pi / roll_rad_s
    rolls = f"the ship rolls in {roll_s:.3g} s, at {roll_rad_s:.3g} rad/s"
    height_m = tank.level_limit_m
    full = f"a reservoir is full or empty at {height_m:.3g} m"
    gives = f"the pump gives {most_pa or 0:g} Pa"
    share = "it is a share of critical damping, 10 % is 0.10"
    rows: list[tuple[str, Any, float | None, float, float, str]] = [
        ("limits.level_m", limits.level_m, height_m, 0.05, 1, full),
        ("limits.pressure_pa", limits.pressure_pa, most_pa, 0.05, math.inf, gives),
        ("limits.rate_pa_s", limits.rate_pa_s, limits.pressure_pa / roll_s, 1, math.inf,
         f"{rolls}, and the pressure needs longer to its limit"),
        ("law.frequency_rad_s", _of(law, "frequency_rad_s"), roll_rad_s, *_PERIODS, rolls),
        ("law.damping_ratio", _of(law, "damping_ratio"), 1, *_RATIOS, share),
        ("law.level_damping_ratio", _of(law, "level_damping_ratio"), 1, *_RATIOS, share),
        ("law.soft_level_m", _of(law, "soft_level_m"), height_m, 0.05, 1, full),
        ("law.hard_level_m", _of(law, "hard_level_m"), height_m, 0.05, 1, full),
        ("law.level_margin_m", _of(law, "level_margin_m"), height_m, 0.005, 0.5, full),
        ("law.error.frequency_rad_s", _of(law, "error.frequency_rad_s"), roll_rad_s, *_PERIODS,
         rolls),
        ("law.error.damping_ratio", _of(law, "error.damping_ratio"), 1, *_RATIOS, share),
        ("law.washout_rad_s", _of(law, "washout_rad_s"), roll_rad_s, 0.002, 0.3, rolls),
        ("law.sample_time_s", _of(law, "sample_time_s"), roll_s, 0, 0.1, rolls),
        ("law.amplitude_rad", _of(law, "amplitude_rad"), 1, 2e-3, 0.35, "it is in radians"),
        ("law.roll_limit_rad", _of(law, "roll_limit_rad"), 1, 5e-3, 0.7, "it is in radians"),
        ("law.period_s", _of(law, "period_s"), roll_s, *_PERIODS, rolls),
        ("law.ramp_s", _of(law, "ramp_s"), roll_s, 0.5, 50, rolls),
    ]  # fmt: skip
    predictor, at = _of(law, "predictor"), "law.predictor"
    if predictor is None:
        predictor, at = _of(law, "pump.predictor"), "law.pump.predictor"
        washout = _of(law, "pump.washout_rad_s")
        rows.append(("law.pump.washout_rad_s", washout, roll_rad_s, 0.002, 0.3, rolls))
    if predictor is not None:
        peak, width = _of(predictor, "wave_peak_rad_s"), _of(predictor, "wave_damping_ratio")
        slope = _of(predictor, "wave_slope_rad")
        rows += [
            (f"{at}.wave_peak_rad_s", peak, roll_rad_s, *_PERIODS, rolls),
            (f"{at}.wave_damping_ratio", width, 1, 1e-4, 1, "it is of the sea's peak"),
            (f"{at}.wave_slope_rad", slope, 1, 1e-3, 0.4, "it is in radians"),
        ]
    if retuning is not None:
        low_s, high_s = retuning.roll_period_range_s
        rows += [
            ("retuning.roll_period_range_s", roll_s / low_s, 1, 1, math.inf, rolls),
            ("retuning.roll_period_range_s", roll_s / high_s, 1, 0, 1, rolls),
            ("retuning.pulse_pa", retuning.pulse_pa, most_pa, 0.02, 1, gives),
            ("retuning.pulse_hold_s", retuning.pulse_hold_s[1], roll_s, 0.05, 1, rolls),
            ("retuning.identification_s", retuning.identification_s, roll_s, 5, 500, rolls),
        ]  # fmt: skip
    for key, value, scale, least, most, words in rows:
        if value is not None and scale and not least <= value / scale <= most:
            yield (
                key,
                f"is {value:.4g}{'' if scale == 1 else ' against ' + f'{scale:.4g}'}: {words}",
            )
    for key in ("law.sea", "law.pump.sea"):
        sea = _of(law, key.removeprefix("law."))
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
