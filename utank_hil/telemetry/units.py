"""How a telemetry column is shown: the unit people read, and the plot it belongs to.

Columns carry SI values and name their unit (`roll_rad`); recordings hold what is plotted
(`roll_deg`), because the viewer cannot convert. The suffix alone decides, so a column nobody has
thought of yet finds its plot, its unit and its way back.
"""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit of the interfaces and the one it is shown in.

    Attributes
    ----------
    suffix, shown_suffix : str
        Ends of the column's name and of the recorded field's name.
    scale : float
        Shown value per SI value.
    plot : str
        Title of the plot that all columns of this unit share.
    main : bool
        Whether that plot is one of the large ones.
    """

    suffix: str
    shown_suffix: str
    scale: float
    plot: str
    main: bool = False


# A suffix stands before the shorter ones that end alike.
UNITS = (
    Unit("_rad_s", "_deg_s", 180 / math.pi, "Roll rate, °/s"),
    Unit("_rad", "_deg", 180 / math.pi, "Roll, °", main=True),
    Unit("_pa", "_kpa", 1e-3, "Pump pressure, kPa", main=True),
    Unit("_m_s", "_m_s", 1.0, "Level rate, m/s"),
    Unit("_m", "_m", 1.0, "Tank level, m", main=True),
    Unit("_nm", "_mnm", 1e-6, "Moment, MN m"),
    Unit("_w", "_kw", 1e-3, "Pump power, kW"),
    Unit("_load", "_load_percent", 100.0, "Bus load, %"),
    Unit("_s", "_ms", 1e3, "Loop timing, ms"),
    Unit("", "", 1.0, "Counts"),
)


@dataclass(frozen=True, slots=True)
class Field:
    """One column as it is recorded.

    Attributes
    ----------
    name : str
        Name in the recording, unit included.
    label : str
        Name for people; the plot's title has the unit.
    unit : Unit
    """

    name: str
    label: str
    unit: Unit


def field_of(column: str) -> Field:
    """Return how a column is recorded and shown.

    Raises
    ------
    ValueError
        If the name says that the values are not in SI units.
    """
    unit = next(unit for unit in UNITS if column.endswith(unit.suffix))
    stem = column.removesuffix(unit.suffix)
    name = stem + unit.shown_suffix
    if column_of(name) != (column, unit):
        raise ValueError(f"telemetry column {column!r}: columns are in SI units")
    return Field(name, stem.replace("_", " "), unit)


def column_of(name: str) -> tuple[str, Unit]:
    """Return the column, and its unit, that a recorded field's name stands for."""
    unit = next(unit for unit in UNITS if name.endswith(unit.shown_suffix))
    return name.removesuffix(unit.shown_suffix) + unit.suffix, unit
