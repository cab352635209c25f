"""Values within mappings and lists, as of a configuration or of JSON."""

import math
from collections.abc import Callable, Mapping
from typing import Any


def mapped(value: Any, change: Callable[[Any], Any]) -> Any:
    """A value with each one changed that is in it, and is neither mapping, list nor tuple."""
    if isinstance(value, Mapping):
        return {key: mapped(each, change) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [mapped(each, change) for each in value]
    return change(value)


def finite(value: Any) -> Any:
    """A value with None in the place of each number that JSON does not know: not finite."""
    return mapped(value, lambda x: None if isinstance(x, float) and not math.isfinite(x) else x)
