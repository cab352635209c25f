"""Who is on a bus: emulated ships, and logs that other people recorded."""

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from others import others_file

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from utank_hil.canbus.frame import STANDARD
from utank_hil.configuration import load_config
from utank_hil.configuration.devices import DevicesSection
from utank_hil.runners import Lockstep
from utank_hil.telemetry.bus_census import BusCensus
from utank_hil.telemetry.bus_files.frame import BusFrame, FrameKind
from utank_hil.telemetry.bus_files.log import BusLog

SECOND_NS = 1_000_000_000
SSI2 = {"profile": "j1939_ssi2", "source": 0x20, "accept_unprotected": True}


def logged(number, data=b"", now_ns=0, kind=FrameKind.DATA, *, extended=True):
    return BusFrame(now_ns, "can0", number, extended, kind, data, len(data))


def scenario(devices=None):
    found = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
    section = None if devices is None else DevicesSection(**devices)
    vessel = found.vessel.model_copy(update={"devices": section})
    return found.model_copy(update={"vessel": vessel})


def traffic(found, seconds=3):
    """Messages of the emulated ship, without a controller."""
    heard = []

    def trace(now_ns, _, frame):
        number, extended = frame.can_id & ~STANDARD, not frame.can_id & STANDARD
        heard.append(logged(number, frame.data, now_ns, extended=extended))

    ship = build_ship_side(found, 1, ())
    run = Lockstep(list(ship.nodes), trace=trace)
    run.run_until(seconds * SECOND_NS)
    return heard, run.bus.load(seconds * SECOND_NS)


def census(messages, vessel=None, bit_rate=250000):
    found = BusCensus(bit_rate, vessel)
    for message in messages:
        found.take(message)
    return found


def kinds(found):
    return Counter(kind for kind, _ in found.problems())


def test_all_that_the_ships_file_expects_is_there_and_once():
    ship = scenario()
    messages, load = traffic(ship)
    found = census(messages, ship.vessel)
    assert found.problems() == []
    assert set(found.versions) == {"SENSORS", "DRIVE", "OPERATOR"}
    assert found.load == pytest.approx(load, rel=0.01)
    rates = {row["message"]: row["rate_hz"] for row in found.rows()}
    assert rates["SENSOR_MOTION"] == pytest.approx(100, rel=0.01)
    assert rates["SENSOR_TANK"] == pytest.approx(50, rel=0.01)


def test_a_device_by_its_profile_is_expected_like_a_node():
    ship = scenario({"motion": SSI2})
    messages, _ = traffic(ship)
    assert census(messages, ship.vessel).problems() == []
    without = [each for each in messages if each.number >> 8 & 0xFFFF != 0xF029]
    (problem,) = census(without, ship.vessel).problems()
    assert problem[0] == "missing"
    assert "motion slope PGN 61481" in problem[1]


def test_contents_of_one_identifier_and_a_status_that_is_not_valid_are_named():
    page, count = {"start": 0, "bits": 8}, {"bits": 16, "signed": True}
    pages = {
        name: {"id": 0x18FF5A21, "format": "29bit", "only": {"from": "PAGE", "in": [number]},
               "signals": {"PAGE": page, "A": {"start": 8, **count}, "B": {"start": 24, **count}}}
        for name, number in (("values", 1), ("state", 2))
    }  # fmt: skip
    roll, rate = ({"from": f"values.{name}", "scale": 1e-4} for name in "AB")
    theirs = {
        "profile": "", "messages": pages, "cycle_ms": 20, "age_ms": 60, "accept_unprotected": True,
        "signals": {"roll_rad": roll, "roll_rate_rad_s": rate},
        "protection": {"unchanged_ms": 2000},
        "valid_when": [{"from": "state.A", "mask": 3, "in": [3]}],
    }  # fmt: skip
    ship = scenario({"motion": theirs})
    messages, _ = traffic(ship)
    found = census(messages, ship.vessel)
    assert found.problems() == []
    (shown,) = (row["message"] for row in found.rows() if row["node"] == "motion")
    assert shown == "values, state PGN 65370"
    ill = [
        each._replace(data=b"\x02\x01" + bytes(6)) if each.number == 0x18FF5A21 else each
        for each in messages
        if each.number != 0x18FF5A21 or each.data[0] == 2
    ]
    assert census(ill, ship.vessel).problems() == [
        ("missing", "motion values PGN 65370 18FF5A21 was not heard"),
        ("wrong", "motion state PGN 65370 18FF5A21: status 0x1 (mask 0x3) is not valid"),
    ]


def test_a_device_of_the_ships_file_has_its_name_in_the_table_and_its_remedy():
    gauges = {
        "profile": "cia404_levels",
        "node": 7,
        "accept_unprotected": True,
        "high_level_m": 4.6,
    }
    gauges["signals"] = {f"{side}_level_m": {"scale": 1e-3} for side in ("port", "starboard")}
    ship = scenario({"motion": {"profile": "sbg_ellipse", "accept_unprotected": True},
                     "levels": gauges})  # fmt: skip
    messages, _ = traffic(ship)
    found = census([each for each in messages if each.extended or each.number < 0x180], ship.vessel)
    named = {row["id"]: (row["node"], row["message"]) for row in found.rows()}
    assert named["132"] == ("motion", "attitude")
    silent = [text for _, text in found.problems()]
    assert any(re.match(r"levels \w+ 187 was not heard; .*conform levels", text) for text in silent)


def test_hard_wired_inputs_are_missed_only_by_a_ship_that_has_them():
    ship = scenario()
    messages, _ = traffic(ship)
    declared = replace(ship.vessel.redundancy, hardwired_inputs=True)
    vessel = ship.vessel.model_copy(update={"redundancy": declared})
    missing = [text for kind, text in census(messages, vessel).problems() if kind == "missing"]
    assert any("HARDWIRED_INPUTS" in text for text in missing)
    having = ship.model_copy(update={"vessel": vessel})
    messages, _ = traffic(having)
    assert census(messages, vessel).problems() == []


def test_what_is_missing_wrong_and_double_is_named():
    ship = scenario()
    messages, _ = traffic(ship)
    motion = next(e for e in messages if e.number & 0xFF == 0x82).number
    assert kinds(census([e for e in messages if e.number & 0xFF != 0x81], ship.vessel)) == {
        "missing": 3
    }
    twice = [each for each in messages for _ in range(1 + (each.number == motion))]
    assert kinds(census(twice, ship.vessel))["double"] >= 1
    stranger = ship.vessel.model_copy(update={"least_gm_m": None, "devices": DevicesSection()})
    wrong = census(messages, stranger).problems()
    assert [kind for kind, _ in wrong] == ["wrong"] * 3
    assert f"wanted {found_version()}/{stranger.version}" in wrong[0][1]


def found_version():
    from utank_hil.canbus import load_catalogue

    return load_catalogue().version


def test_a_sensor_at_half_its_rate_is_wrong():
    ship = scenario()
    messages, _ = traffic(ship)
    ids = Counter(each.number for each in messages)
    motion = max(ids, key=ids.get)
    count = 0
    kept = []
    for each in messages:
        count += each.number == motion
        if each.number != motion or count % 2:
            kept.append(each)
    (problem,) = census(kept, ship.vessel).problems()
    assert problem[0] == "wrong"
    assert "50" in problem[1]
    assert "100 are right" in problem[1]


def test_a_log_of_canopen_nodes():
    found = census(BusLog(others_file("devices/frames/cia402-sample.candump.log")).frames())
    assert len(found.rows()) == 26
    assert found.errors == {"error frame of class 0x4": 2}
    assert set(found.states) == {1, 2, 3, 5}
    assert sum(row["frames"] for row in found.rows()) == 5304 - 2
    assert found.problems() == []


def test_two_attitudes_of_one_ship_are_two_sources():
    log = others_file("devices/frames/n2k-two-attitudes.candump.log")
    found = census(BusLog(log).frames())
    nodes = {row["node"] for row in found.rows() if row["message"] == "PGN 127257"}
    assert nodes == {"source 0x1b", "source 0x34"}
    assert found.duration_s == pytest.approx(120, abs=1)


def test_an_address_that_two_devices_claim_is_double():
    claims = [logged(0x18EEFF20, bytes([k] * 8), k) for k in range(2)]
    assert census(claims).problems() == [("double", "source 0x20 is claimed by 2 devices")]


def test_error_frames_are_counted_by_their_class():
    messages = [logged(0x40, kind=FrameKind.ERROR), logged(5, kind=FrameKind.REMOTE)]
    assert census(messages).errors == {"error frame of class 0x40": 1, "remote frame": 1}
