"""A serial adapter in the place of a SocketCAN interface, on a pseudo terminal."""

import json
import threading
import time

import pytest
from typer.testing import CliRunner

from tests.canbus.slcan_hub import Hub
from utank_hil.canbus import Frame, PortError
from utank_hil.canbus.frame import STANDARD
from utank_hil.canbus.ports import why_other_bit_rate
from utank_hil.canbus.socketcan import SocketCanPort
from utank_hil.commands.bus import bus
from utank_hil.console.common import new_app
from utank_hil.console.exit_codes import ExitCode

LONG, SHORT = Frame(0x08FF3082, bytes(range(8))), Frame(0x132 | STANDARD, b"\x01\x02")


@pytest.fixture
def hub():
    with Hub(2) as hub:
        yield hub


def opened(hub, number, how="O"):
    """Wait until the hub has seen that an adapter was opened."""
    end_s = time.monotonic() + 20
    while how not in hub.told[number] and time.monotonic() < end_s:
        time.sleep(1e-3)


def received(port, count):
    """Frames until so many have come, within five seconds."""
    frames, end_s = [], time.monotonic() + 5
    while len(frames) < count and time.monotonic() < end_s:
        frames += port.receive()
    return frames


def test_frames_of_both_lengths_pass_and_the_bit_rate_is_set(hub):
    here = SocketCanPort(f"slcan:{hub.ports[0]}", standard=True)
    there = SocketCanPort(f"slcan:{hub.ports[1]}:500000", standard=True)
    try:
        opened(hub, 0)
        opened(hub, 1)
        for each in (LONG, SHORT):
            here.send(each)
        assert received(there, 2) == [LONG, SHORT]
        there.send(LONG)
        there.send(SHORT)
        assert received(here, 2) == [LONG, SHORT]  # behind the acknowledgements of its own
    finally:
        here.close()
        there.close()
    assert "S5" in hub.told[0]
    assert "S6" in hub.told[1]


def test_a_spoilt_line_is_counted_and_neither_it_nor_a_filter_does_harm(hub):
    port = SocketCanPort(f"slcan:{hub.ports[0]}", [LONG.can_id])
    try:
        opened(hub, 0)
        hub.say(0, b"\xff\rTnonsense\r\rT08FF3081100\rT08FF308")  # another identifier, half a frame
        hub.say(0, b"28" + LONG.data.hex().encode() + b"\r")
        assert received(port, 1) == [LONG]
        assert port.others == 2  # nothing is lost in silence
    finally:
        port.close()


def test_an_adapter_that_is_pulled_is_an_error_and_is_used_again_when_it_is_back(tmp_path):
    link = tmp_path / "tty"
    with Hub(1) as hub:
        link.symlink_to(hub.ports[0])
        port = SocketCanPort(f"slcan:{link}")
        port.send(LONG)
    with pytest.raises(PortError, match="plug in the adapter"):
        port.receive()
    with Hub(2) as hub:
        link.unlink()
        link.symlink_to(hub.ports[0])
        port.send(LONG)
        port.close()


@pytest.mark.parametrize("name", ["slcan:/dev/none", "slcan:/dev/null:fast", "slcan:"])
def test_one_that_is_not_there_is_named_with_the_remedy(name):
    with pytest.raises(
        PortError, match=r"slcan:/dev/ttyACM0:500000; it needs pip install pyserial"
    ):
        SocketCanPort(name)


def test_its_bit_rate_is_compared_with_that_of_the_file():
    assert why_other_bit_rate("slcan:/dev/ttyACM0", 250_000) == ""
    assert "(slcan:/dev/ttyACM0:500000)" in why_other_bit_rate("slcan:/dev/ttyACM0", 500_000)


def test_bus_lists_what_an_adapter_hears_and_only_listens(hub):
    line = f"T{LONG.can_id:08X}8{LONG.data.hex()}\r".encode()
    later = threading.Thread(target=lambda: (opened(hub, 0, "L"), hub.say(0, line * 3)))
    later.start()
    app = new_app()
    app.command()(bus)
    done = CliRunner().invoke(app, [f"slcan:{hub.ports[0]}", "--seconds", "1", "--json"])
    assert done.exit_code == ExitCode.OK, done.output
    assert [row["frames"] for row in json.loads(done.stdout)["messages"]] == [3]
    assert "L" in hub.told[0]
    assert "O" not in hub.told[0]
