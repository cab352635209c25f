"""A figure of the source: curves, printed numbers beside ours, and its text's statements judged."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any, Final

import numpy as np
import numpy.typing as npt

MOST_CURVES: Final = 4  #: Curves of one panel that can still be distinguished.


class Verdict(StrEnum):
    """Whether a statement of the text holds."""

    HOLDS = "holds"
    PARTLY = "holds in part"
    FAILS = "does not hold"
    OPEN = "can't be judged"

    @classmethod
    def of(cls, holds: bool) -> "Verdict":
        """`HOLDS` or `FAILS`."""
        return cls.HOLDS if holds else cls.FAILS

    @classmethod
    def of_all(cls, each: Iterable[bool]) -> "Verdict":
        """`HOLDS` if all do, `PARTLY` if some do."""
        held = list(each)
        return cls.HOLDS if all(held) else cls.PARTLY if any(held) else cls.FAILS


@dataclass(frozen=True, slots=True)
class Curve:
    """One curve of a panel."""

    label: str  #: Text in the legend.
    #: x, y: shape (n,): in the units of the panel's labels.
    x: npt.ArrayLike
    y: npt.ArrayLike
    marks: bool = False  #: Single points instead of a line.


@dataclass(frozen=True, slots=True)
class Panel:
    """One coordinate system of a figure.

    Raises `ValueError` if there are no curves, or too many.
    """

    title: str
    #: x_label, y_label: units included.
    x_label: str
    y_label: str
    curves: tuple[Curve, ...]  #: One to `MOST_CURVES`.
    log_x: bool = False
    log_y: bool = False
    span: tuple[float, float] | None = None  #: Abscissae to highlight.
    span_label: str = ""  #: What the highlight means.
    y_limits: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if not 1 <= len(self.curves) <= MOST_CURVES:
            raise ValueError(
                f"panel {self.title!r} must have 1 to {MOST_CURVES} curves, got {len(self.curves)}"
            )


def panel_of(
    title: str,
    x_label: str,
    y_label: str,
    x: npt.ArrayLike,
    family: Mapping[str, Any],
    **options: Any,
) -> Panel:
    """Panel with a curve for each member of a family, over the same abscissae."""
    curves = tuple(Curve(name, x, y) for name, y in family.items())
    return Panel(title, x_label, y_label, curves, **options)


@dataclass(frozen=True, slots=True)
class Row:
    """A printed number beside ours."""

    quantity: str
    unit: str
    #: A number, or the ends of a range; the upper one infinite for "or more".
    printed: float | tuple[float, float]
    ours: float | None  #: None where the source gives too little to make it.
    reason: str  #: Why ours deviates, or why there is none.

    @property
    def deviation(self) -> float | None:
        """Relative deviation; 0 within a printed range, from its nearer end outside."""
        if self.ours is None:
            return None
        ends = self.printed if isinstance(self.printed, tuple) else (self.printed, self.printed)
        nearest = min(max(self.ours, ends[0]), ends[1])
        return 0.0 if self.ours == nearest else self.ours / nearest - 1


@dataclass(frozen=True, slots=True)
class Check:
    """A statement of the text about a figure, judged."""

    statement: str
    verdict: Verdict
    measured: str  #: What it was judged by.


@dataclass(frozen=True, slots=True)
class Table:
    """What cells show better than curves."""

    headings: tuple[str, ...]  #: Units included.
    rows: tuple[tuple[str, ...], ...]  #: As many cells each as there are headings.


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure, or a group of printed numbers, made anew."""

    method: str  #: How ours was made.
    open_points: str  #: What the source leaves open, and what was assumed or varied.
    panels: tuple[Panel, ...] = ()
    rows: tuple[Row, ...] = ()
    checks: tuple[Check, ...] = ()
    columns: int = 2  #: Panels side by side.
    table: Table | None = None


def as_json(figure: Figure) -> dict[str, Any]:
    """Numbers, judgements and table of a figure, without its curves."""
    return {
        "method": figure.method,
        "open_points": figure.open_points,
        "rows": [
            {**asdict(row), "printed": _finite(row.printed), "deviation": row.deviation}
            for row in figure.rows
        ],
        "checks": [asdict(check) for check in figure.checks],
        "table": None if figure.table is None else asdict(figure.table),
    }


def _finite(printed: float | tuple[float, float]) -> Any:
    """A printed number for JSON, which knows no infinity: None for an open end."""
    if not isinstance(printed, tuple):
        return printed
    return [each if math.isfinite(each) else None for each in printed]


def printed_text(row: Row) -> str:
    """The printed number of a row as text."""
    if not isinstance(row.printed, tuple):
        return f"{row.printed:.5g}"
    low, high = row.printed
    if math.isinf(high):
        return f"{low:.5g} or more"
    return f"{low:.5g} to {high:.5g}" if low else f"less than {high:.5g}"


def greatest(rows: Iterable[Row]) -> str:
    """The greatest deviation of some rows as text; nothing where none is known."""
    known = [row.deviation for row in rows if row.deviation is not None]
    return f"{max(known, key=abs):+.2%}" if known else ""


def peaks(y: npt.ArrayLike) -> int:
    """Number of inner maxima of a curve."""
    slope = np.diff(np.asarray(y))
    return int(np.count_nonzero((slope[:-1] > 0) & (slope[1:] <= 0)))
