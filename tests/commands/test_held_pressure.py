"""A pump that could capsize its ship is not armed on hardware without a cut of its own."""

from pathlib import Path

import pytest

from utank_hil.commands.commissioning_record import why_not_commissioned
from utank_hil.configuration import ControllerConfig, load_config
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
    vessel = config.vessel.model_copy(update={"redundancy": redundancy})
    config = config.model_copy(update={"vessel": vessel})
    reason = why_not_commissioned(config, "can0", tmp_path / "controller.yaml", None)
    assert ("hardwired_inputs: true" in reason) is refused
    assert reason  # nor without a record
    assert why_not_commissioned(config, "vcan0", tmp_path / "controller.yaml", None) == ""
