"""Valid keys of a place in a configuration file, for advice on misspelt ones."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields, is_dataclass
from difflib import get_close_matches
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel


def instead_of(model: type[BaseModel], location: tuple[str | int, ...]) -> str:
    """Return advice for an unknown key of a model; empty if none resembles it.

    `location` is the key as a validation error gives it, with the kinds of sections chosen by kind.
    """
    *parents, written = location
    near = nearest(str(written), sorted(known_keys(model, parents)))
    return f"; did you mean {near}?" if near else ""


def nearest(written: str, known: Sequence[str]) -> str | None:
    """Return the known word most similar to a misspelt one; None if none resembles it."""
    without_unit = [name for name in known if written and name.startswith(f"{written}_")]
    found = without_unit or get_close_matches(written, known, n=1, cutoff=0.8)
    return found[0] if found else None


def known_keys(model: type[BaseModel], location: Iterable[str | int]) -> set[str]:
    """Return the valid keys of a place, in any kind of section that may stand there."""
    return {name for place in _places(model, location) for name in _members(place)}


def kinds_at(model: type[BaseModel], location: Iterable[str | int]) -> list[str]:
    """Return the kinds of sections that may stand at a place."""
    kinds = (get_args(_members(place).get("kind")) for place in _places(model, location))
    return list(dict.fromkeys(kind for each in kinds for kind in each))


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
    if isinstance(place, type) and issubclass(place, BaseModel):
        return {field.alias or name: field.annotation for name, field in place.model_fields.items()}
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
