"""Outlets on loopback, read by sockets and by the client of pymodbus."""

import os
import socket
import struct
import time
from collections.abc import Iterator
from contextlib import ExitStack
from datetime import UTC, datetime

import numpy as np
import pytest
from pymodbus.client import ModbusTcpClient
from test_sentences import command, parse_alf, split
from typer.testing import CliRunner

from utank_hil.canbus import AlarmState, Fault, Mode
from utank_hil.canbus.events import AlarmEvent
from utank_hil.cli import app
from utank_hil.commands.announcer import Announcer
from utank_hil.commands.outward import outlets as module
from utank_hil.commands.outward import registers
from utank_hil.commands.outward.outlets import Outlet, Outward, read_outlet
from utank_hil.commands.outward.registers import REGISTERS
from utank_hil.nodes.signals import SIGNALS
from utank_hil.telemetry.ring import RowWriter

RAISED = AlarmEvent(0, Fault.LEVEL_LIMIT, AlarmState.ACTIVE_UNACKNOWLEDGED, Mode.FAULT)


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
        found.bind(("127.0.0.1", 0))
        found.settimeout(5.0)
        yield found


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


def row(**shown: float) -> np.ndarray:
    return np.array([shown.get(name, np.nan) for name in SIGNALS])


@pytest.fixture
def served() -> Iterator[tuple[Outward, ModbusTcpClient, RowWriter]]:
    port, said = free_port(), list[str]()
    outlet = read_outlet(f"modbus://127.0.0.1:{port}")
    with (
        RowWriter(SIGNALS, 64) as rows,
        Outward([outlet], os.getpid(), said.append) as outward,
        ModbusTcpClient("127.0.0.1", port=port, timeout=2, retries=0) as client,
    ):
        assert not said
        yield outward, client, rows


def test_registers_show_state_and_alarms(
    served: tuple[Outward, ModbusTcpClient, RowWriter], monkeypatch: pytest.MonkeyPatch
) -> None:
    outward, client, rows = served
    rows.write(
        row(mode=3, roll_rad=np.radians(-4.56), pressure_command_pa=-50e3, pressure_actual_pa=1e9)
    )
    outward.take(RAISED, datetime.now(UTC))
    accepted = AlarmState.ACTIVE_ACKNOWLEDGED
    outward.take(AlarmEvent(0, Fault.DRIFT, accepted, Mode.FAULT), datetime.now(UTC))
    outward.look(lost=0)
    for read in (client.read_input_registers, client.read_holding_registers):
        life, mode, roll, asked, measured, fault, count, waiting, complete = read(
            0, count=len(REGISTERS)
        ).registers
        assert (life, mode, roll, asked) == (1, 3, 65536 - 456, 65536 - 5000)
        assert (measured, fault) == (32767, 0x8000)  # beyond the range; not available
        assert (count, waiting, complete) == (2, 1, 1)
    alarms = client.read_input_registers(100, count=max(Fault) + 1).registers
    assert {code: state for code, state in enumerate(alarms) if state} == {14: 1, 11: 2}
    outward.take(AlarmEvent(0, Fault.DRIFT, AlarmState.NORMAL, Mode.FAULT), datetime.now(UTC))
    monkeypatch.setattr(module, "STALE_S", 0.0)
    outward.look(lost=1)  # no new row: the controller's loop stands, and its life counter with it
    assert client.read_input_registers(0, count=9).registers == [
        1, 0x8000, 0x8000, 0x8000, 0x8000, 0x8000, 1, 1, 0,
    ]  # fmt: skip
    assert client.read_input_registers(100 + Fault.DRIFT, count=1).registers == [0]


def test_writes_and_other_addresses_are_refused(
    served: tuple[Outward, ModbusTcpClient, RowWriter],
) -> None:
    outward, client, _ = served
    outward.look(lost=0)
    before = client.read_holding_registers(0, count=9).registers
    refused = [
        client.write_register(1, 3),
        client.write_registers(0, [1, 2]),
        client.write_coil(0, True),
        client.mask_write_register(address=0, and_mask=0, or_mask=1),
        client.read_coils(0, count=1),
    ]
    assert [(each.isError(), each.exception_code) for each in refused] == [(True, 1)] * 5
    assert client.read_holding_registers(50, count=1).exception_code == 2
    assert client.read_holding_registers(0, count=9).registers == before


def request(pdu: bytes, protocol: int = 0) -> bytes:
    return struct.pack(">HHHB", 7, protocol, len(pdu) + 1, 1) + pdu


READ = request(struct.pack(">BHH", 3, 0, 2))
WRITE_FILE = b"\x15\x09\x06\x00\x01\x00\x00\x00\x01\x00\x05"


@pytest.mark.parametrize(
    ("sent", "answers"),
    [
        (READ * 3, [2 + 4] * 3),  # at once, as by a client that does not wait
        (request(b"\x2b\x0e\x01\x00") + READ, [2, 2 + 4]),  # identification
        (request(WRITE_FILE) + READ, [2, 2 + 4]),
        (request(b"\x03\x00") + READ, [2, 2 + 4]),
        (request(struct.pack(">BHH", 4, 100, 126)) + READ, [2, 2 + 4]),
        (b"GET / HTTP/1.1\r\n\r\n", []),
        (request(b"\x03\x00\x00\x00\x02", protocol=1), []),
    ],
)
def test_a_request_of_any_client_has_its_answer(
    served: tuple[Outward, ModbusTcpClient, RowWriter], sent: bytes, answers: list[int]
) -> None:
    _, client, _ = served
    with socket.create_connection((client.comm_params.host, client.comm_params.port), 5) as own:
        own.sendall(sent)
        own.shutdown(socket.SHUT_WR)
        with own.makefile("rb") as file:
            for length in answers:
                assert struct.unpack(">HHHB", file.read(7)) == (7, 0, length + 1, 1)
                assert bool(file.read(length)[0] & 0x80) == (length == 2)
            assert file.read() == b""
    assert client.read_holding_registers(0, count=2).registers[1] == 0x8000


def test_clients_that_have_gone_without_a_word_keep_no_place(
    served: tuple[Outward, ModbusTcpClient, RowWriter], monkeypatch: pytest.MonkeyPatch
) -> None:
    _, client, _ = served
    monkeypatch.setattr(registers, "_MOST_CLIENTS", 2)
    address = client.comm_params.host, client.comm_params.port
    with ExitStack() as stack:
        first, *_, last = (
            stack.enter_context(socket.create_connection(address, 5)) for _ in range(4)
        )
        last.sendall(READ)
        assert len(last.recv(100)) == 13
        assert first.recv(1) == b""


def test_the_end_with_clients_is_quiet(caplog: pytest.LogCaptureFixture) -> None:
    """One of them waits, and one has asked for more than it reads."""
    port = free_port()
    with ExitStack() as stack:
        outlet = read_outlet(f"modbus://127.0.0.1:{port}")
        with Outward([outlet], os.getpid(), print):
            for asked in (READ, READ * 200_000):
                client = stack.enter_context(socket.create_connection(("127.0.0.1", port), 5))
                client.setblocking(False)
                client.send(asked)
            time.sleep(0.2)
    assert caplog.messages == []


def test_the_server_ends_after_an_answer_that_failed(monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(*_: object) -> bytes:
        raise RuntimeError("an answer that fails")

    monkeypatch.setattr(registers, "reply", failing)
    monkeypatch.setattr(registers, "values", lambda _: {})
    address = ("127.0.0.1", free_port())
    server = registers.ModbusServer(address, None)  # type: ignore[arg-type]
    with socket.create_connection(address, 5) as client:
        client.settimeout(5)
        client.sendall(READ)
        assert client.recv(64) == b""  # its connection is closed, not left open
        server.close()
    assert not server._thread.is_alive()


def test_a_port_in_use_is_said_and_the_rest_goes_on(listener: socket.socket) -> None:
    said: list[str] = []
    with socket.create_server(("127.0.0.1", 0)) as other:
        taken = other.getsockname()[1]
        outlets = [
            Outlet("modbus", ("127.0.0.1", taken)),
            Outlet("udp", ("127.0.0.1", 9), hear=listener.getsockname()),
            Outlet("udp", listener.getsockname()),
        ]
        with Outward(outlets, os.getpid(), said.append) as outward:
            outward.take(RAISED, datetime.now(UTC))
    assert len(said) == 2
    assert f"modbus://127.0.0.1:{taken}" in said[0]
    assert "Address already in use" in said[1]
    assert listener.recv(1500).startswith(b"$U0ALF")


def test_commands_are_heard_and_refused_on_loopback(listener: socket.socket) -> None:
    hear = ("127.0.0.1", free_port())
    outlet = read_outlet(f"udp://127.0.0.1:{listener.getsockname()[1]}?hear=127.0.0.1:{hear[1]}")
    with Outward([outlet], os.getpid(), pytest.fail) as outward:
        outward.take(RAISED, datetime.now(UTC))
        message = listener.recv(1500).decode().splitlines(keepends=True)
        assert parse_alf(message).identifier == 10_014
        listener.sendto(b"\xff noise\r\n", hear)
        listener.sendto(command("A", "10014").encode().replace(b"BN", b"B\xff"), hear)
        listener.sendto(command("A", "10014").encode(), hear)
        outward.look(lost=0)
        assert split(listener.recv(1500).decode())[0] == "U0ARC"
        assert split(listener.recv(1500).decode())[0] == "U0ALC"
        outward.look(lost=0)  # the next list is due in 30 s
        listener.settimeout(0.05)
        with pytest.raises(TimeoutError):
            listener.recv(1500)


def test_a_flood_of_commands_holds_up_no_look(
    listener: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_MOST_COMMANDS", 2)
    hear = ("127.0.0.1", free_port())
    with Outward(
        [Outlet("udp", listener.getsockname(), hear)], os.getpid(), pytest.fail
    ) as outward:
        for _ in range(3):
            listener.sendto(command("A", "10014").encode(), hear)
        for expected in (["ARC", "ARC", "ALC"], ["ARC"]):
            outward.look(lost=0)
            assert [listener.recv(1500)[3:6].decode() for _ in expected] == expected


def test_the_announcers_process_shows_alarms(listener: socket.socket) -> None:
    outlet = Outlet("iec450", listener.getsockname())
    announcer = Announcer(outlets=[outlet])
    announcer.write(RAISED, time.monotonic_ns())
    listener.settimeout(20.0)
    found = b"".join(listener.recv(1500) for _ in range(2))
    announcer.stop()
    assert announcer.error is None
    assert found.count(b"UdPbC\0") == 2
    assert b"$U0ALF,2,1,0," in found
    assert b"LEVEL LIMIT" in found


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("127.0.0.1:5", "write udp://ADDRESS:PORT"),
        ("udp://ship:5", "Expected 4 octets"),
        ("udp://127.0.0.1", "such as 127.0.0.1:10110"),
        ("modbus://127.0.0.1:0", "from 1 to 65535"),
        ("modbus://127.0.0.1:502?hear=127.0.0.1:5", "of sentences only"),
        ("udp://127.0.0.1:5/x", r"only \?hear"),
        ("udp://127.0.0.1:5#hear=127.0.0.1:6", r"only \?hear"),
    ],
)
def test_a_wrong_address_is_refused_with_the_form(text: str, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        read_outlet(text)


def test_the_command_line_says_what_is_wrong() -> None:
    options = ["run", "configs/controllers/gpc.yaml", "--bus", "no-such", "--outward", "tcp://x"]
    result = CliRunner().invoke(app, options)
    assert result.exit_code == 2
    assert "--outward: 'tcp://x': write" in " ".join(result.stderr.split())
