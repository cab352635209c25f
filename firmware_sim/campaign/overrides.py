"""Changes to a scenario's content by dotted keys, such as ``vessel.ship.gm_m``."""

from collections.abc import Iterator, Mapping
from typing import Any, Final

from firmware_sim.scenario import Scenario
from utank_hil.configuration.known_keys import known_keys, nearest

Content = dict[str, Any]
WHOLE: Final = "scenario"  #: Key whose value replaces the whole scenario.
_VESSEL: Final = "vessel"
_EVERY: Final = "*"


class OverrideError(ValueError):
    """Error for a key that the scenario does not have; the message begins with a verb."""


def changed(content: Content, values: Mapping[str, Any]) -> Content:
    """Return a copy of a scenario's content with other values at some dotted keys.

    ``*`` stands for every name, as in ``controllers.*.limits.pressure_pa``. A key of ``vessel``
    also applies to the controllers of the same ship; ``actual_ship`` changes the ship alone and not
    the controllers' model of it. Values are applied in order; `WHOLE` replaces the content. Raises
    `OverrideError` if a key leads into a value, or to a name that does not exist.
    """
    new: Content = values.get(WHOLE, content)
    for key, value in values.items():
        if key != WHOLE:
            for path in list(_paths(new, key.split("."))):
                new = _with(new, path, value)
    return new


def _paths(content: Content, path: list[str]) -> Iterator[list[str]]:
    """Yield the paths that a key with ``*`` matches."""
    if _EVERY in path:
        at = path.index(_EVERY)
        names = _inside(content, path[:at])
        if not isinstance(names, dict) or not names:
            raise OverrideError(f"stands for nothing: {'.'.join(path[:at])} has no names")
        for name in names:
            yield from _paths(content, [*path[:at], name, *path[at + 1 :]])
        return
    if path[0] == _VESSEL:
        vessel = content.get(_VESSEL)
        for name, controller in content.get("controllers", {}).items():
            if isinstance(controller, dict) and controller.get(_VESSEL) == vessel:
                yield ["controllers", name, *path]
    yield path


def _inside(content: Any, path: list[str]) -> Any:
    for part in path:
        content = content[int(part)] if isinstance(content, list) else content.get(part, {})
    return content


def _with(place: Any, path: list[str], value: Any, depth: int = 0) -> Any:
    """Return a copy of a section, down to the end of the path, with the new value there."""
    if depth == len(path):
        return value
    part, above = path[depth], ".".join(path[:depth])
    if isinstance(place, list):
        if not (part.isdecimal() and int(part) < len(place)):
            raise OverrideError(f"names item {part} of {above}, which has {len(place)}")
        inner = _with(place[int(part)], path, value, depth + 1)
        return [*place[: int(part)], inner, *place[int(part) + 1 :]]
    if not isinstance(place, dict):
        raise OverrideError(f"leads into {above}, which is a value and has no keys")
    if part not in place and depth < len(path) - 1:
        _refuse_stranger(place, path[: depth + 1])
    return {**place, part: _with(place.get(part, {}), path, value, depth + 1)}


def _refuse_stranger(place: Content, path: list[str]) -> None:
    """Refuse a key that the schema does not allow; a missing allowed section may be created."""
    *above, name = path
    known = known_keys(Scenario, above)
    if name in known:
        return
    there = sorted(known) or sorted(place)
    near = nearest(name, there)
    advice = f"did you mean {near}?" if near else f"there are {', '.join(there) or 'none'}"
    raise OverrideError(f"names {'.'.join(path)}, which is not there; {advice}")
