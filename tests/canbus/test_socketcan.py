"""The SocketCAN port over stand-ins that behave as python-can's bus was seen to on a real one."""

import errno
import gc
import socket

import can
import pytest

from utank_hil.canbus import Frame, PortError, socketcan
from utank_hil.canbus.socketcan import SocketCanPort

FRAME = Frame(0x18FF0081, bytes(range(8)))


class FakeBus:
    """A SocketcanBus without a kernel: hands out a script of messages and errors."""

    def __init__(self, channel, receive_own_messages, can_filters):
        assert not receive_own_messages
        self.filters = can_filters
        self.script = []
        self.sent = []
        self.send_errors = []
        self.open = True

    def _recv_internal(self, timeout):
        assert timeout == 0
        item = self.script.pop(0) if self.script else None
        if isinstance(item, Exception):
            raise item
        return item, True

    def send(self, message):
        if self.send_errors:
            raise self.send_errors.pop(0)
        self.sent.append(message)

    def shutdown(self):
        self.open = False


@pytest.fixture
def interfaces(monkeypatch):
    """The interfaces that exist, by name; and the buses opened on them."""
    present = {"can0"}

    def index(name):
        if name not in present:
            raise OSError("no interface with this name")
        return 1

    monkeypatch.setattr(socket, "if_nametoindex", index)
    return present


@pytest.fixture
def buses(monkeypatch, interfaces):
    opened = []

    def open_bus(*args, **kwargs):
        opened.append(FakeBus(*args, **kwargs))
        return opened[-1]

    monkeypatch.setattr(socketcan, "SocketcanBus", open_bus)
    return opened


def message(**changes):
    values = {"arbitration_id": FRAME.can_id, "is_extended_id": True, "data": FRAME.data}
    return can.Message(**(values | changes))


def error_frame(classes, detail=0):
    return can.Message(
        arbitration_id=classes, is_extended_id=False, is_error_frame=True, data=[0, detail]
    )


def failure(number):
    return can.CanOperationError("Failed to receive", number)


def test_frames_go_out_extended_with_their_bytes(buses):
    SocketCanPort("can0").send(FRAME)
    (sent,) = buses[0].sent
    assert sent.is_extended_id
    assert (sent.arbitration_id, bytes(sent.data)) == FRAME


def test_frames_come_in_order_and_others_are_counted(buses):
    port = SocketCanPort("can0")
    other = message(arbitration_id=0x0CFF4083, data=b"")
    buses[0].script = [
        message(),
        message(is_extended_id=False, arbitration_id=0x123),
        message(is_remote_frame=True, data=None),
        error_frame(0x004),
        other,
    ]
    assert list(port.receive()) == [FRAME, Frame(0x0CFF4083, b"")]
    assert port.others == 3
    assert list(port.receive()) == []


def test_a_flood_is_read_in_bounded_portions(buses):
    port = SocketCanPort("can0")
    buses[0].script = [message() for _ in range(socketcan.MAX_FRAMES_PER_CALL + 5)]
    assert len(port.receive()) == socketcan.MAX_FRAMES_PER_CALL
    assert len(port.receive()) == 5


def test_the_kernel_filters_only_when_asked(buses):
    SocketCanPort("can0")
    SocketCanPort("can0", can_ids=[0x18FF0081])
    assert buses[0].filters is None
    assert buses[1].filters == [{"can_id": 0x18FF0081, "can_mask": 0x1FFFFFFF, "extended": True}]


@pytest.mark.parametrize(
    ("classes", "meaning"),
    [
        (0x040, "bus-off"),
        (0x020, "no node acknowledges"),
        (0x010, "transceiver fault"),
        (0x001, "transmit timeout"),
    ],
)
def test_error_frames_that_say_nothing_gets_through_are_port_errors(buses, classes, meaning):
    port = SocketCanPort("can0")
    buses[0].script = [error_frame(classes | 0x004)]
    with pytest.raises(PortError, match=f"can0: {meaning}; check wiring"):
        port.receive()
    assert port.others == 1


@pytest.mark.parametrize(
    ("detail", "meaning"),
    [
        (0x01, "receive buffer overflow"),
        (0x02, "transmit buffer overflow"),
        (0x10, "error-passive on receiving"),
        (0x20, "error-passive on sending"),
    ],
)
def test_problems_of_the_controller_that_lose_frames_are_port_errors(buses, detail, meaning):
    port = SocketCanPort("can0")
    buses[0].script = [error_frame(0x004, detail)]
    with pytest.raises(PortError, match=f"can0: {meaning}"):
        port.receive()
    for warning in (error_frame(0x004, 0x04), error_frame(0x004, 0x08), error_frame(0x004, 0x40)):
        buses[0].script = [warning]
        assert list(port.receive()) == []
    assert port.others == 4


@pytest.mark.parametrize("wrong", [error_frame(0x040), failure(errno.EIO)])
def test_frames_that_came_with_an_error_are_not_lost(buses, wrong):
    port = SocketCanPort("can0")
    buses[0].script = [message(), wrong, message()]
    before = list(port.receive())
    with pytest.raises(PortError):
        port.receive()
    assert before + list(port.receive()) == [FRAME, FRAME]
    assert list(port.receive()) == []


@pytest.mark.evidence("with_it1")
@pytest.mark.parametrize("with_it", [[], [message()]])
def test_an_error_leaves_nothing_behind_for_the_garbage_collector(buses, with_it):
    """The loop has switched it off."""
    port = SocketCanPort("can0")
    gc.collect()
    gc.disable()
    try:
        for _ in range(10):
            buses[0].script = [error_frame(0x20), *with_it]
            for _ in with_it:
                assert port.receive() == [FRAME]
            with pytest.raises(PortError, match="acknowledges"):
                port.receive()
        assert gc.collect() == 0
    finally:
        gc.enable()


def test_a_flood_of_error_frames_does_not_hold_frames_back(buses):
    port = SocketCanPort("can0")
    buses[0].script = [*(error_frame(0x040) for _ in range(100)), message()]
    assert list(port.receive()) == [FRAME]
    with pytest.raises(PortError, match="bus-off"):
        port.receive()
    assert list(port.receive()) == []
    assert port.others == 100


def test_a_down_interface_is_reported_until_something_works_again(buses):
    port = SocketCanPort("can0")
    buses[0].script = [failure(errno.ENETDOWN)]
    for _ in range(3):
        with pytest.raises(PortError, match="ip link set can0 up"):
            port.receive()
    buses[0].send_errors = [failure(errno.ENETDOWN)]
    with pytest.raises(PortError) as caught:
        port.send(FRAME)
    assert caught.value.errno == errno.ENETDOWN
    port.send(FRAME)
    assert list(port.receive()) == []
    buses[0].script = [failure(errno.ENETDOWN), message()]
    with pytest.raises(PortError):
        port.receive()
    assert list(port.receive()) == [FRAME]  # of before: the kernel reports the error first
    with pytest.raises(PortError, match="interface down"):
        port.receive()
    buses[0].script = [message()]
    assert list(port.receive()) == [FRAME]
    assert list(port.receive()) == []
    assert len(buses) == 1


@pytest.mark.parametrize("number", [errno.ENETDOWN, errno.ENODEV])
def test_an_error_behind_an_error_frame_is_noted_too(buses, number):
    port = SocketCanPort("can0")
    buses[0].script = [error_frame(0x040), failure(number)]
    with pytest.raises(PortError, match="bus-off"):
        port.receive()
    if number == errno.ENODEV:
        assert not buses[0].open
        return
    for _ in range(3):
        with pytest.raises(PortError, match="interface down"):
            port.receive()


def test_a_deleted_interface_is_reopened_when_it_is_back(buses, interfaces):
    port = SocketCanPort("can0")
    buses[0].script = [failure(errno.ENETDOWN), failure(errno.ENODEV)]
    interfaces.clear()
    for _ in range(2):
        with pytest.raises(PortError):
            port.receive()
    assert not buses[0].open
    with pytest.raises(PortError, match="can0: not found; plug in the adapter"):
        port.send(FRAME)
    interfaces.add("can0")
    port.send(FRAME)
    assert len(buses) == 2
    assert list(port.receive()) == []


def test_a_full_transmit_queue_is_a_port_error(buses):
    port = SocketCanPort("can0")
    buses[0].send_errors = [failure(errno.ENOBUFS), can.CanOperationError("Transmit buffer full")]
    with pytest.raises(PortError, match="transmit queue full: no node acknowledges"):
        port.send(FRAME)
    with pytest.raises(PortError, match="can0: Transmit buffer full"):
        port.send(FRAME)
    assert list(port.receive()) == []


def test_an_interface_that_does_not_exist_is_named_at_once(buses):
    with pytest.raises(PortError, match="can7: not found") as caught:
        SocketCanPort("can7")
    assert caught.value.errno == errno.ENODEV


def test_an_interface_of_another_kind_is_refused_by_what_it_is():
    with pytest.raises(PortError, match="CAN interface lo: is no CAN interface; ") as caught:
        SocketCanPort("lo")
    assert "Errno" not in str(caught.value.strerror)


def test_interfaces_that_are_there_are_named(monkeypatch, tmp_path):
    for name, kind in (("lo", "772"), ("vcan3", "280"), ("can1", "280")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "type").write_text(f"{kind}\n")
    monkeypatch.setattr(socketcan, "_SYSFS", tmp_path)
    with pytest.raises(PortError, match="can7: not found; there is can1, vcan3; plug in"):
        SocketCanPort("can7")


def test_a_kernel_without_can_is_a_port_error(monkeypatch, interfaces):
    def refuse(*args, **kwargs):
        raise OSError(errno.EAFNOSUPPORT, "Address family not supported by protocol")

    monkeypatch.setattr(socketcan, "SocketcanBus", refuse)
    with pytest.raises(PortError, match=r"can0: Address family .*; .*: modprobe can_raw"):
        SocketCanPort("can0")


def test_closing_twice_is_harmless_and_using_a_closed_port_is_an_error(buses):
    port = SocketCanPort("can0")
    port.close()
    port.close()
    assert not buses[0].open
    with pytest.raises(PortError, match="closed"):
        port.send(FRAME)
    with pytest.raises(PortError, match="closed"):
        port.receive()


def test_frames_pass_between_two_ports_over_python_cans_virtual_bus(monkeypatch, interfaces):
    def virtual(channel, receive_own_messages, can_filters):
        return can.Bus(
            interface="virtual",
            channel=channel,
            receive_own_messages=receive_own_messages,
            can_filters=can_filters,
        )

    monkeypatch.setattr(socketcan, "SocketcanBus", virtual)
    here, there = SocketCanPort("can0"), SocketCanPort("can0")
    try:
        for number in range(3):
            here.send(Frame(0x08FF1080, bytes((number,))))
        assert [frame.data[0] for frame in there.receive()] == [0, 1, 2]
        assert list(here.receive()) == []
    finally:
        here.close()
        there.close()
