"""Figure of a decay test: roll and its fit."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from utank_hil.analysis.motion.decay import RollDecay
from utank_hil.pictures.style import BELOW, COLORS, DASHES, WIDEST_IN, picture


def draw_decay(
    found: RollDecay, path: Path, title: str, about: Mapping[str, Any] | None = None
) -> Path:
    """Draw measured roll, the fit, and what the fit leaves."""
    with picture(path, title, (WIDEST_IN, 5.5), about) as figure:
        top, low = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
        for n, (name, roll) in enumerate((("measured", found.roll_rad), ("fit", found.fit_rad))):
            style: dict[str, Any] = {"linestyle": DASHES[2 * n], "color": COLORS[2 * n]}
            top.plot(found.time_s, np.degrees(roll), label=name, **style)
        top.set_ylabel("Roll (°)")
        low.plot(found.time_s, np.degrees(found.roll_rad - found.fit_rad), color=COLORS[0], lw=0.8)
        low.set(xlabel="Time (s)", ylabel="Left (°)")
        figure.legend(**BELOW)
    return path
