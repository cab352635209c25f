"""Files of other people, which stand beside the checkout and are not part of the project."""

import os
from pathlib import Path

import pytest

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


def others_file(name):
    """Return a file or folder of `shared/data` beside the checkout, such as ``hulls/box.1``.

    Where the folder is absent the test is skipped; in continuous integration it fails.
    """
    if not DATA.is_dir():
        assert "UTANK_HIL_CI" not in os.environ, f"no files of others in {DATA}"
        pytest.skip(f"files of others are not here: {DATA}")
    path = DATA / name
    assert path.exists(), f"{path} is missing"
    return path


def field_case(name):
    """Return a file of the cases that other people reported, by its folder and name."""
    return others_file(f"field-cases/{name}")
