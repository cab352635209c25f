"""YAML of configuration files, stricter than plain YAML."""

import re
from collections.abc import Iterator
from copy import deepcopy
from functools import lru_cache
from typing import Any, Final

import yaml

Key = tuple[str | int, ...]
Finding = tuple[Key, str]  #: Key within the text, and what is wrong there.

_STRING = "tag:yaml.org,2002:str"
_MERGE = "tag:yaml.org,2002:merge"
_INT = "tag:yaml.org,2002:int"
_FLOAT = "tag:yaml.org,2002:float"
_NUMBERS = (_INT, _FLOAT)
_MOST_VALUES: Final = 200_000
"""Values of a text with its aliases written out; a law of a hundred states has some 10,000."""


class YamlError(ValueError):
    """The text has no usable content."""


class _Loader(yaml.SafeLoader):
    """Loader that reports the place of a value that resembles a date or number but is none.

    Numbers are decimal, as in YAML 1.2: ``1e7`` is one, ``010`` is ten, ``1:30`` is text.
    """

    yaml_implicit_resolvers = {  # noqa: RUF012, PyYAML's own way
        first: [(tag, pattern) for tag, pattern in resolvers if tag not in _NUMBERS]
        for first, resolvers in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        try:
            return super().construct_object(node, deep)
        except ValueError as error:
            raise yaml.constructor.ConstructorError(
                None, None, f"{error}; put text in quotes", node.start_mark
            ) from error


_Loader.add_implicit_resolver(_INT, re.compile(r"[-+]?[0-9]+$"), list("-+0123456789"))
_Loader.add_implicit_resolver(
    _FLOAT,
    re.compile(
        r"[-+]?(?:\.[0-9]+|[0-9]+\.?[0-9]*)(?:[eE][-+]?[0-9]+)?$"
        r"|[-+]?\.(?:inf|Inf|INF)$|\.(?:nan|NaN|NAN)$"
    ),
    list("-+.0123456789"),
)
_Loader.add_constructor(_INT, lambda _, node: int(node.value))


_OPENED: Final = ("flow", "quoted scalar")


def _at(mark: yaml.Mark | None) -> str:
    return "" if mark is None else f" in line {mark.line + 1}, column {mark.column + 1}"


def parse_yaml(text: str) -> tuple[Any, list[Finding]]:
    """Return the content of a text, and its keys that are written twice or are no names.

    YamlError is raised if the text is not valid YAML, nested without end, or if its aliases make it
    too large.
    """
    try:
        return deepcopy(_parsed(text))
    except yaml.MarkedYAMLError as error:
        mark, opens = error.problem_mark, error.context_mark
        if opens is not None and any(each in (error.context or "") for each in _OPENED):
            raise YamlError(
                f"is not valid YAML{_at(mark)}: the bracket or quote that opens{_at(opens)} is not "
                "closed before: close it, and put commas between its values"
            ) from error
        raise YamlError(
            f"is not valid YAML{_at(mark)}: {_in_words(error.problem or '')}"
        ) from error
    except yaml.YAMLError as error:
        raise YamlError(f"is not valid YAML: {error}") from error
    except RecursionError:
        raise YamlError("is not valid YAML: it is nested too deeply") from None


@lru_cache(maxsize=32)  # the file of a ship is read again for each law that names it
def _parsed(text: str) -> tuple[Any, list[Finding]]:
    loader = _Loader(text)
    node = loader.get_single_node()
    if node is None:
        return None, []
    if _values(node, {}) > _MOST_VALUES:
        raise YamlError(f"holds more than {_MOST_VALUES} values, aliases (*) written out")
    findings = list(_findings(node, ()))
    return loader.construct_document(node), findings


def _in_words(problem: str) -> str:
    """Return the parser's words, or for a line that does not fit those above it what is wrong."""
    if "expected ':'" in problem or "mapping values" in problem:
        return (
            "this line or the one above is no key and value; a colon and a space part the two, as "
            "in hs_m: 3, and a text with a colon needs quotes"
        )
    if "another document" in problem:
        return "a second document (---) begins: a file holds one, so take that line out"
    if "undefined alias" in problem:
        return f"{problem}: put a text that begins with * in quotes"
    if "<block" not in problem:  # its word for lines indented alike
        return problem
    if "'-'" in problem or "sequence" in problem:
        return (
            "an item of a list (-) does not fit the lines above; items of one list are indented "
            "alike, and a section has either keys or items, not both"
        )
    return (
        "a line does not fit those above; keys of one section are indented alike, below a key "
        "without a value"
    )


def _values(node: yaml.Node, known: dict[yaml.Node, int]) -> int:
    """Return the number of values in a node, each alias counted as what it stands for."""
    if node in known:
        if not known[node]:
            raise yaml.composer.ComposerError(
                None, None, "an alias (*) names what it stands in", node.start_mark
            )
        return known[node]
    known[node] = 0
    parts: list[yaml.Node] = []
    if isinstance(node, yaml.SequenceNode):
        parts = node.value
    elif isinstance(node, yaml.MappingNode):
        parts = [part for pair in node.value for part in pair]
    known[node] = 1 + sum(_values(part, known) for part in parts)
    return known[node]


def _findings(node: yaml.Node, key: Key) -> Iterator[Finding]:
    if isinstance(node, yaml.SequenceNode):
        for index, item in enumerate(node.value):
            yield from _findings(item, (*key, index))
    if not isinstance(node, yaml.MappingNode):
        return
    lines: dict[str, int] = {}
    for name, value in node.value:
        line = name.start_mark.line + 1
        if not isinstance(name, yaml.ScalarNode):
            continue  # It can be no key, and is refused when it is made.
        if name.tag not in (_STRING, _MERGE):
            kind = name.tag.rpartition(":")[2]
            if name.tag == _INT and node.flow_style and not value.value and lines:  # {hs_m: 9,5}
                last = next(reversed(lines))
                reason = f"has a decimal comma (line {line}): write a decimal point, as 9.5"
                yield (*key, last), reason
                continue
            yield (
                (*key, name.value),
                f"is read as a {kind} and not as a name (line {line}): put it in quotes",
            )
            continue
        if name.value in lines:
            yield (
                (*key, name.value),
                f"is written twice, in lines {lines[name.value]} and {line}: remove one",
            )
        lines[name.value] = line
        yield from _findings(value, (*key, name.value))
