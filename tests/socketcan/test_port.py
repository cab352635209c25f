"""The port on a real SocketCAN interface; run with ``tools/vcan pytest -m socketcan``."""

import errno
import itertools
import subprocess
import time

import can
import pytest
from can.interfaces.socketcan import SocketcanBus

from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Frame, PortError
from utank_hil.canbus.socketcan import SocketCanPort
from utank_hil.runners import RealTimeLoop

pytestmark = pytest.mark.socketcan

FRAME = Frame(0x18FF0081, bytes(range(8)))
CHANNEL = "vcan7"


def ip(*arguments):
    subprocess.run(["ip", "link", *arguments], check=True, timeout=20)


@pytest.fixture
def interface():
    """An interface of its own, so that taking it down disturbs nobody."""
    ip("add", CHANNEL, "type", "vcan")
    ip("set", CHANNEL, "up")
    yield CHANNEL
    if subprocess.run(["ip", "link", "show", CHANNEL], capture_output=True, timeout=20).returncode:
        return
    ip("del", CHANNEL)


@pytest.fixture
def ports(interface):
    opened = [SocketCanPort(interface), SocketCanPort(interface)]
    yield opened
    for port in opened:
        port.close()


@pytest.fixture
def raw_bus(interface):
    """A bus that sends what a `Frame` can't be."""
    with SocketcanBus(interface) as bus:
        yield bus


def test_frames_arrive_in_order_and_not_at_their_sender(ports):
    here, there = ports
    sent = [Frame(FRAME.can_id, bytes((number,) * 8)) for number in range(50)]
    for frame in sent:
        here.send(frame)
    assert list(there.receive()) == sent
    assert list(there.receive()) == []
    assert list(here.receive()) == []


def test_the_kernel_lets_only_the_asked_identifiers_through(interface, ports):
    filtered = SocketCanPort(interface, can_ids=[FRAME.can_id])
    try:
        ports[0].send(Frame(0x08FF1080, b"\x01"))
        ports[0].send(FRAME)
        assert list(filtered.receive()) == [FRAME]
    finally:
        filtered.close()


def test_standard_and_remote_frames_are_counted_and_left_out(ports, raw_bus):
    raw_bus.send(can.Message(arbitration_id=0x123, is_extended_id=False, data=[1]))
    raw_bus.send(can.Message(arbitration_id=FRAME.can_id, is_remote_frame=True, dlc=8))
    raw_bus.send(can.Message(arbitration_id=FRAME.can_id, data=FRAME.data))
    assert list(ports[0].receive()) == [FRAME]
    assert ports[0].others == 2


def test_bus_off_is_a_port_error(ports, raw_bus):
    raw_bus.send(can.Message(arbitration_id=0x040, is_error_frame=True, data=bytes(8)))
    with pytest.raises(PortError, match=f"{CHANNEL}: bus-off"):
        ports[0].receive()


def test_an_interface_that_goes_down_is_reported_until_it_is_up_and_used(ports):
    here, there = ports
    ip("set", CHANNEL, "down")
    for _ in range(3):
        with pytest.raises(PortError, match=f"ip link set {CHANNEL} up"):
            here.receive()
        with pytest.raises(PortError) as caught:
            here.send(FRAME)
        assert caught.value.errno == errno.ENETDOWN
    ip("set", CHANNEL, "up")
    here.send(FRAME)
    assert list(here.receive()) == []
    with pytest.raises(PortError):  # what the kernel noted while it was down
        there.receive()
    here.send(FRAME)
    assert FRAME in there.receive()


def test_a_deleted_interface_is_reopened_when_it_is_back(ports):
    here, there = ports
    ip("del", CHANNEL)
    for _ in range(4):
        with pytest.raises(PortError):
            here.receive()
        with pytest.raises(PortError):
            there.receive()
    with pytest.raises(PortError, match="not found"):
        here.send(FRAME)
    ip("add", CHANNEL, "type", "vcan")
    ip("set", CHANNEL, "up")
    assert list(there.receive()) == []
    here.send(FRAME)
    assert list(there.receive()) == [FRAME]


class Sender:
    """Sends a frame a tick, and hears those of the other port."""

    name = "sender"
    period_ns = TICK_NS

    def __init__(self):
        self.heard = 0

    def receive(self, frame, now_ns):
        self.heard += 1

    def tick(self, now_ns):
        return [FRAME]


@pytest.mark.timeout(60)  # what waits by the wall clock waits for a day
def test_a_wall_clock_that_jumps_holds_no_loop_up(ports, monkeypatch):
    seconds = itertools.cycle([2e9, 2e9 - 86_400, 2e9 + 86_400, 0.0, 4e9])
    for module in (time, can.bus):  # this has imported the function
        monkeypatch.setattr(module, "time", lambda: next(seconds))
    monkeypatch.setattr(time, "time_ns", lambda: round(1e9 * next(seconds)))
    here, there = ports
    node = Sender()
    loop = RealTimeLoop([node], here)
    begun_ns = time.monotonic_ns()
    for _ in range(20):
        there.send(FRAME)
    loop.run(duration_ns=100 * TICK_NS)
    assert time.monotonic_ns() - begun_ns >= 99 * TICK_NS
    assert node.heard == 20
    assert 0 < len(there.receive()) <= 100


def test_an_interface_that_does_not_exist_is_named():
    with pytest.raises(PortError, match="vcan99: not found"):
        SocketCanPort("vcan99")
