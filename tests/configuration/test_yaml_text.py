"""YAML by libyaml's scanner and by PyYAML's own: the same content, or the same words."""

from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from utank_hil.configuration import yaml_text
from utank_hil.configuration.yaml_text import YamlError, parse_yaml

SHIPPED = sorted(Path("configs").rglob("*.yaml"))
PIECES = [
    *" ,#[]{}|>?!%@`\t~\\\r-:.'\"\n", "a", "b: ", "1", ": ", "- ", "\n  ", " #", "&a ", "*a ",
    " ? ", "!!str ", "---", "...", "<<: ", "0x1", "1e3", "1:30", "é", "\u2028", "\x85", "\ufeff",
    "x:\n",
]  # fmt: skip


def read(text):
    try:
        return repr(parse_yaml(text))  # a NaN is not equal to itself
    except YamlError as error:
        return str(error)


def in_python(text):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(yaml_text, "_FAST", None)
        return read(text)


@pytest.mark.parametrize("path", SHIPPED, ids=str)
def test_a_shipped_file_is_the_same(path):
    text = path.read_text(encoding="utf-8")
    assert read(text) == in_python(text)


@given(st.lists(st.sampled_from(PIECES), max_size=14).map("".join))
@example("a\t")
@example("!")
@example(">#")
@example("{a ? }")
@example("\n\ufeffa")
@example("a: \ud800")
def test_any_text_is_the_same(text):
    assert read(text) == in_python(text)


def test_libyaml_is_used_where_it_is(monkeypatch):
    assert yaml_text._FAST is not None
    monkeypatch.setattr(yaml_text, "_Loader", None)
    assert parse_yaml("a: [1, 2.5, {b: text}]") == ({"a": [1, 2.5, {"b": "text"}]}, [])
