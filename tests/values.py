"""Values that nobody changes, as the controller's measurements: copies with other fields."""

from typing import Any, TypeVar

T = TypeVar("T")


def changed(value: T, **changes: Any) -> T:
    """A copy with other fields; their names are those of the class's arguments."""
    return type(value)(**vars(value) | changes)
