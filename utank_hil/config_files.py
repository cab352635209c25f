"""Reading configuration files: YAML that may name other YAML files, and errors that name the place.

A value that is the name of a ``.yaml`` file stands for that file's content, and one that begins
with ``./`` or ``../`` is the path of a data file; both are relative to the file they stand in.
Every error carries the file and key where the wrong value was written.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError

Key = tuple[str | int, ...]
ModelT = TypeVar("ModelT", bound=BaseModel)


class Section(BaseModel):
    """One mapping of a configuration file: unknown keys are errors, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


@dataclass(frozen=True, slots=True)
class ConfigProblem:
    """One thing wrong in a configuration.

    Attributes
    ----------
    file : Path
        File in which the value stands.
    key : str
        Dotted key within that file; empty for the file as a whole.
    reason : str
        What is wrong with it and what is expected.
    """

    file: Path
    key: str
    reason: str

    def __str__(self) -> str:
        place = f"{self.file}: {self.key}" if self.key else str(self.file)
        return f"{place}: {self.reason}"


class ConfigError(ValueError):
    """A configuration can't be used; `problems` lists everything found, not just the first."""

    def __init__(self, problems: list[ConfigProblem]) -> None:
        super().__init__("\n".join(str(problem) for problem in problems))
        self.problems = problems


def load_config(path: Path | str, model: type[ModelT]) -> ModelT:
    """Read and validate a configuration file with all the files it names.

    Parameters
    ----------
    path : Path or str
        The YAML file.
    model : type of pydantic.BaseModel
        What the file must hold.

    Raises
    ------
    ConfigError
        With every problem found: unreadable files, YAML errors, unknown or missing keys and
        values out of range.
    """
    source = Path(path)
    origins: dict[Key, Path] = {(): source}
    problems: list[ConfigProblem] = []
    content = _read(source, (), origins, problems, ())
    if problems:
        raise ConfigError(problems)
    try:
        return model.model_validate(content)
    except ValidationError as error:
        raise ConfigError([_located(item, content, origins) for item in error.errors()]) from None


def _read(
    file: Path,
    key: Key,
    origins: dict[Key, Path],
    problems: list[ConfigProblem],
    stack: tuple[Path, ...],
) -> Any:
    """Content of `file`, which stands at `key` of the whole, with included files put in place."""
    if file.resolve() in stack:
        problems.append(ConfigProblem(file, "", "includes itself; break the circle"))
        return {}
    try:
        content = yaml.safe_load(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "is not UTF-8 text"
        problems.append(ConfigProblem(file, "", f"can't be read: {reason}"))
        return {}
    except yaml.YAMLError as error:
        problems.append(ConfigProblem(file, "", f"is not valid YAML: {error}"))
        return {}
    if not isinstance(content, dict):
        problems.append(ConfigProblem(file, "", "must hold a mapping of keys to values"))
        return {}
    origins[key] = file
    return _resolve(content, key, file, origins, problems, (*stack, file.resolve()))


def _resolve(
    value: Any,
    key: Key,
    file: Path,
    origins: dict[Key, Path],
    problems: list[ConfigProblem],
    stack: tuple[Path, ...],
) -> Any:
    if isinstance(value, dict):
        return {
            name: _resolve(item, (*key, name), file, origins, problems, stack)
            for name, item in value.items()
        }
    if isinstance(value, list):
        return [
            _resolve(item, (*key, index), file, origins, problems, stack)
            for index, item in enumerate(value)
        ]
    if isinstance(value, str) and value.endswith(".yaml"):
        included = file.parent / value
        if not included.is_file():
            name = _dotted(_within(key, origins)[1])
            problems.append(ConfigProblem(file, name, f"names {included}, which does not exist"))
            return {}
        return _read(included, key, origins, problems, stack)
    if isinstance(value, str) and value.startswith(("./", "../")):
        return str(file.parent / value)
    return value


def _within(key: Key, origins: dict[Key, Path]) -> tuple[Path, Key]:
    """File that holds `key`, and the rest of the key within that file."""
    depth = max(n for n in range(len(key) + 1) if key[:n] in origins)
    return origins[key[:depth]], key[depth:]


def _dotted(key: Key) -> str:
    return ".".join(str(part) for part in key)


def _written(error: Any, content: Any) -> Key:
    """The key as it stands in the file: pydantic names the chosen kind of a section as well."""
    location = error["loc"]
    key: Key = ()
    for index, part in enumerate(location):
        if isinstance(content, dict):
            absent = error["type"] == "missing" and index == len(location) - 1
            if part not in content and not absent:
                continue
            content = content.get(part)
        elif isinstance(content, list):
            content = content[part]
        key = (*key, part)
    return key


def _located(error: Any, content: Any, origins: dict[Key, Path]) -> ConfigProblem:
    file, key = _within(_written(error, content), origins)
    reason = str(error["msg"]).removeprefix("Value error, ")
    if error["type"] == "missing":
        reason = "is required but missing"
    elif error["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        reason = "is not a known key"
    elif not isinstance(error["input"], dict | list):
        reason = f"{reason} (got {error['input']!r})"
    return ConfigProblem(file, _dotted(key), reason)
