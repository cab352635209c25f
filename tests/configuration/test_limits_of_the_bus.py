"""A limit that the bus can't say is refused: the codec would cut the command, and nobody knew."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from pydantic import ValidationError

from utank_hil.canbus import ControlWord, PumpCommand, Quality, SensorMotion, load_catalogue
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.configuration.controller import MOST_PRESSURE_PA, MOST_ROLL_RATE_RAD_S
from utank_hil.control import PumpLimits


def with_limit(pressure_pa):
    """A shipped controller with a pump of 400 kPa."""
    config = load_config(Path("configs/controllers/gpc.yaml"), ControllerConfig)
    assert config.vessel.pump is not None
    vessel = config.vessel.model_copy(
        update={"pump": replace(config.vessel.pump, max_pressure_pa=400e3)}
    )
    limits = PumpLimits(pressure_pa=pressure_pa, rate_pa_s=config.limits.rate_pa_s)
    fields = {name: getattr(config, name) for name in ControllerConfig.model_fields}
    return ControllerConfig.model_validate({**fields, "vessel": vessel, "limits": limits})


def test_the_constant_is_the_largest_pressure_that_pump_cmd_can_say():
    codec = load_catalogue().codec(PumpCommand)
    asked = (MOST_PRESSURE_PA - 8.0, MOST_PRESSURE_PA, MOST_PRESSURE_PA + 800.0)
    said = []
    for pressure_pa in asked:
        command = PumpCommand(pressure_pa, ControlWord.ENABLE_OPERATION, 0.05)
        heard = codec.decode(codec.encode(command, 0))
        said.append(heard.pressure_pa)
    assert said == pytest.approx([asked[0], asked[1], asked[1]], abs=4.0)


def test_a_limit_that_the_bus_can_say_is_taken_and_a_larger_one_is_not():
    assert with_limit(MOST_PRESSURE_PA).limits.pressure_pa == MOST_PRESSURE_PA
    with pytest.raises(ValidationError, match="PUMP_CMD can ask for 250000 at most: set it to 25"):
        with_limit(MOST_PRESSURE_PA + 1.0)


def test_the_constant_is_the_fastest_roll_that_sensor_motion_can_say():
    codec = load_catalogue().codec(SensorMotion)
    for rate, known in ((MOST_ROLL_RATE_RAD_S, True), (1.01 * MOST_ROLL_RATE_RAD_S, False)):
        heard = codec.decode(codec.encode(SensorMotion(0.0, rate, Quality.GOOD), 0))
        assert (heard.roll_rate_rad_s == pytest.approx(rate, abs=1e-4)) is known


@pytest.mark.parametrize(("period_s", "warned"), [(2.1, True), (2.4, False)])
def test_a_roll_limit_that_no_sensor_could_tell_is_warned_of(period_s, warned):
    config = load_config(Path("configs/controllers/gpc.yaml"), ControllerConfig)
    ship = config.vessel.ship
    stiffness = ship.inertia_kg_m2 * (2 * math.pi / period_s) ** 2
    quick = config.vessel.model_copy(update={"ship": replace(ship, stiffness_nm_rad=stiffness)})
    controller = config.model_copy(update={"vessel": quick})
    reasons = [reason for key, reason in controller.warnings() if key == "safety.roll_limit_rad"]
    assert any("SENSOR_MOTION tells 1 at most" in reason for reason in reasons) is warned
