"""An alarm says which node, which message and which value it is raised for."""

from types import SimpleNamespace

from utank_hil.canbus import (
    Address,
    AddressClaim,
    AlarmState,
    DriveFault,
    DriveState,
    DriveStatus1,
    DriveStatus2,
    Fault,
    Heartbeat,
    Mode,
    NodeState,
    load_catalogue,
)
from utank_hil.canbus.events import AlarmEvent
from utank_hil.nodes.inbox import Inbox
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
    own = SimpleNamespace(can_id=0x18FF0080, data=b"")
    inbox.receive(own, 1)
    assert inbox.received(Fault.ADDRESS_CONFLICT) == "identifier 0x18FF0080"
    inbox.link_error(1, 1, "CAN interface can0: bus-off; check wiring")
    assert inbox.received(Fault.BUS_LOST) == "CAN interface can0: bus-off; check wiring"
    assert inbox.received(Fault.LEVEL_LIMIT) == ""


def test_the_text_of_an_alarm_has_it():
    event = AlarmEvent(0, Fault.BUS_LOST, AlarmState.ACTIVE_UNACKNOWLEDGED, Mode.FAULT, "bus-off")
    assert event_text(event).endswith(" Received: bus-off")
