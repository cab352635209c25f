"""Sentences, read by a parser of their published form that shares nothing with their maker."""

import re
from dataclasses import dataclass
from datetime import UTC, datetime

import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.canbus import AlarmState, Fault, Mode
from utank_hil.canbus.events import AlarmEvent
from utank_hil.canbus.sentences import checksum
from utank_hil.commands.outward.alerts import (
    Alerts,
    Framing,
    alert_command,
    sentence,
    text_field,
    title,
)
from utank_hil.safety.alarms import Gravity, gravest
from utank_hil.safety.faults import FAULTS, FaultRow

UTC_TIME = datetime(2026, 11, 28, 9, 8, 7, 654_321, UTC)


@dataclass
class Alf:
    time: str
    category: str
    priority: str
    state: str
    identifier: int
    revision: int
    title: str
    description: str


def split(text: str) -> list[str]:
    """Fields of one sentence, checked character by character."""
    assert text.endswith("\r\n")
    assert len(text) <= 82
    body, _, digits = text[1:-2].partition("*")
    assert text[0] == "$"
    value = 0
    for character in body:
        assert 0x20 <= ord(character) < 0x7F
        value ^= ord(character)
    assert int(digits, 16) == value
    assert len(digits) == 2
    return body.split(",")


def parse_alf(message: list[str]) -> Alf:
    first, second = map(split, message)
    assert (len(first), len(second)) == (14, 14)
    assert first[0][2:] == second[0][2:] == "ALF"
    assert (first[1:3], second[1:3]) == (["2", "1"], ["2", "2"])
    assert first[3] == second[3]
    assert 0 <= int(first[3]) <= 9
    assert second[4:8] == ["", "", "", ""]  # null in the second sentence
    assert first[8:13] == second[8:13]
    assert 1 <= int(first[11]) <= 99
    assert (first[8], first[10], first[12]) == ("", "1", "0")
    texts = [
        re.sub(r"\^([0-9A-F]{2})", lambda found: chr(int(found[1], 16)), fields[13])
        for fields in (first, second)
    ]
    assert len(texts[0]) <= 16
    return Alf(*first[4:8], int(first[9]), int(first[11]), *texts)


def event(code: Fault, state: AlarmState | None) -> AlarmEvent:
    return AlarmEvent(0, code, state, Mode.ACTIVE)


def command(letter: str, identifier: str, *, manufacturer: str = "", flag: str = "C") -> str:
    body = f"BNACN,120000.00,{manufacturer},{identifier},1,{letter},{flag}"
    return f"${body}*{checksum(body.encode())}\r\n"


def test_the_checksum_is_that_of_published_sentences() -> None:
    # a sentence and a tag block as receivers of others give them
    assert checksum(b"HEHDT,119.9,T") == "2F"
    block = "g:1-2-73874,n:157036,s:r003669945,c:1241544035"
    assert checksum(block.encode()) == "4A"


@pytest.mark.parametrize("row", FAULTS, ids=lambda row: row.code.name)
def test_every_fault_has_a_whole_alert(row: FaultRow) -> None:
    code = row.code
    (message,) = Alerts().take(event(code, AlarmState.ACTIVE_UNACKNOWLEDGED), UTC_TIME)
    alert = parse_alf(message)
    assert (alert.time, alert.category, alert.revision) == ("090807.65", "B", 1)
    assert alert.identifier == 10_000 + code
    assert alert.title == title(code)
    assert row.happened.startswith(alert.description)
    assert len(alert.description) > 20
    grave = gravest(code)
    assert alert.priority == {Gravity.ENDS: "A", Gravity.HALVES: "W", Gravity.NOTHING: "C"}[grave]
    assert alert.state == ("A" if grave is Gravity.NOTHING else "V")


def test_titles_differ_and_identifiers_stay() -> None:
    assert len({title(code) for code in Fault}) == len(Fault)
    # known to a ship's system that was set up with them
    numbers = {"MOTION_SILENT": 10001, "LEVEL_LIMIT": 10014, "HARDWIRED_STOP": 10032}
    for name, identifier in numbers.items():
        (message,) = Alerts().take(event(Fault[name], AlarmState.ACTIVE_UNACKNOWLEDGED), UTC_TIME)
        assert parse_alf(message).identifier == identifier


def test_priorities_follow_what_a_fault_does_to_the_pressure() -> None:
    assert gravest(Fault.LEVEL_LIMIT) is Gravity.ENDS
    assert gravest(Fault.DRIVE_WARNING) is not Gravity.ENDS
    assert gravest(Fault.NOT_COMMISSIONED) is Gravity.NOTHING
    assert gravest(Fault.NONE) is Gravity.NOTHING


def test_an_alert_goes_through_its_states_with_a_revision_each() -> None:
    alerts, seen = Alerts(), []
    for state in (
        AlarmState.ACTIVE_UNACKNOWLEDGED,
        AlarmState.ACTIVE_UNACKNOWLEDGED,  # raised anew
        None,  # a refused reset changes no alert
        AlarmState.ACTIVE_ACKNOWLEDGED,
        AlarmState.NORMAL,
        AlarmState.ACTIVE_UNACKNOWLEDGED,
        AlarmState.RECTIFIED_UNACKNOWLEDGED,
        AlarmState.NORMAL,
    ):
        seen += [parse_alf(m) for m in alerts.take(event(Fault.LEVEL_LIMIT, state), UTC_TIME)]
    assert "".join(each.state for each in seen) == "VVANVUN"
    assert [each.revision for each in seen] == list(range(1, 8))


def test_a_caution_is_never_unacknowledged() -> None:
    alerts, seen = Alerts(), []
    for state in (*list(AlarmState)[:3], AlarmState.NORMAL):
        for each in alerts.take(event(Fault.NOT_COMMISSIONED, state), UTC_TIME):
            seen += parse_alf(each).state
    assert seen == ["A", "N"]


def test_the_cyclic_list_splits_between_entries_and_has_each_alert_once() -> None:
    alerts = Alerts()
    head = split(alerts.cyclic()[0])
    assert head[1:] == ["01", "01", "00", "0"]
    for code in list(Fault) * 12:  # revisions of two digits
        alerts.take(event(code, AlarmState.ACTIVE_UNACKNOWLEDGED), UTC_TIME)
    alerts.take(event(Fault.DRIFT, AlarmState.NORMAL), UTC_TIME)
    message = alerts.cyclic()
    found = []
    for number, text in enumerate(message, 1):
        fields = split(text)
        assert fields[:4] == ["U0ALC", f"{len(message):02}", f"{number:02}", "01"]
        entries = fields[5:]
        assert len(entries) == 4 * int(fields[4])
        found += [int(identifier) for identifier in entries[1::4]]
    assert sorted(found) == sorted(10_000 + code for code in Fault if code is not Fault.DRIFT)


@pytest.mark.parametrize("letter", "AOS")
def test_commands_are_refused(letter: str) -> None:
    alerts = Alerts()
    alerts.take(event(Fault.LEVEL_LIMIT, AlarmState.ACTIVE_UNACKNOWLEDGED), UTC_TIME)
    ((text,),) = alerts.answer(command(letter, "10014"), UTC_TIME)
    assert split(text) == ["U0ARC", "090807.65", "", "10014", "1", letter]


def test_a_request_is_answered_by_the_alert_itself() -> None:
    alerts = Alerts()
    ((refused,),) = alerts.answer(command("Q", "10014"), UTC_TIME)  # there is no such alert yet
    assert split(refused)[0] == "U0ARC"
    ((sent),) = alerts.take(event(Fault.LEVEL_LIMIT, AlarmState.ACTIVE_UNACKNOWLEDGED), UTC_TIME)
    ((again),) = alerts.answer(command("Q", "10014"), UTC_TIME)
    assert parse_alf(again) == parse_alf(sent)


@pytest.mark.parametrize(
    "line",
    [
        command("A", "10014", manufacturer="FEC"),
        command("A", "14"),
        command("A", "10014", flag=""),
        command("X", "10014"),
        command("", "10014"),
        command("A", "10014").replace("*", "*0"),
        command("A", "10014").replace("ACN", "ACM"),
        "",
        "$*00",
    ],
)
def test_what_is_not_for_this_equipment_has_no_answer(line: str) -> None:
    assert Alerts().answer(line, UTC_TIME) == []


@given(st.text(max_size=200))
def test_no_text_breaks_a_sentence_or_its_reader(text: str) -> None:
    assert len(split(sentence("ALF", [text_field(text, 40)]))) == 2
    alert_command(text)
    list(Framing(header=True).lines(text.encode()))


def test_a_sentence_that_is_too_long_is_an_error() -> None:
    with pytest.raises(ValueError, match="83 characters"):
        sentence("ALF", ["x" * 71])


def test_datagrams_of_61162_450_carry_source_line_and_group() -> None:
    framing = Framing(header=True)
    messages = [[sentence("ALC", [str(n)]), sentence("ALC", ["0"])] for n in range(2)]
    datagrams = [framing.datagram(each) for each in messages]
    blocks = []
    for datagram, message in zip(datagrams, messages, strict=True):
        assert datagram[:6] == b"UdPbC\0"
        assert list(framing.lines(datagram)) == [each.rstrip() for each in message]
        for line in datagram[6:].decode().splitlines():
            _, block, text = line.split("\\")
            content, _, digits = block.partition("*")
            assert int(digits, 16) == int(checksum(content.encode()), 16)
            assert text.startswith("$U0ALC")
            blocks.append(content)
    assert blocks == [
        "g:1-2-1,s:U00001,n:1",
        "g:2-2-1,s:U00001,n:2",
        "g:1-2-2,s:U00001,n:3",
        "g:2-2-2,s:U00001,n:4",
    ]
    damaged = datagrams[0].replace(b"n:1", b"n:7")
    assert len(list(framing.lines(damaged))) == 1
    assert list(framing.lines(datagrams[0][6:])) == []  # no header, where one is due
