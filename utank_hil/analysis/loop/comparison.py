"""Laws side by side: linear motion in a sea, margins, and what they cost."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from utank_hil.analysis.loop.margins import Margins, margins
from utank_hil.analysis.loop.performance_index import performance_index
from utank_hil.analysis.loop.sea_response import (
    MotionInSea,
    motion_in_sea,
    require_roll,
    rms,
    roll_response_without_tank,
)
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.interface import LinearLaw
from utank_hil.dynamics.linear import coupled_model
from utank_hil.sea import Harmonics

if TYPE_CHECKING:
    from rich.table import Table

NO_TANK, PASSIVE = "no tank", "passive"


@dataclass(frozen=True, slots=True)
class Loop:
    """A law with its name and what it sees.

    Attributes
    ----------
    measured : tuple of str
        Names of outputs of `coupled_model`, in the law's order.
    """

    name: str
    law: LinearLaw
    measured: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ComparisonRow:
    """One law of a comparison.

    Attributes
    ----------
    motion : MotionInSea or None
        None if the loop is unstable.
    roll_below_no_tank, roll_below_passive : float or None
        Share by which the roll RMS is less.
    margins : Margins or None
        None where there is no loop.
    index_rad_pa : float or None
        `performance_index`; None where there is no loop or an unstable one.
    """

    name: str
    motion: MotionInSea | None
    roll_below_no_tank: float | None
    roll_below_passive: float | None
    margins: Margins | None = None
    index_rad_pa: float | None = None


def compare(
    loops: Sequence[Loop],
    plant: DesignPlant,
    wave_moment: Harmonics,
) -> tuple[ComparisonRow, ...]:
    """Rows for the ship without tank, with the passive tank, and with each law.

    Parameters
    ----------
    wave_moment : Harmonics
        The sea's roll moment in N m.

    Raises
    ------
    CalmSeaError
        If the sea does not roll the ship: there is no roll to compare.
    """
    system = coupled_model(plant.ship, plant.tank)
    response = roll_response_without_tank(plant.ship, wave_moment.frequency_rad_s)
    bare = MotionInSea(rms(response, wave_moment), 0.0, 0.0)
    passive = motion_in_sea(None, system, ("roll_rad",), wave_moment)
    require_roll(passive)

    def row(
        name: str,
        motion: MotionInSea,
        judged: Margins | None = None,
        index_rad_pa: float | None = None,
    ) -> ComparisonRow:
        below_bare, below_passive = (
            1 - motion.roll_rms_rad / other.roll_rms_rad for other in (bare, passive)
        )
        return ComparisonRow(name, motion, below_bare, below_passive, judged, index_rad_pa)

    rows = [row(NO_TANK, bare), row(PASSIVE, passive)]
    for loop in loops:
        judged = margins(loop.law, plant.model(loop.measured), plant.delay_s, plant.lag_s)
        if judged.radius >= 1:
            rows.append(ComparisonRow(loop.name, None, None, None, judged))
            continue
        motion = motion_in_sea(
            loop.law, system, loop.measured, wave_moment, plant.delay_s, plant.lag_s
        )
        index = performance_index(loop.law, plant, loop.measured)
        rows.append(row(loop.name, motion, judged, index))
    return tuple(rows)


def comparison_table(rows: Sequence[ComparisonRow], title: str = "") -> "Table":
    """Table of a comparison, for a terminal; linear theory, no limits."""
    from rich.table import Table

    table = Table(title=title or None)
    table.add_column("", no_wrap=True)
    for heading in (
        "roll RMS\n°",
        "below\nno tank",
        "below\npassive",
        "level RMS\nm",
        "pressure\nRMS kPa",
        "peak sen-\nsitivity",
        "gain\nmargin",
        "phase\nmargin °",
        "delay\nmargin s",
        "index\n1e-6/Pa",
    ):
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(row.name, *_motion_cells(row), *_loop_cells(row))
    return table


def _motion_cells(row: ComparisonRow) -> tuple[str, ...]:
    motion, bare, passive = row.motion, row.roll_below_no_tank, row.roll_below_passive
    if motion is None or bare is None or passive is None:
        return ("unstable", "", "", "", "")
    return (
        f"{math.degrees(motion.roll_rms_rad):.2f}",
        "" if row.name == NO_TANK else f"{bare:.1%}",
        "" if row.name in (NO_TANK, PASSIVE) else f"{passive:.1%}",
        "" if row.name == NO_TANK else f"{motion.level_rms_m:.2f}",
        "" if row.margins is None else f"{motion.pressure_rms_pa / 1e3:.1f}",
    )


def _loop_cells(row: ComparisonRow) -> tuple[str, ...]:
    loop = row.margins
    if loop is None:
        return ("", "", "", "", "")
    if row.index_rad_pa is None:
        return (f"{loop.peak_sensitivity:.2f}", "", "", "", "")
    return (
        f"{loop.peak_sensitivity:.2f}",
        f"{loop.gain_low:.2f} to {_number(loop.gain_high, 2)}",
        _number(math.degrees(loop.phase_margin_rad), 0),
        _number(loop.delay_margin_s, 2),
        f"{1e6 * row.index_rad_pa:.2f}",
    )


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "any"
