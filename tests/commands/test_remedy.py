"""A refused law gets a remedy that can be written into its file, and that passes there."""

import json
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.testing import CliRunner

from utank_hil.cli import app
from utank_hil.configuration.yaml_text import parse_yaml

CONFIGS = Path("configs").resolve()


def check(folder: Path, shipped: str, ship: str, **law: Any) -> dict[str, Any]:
    """What `check` says of a shipped law on another ship, as JSON."""
    content = parse_yaml((CONFIGS / "controllers" / f"{shipped}.yaml").read_text())[0]
    content |= {"vessel": str(CONFIGS / "ships" / f"{ship}.yaml"), "law": content["law"] | law}
    file = folder / "controller.yaml"
    file.write_text(yaml.safe_dump(content))
    return json.loads(CliRunner().invoke(app, ["check", str(file), "--json"]).stdout)


@pytest.mark.slow
def test_what_is_named_passes_when_it_is_written(tmp_path: Path) -> None:
    refused = check(tmp_path, "gpc", "naval_vessel")
    assert not refused["accepted"]
    law, found, _ = refused["remedy"].removeprefix("law: ").partition(" passes")
    assert found
    mended = yaml.safe_load((tmp_path / "controller.yaml").read_text()) | {
        "law": yaml.safe_load(law)
    }
    file = tmp_path / "mended.yaml"
    file.write_text(yaml.safe_dump(mended))
    passed = json.loads(CliRunner().invoke(app, ["check", str(file), "--json"]).stdout)
    assert (passed["accepted"], passed["remedy"]) == (True, None)


def test_ship_that_no_law_can_mend_is_told_so(tmp_path: Path) -> None:
    """Patti-B with 0.59 of her stiffness loses more to the free surface than she has left."""
    refused = check(tmp_path, "gpc", "patti_b")
    assert not refused["accepted"]
    assert refused["remedy"].startswith("at 1.3 of the roll period the ship is unstable")


def test_law_that_passes_or_was_refused_for_something_else_gets_no_remedy(tmp_path: Path) -> None:
    assert check(tmp_path, "gpc", "thesis_first")["remedy"] is None
    assert check(tmp_path, "pd", "thesis_first")["remedy"] is None
