"""Figure of roll statistics: spectra over the period, and exceedance of amplitudes."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np

from utank_hil.analysis.motion.statistics import exceedance
from utank_hil.base.arrays import FloatArray
from utank_hil.pictures.style import BELOW, COLORS, DASHES, NO_TANK, WIDEST_IN, picture

SEGMENT_S: Final = 200.0  #: Segments of Welch's spectra, with a resolution of 0.03 rad/s.
LONGEST_S, SHORTEST_S = 40.0, 3.0  #: Range of periods in the figure.


def draw_roll_statistics(
    rolls: Mapping[str, FloatArray], step_s: float, path: Path, title: str
) -> Path:
    """Draw spectra of the roll over its period, and shares of its amplitudes above each angle.

    `rolls` in radians, shape (n,), are in the order of the colours; "no tank" may come first.
    """
    from scipy.signal import welch

    colors = [NO_TANK, *COLORS] if "no tank" in rolls else list(COLORS)
    dashes = ["-", *DASHES] if "no tank" in rolls else list(DASHES)
    with picture(path, title, (WIDEST_IN, 4.4)) as figure:
        spectra, shares = figure.subplots(1, 2)
        for (name, roll_rad), color, dash in zip(rolls.items(), colors, dashes, strict=False):
            degrees = np.rad2deg(roll_rad)
            frequency_hz, density = welch(
                degrees, 1 / step_s, nperseg=min(len(degrees), round(SEGMENT_S / step_s))
            )
            shown = (frequency_hz > 1 / LONGEST_S) & (frequency_hz < 1 / SHORTEST_S)
            style = {"color": color, "linestyle": dash, "linewidth": 1.5}
            spectra.plot(1 / frequency_hz[shown], density[shown], label=name, **style)
            levels = np.linspace(0.0, np.abs(degrees).max(), 60)
            try:
                share = exceedance(degrees, levels)
            except ValueError:  # the record has no half-cycle
                continue
            shares.plot(levels, np.where(share > 0, 100 * share, np.nan), **style)
        ticks = [4, 5, 6, 8, 10, 12, 15, 20, 30]
        spectra.set(xscale="log", xlabel="Period (s)", ylabel="Spectrum of the roll (°²/Hz)")
        spectra.set_xticks(ticks, [str(tick) for tick in ticks])
        spectra.minorticks_off()
        spectra.set_ylim(bottom=0.0)
        ordinate = "Share of amplitudes above it (%)"
        shares.set(yscale="log", xlabel="Single amplitude of the roll (°)", ylabel=ordinate)
        shares.set_xlim(left=0.0)
        figure.legend(**BELOW | {"ncols": len(rolls)})
    return path
