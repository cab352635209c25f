"""Waves one by one in a CSV file: of a ship's record, or of another program.

Its columns are ``omega_rad_s, amplitude_m, phase_rad`` of each wave at the ship at the start, and
``heading_deg`` (0 following, 90 from port to starboard, 180 head) where they differ.
"""

from pathlib import Path
from typing import Final

import numpy as np

from utank_hil.base.text_files import read_number_table, unread
from utank_hil.base.whole_file import write_whole
from utank_hil.sea.ndbc import HIGHEST_M
from utank_hil.sea.sea import BEAM_RAD, Sea

COLUMNS: Final = ("omega_rad_s", "amplitude_m", "phase_rad")
_RANGES: Final = {
    "omega_rad_s": (1e-3, 10.0), "amplitude_m": (0.0, HIGHEST_M), "phase_rad": (-1e3, 1e3),
    "heading_deg": (-360.0, 360.0),
}  # fmt: skip
_MOST: Final = 4096  #: A plant turns each of them at each tick.


def read_components(file: Path, heading_rad: float = BEAM_RAD) -> Sea:
    """Read waves, `heading_rad` where the file has none; ValueError names place and remedy."""
    try:
        columns = read_number_table(file)
    except OSError as error:
        raise ValueError(unread(error)) from error
    if set(columns) - {"heading_deg"} != set(COLUMNS):
        raise ValueError(
            f"{file} needs the columns {', '.join(COLUMNS)}, and may have heading_deg; it has "
            f"{', '.join(columns)}"
        )
    omega, amplitude_m, phase_rad = (columns[name] for name in COLUMNS)
    if len(omega) > _MOST:
        raise ValueError(
            f"{file} has {len(omega)} waves; {_MOST} are the most: leave out the smallest, or take "
            "a shorter record"
        )
    for name, values in columns.items():
        least, most = _RANGES[name]
        wrong = np.flatnonzero(~((values >= least) & (values <= most)))
        if wrong.size:
            raise ValueError(
                f"{file}: line {int(wrong[0]) + 2}: {name} is {values[wrong[0]]:g}; it must be "
                f"from {least:g} to {most:g}"
            )
    heading = np.full(len(omega), heading_rad)
    if "heading_deg" in columns:
        heading = np.radians(columns["heading_deg"])
    return Sea(amplitude_m, omega, heading, phase_rad)


def write_components(sea: Sea, file: Path) -> Path:
    """Write frequency, amplitude and phase of waves that have one direction, exactly."""
    columns = zip(sea.omega_rad_s, sea.amplitude_m, sea.phase_rad, strict=True)
    rows = [",".join(COLUMNS), *(",".join(map(repr, map(float, row))) for row in columns)]
    write_whole(file, "\n".join([*rows, ""]))
    return file
