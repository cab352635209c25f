"""Every Python snippet of the documents runs as typed, in a folder that has ``configs`` only.

Those of the how-to pages are run by `test_how_to`, among the files that the pages make.
"""

import re
from pathlib import Path

import pytest
from pages import DOCUMENTS, HOW_TO, ROOT, Block, blocks, run_python

pytestmark = pytest.mark.slow

SNIPPETS = [
    (page, block)
    for page in DOCUMENTS
    for block in blocks(page.read_text(encoding="utf-8"))
    if block.language == "python"
]


@pytest.mark.parametrize(
    ("page", "block"),
    [
        pytest.param(page, block, id=f"{page.name}:{block.line + 1}")
        for page, block in SNIPPETS
        if page not in HOW_TO
    ],
)
def test_snippet_runs_as_typed(
    page: Path, block: Block, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "configs").symlink_to(ROOT / "configs")
    monkeypatch.chdir(tmp_path)
    run_python(page, block)


def test_no_snippet_is_overlooked() -> None:
    fences = sum(
        bool(re.match(r"\s*```+\s*py", line))
        for page in DOCUMENTS
        for line in page.read_text(encoding="utf-8").splitlines()
    )
    assert fences == len(SNIPPETS) > 5


def test_a_wrong_snippet_fails_at_its_line(tmp_path: Path) -> None:
    page = tmp_path / "wrong.md"
    page.write_text("text\n\n```python\nx = 1\nprint(y)\n```\n")
    (block,) = blocks(page.read_text())
    with pytest.raises(NameError) as caught:
        run_python(page, block)
    assert caught.traceback[-1].lineno + 1 == 5
