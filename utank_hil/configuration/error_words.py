"""Words for values that a configuration can't take, and valid keys near misspelt ones."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields, is_dataclass
from datetime import date
from difflib import get_close_matches
from types import NoneType, UnionType
from typing import Annotated, Any, Final, Literal, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel


def instead_of(model: type[BaseModel], location: tuple[str | int, ...]) -> str:
    """Return advice for an unknown key of a model: the one it resembles, one of a section, or all.

    `location` is the key as a validation error gives it, with the kinds of sections chosen by kind.
    """
    *parents, written = location
    known = sorted(known_keys(model, parents))
    near = nearest(str(written), known)
    below = [name for name in known if not near and written in known_keys(model, (*parents, name))]
    if len(below) == 1:
        near = f"{below[0]}.{written}"
    return f"; did you mean {near}?" if near else _keys(model, parents)


def _keys(model: type[BaseModel], location: Iterable[str | int]) -> str:
    """Return the keys of a place for the end of a message; empty if there are none or many."""
    known = sorted(known_keys(model, location))
    return f"; its keys are {', '.join(known)}" if 0 < len(known) <= _FEW_KEYS else ""


def nearest(written: str, known: Sequence[str]) -> str | None:
    """Return the known word most similar to a misspelt one; None if none resembles it."""
    without_unit = [name for name in known if written and name.startswith(f"{written}_")]
    found = without_unit or get_close_matches(written, known, n=1, cutoff=0.8)
    return found[0] if found else None


def known_keys(model: type[BaseModel], location: Iterable[str | int]) -> set[str]:
    """Return the valid keys of a place, in any kind of section that may stand there."""
    return {name for place in _places(model, location) for name in _members(place)}


def choices_at(
    model: type[BaseModel], location: Iterable[str | int], key: str | int = "kind"
) -> list[str]:
    """Return the words that a key of a place may have, if it has one of a few."""
    hints = (_members(place).get(str(key)) for place in _places(model, location))
    chosen = (get_args(hint) for hint in hints if get_origin(hint) is Literal)
    return list(dict.fromkeys(str(word) for each in chosen for word in each))


def _places(model: type[BaseModel], location: Iterable[str | int]) -> list[Any]:
    """Return the models of a place: sections, each kind of them alone."""
    places: list[Any] = [model]
    for part in location:
        places = [inner for place in places for inner in _inside(place, part)]
    return [kind for place in places for kind in _alone(place)]


def _alone(place: Any) -> Iterator[Any]:
    """Return the members of a union, without the marks on them."""
    origin, arguments = get_origin(place), get_args(place)
    if origin is Annotated:
        yield from _alone(arguments[0])
    elif origin in (Union, UnionType):
        for kind in arguments:
            yield from _alone(kind)
    elif place is not NoneType:
        yield place


def _members(place: Any) -> dict[str, Any]:
    """Return the annotations of a section's keys, without the marks on them."""
    if get_origin(place) in (Union, UnionType):
        return {name: hint for kind in get_args(place) for name, hint in _members(kind).items()}
    if model_fields := getattr(place, "model_fields", None):  # of pydantic
        return {field.alias or name: field.annotation for name, field in model_fields.items()}
    if isinstance(place, type) and is_dataclass(place):
        hints = get_type_hints(place)
        return {field.name: hints[field.name] for field in fields(place) if field.init}
    return {}


def _inside(place: Any, part: str | int) -> Iterator[Any]:
    """Return the annotation at a key or index, or of the kind of that name."""
    origin, arguments = get_origin(place), get_args(place)
    if origin is Annotated:
        yield from _inside(arguments[0], part)
    elif origin in (Union, UnionType):
        # The place is a kind, or another key and its value.
        key, _, value = str(part).rpartition(" ")
        members = [*_alone(place)]
        chosen = [each for each in members if value in get_args(_members(each).get(key or "kind"))]
        if chosen:
            yield from chosen
        else:
            for each in members:
                yield from _inside(each, part)
    elif origin is dict:
        yield arguments[1]
    elif origin in (tuple, list):
        yield arguments[0]
    elif origin is not Literal and part in _members(place):
        yield _members(place)[str(part)]


_NUMBER: Final = "a number"
_WHOLE: Final = "a whole number"
_FEW_KEYS: Final = 10  #: Most keys that a message lists.
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

_LONGEST = 60  #: Characters of a value that fit on a line.


def words_for(error: Any, model: type[BaseModel]) -> str:
    """Describe an error of `ValidationError.errors` of the whole configuration, a `model`."""
    kind, value, context = error["type"], error["input"], error.get("ctx", {})
    if kind == "missing":
        *parents, key = error["loc"]
        choices = choices_at(model, parents, key)
        return "is required but missing" + (f": one of {', '.join(choices)}" if choices else "")
    if kind in ("extra_forbidden", "unexpected_keyword_argument"):
        return "is not a known key" + instead_of(model, error["loc"])
    if kind == "union_tag_not_found":
        return f"needs the key kind: one of {', '.join(choices_at(model, error['loc']))}"
    if kind == "union_tag_invalid":
        tag = context["tag"]
        return f"must be {_one_of(context, 'expected_tags', tag)} (got {_short(tag)!r})"
    if kind in ("enum", "literal_error"):
        return f"must be {_one_of(context, 'expected', value)} (got {_shown(value)})"
    if kind in ("too_short", "too_long"):
        most = kind == "too_long"
        bound = f"{context['max_length']} at most" if most else f"{context['min_length']} or more"
        return f"must have {bound}, got {len(value)}"
    if kind in WANTED:
        wanted = WANTED[kind]
        keys = _keys(model, error["loc"]) if wanted is _MAPPING else ""
        return f"must be {wanted}, got {_shown(value)}{_remedy(wanted, value)}{keys}"
    words = str(error["msg"]).removeprefix("Value error, ")
    if isinstance(value, dict | list | tuple | BaseModel):
        return words
    if isinstance(value, str) and value and words.startswith(value):
        return words  # a file is named by its reader
    return f"{words} (got {_short(repr(value))})"


def _one_of(context: Any, key: str, written: Any) -> str:
    """Return the choices of an error, and the probably intended one."""
    choices = re.findall(r"'([^' ]*)'", context[key]) or re.findall(r"-?\d+", context[key])
    near = nearest(str(written).lower(), choices)
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
    if wanted == _NUMBER and isinstance(value, dict) and len(value) == 1:
        (number,) = value.values()
        return f": write {number:g} alone" if isinstance(number, int | float) else ""
    if wanted == _MAPPING and isinstance(value, str):
        return ", or the name of a file that ends with .yaml"
    if wanted not in (_NUMBER, _WHOLE) or not isinstance(value, str):
        return ""
    if re.fullmatch(r"\s*[-+]?\d+,\d+\s*", value):
        return f": write a decimal point, {value.strip().replace(',', '.')}"
    try:
        return f": write {float(value):.15g}, without quotes"
    except ValueError:
        pass
    if re.fullmatch(r"\s*[-+]?\d+(\.\d*)?\s*%\s*", value):
        return f": write it as a share, {float(value.strip().rstrip('%')) / 100:.12g}"
    if re.match(r"\s*[-+]?\.?\d", value):
        return ": write the number alone, in the unit that the key ends with"
    return ""


def _short(text: str) -> str:
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."
