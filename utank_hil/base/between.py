"""Part of a record between two times."""

import math
from typing import Final

Between = tuple[float, float]  #: First and last time, s.
ALWAYS: Final = (-math.inf, math.inf)
