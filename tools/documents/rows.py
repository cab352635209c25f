"""What every table is made of."""

from collections.abc import Callable
from typing import Any

Rows = list[list[str]]  # the heading first
Table = tuple[str, Callable[[Any], Rows]]
"""The part of the evidence it is made from, and how."""


def number(value: float | None, form: str) -> str:
    """A number as written; nothing where there is none."""
    return "" if value is None else format(value, form)


def share(value: dict[str, float]) -> str:
    """A share in per cent with its interval."""
    half = value.get("half_width")
    return f"{value['mean']:.0%}" + ("" if half is None else f" ± {100 * half:.0f}")


def points(value: dict[str, float]) -> str:
    """A difference in per cent with its interval."""
    return f"{100 * value['mean']:.1f} ± {100 * value['half_width']:.1f}"
