"""Words for values that a configuration can't take, in one table."""

import re
from datetime import date
from typing import Any, Final

from pydantic import BaseModel

from utank_hil.configuration.known_keys import instead_of, kinds_at, nearest

_NUMBER: Final = "a number"
_WHOLE: Final = "a whole number"
_MAPPING: Final = "a mapping of keys to values"
_TIME: Final = "a date and time such as 2019-02-10T05:40"

WANTED: Final = {
    **dict.fromkeys(("number_type", "float_type", "float_parsing"), _NUMBER),
    **dict.fromkeys(("int_type", "int_parsing", "int_parsing_size", "int_from_float"), _WHOLE),
    **dict.fromkeys(("bool_type", "bool_parsing"), "true or false"),
    **dict.fromkeys(("dataclass_type", "model_type", "model_attributes_type"), _MAPPING),
    **dict.fromkeys(("dict_type", "mapping_type"), _MAPPING),
    **dict.fromkeys(("tuple_type", "list_type"), "a list"),
    **dict.fromkeys(("datetime_type", "datetime_parsing", "datetime_object_invalid"), _TIME),
    "datetime_from_date_parsing": _TIME,
    "finite_number": "a finite number",
    "string_type": "text",
    "path_type": "the path of a file",
}
"""Description of a valid value, by the type of the validation error."""

_LONGEST = 60


def words_for(error: Any, model: type[BaseModel]) -> str:
    """Describe an error of validation, one of `ValidationError.errors`, for the reader of a file.

    `model` is that of the whole configuration.
    """
    kind, value, context = error["type"], error["input"], error.get("ctx", {})
    if kind == "missing":
        return "is required but missing"
    if kind in ("extra_forbidden", "unexpected_keyword_argument"):
        return "is not a known key" + instead_of(model, error["loc"])
    if kind == "union_tag_not_found":
        return f"needs the key kind: one of {', '.join(kinds_at(model, error['loc']))}"
    if kind == "union_tag_invalid":
        return f"must be {_one_of(context, 'expected_tags')} (got {_short(context['tag'])!r})"
    if kind in ("enum", "literal_error"):
        return f"must be {_one_of(context, 'expected')} (got {_shown(value)})"
    if kind in ("too_short", "too_long"):
        most = kind == "too_long"
        bound = f"{context['max_length']} at most" if most else f"{context['min_length']} or more"
        return f"must have {bound}, got {len(value)}"
    if kind in WANTED:
        return f"must be {WANTED[kind]}, got {_shown(value)}{_remedy(WANTED[kind], value)}"
    words = str(error["msg"]).removeprefix("Value error, ")
    if isinstance(value, dict | list | tuple | BaseModel):
        return words
    return f"{words} (got {_short(repr(value))})"


def _one_of(context: Any, key: str) -> str:
    """Return the choices of an error, and the probably intended one."""
    choices = re.findall(r"'([^' ]*)'", context[key])
    near = nearest(str(context.get("tag", "")).lower(), choices)
    return f"one of {', '.join(choices)}" + (f"; did you mean {near}?" if near else "")


def _shown(value: Any) -> str:
    """Return a value as its writer recognizes it."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true or yes" if value else "false or no"
    if isinstance(value, dict):
        return "a mapping of keys to values"
    if isinstance(value, list | tuple):
        return "a list"
    if isinstance(value, date):
        return f"the date {value.isoformat()}"
    return _short(repr(value))


def _remedy(wanted: str, value: Any) -> str:
    """Return how to write a value validly; empty if that is unknown."""
    if wanted == "text":
        return ": put it in quotes" if isinstance(value, bool | int | float | date) else ""
    if wanted not in (_NUMBER, _WHOLE) or not isinstance(value, str):
        return ""
    if re.fullmatch(r"\s*[-+]?\d+,\d+\s*", value):
        return f": write a decimal point, {value.strip().replace(',', '.')}"
    try:
        return f": write {float(value):.15g}, without quotes"
    except ValueError:
        pass
    if re.match(r"\s*[-+]?\.?\d", value):
        return ": write the number alone, in the unit that the key ends with"
    return ""


def _short(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."
