"""An alarm says which node, which message and which value it is raised for."""

import re
from pathlib import Path

import pytest
from bought_devices import LEVELS, SBG

from utank_hil.canbus import (
    Address,
    AddressClaim,
    AlarmState,
    DriveFault,
    DriveState,
    DriveStatus1,
    DriveStatus2,
    Fault,
    Frame,
    Heartbeat,
    Mode,
    NodeState,
    Quality,
    SensorMotion,
    load_catalogue,
)
from utank_hil.canbus.events import AlarmEvent
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD
from utank_hil.configuration import Vessel, load_config
from utank_hil.configuration.devices import DevicesSection
from utank_hil.nodes.inbox import Inbox
from utank_hil.nodes.redundancy import Redundancy
from utank_hil.safety.faults import FAULTS
from utank_hil.telemetry.events import event_text

CATALOGUE = load_catalogue()
NAN = float("nan")


def test_what_was_received_is_in_words():
    inbox = Inbox(CATALOGUE, 7)

    def hear(message, sender, *fields):
        inbox.receive(CATALOGUE.transmitter(message, sender).frame(message(*fields)), 1)

    hear(Heartbeat, Address.DRIVE, NodeState.OPERATIONAL, None, 1.0, CATALOGUE.version, 8, NAN, NAN)
    said = inbox.received(Fault.VERSION_MISMATCH)
    assert said.startswith("drive: heartbeat 0x")
    assert said.endswith(f"and ship 8, here {CATALOGUE.version} and 7")
    beat = CATALOGUE.codec(Heartbeat, Address.DRIVE).can_id
    assert f"0x{beat:08X}" in said
    claims = CATALOGUE.transmitter(AddressClaim, Address.SENSORS)
    for name in (5, 6):
        inbox.receive(claims.frame(AddressClaim(name)), 1)
    claimed = inbox.received(Fault.FOREIGN_SENDER)
    assert claimed.startswith("sensors: address claim 0x")
    assert claimed.endswith("name 6 after 5")
    hear(DriveStatus1, None, 0.0, 0.0, DriveState.FAULT, 3, False, False, False, False)
    hear(
        DriveStatus2, None, DriveFault.OVERCURRENT, 500.0, 1.0, NAN, NAN, False, False, False, False
    )
    assert inbox.received(Fault.DRIVE_FAULT) == (
        "drive: state 8 (FAULT) in DRIVE_STATUS_1, fault 1 (OVERCURRENT) in DRIVE_STATUS_2"
    )
    own = Frame(0x18FF0080, b"")
    inbox.receive(own, 1)
    assert inbox.received(Fault.ADDRESS_CONFLICT) == "identifier 0x18FF0080"
    inbox.link_error(1, 1, "CAN interface can0: bus-off; check wiring")
    assert inbox.received(Fault.BUS_LOST) == "CAN interface can0: bus-off; check wiring"
    assert inbox.received(Fault.LEVEL_LIMIT) == ""


def test_an_alarm_names_the_device_that_the_ship_has_and_its_message():
    foreign = DevicesSection(motion_2=SBG, levels=LEVELS).foreign()
    inbox = Inbox(CATALOGUE, 7, foreign=foreign, redundancy=Redundancy(second_motion_sensor=True))
    gauges = 0x187 | STANDARD | 2 << BUS_SHIFT
    said = inbox.received(Fault.TANK_SILENT)
    assert said == "levels: inputs 0x187 on can2, never heard"
    for data in (bytes(5), bytes(6), bytes(7)):
        inbox.receive(Frame(gauges, data), 1)
    said = inbox.received(Fault.TANK_SILENT)
    # and no current in both: below the 3.6 mA of NAMUR NE 43
    why, _, frames = said.partition("; ")
    assert why == "levels: port_level_m, starboard_level_m not available, or out of range"
    assert frames == "levels: inputs 0x187 on can2, 2 with wrong length"
    assert inbox.received(Fault.PROTECTION) == frames
    inbox.receive(Frame(gauges, bytes((0, 0, 5, 0, 0, 0))), 1)  # 6150h: not valid, under range
    said = inbox.received(Fault.TANK_SILENT)
    assert said.endswith(", 2 with wrong length, status 0x5 (mask 0x7) is not valid")
    motion = CATALOGUE.transmitter(SensorMotion, Address.SENSORS)
    number = motion.can_id
    assert inbox.received(Fault.MOTION_SILENT) == (
        f"sensors: SENSOR_MOTION 0x{number:08X}, never heard"
    )
    inbox.receive(motion.frame(SensorMotion(0.0, 0.0, Quality.GOOD)), 5)
    assert "motion_2: attitude 0x132 on can1, never heard; " in (
        inbox.received(Fault.MOTION_SILENT) + "; "
    )
    assert "SENSOR_MOTION" not in inbox.received(Fault.MOTION_SILENT)
    assert "SENSOR_PUMP" in inbox.received(Fault.PUMP_SENSOR_SILENT)
    assert "DRIVE_STATUS_1" in inbox.received(Fault.DRIVE_SILENT)
    assert "OPERATOR_CMD" in inbox.received(Fault.OPERATOR_SILENT)


def test_contents_of_one_identifier_have_their_own_names():
    levels = LEVELS | {"messages": {"other": {"cob": "0x180", "bytes": 6}}}
    said = Inbox(CATALOGUE, 7, foreign=DevicesSection(levels=levels).foreign())
    both = "levels: inputs 0x187 on can2, never heard; levels: other 0x187 on can2, never heard"
    assert said.received(Fault.TANK_SILENT) == both


def test_a_status_that_is_silent_is_told():
    """Ten cycles of an Ellipse's values and stamps; its status, 0x102, with the first alone."""
    inbox = Inbox(CATALOGUE, 7, foreign=DevicesSection(motion=SBG).foreign())
    own = 1 << BUS_SHIFT | STANDARD
    for k in range(10):
        stamp = (10_000 * (k + 1)).to_bytes(4, "little")
        inbox.receive(Frame(own | 0x102, bytes((0x11, *[0] * 5))), 0) if not k else None
        for number, data in (
            (0x120, stamp + b"\x23\x02\0\0"), (0x122, bytes(6)), (0x130, stamp), (0x132, bytes(6)),
        ):  # fmt: skip
            inbox.receive(Frame(own | number, data), 10_000_000 * k)
    said = inbox.received(Fault.MOTION_SILENT).split("; ")
    assert [each for each in said if "status" in each] == [
        "motion: status 0x102 on can1, too late for a status"
    ]


def test_an_alarm_says_why_whole_frames_do_not_count():
    """PGN 61481 of source 0x21, as a sensor that hangs sends it, after another has its address."""
    guards = {"n2k_name": 5, "unchanged_ms": 100}
    ssi2 = {
        "profile": "j1939_ssi2", "source": 0x21, "accept_unprotected": True, "protection": guards,
        "signals": {"roll_rate_rad_s": {"source": "derived"}},
    }  # fmt: skip
    inbox = Inbox(CATALOGUE, 7, foreign=DevicesSection(motion=ssi2).foreign())

    def slopes(frames):
        for k in range(frames):
            data = (250 << 15).to_bytes(3, "little") * 2 + bytes(2)
            inbox.receive(Frame(0x18F02921, data), (k + 1) * 10_000_000)
        return inbox.received(Fault.MOTION_SILENT)

    said = slopes(2)
    assert said.startswith(
        "motion: address 0x21 not claimed by 0x5; motion: slope PGN 61481 of 0x21"
    )
    inbox.receive(Frame(0x18EEFF21, (5).to_bytes(8, "little")), 1)
    assert slopes(11).startswith("motion: slope PGN 61481 of 0x21")
    assert slopes(12).startswith("motion: says the same for too long (unchanged_ms); motion: slo")


def test_a_canopen_drive_is_named_and_its_frames():
    ship = load_config(Path("configs/ships/thesis_first_devices.yaml"), Vessel)
    said = Inbox(CATALOGUE, 7, foreign=ship.foreign).received(Fault.DRIVE_SILENT)
    assert "pump: TPDO1 0x185 on can2, never heard" in said
    assert "DRIVE_STATUS" not in said


@pytest.mark.parametrize("row", FAULTS, ids=lambda row: row.code.name)
def test_the_remedy_of_a_fault_names_no_message_that_a_ship_need_not_have(row):
    """What is received, and which message it is in, stands behind it, see `Inbox.received`."""
    assert not re.search(r"\b(SENSOR|DRIVE|VALVE|PUMP)_[A-Z]+", row.remedy)


def test_the_text_of_an_alarm_has_it():
    event = AlarmEvent(0, Fault.BUS_LOST, AlarmState.ACTIVE_UNACKNOWLEDGED, Mode.FAULT, "bus-off")
    assert event_text(event).endswith(" Received: bus-off")
