"""Lines of motion sentences: UDP on the loopback, a serial port on a pseudo terminal."""

import os
import socket
import struct
import threading
import time

import pytest
from typer.testing import CliRunner

from utank_hil.canbus import Frame, PortError
from utank_hil.canbus.frame import BUS_SHIFT
from utank_hil.canbus.line_names import line_of
from utank_hil.canbus.ports import open_buses
from utank_hil.canbus.sentences import EM3000, PSXN_ATTITUDE, PSXN_QUALITY, TSS1
from utank_hil.canbus.socketcan import SocketCanPort
from utank_hil.commands.bus import bus
from utank_hil.configuration.devices import DevicesSection
from utank_hil.console.common import new_app

SAID = b"$PSXN,20,0,0,0,0*3B\r\n$PSXN,23,1.28,1.93,104.68,-0.24*18\r\n"
MOTION = struct.pack("<Bhhh", 0x46, 128, 193, -24)


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


@pytest.fixture
def udp():
    """A line, its port, and a socket of the address that may send there."""
    number = free_port()
    port = SocketCanPort(f"udp:127.0.0.1:{number}:127.0.0.2", standard=True)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.bind(("127.0.0.2", 0))
        sender.connect(("127.0.0.1", number))
        yield port, number, sender
    port.close()


def received(port, count):
    """Frames until so many have come, within five seconds."""
    frames, end_s = [], time.monotonic() + 5
    while len(frames) < count and time.monotonic() < end_s:
        frames += port.receive()
    return frames


def told(port, count):
    """What it says in three looks that bring so many frames."""
    found, said = [], []
    for _ in range(3):
        try:
            found += port.receive()
        except PortError as error:
            said.append(str(error).partition(": ")[2].partition(";")[0])
    assert len(found) == count
    return said


def ids(frames):
    return [each.can_id for each in frames]


def test_two_sentences_in_one_datagram_and_one_in_two(udp):
    port, _, sender = udp
    sender.send(SAID)
    assert ids(received(port, 2)) == [PSXN_QUALITY, PSXN_ATTITUDE]
    sender.send(SAID[:30])
    sender.send(SAID[30:])
    assert ids(received(port, 2)) == [PSXN_QUALITY, PSXN_ATTITUDE]
    assert port.others == 0


def test_another_sender_is_not_read_and_told_once(udp):
    port, number, sender = udp
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
        stranger.bind(("127.0.0.3", 0))
        for _ in range(200):
            stranger.sendto(SAID, ("127.0.0.1", number))
        sender.send(SAID)
        assert told(port, 2) == ["there is another sender than its own"]
        sender.send(SAID)
        stranger.sendto(SAID, ("127.0.0.1", number))
        assert told(port, 2) == []


def test_a_flood_holds_no_look_for_long_and_garbage_is_counted(udp):
    port, _, sender = udp
    for k in range(250):
        sender.send(b"\xff" * 200 if k % 2 else b"$GPHDT,104.68,T*0E\r\n")
    assert port.receive() == []
    assert port.others > 10
    for _ in range(20):
        port.receive()
    sender.send(b"\r\n" + SAID)
    assert ids(received(port, 2))[-2:] == [PSXN_QUALITY, PSXN_ATTITUDE]


def test_the_controller_sends_nothing_there(udp):
    port, _, _ = udp
    with pytest.raises(PortError, match="nothing is sent there"):
        port.send(Frame(TSS1, MOTION))


def test_a_line_in_use_is_an_error_with_its_remedy(udp):
    _, number, _ = udp
    name = f"udp:127.0.0.1:{number}:127.0.0.2"
    with pytest.raises(PortError, match=r"line udp:.*in use.*only one program") as error:
        SocketCanPort(name)
    assert str(error.value).count("write udp:") == 1


def test_emulated_sensor_and_controller_on_two_lines(tmp_path):
    """As the buses of a ship are opened on both sides; the serial port is made by the sensor."""
    names = f"udp:127.0.0.1:{free_port()}:127.0.0.1", f"serial:{tmp_path}/tty:115200"
    motion = {"accept_unprotected": True}
    section = DevicesSection(
        motion=motion | {"profile": "tss1", "bus": names[0]},
        motion_2=motion | {"profile": "em3000", "bus": names[1]},
    )
    buses = section.foreign().buses
    there = [SocketCanPort(name, standard=True, emulates=True) for name in buses[1:]]
    here = [SocketCanPort(name, standard=True) for name in buses[1:]]
    try:
        for name, sensor, port in zip(buses[1:], there, here, strict=True):
            data = MOTION if name == names[0] else b"\x90" + MOTION[1:]
            frame = Frame(TSS1 if name == names[0] else EM3000, data)
            for _ in range(3):
                sensor.send(frame)
            assert received(port, 2)[:2] == [frame, frame]
            assert sensor.receive() == []
    finally:
        for port in here + there:
            port.close()
    assert not (tmp_path / "tty").exists()


def test_a_serial_port_that_is_pulled_is_used_again_when_it_is_back(tmp_path):
    link = tmp_path / "tty"
    first, second = os.openpty()
    link.symlink_to(os.ttyname(second))
    port = SocketCanPort(f"serial:{link}:9600", standard=True)
    try:
        os.write(first, SAID)
        assert ids(received(port, 2)) == [PSXN_QUALITY, PSXN_ATTITUDE]
        os.close(first)
        os.close(second)
        link.unlink()
        assert len(told(port, 0)) == 3
        with pytest.raises(PortError, match="No such file"):
            port.receive()
        first, second = os.openpty()
        link.symlink_to(os.ttyname(second))
        assert port.receive() == []
        os.write(first, SAID)
        assert ids(received(port, 2)) == [PSXN_QUALITY, PSXN_ATTITUDE]
    finally:
        port.close()
        os.close(first)
        os.close(second)


def test_a_file_is_no_serial_port(tmp_path):
    (tmp_path / "log").touch()
    with pytest.raises(PortError, match="no serial port"):
        SocketCanPort(f"serial:{tmp_path}/log:9600")


@pytest.mark.parametrize(
    "name",
    ["udp:127.0.0.1:5001", "udp:127.0.0.1:5001:", "udp:0.0.0.0:5001:127.0.0.1",
     "udp:127.0.0.1:5001:239.1.2.3", "udp:127.0.0.1:0:127.0.0.1", "udp:127.0.0.1:70000:127.0.0.1",
     "udp:127.0.0.1:x:127.0.0.1", "udp:255.255.255.255:1:127.0.0.1", "udp:mru:5001:127.0.0.1",
     "serial:ttyS0:9600", "serial:/dev/ttyS0", "serial:/dev/ttyS0:0", "serial:/dev/ttyS0:12345",
     "serial:/dev/ttyS0:9600:7"],
)  # fmt: skip
def test_names_that_are_no_line(name):
    with pytest.raises(ValueError, match=r"\S"):
        line_of(name)
    with pytest.raises(PortError, match="write udp:OWN_ADDRESS"):
        SocketCanPort(name)


def test_bus_lists_what_a_line_brings(tmp_path):
    name = f"serial:{tmp_path}/tty:38400"
    first, second = os.openpty()
    (tmp_path / "tty").symlink_to(os.ttyname(second))

    app = new_app("test")
    app.command()(bus)
    ended = threading.Event()

    def keep():
        while not ended.wait(0.02):
            os.write(first, SAID)

    thread = threading.Thread(target=keep)
    thread.start()
    try:
        done = CliRunner().invoke(app, [name, "--seconds", "1", "--json"])
    finally:
        ended.set()
        thread.join()
        os.close(first)
        os.close(second)
    assert done.exit_code == 0
    assert '"023"' in done.output
    assert '"$PSXN,23"' in done.output


def test_one_that_fails_to_open_leaves_none_open():
    name = f"udp:127.0.0.1:{free_port()}:127.0.0.1"
    motion = {"accept_unprotected": True, "profile": "psxn"}
    section = DevicesSection(motion=motion | {"bus": name}).foreign()
    with pytest.raises(PortError):
        open_buses("nothing0", section)
    SocketCanPort(name).close()
    assert section.motions[0].messages[0].can_ids == (PSXN_QUALITY | 1 << BUS_SHIFT,)
