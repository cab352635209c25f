"""The catalogue against the message table of the safety manual, and what it refuses."""

from enum import IntEnum
from pathlib import Path
from typing import get_type_hints

import pytest
from message_strategies import CASE_IDS, CASES, DATABASE, PROTECTED

import utank_hil.canbus
from utank_hil.analysis.loop.loop_simulation import LEVEL_TICKS
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import (
    Address,
    AddressClaim,
    Frame,
    Heartbeat,
    OperatorCommand,
    PumpCommand,
    SensorMotion,
    SensorTank,
    load_catalogue,
)
from utank_hil.canbus.catalogue import DBC_PATH, read_data_ids
from utank_hil.canbus.codec import field_kind
from utank_hil.canbus.e2e import data_ids
from utank_hil.canbus.messages import DBC_NAMES
from utank_hil.runners.bus_model import LONGEST_FRAME_BITS

TABLE = {
    "PUMP_CMD": (0x08FF1080, 20),
    "DRIVE_STATUS_1": (0x08FF2081, 20),
    "DRIVE_STATUS_2": (0x14FF2181, 100),
    "SENSOR_MOTION": (0x08FF3082, 10),
    "SENSOR_TANK": (0x0CFF3182, 20),
    "SENSOR_PUMP": (0x0CFF3282, 20),
    "CTRL_STATUS": (0x18FF1180, 100),
    "OPERATOR_CMD": (0x0CFF4083, 200),
    "HEARTBEAT_CONTROLLER": (0x18FF0080, 100),
    "HEARTBEAT_DRIVE": (0x18FF0081, 100),
    "HEARTBEAT_SENSORS": (0x18FF0082, 100),
    "HEARTBEAT_OPERATOR": (0x18FF0083, 100),
    "ADDRESS_CLAIM_CONTROLLER": (0x18EEFF80, None),
    "ADDRESS_CLAIM_DRIVE": (0x18EEFF81, None),
    "ADDRESS_CLAIM_SENSORS": (0x18EEFF82, None),
    "ADDRESS_CLAIM_OPERATOR": (0x18EEFF83, None),
    "VALVE_CMD": (0x08FF1280, 20),
    "VALVE_STATUS": (0x08FF2284, 20),
    "SENSOR_MOTION_2": (0x08FF3085, 10),
    "HARDWIRED_INPUTS": (0x08FF5086, 50),
    "SEA_ESTIMATE": (0x18FF1380, 1000),
    "SHIP_ESTIMATE": (0x18FF1480, 1000),
    "PASSIVE_TWIN": (0x18FF1580, 100),
    "ALARM": (0x18FF1680, 100),
    "OPERATOR_CMD_2": (0x0CFF4088, 200),
    "HEARTBEAT_VALVE": (0x18FF0084, 100),
    "HEARTBEAT_SENSORS_2": (0x18FF0085, 100),
    "HEARTBEAT_HARDWIRED": (0x18FF0086, 100),
    "HEARTBEAT_OPERATOR_2": (0x18FF0088, 100),
    "ADDRESS_CLAIM_VALVE": (0x18EEFF84, None),
    "ADDRESS_CLAIM_SENSORS_2": (0x18EEFF85, None),
    "ADDRESS_CLAIM_HARDWIRED": (0x18EEFF86, None),
    "ADDRESS_CLAIM_OPERATOR_2": (0x18EEFF88, None),
}

#: How the end of a signal's name says the unit of the DBC.
UNIT_SUFFIXES = {
    "Pa": "_pa",
    "s": "_s",
    "rad": "_rad",
    "rad/s": "_rad_s",
    "m": "_m",
    "m3/s": "_m3_s",
    "V": "_v",
    "W": "_w",
    "A": "_a",
    "degC": "_c",
    "1": "",
}


def altered(tmp_path, *changes):
    text = DBC_PATH.read_text()
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = tmp_path / "altered.dbc"
    path.write_text(text)
    return path


def test_identifiers_and_cycles_are_those_of_the_message_table():
    """Nodes of other makers rely on them; further messages may join."""
    found = {dbc.name: (dbc.frame_id, dbc.cycle_time) for _, _, dbc in CASES}
    assert TABLE.items() <= found.items()
    assert load_catalogue().can_ids == {can_id for can_id, _ in found.values()}
    assert all(dbc.is_extended_frame and dbc.length == 8 for _, _, dbc in CASES)


def test_cycles_are_whole_numbers_of_ticks_and_the_simulated_gauges_have_that_of_the_catalogue():
    assert not any((dbc.cycle_time or 0) * 1_000_000 % TICK_NS for _, _, dbc in CASES)
    assert load_catalogue().codec(SensorTank).cycle_ns == LEVEL_TICKS * TICK_NS


def test_everything_is_commented_has_receivers_and_says_its_unit_in_its_name():
    for _, _, dbc in CASES:
        assert dbc.comment, dbc.name
        assert dbc.receivers, dbc.name
        for signal in dbc.signals:
            assert signal.comment, (dbc.name, signal.name)
            if signal.unit is not None:
                assert signal.name.endswith(UNIT_SUFFIXES[signal.unit]), (dbc.name, signal.name)


def test_zero_is_sent_without_rounding():
    """A zero pressure command is zero pressure, not half a step of it."""
    for _, _, dbc in CASES:
        for signal in dbc.signals:
            if signal.minimum <= 0 <= signal.maximum:
                raw = round(-signal.offset / signal.scale)
                assert raw * signal.scale + signal.offset == 0, (dbc.name, signal.name)


def test_data_ids_are_sixteen_and_no_two_messages_share_one_at_a_counter():
    lists = [read_data_ids(dbc) for _, _, dbc in PROTECTED]
    assert {len(ids) for ids in lists} == {16}
    assert set(lists) == {data_ids(number) for number in range(1, len(lists) + 1)}
    for at_one_counter in zip(*lists, strict=True):
        assert len(set(at_one_counter)) == len(lists)


def test_version_is_a_hash_of_the_dbc_and_never_not_available(tmp_path):
    catalogue = load_catalogue()
    assert 0 <= catalogue.version <= 4094
    other = load_catalogue(altered(tmp_path, ("(8,-262144)", "(4,-131072)"), ("250000", "125000")))
    assert other.version != catalogue.version
    unix = tmp_path / "windows.dbc"
    unix.write_bytes(DBC_PATH.read_bytes().replace(b"\n", b"\r\n"))
    assert load_catalogue(unix).version == catalogue.version


def test_messages_of_every_node_need_the_node():
    with pytest.raises(ValueError, match="Heartbeat is sent by CONTROLLER, DRIVE, SENSORS"):
        load_catalogue().transmitter(Heartbeat)
    with pytest.raises(ValueError, match="PumpCommand is sent by no such node"):
        load_catalogue().receiver(PumpCommand, Address.DRIVE)
    with pytest.raises(ValueError, match="Frame is sent by no such node"):
        load_catalogue().codec(Frame)
    assert load_catalogue().codec(PumpCommand, Address.CONTROLLER).name == "PUMP_CMD"
    assert load_catalogue().codec(AddressClaim, Address.DRIVE).can_id == 0x18EEFF81


@pytest.mark.parametrize(
    ("message", "first", "second"),
    [
        (SensorMotion(0.1, 0.0, None), Address.SENSORS, Address.SENSORS_2),
        (OperatorCommand(None, False, True, False, False), Address.OPERATOR, Address.OPERATOR_2),
    ],
)
def test_messages_of_a_second_node_have_an_identifier_and_data_ids_of_their_own(
    message, first, second
):
    catalogue, kind = load_catalogue(), type(message)
    assert catalogue.codec(kind) is catalogue.codec(kind, first)
    assert catalogue.codec(kind, second).can_id != catalogue.codec(kind).can_id
    data = catalogue.codec(kind, second).encode(message, 1)
    assert catalogue.codec(kind, second).decode(data) is not None
    assert catalogue.codec(kind).decode(data) is None


def test_the_bus_carries_all_nodes_at_once():
    """Every message in its cycle, each frame as long as stuffing makes it at most; 0.6 warns."""
    frames_a_second = sum(1000 / dbc.cycle_time for _, _, dbc in CASES if dbc.cycle_time)
    assert frames_a_second * LONGEST_FRAME_BITS / 250_000 < 0.6
    row = f"| all: every message in its cycle | {frames_a_second:.0f} |"
    assert row in Path("docs/can-catalogue.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("case", CASES, ids=CASE_IDS)
def test_the_dbc_fits_the_message_types(case):
    """`load_catalogue` relies on it; what it can't see would be a frame that is read wrongly."""
    kind, address, dbc = case
    assert dbc.frame_id & 0xFF == address
    signals = {signal.name: signal for signal in dbc.signals}
    if read_data_ids(dbc) is not None:
        places = [(s.start, s.length) for s in (signals.pop("crc"), signals.pop("counter"))]
        assert places == [(0, 8), (8, 4)]
    hints = get_type_hints(kind)
    assert signals.keys() == hints.keys()
    for name, signal in signals.items():
        what, ones = field_kind(hints[name]), (1 << signal.length) - 1
        assert (signal.is_signed, signal.byte_order) == (False, "little_endian"), name
        if what is bool:
            assert signal.length == 1, name
            continue
        low, high = signal.minimum, signal.maximum
        if what is float:
            low, high = (round((x - signal.offset) / signal.scale) for x in (low, high))
        else:
            assert (signal.scale, signal.offset) == (1, 0), name
        assert 0 <= low < high < ones, name
        if issubclass(what, IntEnum):
            table = {value: str(text) for value, text in signal.choices.items()}
            members = {member.value: member.name for member in what}
            assert table == members | {ones: "NOT_AVAILABLE"}, name


def test_every_message_type_and_node_is_in_the_dbc():
    assert {kind for kind, _, _ in CASES} == set(DBC_NAMES)
    for address in Address:
        node = DATABASE.get_node_by_name(address.name)
        assert node.dbc.attributes["NmStationAddress"].value == address


def test_every_message_of_the_dbc_is_exported_and_knows_its_sender():
    for kind, _, _ in CASES:
        assert getattr(utank_hil.canbus, kind.__name__) is kind
    for address in Address:
        expected = {dbc.frame_id for _, _, dbc in CASES if dbc.senders == [address.name]}
        assert load_catalogue().ids_sent_by(address) == expected


def test_an_unknown_public_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'NoSuchName'"):
        utank_hil.canbus.NoSuchName  # noqa: B018
