"""``utank-hil identify sea``: the waves of a record, for the bench."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Final

import numpy as np
import typer

from utank_hil.analysis.motion.wave_slope import BAND_RAD_S, beam_sea, wave_slope
from utank_hil.base.arrays import FloatArray
from utank_hil.base.between import Between
from utank_hil.base.provenance import describe
from utank_hil.commands.identify_test import read_run, refuse
from utank_hil.configuration import Vessel
from utank_hil.console import common
from utank_hil.console.terminal import Terminal, new_table
from utank_hil.dynamics.nonlinear import RollModel
from utank_hil.sea.components import write_components

FILE, PICTURE = "sea.csv", "sea.png"
NEEDED: Final = ("time_s", "roll_rad", "port_level_m", "starboard_level_m")
STEP_S = 0.1  #: Samples in it are averaged: at 3 rad/s it takes 0.4 % of the amplitude.
LONGEST_GAP_S = 1.0  #: Filled by a line; waves of 2 s are the shortest.
SHORTEST_S = 120.0  #: Of a record; its ends rise and fall over 20 s.


def sea(
    context: typer.Context,
    log: Annotated[Path, common.argument("With roll and levels: .rrd, .frames, .csv, bus log.")],
    ship: Annotated[Path, common.option("Ship as it was loaded: by `identify`, if need be.")],
    run: common.Run = None,
    channel: common.Channel = None,
    from_s: common.From = None,
    to_s: common.To = None,
    slope: Annotated[
        float, common.option("Effective slope coefficient of the scenario.", min=0.05, max=1.0)
    ] = 1.0,
    out: common.Out = common.OUT,
    json_: common.Json = False,
) -> None:
    """Find the waves of a record, so that the bench meets them with any law.

    The pump may have been at work. The ship must be that of the file: its moment is what the waves
    are taken from. Waves of 2 to 126 s are found, and what heels the ship steadily. Exit code 1:
    the record has gaps of over a second, or is shorter than 120 s.

    **Example:** utank-hil identify sea out/bench.rrd --ship configs/ships/thesis_first.yaml
    """
    from utank_hil.pictures.identification import draw_waves

    vessel = common.load(ship, Vessel)
    part_s = common.chosen_part(from_s, to_s)
    name, columns = read_run(log, NEEDED, part_s, channel=channel, run=run)
    try:
        roll_rad, level_m = _samples(columns, part_s)
    except ValueError as error:
        refuse(f"{log}: {error}", json_)
    slope_rad, heeling_nm = wave_slope(
        roll_rad, level_m, STEP_S, RollModel(vessel.ship, vessel.tank)
    )
    found = beam_sea(slope_rad, STEP_S, slope)
    if not found.amplitude_m.any():
        refuse(f"{log}: the ship does not move", json_)
    out = common.prepare_out(out, (FILE, PICTURE))
    about = describe("identify sea", vessel, out, options=context.params)
    title = f"{log.name}, {name}"
    files = {
        "sea": write_components(found, out / FILE),
        "picture": draw_waves(roll_rad, slope_rad, STEP_S, out / PICTURE, title, about),
    }
    figures = {
        "slope_rms_rad": slope * math.sqrt(found.slope.variance),
        "mean_frequency_rad_s": float(
            np.average(found.omega_rad_s, weights=found.slope.amplitude**2)
        ),
        "heeling_moment_nm": heeling_nm,
        "components": len(found.omega_rad_s),
        "duration_s": STEP_S * len(slope_rad),
    }
    if json_:
        paths = {key: str(path) for key, path in files.items()}
        common.print_json(about | figures | {"files": paths})
    else:
        _print(figures, slope, files)


def _samples(
    columns: Mapping[str, FloatArray], between_s: Between
) -> tuple[FloatArray, FloatArray]:
    """Return roll and level every `STEP_S`; ValueError says what the record lacks."""
    time_s, roll_rad, port_m, starboard_m = (columns[name] for name in NEEDED)
    part = (time_s >= between_s[0]) & (time_s <= between_s[1])
    if not part.any() or float(np.ptp(time_s[part])) < SHORTEST_S:
        raise ValueError(f"is shorter than {SHORTEST_S:g} s: take a longer part")
    if (np.diff(time_s[part]) <= 0).any():
        raise ValueError("needs rising times: sort the rows, and keep one of each time")
    level_m = (starboard_m - port_m) / 2
    return even_means(time_s[part], roll_rad[part]), even_means(time_s[part], level_m[part])


def _print(figures: Mapping[str, float], slope: float, files: Mapping[str, Path]) -> None:
    terminal = Terminal()
    table = new_table("Waves of the record", "value")
    waves = f"waves from {BAND_RAD_S[0]:g} to {BAND_RAD_S[1]:g} rad/s"
    for row in (
        ("effective wave slope, ° RMS", f"{math.degrees(figures['slope_rms_rad']):.3g}"),
        ("mean frequency, rad/s", f"{figures['mean_frequency_rad_s']:.3g}"),
        (waves, f"{figures['components']}"),
        ("steady heeling moment, kN m", f"{figures['heeling_moment_nm'] / 1e3:.3g}"),
        ("length, after which it repeats, s", f"{figures['duration_s']:.0f}"),
    ):
        table.add_row(*row)
    terminal.table(table)
    terminal.say("Section of a scenario of this ship, beside the file:")
    coefficient = "" if slope == 1 else f", effective_slope: {{coefficient: {slope:g}}}"
    terminal.say(f"  sea: {{kind: components, file: ./{FILE}{coefficient}}}")
    terminal.files(files)


def even_means(time_s: FloatArray, values: FloatArray) -> FloatArray:
    """Means over `STEP_S`, shape (M,); ValueError names a gap longer than `LONGEST_GAP_S`."""
    good = np.isfinite(values)
    if not good.any():
        raise ValueError("a column has no values")
    place = np.rint((time_s - time_s[0]) / STEP_S).astype(np.int64)
    sums = np.bincount(place[good], values[good])
    numbers = np.bincount(place[good], minlength=len(sums))
    (there,) = np.nonzero(numbers)
    gaps = np.diff(there, prepend=-1, append=int(place[-1]) + 1)
    longest = int(gaps.argmax())
    if gaps[longest] > LONGEST_GAP_S / STEP_S:
        end_s = float(time_s[0]) + STEP_S * float(there[min(longest, len(there) - 1)])
        raise ValueError(
            f"has a gap of {STEP_S * gaps[longest]:.3g} s around {end_s:.5g} s: choose a part "
            "without by --from and --to"
        )
    return np.interp(np.arange(place[-1] + 1), there, sums[there] / numbers[there])
