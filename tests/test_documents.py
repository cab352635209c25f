"""Every Python snippet of the documents runs as typed, in a folder that has ``configs`` only."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.M | re.S)


def snippets(document: Path) -> list[tuple[int, str]]:
    """Line before the first and source of each block marked as Python."""
    text = document.read_text(encoding="utf-8")
    return [(text.count("\n", 0, m.start(1)), m.group(1)) for m in BLOCK.finditer(text)]


def run(document: Path, line: int, source: str) -> None:
    """Run a snippet in a namespace of its own; errors name the document's line."""
    code = compile("\n" * line + source, str(document), "exec")
    exec(code, {"__name__": "__main__"})


@pytest.mark.parametrize(
    ("document", "line", "source"),
    [
        pytest.param(document, line, source, id=f"{document.name}:{line + 1}")
        for document in DOCUMENTS
        for line, source in snippets(document)
    ],
)
def test_snippet_runs_as_typed(
    document: Path, line: int, source: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "configs").symlink_to(ROOT / "configs")
    monkeypatch.chdir(tmp_path)
    run(document, line, source)


def test_no_snippet_is_overlooked() -> None:
    fences = sum(
        bool(re.match(r"\s*```+\s*py", line))
        for document in DOCUMENTS
        for line in document.read_text(encoding="utf-8").splitlines()
    )
    assert fences == sum(len(snippets(document)) for document in DOCUMENTS) > 5


def test_a_wrong_snippet_fails_at_its_line(tmp_path: Path) -> None:
    document = tmp_path / "wrong.md"
    document.write_text("text\n\n```python\nx = 1\nprint(y)\n```\n")
    ((line, source),) = snippets(document)
    with pytest.raises(NameError) as caught:
        run(document, line, source)
    assert caught.traceback[-1].lineno + 1 == 5
