"""Part of a record between two times."""

import math
from typing import Final

Between = tuple[float, float]  #: First and last time, s.
ALWAYS: Final = (-math.inf, math.inf)


def between(first_s: float | None, last_s: float | None) -> Between:
    """The part from one time to another, either of which may be left out."""
    return -math.inf if first_s is None else first_s, math.inf if last_s is None else last_s
