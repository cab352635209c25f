"""The drive in a ship's file: what is missing or does not fit is refused by its key."""

import pytest

from tests.nodes.canopen_peers import PROFILE, PUMP
from utank_hil.base.parameters import ParameterError
from utank_hil.canbus.profiles.drive_plan import Place
from utank_hil.configuration.devices import DevicesSection
from utank_hil.console.ship_report import devices_json, print_devices
from utank_hil.console.terminal import Terminal


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"node": None}, "pump.node is required"),
        ({"mode": None}, "pump.mode is required"),
        ({"pressure_pa_per_unit": None}, "pump.pressure_pa_per_unit is required"),
        ({"speed_rad_s_per_unit": 0}, "pump.speed_rad_s_per_unit is required"),
        ({"node": 127}, "pump.controller_node is the drive's own"),
        ({"require": {"60FGh": 1}}, "'60FGh' is no object: write 0x605A"),
        ({"delay_ms": 30}, "pump.delay_ms is 30, and the pressure loop's margins are 42 degrees"),
        ({"profile": "native", "bus": "can1"}, "pump.bus is for a drive with a profile"),
    ],
)
def test_what_does_not_fit_is_refused(changes, reason):
    with pytest.raises((ParameterError, ValueError), match=reason.replace("(", r"\(")):
        DevicesSection(pump=PROFILE | changes)


def test_a_receive_only_bus_can_not_command():
    with pytest.raises(ValueError, match=r"pump\.bus can1 is receive-only"):
        DevicesSection(pump=PROFILE | {"bus": "can1"}, receive_only=["can1"])


@pytest.mark.parametrize("lacks", ["0x6007", "6007h", "0x6007:0"])
def test_what_is_required_adds_to_the_profile_or_takes_away(lacks):
    section = DevicesSection(pump=PROFILE | {"require": {lacks: None, "0x1400:5": 60}})
    plan = section.foreign(PUMP).pump
    assert dict(plan.require) == {Place(0x605A): 2, Place(0x605E): 2, Place(0x1400, 5): 60}


def test_check_says_what_the_drive_is_and_what_its_loop_stands(capsys):
    devices = DevicesSection(pump=PROFILE | {"bus": "can1"})
    print_devices(Terminal(), devices)
    said = capsys.readouterr().out
    for words in ("pump: cia402, node 5, torque on can1", "0x6007 3, 0x605A 2, 0x605E 2",
                  "identity", "10 rad/s, margins 61 degrees and 3.1"):  # fmt: skip
        assert words in said
    assert devices_json(devices)["pump"]["loop_gain_margin"] == pytest.approx(3.14, abs=0.01)
