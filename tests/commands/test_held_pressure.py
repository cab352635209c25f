"""A pump that could capsize its ship is not armed on hardware without a cut of its own."""

import json
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from utank_hil.cli import app
from utank_hil.commands.commissioning_record import why_not_commissioned
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.console.exit_codes import ExitCode
from utank_hil.nodes.redundancy import Redundancy


@pytest.mark.parametrize(
    ("name", "declared", "refused"),
    [
        ("patti_b_constrained_gpc", False, True),
        ("patti_b_constrained_gpc", True, False),
        ("naval_constrained_gpc", False, False),
        ("gpc", False, False),
    ],
)
def test_it_is_armed_on_hardware_only_with_a_hard_wired_cut(
    name: str, declared: bool, refused: bool, tmp_path: Path
) -> None:
    config = load_config(f"configs/controllers/{name}.yaml", ControllerConfig)
    redundancy = Redundancy(hardwired_inputs=declared)
    update = {"redundancy": redundancy, "emulated": False}
    vessel = config.vessel.model_copy(update=update)
    config = config.model_copy(update={"vessel": vessel})
    reason = why_not_commissioned(config, "can0", tmp_path / "controller.yaml", None)
    assert ("hardwired_inputs: true" in reason) is refused
    assert reason  # nor without a record


@pytest.mark.parametrize("declared", [True, False])
@pytest.mark.parametrize("kind", ["ship", "controller"])
def test_check_refuses_it_unless_a_cut_is_declared(
    kind: str, declared: bool, tmp_path: Path
) -> None:
    ship = yaml.safe_load(Path("configs/ships/patti_b.yaml").read_text())
    assert ship["redundancy"] == {"hardwired_inputs": True}
    ship["redundancy"] = {"hardwired_inputs": declared}
    file = tmp_path / "file.yaml"
    law = {"name": "none", "vessel": ship, "law": {"kind": "passive"}}
    file.write_text(yaml.safe_dump(ship if kind == "ship" else law))
    result = CliRunner().invoke(app, ["check", str(file), "--json"])
    assert result.exit_code == (ExitCode.OK if declared else ExitCode.REFUSED)
    assert json.loads(result.stdout)["accepted"] is declared
    said = CliRunner().invoke(app, ["check", str(file)]).output.replace("\n", " ")
    assert ("refused:" in said) is not declared
    assert ("is 20 kPa, and over" in said) is not declared
