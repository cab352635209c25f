"""Every Python snippet of the documents runs as typed, in a folder that has ``configs`` only.

Those of the how-to pages are run by `test_how_to`, among the files that the pages make.
"""

import re
from typing import Any

import numpy as np
import pytest
from pages import DOCUMENTS, HOW_TO, ROOT, blocks, run_python

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
def test_snippet_runs_as_typed(page, block, tmp_path, monkeypatch):
    (tmp_path / "configs").symlink_to(ROOT / "configs")
    monkeypatch.chdir(tmp_path)
    run_python(page, block)


def test_the_loop_of_the_readme_is_stable_and_rolls_less_than_the_passive_tank():
    """Ten minutes of it, from its roll of one degree; a law that acts too late diverges in two."""
    (block,) = (block for page, block in SNIPPETS if page.name == "README.md")
    begun: dict[str, Any] = {}
    exec(block.text, begun)
    plant, rolled = begun["plant"], {}
    for name, controller in (("law", begun["law"].controller()), ("passive", None)):
        x, u, roll = np.radians([1.0, 0, 0, 0, 0]), np.zeros(1), []
        for _ in range(3000):
            y, x = plant.C @ x + plant.D @ u, plant.A @ x + plant.B @ u
            u = np.zeros(1) if controller is None else controller.step(y)
            roll.append(np.degrees(y[0]))
        rolled[name] = np.array(roll)
    assert np.abs(rolled["law"][-500:]).max() < 1e-3
    assert np.std(rolled["law"][500:]) < 0.97 * np.std(rolled["passive"][500:])
    assert abs(begun["y"][0]) < np.radians(0.5)  # what its own minute ends with


def test_no_snippet_is_overlooked():
    fences = sum(
        bool(re.match(r"\s*```+\s*py", line))
        for page in DOCUMENTS
        for line in page.read_text(encoding="utf-8").splitlines()
    )
    assert fences == len(SNIPPETS) > 5


def test_a_wrong_snippet_fails_at_its_line(tmp_path):
    page = tmp_path / "wrong.md"
    page.write_text("text\n\n```python\nx = 1\nprint(y)\n```\n")
    (block,) = blocks(page.read_text())
    with pytest.raises(NameError) as caught:
        run_python(page, block)
    assert caught.traceback[-1].lineno + 1 == 5
