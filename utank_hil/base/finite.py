"""Numbers for JSON, which knows neither infinity nor what is not a number."""

import math
from collections.abc import Mapping
from typing import Any


def finite(value: Any) -> Any:
    """A value with None in the place of each number in it that is not finite."""
    if isinstance(value, Mapping):
        return {str(key): finite(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [finite(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
