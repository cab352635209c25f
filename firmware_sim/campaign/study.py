"""Studies (``configs/studies``): the cases of a scenario that a campaign computes."""

import hashlib
import importlib.metadata
import itertools
import json
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from datetime import date
from functools import cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import Field, ValidationError, model_validator

from firmware_sim.campaign.axes import MOST_CASES, Axis, Draws
from firmware_sim.scenario import Scenario
from utank_hil.base.parameters import ParameterError, Positive, Range, refuse
from utank_hil.configuration import Section
from utank_hil.configuration.error_words import known_keys, nearest
from utank_hil.configuration.files import (
    ALLOW_CODE,
    ConfigError,
    ConfigProblem,
    files_named,
    load_config,
    located,
    problems_in_words,
)
from utank_hil.configuration.yaml_text import Key

METRICS: Final = {
    "roll_rms_rad": "root mean square of the roll",
    "roll_significant_rad": "significant single amplitude of the roll",
    "roll_max_rad": "greatest roll",
    "roll_below_no_tank": "share by which the roll RMS is less than without a tank",
    "roll_below_passive": "share by which the roll RMS is less than with the passive tank",
    "level_peak_m": "greatest deviation of a reservoir's level",
    "pressure_rms_pa": "root mean square of the pump's pressure",
    "pressure_peak_pa": "greatest pressure of the pump",
    "power_mean_w": "mean power drawn; of the shaft, in the linear simulation into the water",
    "power_peak_w": "greatest power drawn",
    "strikes": "how often the water struck a limit of its level",
    "active_share": "share of the time in which the controller was in charge",
}  #: Meaning of each metric's column over the scenario's window; NaN where it does not apply.

_PACKAGES: Final = ("utank_hil", "firmware_sim")
_SUFFIXES: Final = (".py", ".dbc")
_NUMERICAL: Final = ("numpy", "scipy", "numba")
_ROOT: Final = Path(__file__).resolve().parents[2]
_DIGITS: Final = 24
"""Hexadecimal digits of a hash: 96 bits, without collisions among a million cases."""
_PATH: Final = re.compile(r'"([^"\\]*/[^"\\]*)"')
_WAVES: Final = ("sea", "voyage", "duration_s", "settle_s")


@cache
def code_digest() -> str:
    """Hash of the program's files and of the versions of the numerical packages."""
    whole = hashlib.sha256()
    for package in _PACKAGES:
        files = (file for file in (_ROOT / package).rglob("*") if file.suffix in _SUFFIXES)
        for file in sorted(files):
            content = file.read_bytes()
            name = file.relative_to(_ROOT).as_posix()
            whole.update(f"{name}\n{len(content)}\n".encode() + content)
    for name in _NUMERICAL:
        whole.update(f"{name} {importlib.metadata.version(name)}\n".encode())
    return whole.hexdigest()[:_DIGITS]


def case_name(simulation: str, content: dict[str, Any]) -> str:
    """Name of a case: a hash of the scenario's content, its seed and its data files."""
    return _digest([simulation, content, code_digest()])


def waves_name(content: dict[str, Any]) -> str:
    """Hash of a scenario's waves and of the span that is judged.

    Runs with the same name met the same waves and are compared pair by pair.
    """
    return _digest([{key: content.get(key) for key in _WAVES}, content.get("seed", 1)])


def as_text(content: Any) -> str:
    """Content as JSON in canonical form."""
    return json.dumps(content, sort_keys=True, default=_plain)


def _digest(content: Any) -> str:
    text = _PATH.sub(lambda found: _file_digest(found[1]) or found[0], as_text(content))
    return hashlib.sha256(text.encode()).hexdigest()[:_DIGITS]


@cache
def _file_digest(name: str) -> str:
    file = Path(name)
    return hashlib.sha256(file.read_bytes()).hexdigest() if file.is_file() else ""


def _plain(value: Any) -> str:
    if isinstance(value, date):
        return value.isoformat()
    raise TypeError(f"{type(value).__name__} is no content of a configuration")


Content = dict[str, Any]
WHOLE: Final = "scenario"  #: Key whose value replaces the whole scenario.
_VESSEL: Final = "vessel"
_EVERY: Final = "*"


class OverrideError(ValueError):
    """Error for a key that the scenario does not have; the message begins with a verb."""

    key: str  #: The override that names it, in `changed`.


def changed(content: Content, values: Mapping[str, Any]) -> Content:
    """Return a copy of a scenario's content with other values at some dotted keys.

    ``*`` stands for every name, as in ``controllers.*.limits.pressure_pa``. A key of ``vessel``
    also applies to the controllers of the same ship; ``actual_ship`` changes the ship alone and not
    the controllers' model of it. Values are applied in order; `WHOLE` replaces the content. Raises
    `OverrideError` if a key leads into a value, or to a name that does not exist.
    """
    new: Content = values.get(WHOLE, content)
    for key, value in values.items():
        try:
            for path in [] if key == WHOLE else list(_paths(new, key.split("."))):
                new = _with(new, path, value)
        except OverrideError as error:
            error.key = key
            raise
    return new


def _paths(content: Content, path: list[str]) -> Iterator[list[str]]:
    """Yield the paths that a key with ``*`` matches."""
    if _EVERY in path:
        at, names = path.index(_EVERY), content
        for part in path[:at]:
            names = names[int(part)] if isinstance(names, list) else names.get(part, {})
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
    *above, name = path
    known = known_keys(Scenario, above)
    if name in known:
        return
    there = sorted(known) or sorted(place)
    near = nearest(name, there)
    advice = f"did you mean {near}?" if near else f"there are {', '.join(there) or 'none'}"
    raise OverrideError(f"names {'.'.join(path)}, which is not there; {advice}")


Scalar = str | float | int | bool
SEED: Final = "seed"


class Stop(Section):
    """Stopping rule for a group of cases.

    The interval is computed over the first cases of the group in their order, so it does not depend
    on which cases return first.
    """

    metric: str  #: Column of the results whose interval is judged.
    half_width: Positive | None = None
    """Largest half width of the 95 % confidence interval, in the metric's unit."""
    relative: Positive | None = None
    """Largest half width as a share of the mean, instead of `half_width`."""
    least: Annotated[int, Range(least=3)] = 10  #: Least number of cases computed.

    @model_validator(mode="after")
    def _one_measure(self) -> "Stop":
        problems = []
        if self.metric not in METRICS:
            problems.append(("metric", f"must be one of {', '.join(METRICS)}"))
        if (self.half_width is None) == (self.relative is None):
            problems.append(("half_width", "or relative: give one of the two"))
        refuse("stop", problems)
        return self


class Study(Section):
    """Scenario and the keys that are varied in it."""

    noun: ClassVar = "study"

    name: str
    scenario: Content  #: Scenario file that is varied.
    simulation: Literal["bus", "linear", "nonlinear"]
    """Kind of simulation, which determines the effects that are left out."""
    set: Content = Field(default_factory=dict)  #: Values by dotted key that apply to every case.
    cases: Annotated[tuple[Content, ...], Field(min_length=1)] = ({},)
    """Sets of values by dotted key; each set is combined with all of `grid`."""
    grid: dict[str, Axis] = Field(default_factory=dict)
    """Lists of values by dotted key; all combinations are computed."""
    random: Draws | None = None  #: Random samples, each combined with all of `cases` and `grid`.
    average_over: tuple[str, ...] = (SEED,)
    """Keys that are averaged over and define no group; drawn keys always belong to them."""
    stop: Stop | None = None  #: Rule by which a group needs no more cases.

    @model_validator(mode="after")
    def _consistent(self) -> "Study":
        count = len(self.cases) * (self.random.samples if self.random else 1)
        for values in self.grid.values():
            count *= len(values)
        problems = []
        if count > MOST_CASES:
            problems.append(("grid", f"makes {count} cases; {MOST_CASES} at most"))
        drawn = self.random.samples_drawn()[0] if self.random else {}
        sources = {"set": self.set, "grid": self.grid, "random.keys": drawn}
        sources |= {f"cases.{index}": each for index, each in enumerate(self.cases)}
        for (name, keys), (other, others) in itertools.combinations(sources.items(), 2):
            if name.startswith("cases") and other.startswith("cases"):
                continue
            problems += [
                (f"{other}.{key}", f"is in {name}, too: remove one")
                for key in sorted(set(keys) & set(others))
            ]
        refuse("", problems)
        return self


@dataclass(frozen=True, slots=True)
class Case:
    """One case of a study."""

    index: int
    name: str  #: Hash of configuration, seed and code.
    waves: str  #: Hash of what determines the waves.
    seed: int
    group: tuple[Scalar, ...]  #: Values of the keys that define groups.
    #: Varied keys with their values, or the names of files that stand for them.
    parameters: dict[str, Scalar]
    values: Content  #: Overrides of the study's scenario by dotted key.


@dataclass(frozen=True, slots=True)
class LoadedStudy:
    """Study with its cases."""

    path: Path
    study: Study
    cases: list[Case]
    keys: tuple[str, ...]  #: Keys that define groups.
    allow_code: bool  #: Whether laws may be code that the files name.

    def scenario_of(self, case: Case) -> Scenario:
        """Scenario of a case."""
        content = changed(self.study.scenario, case.values)
        return Scenario.model_validate(content, context={ALLOW_CODE: self.allow_code})


def load_study(path: Path, *, allow_code: bool = False) -> LoadedStudy:
    """Read a study and list its cases.

    The first case with each set of keys is validated completely; a later invalid case fails alone.
    The parameter `allow_code` is that of `load_config`. Raises `ConfigError` if the study, its
    scenario or one of its keys is invalid.
    """
    study = load_config(path, Study)
    files = files_named(path)
    axes = _axes(study, files)
    averaged = {*study.average_over, *(study.random.samples_drawn()[0] if study.random else ())}
    varied = list(dict.fromkeys(key for axis in axes for each in axis for key in each))
    for key in study.average_over:
        if key != SEED and key not in varied:
            problem = f"names {key}, which is not varied"
            raise ConfigError([ConfigProblem(path, "average_over", problem)])
    # averaged keys vary slowest: every group has its first cases early
    axes.sort(key=lambda axis: any(key not in averaged for each in axis for key in each))
    keys = tuple(key for key in varied if key not in averaged)
    cases = []
    checked = set()
    for index, parts in enumerate(itertools.product(*axes)):
        given = {key: each for part in parts for key, each in part.items()}
        values = {**study.set, **{key: value for key, (value, _) in given.items()}}
        parameters = {key: label for key, (_, label) in given.items()}
        try:
            content = changed(study.scenario, values)
        except OverrideError as error:
            refused = ConfigProblem(path, _place(study, error.key), str(error))
            raise ConfigError([refused]) from error
        cases.append(
            Case(
                index,
                case_name(study.simulation, content),
                waves_name(content),
                content.get(SEED, 1),
                tuple(parameters.get(key, "") for key in keys),
                parameters,
                values,
            )
        )
        kind = (parameters.get(WHOLE), frozenset(values))
        if kind not in checked:
            checked.add(kind)
            _check(path, study, values, content, allow_code=allow_code)
    return LoadedStudy(path, study, cases, keys, allow_code)


def _axes(study: Study, files: Mapping[Key, Path]) -> list[list[dict[str, tuple[Any, Scalar]]]]:
    """Varied axes, each a list of alternatives: values and their labels by key."""

    def labelled(value: Any, at: Key) -> tuple[Any, Scalar]:
        if at in files:
            return value, files[at].stem
        if isinstance(value, str | float | int):
            return value, value
        return value, value.isoformat() if isinstance(value, date) else as_text(value)

    axes = [
        [
            {key: labelled(value, ("cases", index, key)) for key, value in each.items()}
            for index, each in enumerate(study.cases)
        ]
    ]
    if study.random is not None:
        samples = study.random.samples_drawn()
        axes.append([{key: labelled(each[key], ()) for key in each} for each in samples])
    axes += [
        [{key: labelled(value, ("grid", key, place))} for place, value in enumerate(values)]
        for key, values in study.grid.items()
    ]
    return [axis for axis in axes if any(axis)]


def _check(
    path: Path, study: Study, values: Content, content: Content, *, allow_code: bool
) -> None:
    """Refuse an invalid case, with each problem at the place where its value was written."""
    try:
        Scenario.model_validate(content, context={ALLOW_CODE: allow_code})
        return
    except ValidationError as error:
        found = problems_in_words(error, content, Scenario)
    problems: list[ConfigProblem] = []
    for key, reason in found:
        dotted = ".".join(map(str, key))
        if (written := _override_of(values, dotted)) is not None:
            place = _place(study, written)
            inner = "" if dotted == written else f"{dotted}: "
            problems.append(ConfigProblem(path, place, inner + reason))
        elif WHOLE in values:
            problems.append(ConfigProblem(path, _place(study, WHOLE), f"{dotted}: {reason}"))
        else:
            there = f"{WHOLE}.{dotted}".rstrip(".")
            problems += located(ParameterError("", [(there, reason)]), path).problems
    raise ConfigError(list(dict.fromkeys(problems)))


def _override_of(values: Iterable[str], dotted: str) -> str | None:
    """Override that set a key of the scenario, or a part of it."""

    def matches(written: str) -> bool:
        shorter = min(len(written.split(".")), len(dotted.split(".")))
        pairs = itertools.islice(zip(written.split("."), dotted.split("."), strict=False), shorter)
        return bool(dotted) and all(one in (other, "*") for one, other in pairs)

    inner = dotted.split(".vessel.", 1)
    controllers = dotted.startswith("controllers.") and len(inner) == 2
    others = (f"vessel.{inner[1]}",) if controllers else ()
    for key in values:
        if matches(key) or any(other.startswith(key) for other in others):
            return key
    return None


def _place(study: Study, key: str) -> str:
    """Place in a study's file where the value of a key is written."""
    places: dict[str, Iterable[str]] = {"set": study.set, "grid": study.grid}
    if study.random is not None:
        places["random.keys"] = study.random.keys
        if study.random.table is not None:
            places["random.table"] = study.random.samples_drawn()[0]
    places |= {f"cases.{index}": each for index, each in enumerate(study.cases)}
    return next((f"{name}.{key}" for name, keys in places.items() if key in keys), key)
