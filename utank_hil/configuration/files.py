"""Reader of configuration files: YAML that may name other YAML files, with errors at their place.

A value that is the name of a ``.yaml`` or ``.yml`` file stands for that file's content, and one
that begins with ``./`` or ``../``, or names a file beside it, is the path of a data file, as is
that of a key for one. Both are relative to the file they stand in. The key ``name`` of a file is
text, whatever it looks like. Every error carries file and key of the wrong value.
"""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Final, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError

from utank_hil.base.parameters import ParameterError, Problem
from utank_hil.base.text_files import open_text, refuse_device, where_instead
from utank_hil.configuration.error_words import known_keys, nearest, words_for
from utank_hil.configuration.yaml_text import Key, YamlError, parse_yaml

ModelT = TypeVar("ModelT", bound=BaseModel)

_LIMIT_BYTES: Final = 1 << 22  #: Largest file: four megabytes take half a minute to parse.
_SUFFIXES: Final = (".yaml", ".yml")
_OF_OTHERS: Final = (
    "dbc",
    "direction_file",
    "eds",
    "file",
    "profile",
    "roll_moment_table",
    "table",
)
"""Keys whose value is no file of this program."""
ALLOW_CODE: Final = "allow_code"  #: Key of the context: whether the file may name code to run.


class Section(BaseModel):
    """One mapping of a configuration file: unknown keys are errors, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    noun: ClassVar[str] = ""  #: Name of this kind of file in one word; empty for a part of files.

    def warnings(self) -> list[Problem]:
        """Return what is unusual but usable in the section, by keys within it."""
        return []


def readable(read: Callable[[Path], object]) -> AfterValidator:
    """Return the validator of a data file that a function must be able to read."""

    def checked(file: Path) -> Path:
        read(file)
        return file

    return AfterValidator(checked)


@dataclass(frozen=True, slots=True)
class ConfigProblem:
    """One problem of a configuration."""

    file: Path  #: File of the value.
    key: str  #: Dotted key within that file; empty for the file as a whole.
    reason: str  #: What is wrong with the value, and what is expected.

    def __str__(self) -> str:
        place = f"{self.file}: {self.key}" if self.key else str(self.file)
        return f"{place}: {self.reason}"


class ConfigError(ValueError):
    """A configuration can't be used; `problems` lists all of them, not just the first."""

    def __init__(self, problems: list[ConfigProblem]) -> None:
        super().__init__("\n".join(str(problem) for problem in problems))
        self.problems = problems


def load_config(path: Path | str, model: type[ModelT], *, allow_code: bool = False) -> ModelT:
    """Read and validate a configuration file with all the files it names.

    `allow_code` says whether the file may name code to run (a law of the kind python). ConfigError
    has every problem found: unreadable files, YAML errors, keys written twice, unknown or missing
    keys and values out of range. The content of an unreadable file is not reported missing.
    """
    reader = _Reader(path)
    reader.refuse_strangers(model)
    problems = reader.problems
    if () in reader.unread:
        raise ConfigError(problems)
    try:
        loaded = model.model_validate(reader.content, context={ALLOW_CODE: allow_code})
    except ValidationError as error:
        problems += [
            reader.problem(key, reason)
            for key, reason in problems_in_words(error, reader.content, model)
            if not reader.lost(key)
        ]
    except (ArithmeticError, MemoryError, RecursionError) as error:
        why = f"holds a number that overflows, or too many of them: {error}"
        problems.append(ConfigProblem(Path(path), "", why))
    if problems:
        raise ConfigError(problems)
    return loaded


def located(error: ParameterError, path: Path | str, key: str = "") -> ConfigError:
    """Return later problems of a configuration at the places where the values are written.

    The problems of `error` are named by their keys in the configuration, which stands in the file
    `path` at `key`, empty for the file as a whole.
    """
    reader = _Reader(path)
    return ConfigError(
        [reader.problem(_split(key) + _split(name), why) for name, why in error.problems]
    )


def files_named(path: Path | str) -> dict[Key, Path]:
    """Files that a configuration names, by keys; ConfigError if one can't be read."""
    reader = _Reader(path)
    if reader.problems:
        raise ConfigError(reader.problems)
    return {key: file for key, file in reader.origins.items() if key}


def problems_in_words(
    error: ValidationError, content: Any, model: type[BaseModel]
) -> list[tuple[Key, str]]:
    """Describe the problems of assembled content, by the keys within it."""
    problems: list[tuple[Key, str]] = []
    for item in error.errors():
        at = _written(item, content)
        if item["type"] == "union_tag_invalid":
            at = (*at, "kind")
        cause = item.get("ctx", {}).get("error")
        if isinstance(cause, ParameterError):
            problems += [(at + _split(name), reason) for name, reason in cause.problems]
        else:
            problems.append((at, words_for(item, model)))
    return problems


def kind_of(path: Path | str, models: dict[str, type[BaseModel]]) -> str:
    """Kind of a file by the keys that no other has; ConfigError if they decide for none."""
    reader = _Reader(path)
    if () in reader.unread:
        raise ConfigError(reader.problems)
    kind = _kind(reader.content, models)
    if kind is None:
        known = "; ".join(f"a {kind} has {', '.join(sorted(own))}" for kind, own in _own(models))
        reason = f"has the keys of no {', '.join(models)} alone: {known}"
        raise ConfigError([ConfigProblem(Path(path), "", reason)])
    return kind


def _own(models: dict[str, type[BaseModel]]) -> Iterator[tuple[str, set[str]]]:
    """Return the keys that only one of several models has, for each."""
    for kind, model in models.items():
        others = (other.model_fields for name, other in models.items() if name != kind)
        yield kind, set(model.model_fields).difference(*others)


def _kind(content: dict[str, Any], models: dict[str, type[BaseModel]]) -> str | None:
    """Return the model with most of its own keys in a content; None without a unique one."""
    found = {kind: len(own.intersection(content)) for kind, own in _own(models)}
    best = max(found.values())
    kinds = [kind for kind, count in found.items() if count == best]
    return kinds[0] if best and len(kinds) == 1 else None


def _nouns(base: type[Section] = Section) -> Iterator[tuple[str, type[Section]]]:
    """Return the models of whole files by their nouns."""
    for model in base.__subclasses__():
        if model.noun:
            yield model.noun, model
        yield from _nouns(model)


class _Reader:
    """Assembles the content of files and remembers where each part was written."""

    def __init__(self, path: Path | str) -> None:
        self.problems: list[ConfigProblem] = []
        self.unread: set[Key] = set()  #: Keys of the whole whose files could not be read.
        self.origins: dict[Key, Path] = {}  #: Files by the keys at which their content stands.
        self.content = self.read(Path(path))

    def lost(self, key: Key) -> bool:
        """Whether a key stands in a file that could not be read."""
        return any(key[: len(upper)] == upper for upper in self.unread)

    def read(
        self, file: Path, key: Key = (), stack: tuple[Path, ...] = (), namer: Key | None = None
    ) -> Any:
        """Return the content of a file, with that of the files it names.

        `key` is its place in the whole; the files of `stack` led to it; `namer` is the key of the
        value that names it.
        """
        try:
            resolved = file.resolve()
            with open_text(file, _LIMIT_BYTES) as content_of:
                text = content_of.read()
        except (OSError, RuntimeError, ValueError) as error:
            reason = f"can't be read: {_why(error).removeprefix(f'{file}: ')}"
            if isinstance(error, FileNotFoundError):
                reason += f"; {where_instead(file)}"
            if namer is None:
                return self._give_up(key, ConfigProblem(file, "", reason))
            where, within = self._within(namer)
            named = ConfigProblem(where, _dotted(within), f"names {file}, which {reason}")
            return self._give_up(key, named)
        if resolved in stack:
            reason = "includes itself; break the circle"
            return self._give_up(key, ConfigProblem(file, "", reason))
        try:
            content, findings = parse_yaml(text)
        except YamlError as error:
            return self._give_up(key, ConfigProblem(file, "", str(error)))
        for at, reason in findings:
            self.problems.append(ConfigProblem(file, _dotted(at), reason))
        if not isinstance(content, dict):
            reason = "must hold a mapping of keys to values"
            if content is None:
                reason = f"is empty and {reason}"
            return self._give_up(key, ConfigProblem(file, "", reason))
        self.origins[key] = file
        return self._resolve(content, key, file, (*stack, resolved))

    def refuse_strangers(self, model: type[BaseModel]) -> None:
        """Report files of another kind than they are named for."""
        for key, file in sorted(self.origins.items(), key=lambda item: len(item[0])):
            if self.lost(key):
                continue
            part = self.content
            for name in key:
                part = part[name]
            known = sorted(known_keys(model, key) - {"name", "kind"})
            own = [name for name in part if name not in ("name", "kind")]
            strange = [name for name in own if name not in known and not nearest(name, known)]
            open_ended = not key and model.model_config.get("extra") != "forbid"
            noun, wanted = "" if key else _kind(part, dict(_nouns())), getattr(model, "noun", "")
            if "controller" in (noun, wanted) and "controllers" in part:  # its model is not loaded
                noun = "scenario"
            another = noun and wanted and noun != wanted
            few = len(strange) <= len(own) - len(strange)
            if open_ended or not known or (few and not another):
                continue
            why = f"has the keys {', '.join(own)}; a file for this has {', '.join(known)}"
            if key:
                where, within = self._within(key[:-1])
                at_name = _dotted((*within, key[-1]))
                self.problems.append(ConfigProblem(where, at_name, f"names {file}, which {why}"))
            else:
                if another:
                    place = {"ship": "vessel", "controller": "controllers"}.get(wanted)
                    named = [each for at, each in self.origins.items() if at[:1] == (place,)]
                    its = f", such as its {named[0]}" if named else ""
                    why = f"is a {noun}, and a {wanted} is wanted{its}"
                self.problems.append(ConfigProblem(file, "", why))
            self.unread.add(key)

    def problem(self, key: Key, reason: str) -> ConfigProblem:
        """Return a problem at the place where the value of a key is written."""
        file, within = self._within(key)
        return ConfigProblem(file, _dotted(within), reason)

    def _give_up(self, key: Key, problem: ConfigProblem) -> dict[str, Any]:
        self.problems.append(problem)
        self.unread.add(key)
        self.origins.setdefault(key, problem.file)
        return {}

    def _resolve(self, value: Any, key: Key, file: Path, stack: tuple[Path, ...]) -> Any:
        if isinstance(value, dict):
            return {
                name: self._resolve(item, (*key, name), file, stack)
                for name, item in value.items()
                if isinstance(name, str)  # Other names have been reported.
            }
        if isinstance(value, list):
            return [
                self._resolve(item, (*key, index), file, stack) for index, item in enumerate(value)
            ]
        named = key[-1:] == ("name",) and key[:-1] in self.origins
        ours = isinstance(value, str) and value.lower().endswith(_SUFFIXES) and not named
        if ours and key[-1] not in _OF_OTHERS:
            return self.read(file.parent / value, key, stack, key)
        beside = isinstance(value, str) and "." in value and os.path.isfile(file.parent / value)
        if isinstance(value, str) and (value.startswith(("./", "../")) or (beside and not named)):
            try:
                refuse_device(file.parent / value)
            except (OSError, ValueError) as error:
                self.problems.append(self.problem(key, str(error)))
                self.unread.add(())  # A reader would wait for it.
            return str(file.parent / value)
        return value

    def _within(self, key: Key) -> tuple[Path, Key]:
        """Return the file that holds `key`, and the rest of the key within that file."""
        depth = max(n for n in range(len(key) + 1) if key[:n] in self.origins)
        return self.origins[key[:depth]], key[depth:]


def _why(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return "is not UTF-8 text" if isinstance(error, UnicodeDecodeError) else str(error)


def _dotted(key: Key) -> str:
    return ".".join(str(part) for part in key)


def _split(name: str) -> Key:
    return tuple(name.split(".")) if name else ()


def _written(error: Any, content: Any) -> Key:
    """Return the key as written in the file, without the kind of a section that pydantic adds."""
    location = error["loc"]
    key: Key = ()
    for index, part in enumerate(location):
        if isinstance(content, dict):
            absent = error["type"] == "missing" and index == len(location) - 1
            if part not in content and not absent:
                continue
            content = content.get(part)
        elif isinstance(content, list):
            if not isinstance(part, int) or part >= len(content):
                continue
            content = content[part]
        key = (*key, part)
    return key
