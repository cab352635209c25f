"""Display units and plots of telemetry columns, by the suffix of their names alone.

Columns carry SI values (`roll_rad`); recordings hold the displayed values (`roll_deg`), because the
viewer cannot convert.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Unit:
    """An SI unit and its display unit."""

    #: suffix, shown_suffix: endings of the column's name and of the recorded field's name.
    suffix: str
    shown_suffix: str
    scale: float  #: Displayed value per SI value.
    plot: str  #: Title of the plot of columns of this unit without a plot of their own.


# The order is that of matching: a suffix comes before any shorter one that it ends in.
UNITS = (
    Unit("_rad_s", "_deg_s", 180 / math.pi, "Angular rate, °/s"),
    Unit("_rad", "_deg", 180 / math.pi, "Angle, °"),
    Unit("_pa", "_kpa", 1e-3, "Pressure, kPa"),
    Unit("_m_s", "_m_s", 1.0, "Speed, m/s"),
    Unit("_m", "_m", 1.0, "Length, m"),
    Unit("_nm", "_mnm", 1e-6, "Moment, MN m"),
    Unit("_w", "_kw", 1e-3, "Power, kW"),
    Unit("_opening", "_opening_percent", 100.0, "Valve opening, %"),
    Unit("_load", "_load_percent", 100.0, "Bus load, %"),
    Unit("_lateness_s", "_lateness_ms", 1e3, "Loop timing, ms"),
    Unit("_duration_s", "_duration_ms", 1e3, "Loop timing, ms"),
    Unit("_s", "_s", 1.0, "Time, s"),
    Unit("", "", 1.0, "Counts"),
)


@dataclass(frozen=True, slots=True)
class Field:
    """A column as recorded."""

    column: str  #: Name of the column, in SI units.
    name: str  #: Name in the recording, unit included.
    label: str  #: Label in the plot, without unit.
    unit: Unit


def field_of(column: str) -> Field:
    """Return the recorded field of a column; raises ValueError for a unit that is not SI."""
    unit = next(unit for unit in UNITS if column.endswith(unit.suffix))
    stem = column.removesuffix(unit.suffix)
    name = stem + unit.shown_suffix
    if column_of(name) != (column, unit):
        raise ValueError(f"telemetry column {column!r}: columns are in SI units")
    return Field(column, name, stem.replace("_", " "), unit)


def column_of(name: str) -> tuple[str, Unit]:
    """Return the column, and its unit, of a recorded field's name."""
    unit = next(unit for unit in UNITS if name.endswith(unit.shown_suffix))
    return name.removesuffix(unit.shown_suffix) + unit.suffix, unit
