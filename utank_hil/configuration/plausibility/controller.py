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
from utank_hil.dynamics.nonlinear import RollModel, greatest_held_pa
from utank_hil.safety.monitors.level_stuck import way_until_found_m

_PERIODS: Final = (0.2, 5.0)
"""Range of a period of waves or of a wanted motion per the ship's roll period."""
_RATIOS: Final = (0.005, 3.0)
"""Damping ratios that a law may want of a motion, or see in a sea's peak."""
STUCK_SHARE: Final = 0.25
"""Of the roll limit, by which water may heel that is moved unseen: the share of the roll budget."""


def controller_warnings(config: Any) -> Iterator[Problem]:
    """Return what is unusual in law, limits and retuning of a `ControllerConfig`, by their keys."""
    ship, tank, pump = config.vessel.ship, config.vessel.tank, config.vessel.pump
    roll_rad_s = ship.natural_frequency_rad_s
    roll_s = 2 * math.pi / roll_rad_s
    rolls = f"the ship rolls in {roll_s:.3g} s, at {roll_rad_s:.3g} rad/s"
    height_m = tank.level_limit_m
    full = f"a reservoir is full or empty at {height_m:.3g} m"
    most_pa = 0.0 if pump is None else pump.max_pressure_pa
    most_pa_s = 0.0 if pump is None else pump.max_pressure_rate_pa_s
    gives = f"the pump gives {most_pa:g} Pa"
    share = "it is a share of critical damping, 10 % is 0.10"
    rows: list[tuple[str, float, float, float, str]] = [
        ("limits.level_m", height_m, 0.05, 1, full),
        ("limits.pressure_pa", most_pa, 0.05, math.inf, gives),
        ("limits.rate_pa_s", config.limits.pressure_pa / roll_s, 1, math.inf,
         f"{rolls}, and the pressure needs longer to its limit"),
        ("limits.rate_pa_s", most_pa_s, 0, 1, "the pump's pressure changes no faster"),
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
    if pump is not None and config.vessel.valve is None:  # behind a valve levels are not judged
        yield from _of_gauges(config)


def _of_gauges(config: Any) -> Iterator[Problem]:
    """Gauges too noisy for a pump that is strong for its ship.

    While both stand still, the pump may move the water until the monitor finds that. Held there,
    the water may heel the ship by a part of its roll limit.
    """
    tank, most_pa, noise_m = (
        config.vessel.tank, config.limits.pressure_pa, config.sensor_figures.level_noise_m,
    )  # fmt: skip
    heel_rad = STUCK_SHARE * config.safety.roll_limit_rad
    held_pa = greatest_held_pa(RollModel(config.vessel.ship, tank), most_pa, heel_rad)
    pa_per_m = 2 * tank.density_kg_m3 * GRAVITY_M_S2
    way_m = way_until_found_m(noise_m)
    if held_pa >= min(most_pa, pa_per_m * way_m):
        return
    # from rest the pump swings it to twice the level that it holds
    turn = math.acos(max(1 - pa_per_m * way_m / most_pa, -1.0))
    fine_m = held_pa / pa_per_m / way_until_found_m(1.0)
    reason = (
        f"is {noise_m:g}: levels that stand still are found once the water has moved "
        f"{way_m:.2g} m, after {turn / tank.natural_frequency_rad_s:.2g} s of the greatest "
        f"pressure; held there, it heels the ship beyond {heel_rad:.2g} rad, a quarter of "
        f"safety.roll_limit_rad: use gauges of {math.floor(1e4 * fine_m) / 1e4:g} m or less, or "
        f"set limits.pressure_pa to {math.floor(held_pa):g} or less"
    )
    yield "sensors.level_noise_m", reason


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
