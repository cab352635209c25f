"""The thresholds of the shipped ships in docs/monitors.md, as the code computes them."""

import math
from typing import Final

from tools.documents.marked import DOCS, written_anew
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.safety.monitors.thresholds import MonitorThresholds, thresholds_of

PAGE = DOCS / "monitors.md"
CONTROLLERS: Final = ("gpc", "naval_constrained_gpc", "patti_b_constrained_gpc")

DEGREES: Final = math.degrees(1.0)
ROWS: Final = (
    ("period T, s", "roll_period_s", 1.0),
    ("drift, degrees", "drift_rad", DEGREES),
    ("a still roll stays within, degrees", "roll_still_rad", DEGREES),
    ("a still rate stays within, degrees/s", "rate_still_rad_s", DEGREES),
    ("a still level stays within, m", "level_still_m", 1.0),
    ("sum of the levels, m", "volume_m", 1.0),
    ("motion sensor late, s", "motion_late_s", 1.0),
    ("spike of the roll, degrees in 10 ms", "roll_spike_rad", DEGREES),
    ("spike of a level, m in 20 ms", "level_spike_m", 1.0),
    ("error of the pump's pressure, kPa", "pressure_error_pa", 1e-3),
    ("pressure until the water obeyed, share", "unconfirmed_share", 1.0),
    ("degraded pressure, share", "degraded_share", 1.0),
    ("roll compared with the twin's from, degrees RMS", "amplified_roll_rad", DEGREES),
)
"""What it says, of `MonitorThresholds`, and times what; spikes beside what she moves meanwhile."""


def thresholds(controller: str) -> tuple[str, MonitorThresholds]:
    """A shipped controller's vessel, and her thresholds."""
    path = DOCS.parent / "configs" / "controllers" / f"{controller}.yaml"
    config = load_config(path, ControllerConfig)
    found = thresholds_of(config.plant, config.safety.roll_limit_rad, config.sensors)
    return config.vessel.name, found


def page() -> str:
    """The page as it stands, with the table written anew."""
    ships = [thresholds(name) for name in CONTROLLERS]
    lines = [
        f"| threshold | {' | '.join(name for name, _ in ships)} |\n",
        f"|---|{'---|' * len(ships)}\n",
        *(
            f"| {words} | "
            + " | ".join(f"{getattr(each, field) * times:.3g}" for _, each in ships)
            + " |\n"
            for words, field, times in ROWS
        ),
    ]
    return written_anew(PAGE, lines)
